"""Nothing of a test fold reaches the model: not through scaling, not through weights."""

from dataclasses import replace

import numpy as np
from make_dataset import make_dataset

from taxel.evaluation.baselines import trivial_accuracies
from taxel.evaluation.crossval import Job, pool, run_fold
from taxel.evaluation.splits import by_group
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


def test_a_learnable_set_is_learned_and_the_trivial_baselines_are_not_fooled() -> None:
    dataset = make_dataset()
    split = by_group(dataset, "shape", "session", 3, seed=0)
    pooled = pool(dataset, split, [run_fold(dataset, fold, JOB) for fold in split.folds])
    trivial = trivial_accuracies(dataset, "shape", split.folds)

    assert pooled.scores.accuracy > 0.9
    assert pooled.interval_group == "session"
    assert pooled.interval[0] <= pooled.scores.accuracy <= pooled.interval[1]
    assert trivial["majority"] == 1 / 3
    assert trivial["channel means"] > 0.9
    assert trivial["session"] < 0.5
    assert trivial["length of the trial"] < 0.5
