"""Splits cannot leak: whole trials and whole groups stay on one side."""

import numpy as np
import pytest
from make_dataset import make_dataset

from taxel.errors import BadSplit
from taxel.evaluation.splits import (
    TrialFold,
    by_group,
    by_order,
    parse_split,
    random_windows,
)
from taxel.windows.config import WindowConfig


@pytest.mark.parametrize("folds", [2, 3, 5, 9])
def test_no_session_stands_on_both_sides(folds: int) -> None:
    dataset = make_dataset()
    sessions = dataset.group("session")[dataset.trial]

    for fold in by_group(dataset, "shape", "session", folds, seed=0).folds:
        train, test = fold.windows(dataset)
        assert not set(sessions[train]) & set(sessions[test])
        assert len(train) + len(test) == len(dataset)


def test_every_window_is_tested_once() -> None:
    dataset = make_dataset()
    for split in (
        by_group(dataset, "shape", "session", 3, seed=0),
        random_windows(dataset, "shape", 5, seed=0, test=0.0),
    ):
        tested = np.concatenate([fold.windows(dataset)[1] for fold in split.folds])
        np.testing.assert_array_equal(np.sort(tested), np.arange(len(dataset)))


def test_the_last_test_part_is_in_no_fold() -> None:
    dataset = make_dataset()
    for split in (
        by_group(dataset, "shape", "session", 5, seed=0, final=True),
        random_windows(dataset, "shape", 5, seed=0, test=0.1),
    ):
        assert split.final is not None
        development, test = split.final.windows(dataset)
        assert not set(development) & set(test)
        for fold in split.folds:
            train, held = fold.windows(dataset)
            assert not (set(train) | set(held)) & set(test)


@pytest.mark.parametrize("share", [-0.1, 0.001, 0.7, 1.0, 1.5, float("nan")])
def test_a_share_that_cannot_be_kept_out_is_refused_with_its_range(share: float) -> None:
    dataset = make_dataset()
    fewest = np.bincount(dataset.class_numbers("shape")).min()

    with pytest.raises(BadSplit) as refused:
        random_windows(dataset, "shape", 5, seed=0, test=share)
    assert str(refused.value) == (
        f"needed a test share of 0, or {1 / fewest:.2g} to 0.5, with {fewest} windows of the "
        f"rarest class; got {share:g}; choose another share."
    )
    random_windows(dataset, "shape", 5, seed=0, test=0.5)


def test_the_random_split_says_that_it_leaks() -> None:
    dataset = make_dataset()
    split = random_windows(dataset, "shape", 5, seed=0, test=0.0)
    train, test = split.folds[0].windows(dataset)

    assert "leaks" in split.name
    assert set(dataset.trial[train]) & set(dataset.trial[test])


def test_a_split_says_which_of_its_folds_move_whole_trials() -> None:
    dataset = make_dataset()
    whole = by_group(dataset, "shape", "session", 3, seed=0)
    single = random_windows(dataset, "shape", 5, seed=0, test=0.0)

    assert whole.trial_folds == whole.whole_trials("to choose on", "") == whole.folds
    assert single.trial_folds == ()
    with pytest.raises(BadSplit) as refused:
        single.whole_trials("to choose on", "choose group:KEY")
    assert refused.value.needed == "a split of whole trials, to choose on"
    assert refused.value.got == "random windows (leaks)"
    assert refused.value.mend == "choose group:KEY"


def test_overlapping_windows_cannot_be_split_at_random() -> None:
    dataset = make_dataset(config=WindowConfig(steps=6, stride=3))
    split = random_windows(dataset, "shape", 5, seed=0, test=0.0)

    with pytest.raises(BadSplit, match="overlap"):
        split.folds[0].windows(dataset)


def test_a_trial_on_both_sides_cannot_be_written_down() -> None:
    with pytest.raises(BadSplit, match="both sides"):
        TrialFold("bad", frozenset({1, 2}), frozenset({2, 3}))


def test_a_class_with_one_session_is_refused_in_one_line() -> None:
    dataset = make_dataset(sessions=3, one_session_a_class=True)

    with pytest.raises(BadSplit, match="at least two groups 'session'") as caught:
        by_group(dataset, "shape", "session", 3, seed=0)
    assert "\n" not in str(caught.value)


def test_every_training_part_holds_every_class() -> None:
    """With one session a class in two of six sessions each, most assignments lose a class."""
    dataset = make_dataset(sessions=6, one_session_a_class=True)
    for fold in by_group(dataset, "shape", "session", 3, seed=0).folds:
        train, _ = fold.windows(dataset)
        assert set(dataset.class_numbers("shape")[train]) == {0, 1, 2}


def test_a_split_by_order_trains_on_the_first() -> None:
    dataset = make_dataset()
    numbers = dataset.group("number").astype(int)[dataset.trial]
    train, test = by_order(dataset, "shape", "number", 3).folds[0].windows(dataset)

    assert numbers[train].max() == 3
    assert numbers[test].min() == 4


@pytest.mark.parametrize("text", ["", "group", "group:", "order:number", "order:number:x", "other"])
def test_a_wrong_split_is_refused_in_one_line(text: str) -> None:
    from taxel.errors import BadInput

    with pytest.raises(BadInput) as caught:
        parse_split(text, make_dataset(), "shape", 5, 0)
    assert "\n" not in str(caught.value)


def test_a_fold_of_camera_trials_cannot_leak_either_and_gives_its_rows_in_order():
    """Cups and camera trials go through the type that arrays go through."""
    fold = TrialFold.of("cup a", np.array([5, 1, 3]), np.array([4, 0]))

    assert (fold.train_rows.tolist(), fold.test_rows.tolist()) == ([1, 3, 5], [0, 4])
    with pytest.raises(BadSplit, match="1 on both sides of cup a"):
        TrialFold.of("cup a", np.array([0, 1]), np.array([1, 2]))
