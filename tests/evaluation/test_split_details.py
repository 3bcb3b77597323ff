"""Which trials and windows each split takes, by which seed, and under which name (0049)."""

from collections.abc import Iterator
from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest
from make_dataset import make_dataset
from sklearn.model_selection import StratifiedGroupKFold, StratifiedKFold

from taxel.errors import BadInput, BadSplit
from taxel.evaluation.splits import TrialFold, by_group, by_order, parse_split, random_windows
from taxel.windows.config import WindowConfig


def held_sessions(fold: object) -> set[str]:
    assert isinstance(fold, TrialFold)
    return {f"s{trial // 6}" for trial in fold.test}


@pytest.mark.parametrize("folds", [3, 4])
def test_no_more_groups_than_folds_are_each_held_out_once_by_name(folds: int) -> None:
    split = by_group(make_dataset(sessions=3), "shape", "session", folds, seed=0)

    assert split.name == "session held out"
    assert split.final is None
    assert [(fold.name, held_sessions(fold)) for fold in split.folds] == [
        ("without s0", {"s0"}), ("without s1", {"s1"}), ("without s2", {"s2"}),
    ]  # fmt: skip


def test_more_groups_than_folds_are_dealt_out_by_the_seed() -> None:
    dataset = make_dataset()
    y, owners = dataset.class_numbers("shape"), dataset.group("session")[dataset.trial]
    dealt = StratifiedGroupKFold(4, shuffle=True, random_state=9).split(y, y, owners)
    split = by_group(dataset, "shape", "session", 4, seed=9)

    assert [fold.name for fold in split.folds] == ["fold 1", "fold 2", "fold 3", "fold 4"]
    assert [held_sessions(fold) for fold in split.folds] == [set(owners[out]) for _, out in dealt]


class Dealer:
    """In place of scikit-learn's splitter: deals hands that are no good, and keeps the seeds."""

    seeds: ClassVar[list[int]] = []

    def __init__(self, folds: int, *, shuffle: bool, random_state: int) -> None:
        assert shuffle
        self.folds = folds
        self.seeds.append(random_state)

    def split(self, y: np.ndarray, _: object, owners: np.ndarray) -> Iterator[object]:
        yield None, np.flatnonzero(owners == owners[0])
        for _ in range(self.folds - 1):
            yield None, np.zeros(0, int)


def test_fifty_seeds_are_tried_for_folds_that_are_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    """All classes stand in each training part here; but a fold that tests nothing is no fold."""
    monkeypatch.setattr("sklearn.model_selection.StratifiedGroupKFold", Dealer)
    Dealer.seeds = []

    with pytest.raises(BadSplit, match="none of 50 ways to make 3 folds"):
        by_group(make_dataset(), "shape", "session", 3, seed=9)
    assert Dealer.seeds == [9 + 1000 * attempt for attempt in range(50)]


def test_the_last_group_by_name_is_kept_for_the_last_test() -> None:
    split = by_group(make_dataset(), "shape", "session", 5, seed=0, final=True)

    assert isinstance(split.final, TrialFold)
    assert split.final.name == "test"
    assert held_sessions(split.final) == {"s5"}
    assert split.final.train == frozenset(range(30))
    assert [fold.name for fold in split.folds] == [f"without s{n}" for n in range(5)]


def test_one_group_left_beside_the_last_is_refused() -> None:
    with pytest.raises(BadSplit, match="at least two groups to hold out"):
        by_group(make_dataset(sessions=2), "shape", "session", 5, seed=0, final=True)
    assert len(by_group(make_dataset(sessions=2), "shape", "session", 5, seed=0).folds) == 2


def test_the_class_with_one_group_is_named_although_others_have_more() -> None:
    dataset = make_dataset(sessions=5, one_session_a_class=True)

    with pytest.raises(BadSplit, match=r"one \(s2\) for 'c2'"):
        by_group(dataset, "shape", "session", 3, seed=0)


def test_a_class_with_one_group_is_named_also_where_it_is_the_first_by_name() -> None:
    dataset = make_dataset(sessions=5, one_session_a_class=True)
    trials = tuple(
        replace(trial, labels={"shape": trial.labels["shape"].replace("c2", "b2")})
        for trial in dataset.trials
    )
    with pytest.raises(BadSplit, match=r"one \(s2\) for 'b2'"):
        by_group(replace(dataset, trials=trials), "shape", "session", 3, seed=0)


def test_windows_at_random_take_the_seed_and_the_one_after() -> None:
    dataset = make_dataset()
    y = dataset.class_numbers("shape")
    outer = StratifiedKFold(10, shuffle=True, random_state=3)
    rest, held = next(iter(outer.split(y, y)))
    inner = StratifiedKFold(4, shuffle=True, random_state=4).split(rest, y[rest])
    split = random_windows(dataset, "shape", 4, seed=3, test=0.1)

    assert split.name == "random windows (leaks)"
    assert split.final is not None
    assert split.final.name == "test"
    for own, expected in zip(split.final.windows(dataset), (rest, held), strict=True):
        np.testing.assert_array_equal(own, expected)
    assert [fold.name for fold in split.folds] == ["fold 1", "fold 2", "fold 3", "fold 4"]
    for fold, (train, out) in zip(split.folds, inner, strict=True):
        np.testing.assert_array_equal(fold.windows(dataset)[0], rest[train])
        np.testing.assert_array_equal(fold.windows(dataset)[1], rest[out])


def test_without_a_test_share_all_windows_are_in_the_folds() -> None:
    dataset = make_dataset()
    split = random_windows(dataset, "shape", 3, seed=0, test=0.0)

    assert split.final is None
    assert sum(len(fold.windows(dataset)[1]) for fold in split.folds) == len(dataset)


@pytest.mark.parametrize(("windows", "fine"), [(4, True), (3, False)])
def test_a_class_needs_as_many_windows_as_folds(windows: int, fine: bool) -> None:
    dataset = make_dataset(sessions=2, trials_a_session=3, windows_a_trial=windows // 2 + 1)
    rare = np.flatnonzero(dataset.class_numbers("shape") == 1)[windows:]
    keep = np.setdiff1d(np.arange(len(dataset)), rare)
    dataset = replace(dataset, windows=dataset.windows[keep], trial=dataset.trial[keep])
    if fine:
        assert len(random_windows(dataset, "shape", 4, seed=0, test=0.0).folds) == 4
        return
    with pytest.raises(BadSplit, match=r"at least 4 windows of each class.*3 of 'c1'"):
        random_windows(dataset, "shape", 4, seed=0, test=0.0)


def test_windows_that_lie_apart_may_be_split_at_random() -> None:
    dataset = make_dataset(config=WindowConfig(steps=6, stride=9))
    train, test = random_windows(dataset, "shape", 2, seed=0, test=0.0).folds[0].windows(dataset)

    assert len(train) == len(test) == len(dataset) // 2


@pytest.mark.parametrize("folds", [1, 0])
def test_fewer_than_two_folds_are_refused(folds: int) -> None:
    for split in (
        lambda: by_group(make_dataset(), "shape", "session", folds, seed=0),
        lambda: random_windows(make_dataset(), "shape", folds, seed=0, test=0.0),
    ):
        with pytest.raises(BadSplit, match="at least two folds"):
            split()


def test_a_split_by_order_ends_where_it_is_told_to() -> None:
    dataset = make_dataset()
    numbers = dataset.group("number").astype(int)
    split = by_order(dataset, "shape", "number", 3, 5)
    fold = split.folds[0]

    assert isinstance(fold, TrialFold)
    assert (split.name, fold.name, split.final) == (
        "number up to 3 → above, up to 5", "number up to 3 → above, up to 5", None,
    )  # fmt: skip
    assert sorted(set(numbers[list(fold.train)])) == [1, 2, 3]
    assert sorted(set(numbers[list(fold.test)])) == [4, 5]


def test_a_split_by_order_that_tests_a_class_never_learned_is_refused() -> None:
    with pytest.raises(BadSplit, match=r"every tested class of 'shape'.*none of c2"):
        by_order(make_dataset(), "shape", "number", 2)


@pytest.mark.parametrize(("last", "got"), [(6, "36 and 0"), (0, "0 and 36")])
def test_a_split_by_order_with_an_empty_side_is_refused(last: float, got: str) -> None:
    with pytest.raises(BadSplit, match=f"{got}.*between 1 and 6"):
        by_order(make_dataset(), "shape", "number", last)


def test_a_split_by_order_of_words_is_refused() -> None:
    with pytest.raises(BadSplit, match="numbers in the group 'session'"):
        by_order(make_dataset(), "shape", "session", 3)


@pytest.mark.parametrize(("text", "name", "folds"), [
    ("random", "random windows (leaks)", 3), ("group:session", "session held out", 3),
    ("order:number:3", "number up to 3 → above", 1),
    ("order:number:3:5", "number up to 3 → above, up to 5", 1),
])  # fmt: skip
def test_a_text_names_its_split(text: str, name: str, folds: int) -> None:
    split = parse_split(text, make_dataset(), "shape", 3, 0)

    assert (split.name, len(split.folds), split.final) == (name, folds, None)


@pytest.mark.parametrize("text", [
    "random:session", "sort", "group:session:number", "sort:number:3", "order:number:3:5:6",
    "sort:session", "order:session",
])  # fmt: skip
def test_a_text_that_names_no_split_is_refused(text: str) -> None:
    with pytest.raises(BadInput, match="group:KEY"):
        parse_split(text, make_dataset(), "shape", 3, 0)


def test_a_trial_to_choose_by_is_neither_trained_on_nor_tested() -> None:
    dataset = make_dataset()
    fold = TrialFold("own", frozenset({0}), frozenset({1}), frozenset({2}))
    np.testing.assert_array_equal(fold.validation_windows(dataset), [6, 7, 8])
    for side in ({0}, {1}):
        with pytest.raises(BadSplit, match="1 on both sides of own"):
            TrialFold("own", frozenset({0}), frozenset({1}), frozenset(side))
