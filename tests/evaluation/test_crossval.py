"""Nothing of a test fold reaches the model: not through scaling, not through weights."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from make_dataset import make_dataset

from taxel.evaluation.baselines import below_majority, shares, trivial_accuracies, trivial_right
from taxel.evaluation.crossval import pool, run_fold
from taxel.evaluation.splits import by_group
from taxel.training.fitting import Job
from taxel.training.loop import TrainConfig

JOB = Job(model="cnn2d", target="shape", train=TrainConfig(epochs=60, batch=16), scaling="standard")


def test_spoiling_the_test_windows_does_not_change_the_model() -> None:
    dataset = make_dataset()
    fold = by_group(dataset, "shape", "session", 3, seed=0).folds[0]
    _, test = fold.windows(dataset)
    values = dataset.windows.values.copy()
    values[test] = 1e6
    spoiled = replace(dataset, windows=replace(dataset.windows, values=values))

    clean, other = run_fold(dataset, fold, JOB), run_fold(spoiled, fold, JOB)

    np.testing.assert_array_equal(clean.fitted.scaling.offset, other.fitted.scaling.offset)
    np.testing.assert_array_equal(clean.fitted.scaling.factor, other.fitted.scaling.factor)
    probe = dataset.windows.values[:20], dataset.windows.mask[:20]
    np.testing.assert_array_equal(
        clean.fitted.probabilities(*probe), other.fitted.probabilities(*probe)
    )


@pytest.mark.slow
def test_a_learnable_set_is_learned_and_the_trivial_baselines_are_not_fooled() -> None:
    dataset = make_dataset()
    split = by_group(dataset, "shape", "session", 3, seed=0)
    pooled = pool(dataset, split, [run_fold(dataset, fold, JOB) for fold in split.folds])
    trivial = trivial_accuracies(dataset, "shape", split.folds)

    assert pooled.scores.accuracy > 0.9
    assert pooled.interval_group == "session"
    assert pooled.interval_groups == 6
    assert pooled.interval[0] <= pooled.scores.accuracy <= pooled.interval[1]
    assert trivial["majority"] == 1 / 3
    assert trivial["channel means"] > 0.9
    assert trivial["session"] < 0.5
    assert trivial["length of the trial"] < 0.5


def test_of_few_windows_a_baseline_still_finds_what_the_channel_means_give_away() -> None:
    """With leaves of five windows 24 training windows of six classes have four leaves at most."""
    dataset = make_dataset(sessions=3, trials_a_session=12, windows_a_trial=1, classes=6)
    split = by_group(dataset, "shape", "session", 3, seed=0)
    trivial = trivial_accuracies(dataset, "shape", split.folds)
    assert trivial["channel means"] > 0.8
    assert trivial["length of the trial"] < 0.5


def test_of_many_channels_a_baseline_finds_what_all_of_them_give_away_together() -> None:
    """Twenty trees look at few of 120 channels; they named a third of these windows."""
    dataset = make_dataset(sessions=3, trials_a_session=60, windows_a_trial=1, classes=6)
    split = by_group(dataset, "shape", "session", 3, seed=0)
    rng = np.random.default_rng(0)
    steps = dataset.windows.values.shape[1]
    classes = rng.normal(0.0, 1.0, (6, 120))[dataset.class_numbers("shape")]
    values = classes[:, None] + rng.normal(0.0, 4.0, (len(dataset), 1, 120)) + np.zeros((steps, 1))
    many = replace(dataset, windows=replace(dataset.windows, values=values.astype(np.float32)))

    trivial = trivial_accuracies(many, "shape", split.folds)

    assert trivial["first row of the trial"] > 0.6


def test_of_many_columns_the_baseline_that_is_better_over_all_folds_counts() -> None:
    """The better in each fold was right wherever either model was: noise looked like touch."""
    dataset = make_dataset(sessions=2, trials_a_session=8, windows_a_trial=1, classes=2)
    values = np.random.default_rng(0).normal(size=(len(dataset), 2, 60)).astype(np.float32)
    windows = replace(dataset.windows, values=values, mask=np.ones((len(dataset), 2), bool))
    noise = replace(dataset, windows=windows)
    y, every = noise.class_numbers("shape"), np.arange(len(dataset))
    folds = [(np.delete(every, n), every[n : n + 1]) for n in every]

    right = trivial_right(noise, y, folds)

    own = {model: count for (name, model), count in right.items() if name == "channel means"}
    assert set(own) == {"trees", "discriminant"}
    assert shares(right, len(y))["channel means"] == max(own.values()) / len(y)
    together: Counter[tuple[str, str]] = Counter()
    for fold in folds:
        together.update(trivial_right(noise, y, [fold]))
    assert shares(together, len(y)) == shares(right, len(y))


@pytest.mark.slow
def test_majority_is_what_the_best_constant_answer_reaches_whatever_is_held_out() -> None:
    """With objects held out the training part's commonest class is never that of the test."""
    dataset = make_dataset()
    trials = tuple(
        replace(
            trial,
            groups={**trial.groups, "object": trial.labels["shape"] + trial.groups["session"]},
        )
        for trial in dataset.trials
    )
    dataset = replace(dataset, trials=trials)
    split = by_group(dataset, "shape", "object", 18, seed=0)
    assert len(split.folds) == 18
    trivial = trivial_accuracies(dataset, "shape", split.folds)
    assert trivial["majority"] == 1 / 3
    assert trivial["length of the trial"] < 1 / 3
    sentence = below_majority(trivial)
    assert sentence is not None
    assert "length of the trial" in sentence
    assert "channel means" not in sentence
    assert below_majority({"majority": 0.3, "channel means": 0.3}) is None


@pytest.mark.slow
def test_the_interval_is_by_the_object_where_objects_of_several_sessions_are_held_out() -> None:
    dataset = make_dataset()
    trials = tuple(
        replace(trial, groups={**trial.groups, "object": trial.groups["number"]})
        for trial in dataset.trials
    )
    dataset = replace(dataset, trials=trials)
    split = by_group(dataset, "shape", "object", 6, seed=0)
    job = Job(model="extra-trees", target="shape")
    pooled = pool(dataset, split, [run_fold(dataset, fold, job) for fold in split.folds])
    assert (pooled.interval_group, pooled.interval_groups) == ("object", 6)
