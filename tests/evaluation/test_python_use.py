"""Folds of one's own, from Python: classes that a side lacks, empty sides, wrong names."""

from __future__ import annotations

import numpy as np
import pytest
from make_dataset import make_dataset

from taxel.errors import BadDataset, BadInput, BadSplit
from taxel.evaluation.crossval import pool, run_fold
from taxel.evaluation.splits import Split, TrialFold, by_group
from taxel.training.fitting import Job
from taxel.training.loop import TrainConfig


@pytest.mark.parametrize("left", [0, 1, 2])
def test_a_librarys_model_keeps_the_classes_numbers(left: int) -> None:
    """A class that is not trained on has probability 0; the others stay in their columns."""
    dataset = make_dataset()
    y = np.array([dataset.classes("shape").index(t.labels["shape"]) for t in dataset.trials])
    kept = np.flatnonzero(y != left)
    fold = TrialFold.of("some", kept[:12], kept[12:])

    result = run_fold(dataset, fold, Job(model="extra-trees", target="shape"))

    assert result.probabilities.shape == (len(result.y), 3)
    assert not result.probabilities[:, left].any()
    assert result.scores.accuracy > 0.5  # shifted columns would have none right


@pytest.mark.parametrize(("train", "test"), [((), (0, 1)), ((0, 1), ()), ((0, 1), (9999,))])
def test_a_fold_needs_windows_on_both_sides(train: tuple[int, ...], test: tuple[int, ...]) -> None:
    fold = TrialFold("thin", frozenset(train), frozenset(test))
    with pytest.raises(BadSplit, match="needed windows on both sides of thin"):
        run_fold(make_dataset(), fold, Job(model="extra-trees", target="shape"))


def test_a_label_that_is_not_there_is_refused_by_name() -> None:
    """With those that are, wherever it is named first."""
    dataset = make_dataset()
    for ask in (dataset.classes, dataset.class_numbers,
                lambda name: by_group(dataset, name, "session", 3, seed=0)):  # fmt: skip
        with pytest.raises(BadDataset, match=r"the label 'shpe' on every trial.*are shape"):
            ask("shpe")


@pytest.mark.parametrize("kept", [(-1,), (0, 9999)])
def test_trials_that_are_not_there_cannot_be_kept(kept: tuple[int, ...]) -> None:
    with pytest.raises(BadDataset, match="needed indices of trials from 0 to"):
        make_dataset().only_trials(kept)


def test_folds_may_be_pooled_as_they_come() -> None:
    """A generator of results is taken; none at all is refused."""
    dataset = make_dataset()
    split = by_group(dataset, "shape", "session", 2, seed=0)
    job = Job(model="extra-trees", target="shape")

    pooled = pool(dataset, split, (run_fold(dataset, fold, job) for fold in split.folds))

    assert pooled.windows == len(dataset)
    with pytest.raises(BadInput, match="at least one fold"):
        pool(dataset, Split("none", (), None), [])


@pytest.mark.parametrize(
    "settings",
    [
        {"epochs": 0},
        {"batch": -3},
        {"steps": 0},
        {"learning_rate": 0.0},
        {"learning_rate": float("inf")},
        {"clip": -1.0},
        {"weight_decay": -0.1},
        {"warmup": 1.1},
        {"label_smoothing": -0.1},
        {"warmup": float("nan")},
    ],
)
def test_settings_that_train_nothing_are_refused(settings: dict[str, float]) -> None:
    """A batch below 0 would take no step, and the untrained network be scored."""
    with pytest.raises(BadInput):
        TrainConfig(**settings)


def test_settings_may_be_numbers_of_numpys() -> None:
    """As loops over np.arange give them: PyTorch and JSON take only Python's own."""
    config = TrainConfig(epochs=np.int64(1), seed=np.int64(3), learning_rate=np.float32(0.5))

    assert [type(v) for v in (config.epochs, config.seed, config.learning_rate)] == [
        int,
        int,
        float,
    ]
