"""Claims about folds of whole groups of which each holds a single class."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from taxel.errors import BadSplit
from taxel.evaluation.audit.audit import make_case
from taxel.evaluation.audit.both_sides import one_class_folds
from taxel.evaluation.audit.finding import Finding
from taxel.evaluation.audit.sides import named_sides
from taxel.evaluation.audit.touch_set import TouchSet
from taxel.evaluation.splits import Split

Make = dict[str, Callable[..., TouchSet]]


def at_positions(touch: TouchSet, of_class: list[list[str]]) -> TouchSet:
    """Return the set with a position for each trial, from those of its class in turn."""
    own = [of_class[c][index // 10 % len(of_class[c])] for index, c in enumerate(touch.y)]
    return replace(touch, trials=tuple(
        replace(trial, groups={**trial.groups, "position": name})
        for trial, name in zip(touch.trials, own, strict=True)
    ))  # fmt: skip


def found_with(touch: TouchSet, folds: int) -> Finding:
    """Return the finding under a split that holds out positions."""
    split = named_sides(touch, "group:position", 10, folds, 0)
    return one_class_folds(make_case(touch, split, 10, 0))


@pytest.mark.parametrize("each", [2, 3])
def test_positions_of_one_class_each_name_a_fold_count_that_mends_it(
    make_set: Make, each: int
) -> None:
    """With the number that is named, it is clear; with one more, it is not."""
    classes = [[f"{c}-{n}" for n in range(each)] for c in range(2)]
    touch = at_positions(make_set["array"](classes=2), classes)
    found = found_with(touch, 5)

    assert found.verdict == "leak"
    assert f" {2 * each} of {2 * each} positions hold one class each" in found.message
    assert "accuracy in such a fold shows how often that class is named" in found.message
    assert found.mend.startswith(f"choose --fold-count {each}, ")
    assert found_with(touch, each).verdict == "clear"
    assert found_with(touch, each + 1).verdict == "leak"


def in_groups(touch: TouchSet, names: list[str]) -> TouchSet:
    """Return the first trials, each at the position that is named for it."""
    some = touch.only(np.arange(len(names)))
    return replace(some, trials=tuple(
        replace(trial, groups={**trial.groups, "position": name})
        for trial, name in zip(some.trials, names, strict=True)
    ))  # fmt: skip


def test_where_no_fold_count_mends_it_that_is_stated(make_set: Make) -> None:
    """One position holds nearly all of a class, another both, a third the other class: two folds
    put the first two together, since so their shares of classes are most alike.
    """
    touch = make_set["array"](classes=2)
    zero, other = np.flatnonzero(touch.y == 0), np.flatnonzero(touch.y == 1)[:2]
    names = ["a"] * (len(zero) - 1) + ["both", "both", "b"]
    touch = in_groups(touch.only(np.array([*zero, *other])), names)
    _, sides = named_sides(touch, "group:position", 10, 3, 0)
    found = found_with(touch, 3)

    assert sides.fold_count == 0
    assert found.verdict == "leak"
    assert "no smaller --fold-count was found that mends it" in found.mend
    assert "hold out another group" in found.mend


def test_where_no_fold_count_was_tried_none_is_denied(make_set: Make) -> None:
    touch = at_positions(make_set["array"](classes=2), [["a", "b"], ["c", "d"]])
    pieces, sides = named_sides(touch, "group:position", 10, 4, 0)
    assert sides.fold_count == 2
    found = one_class_folds(make_case(touch, (pieces, replace(sides, fold_count=None)), 10, 0))

    assert found.mend == "hold out another group, or record several classes in each position. " \
                         "Or pool the folds' predictions"  # fmt: skip


def test_each_trial_may_be_a_group(make_set: Make) -> None:
    """scikit-learn refuses 19 folds of ten trials a class: such counts are not tried."""
    touch = in_groups(make_set["array"](classes=2), [f"{i:02d}" for i in range(20)])
    assert np.bincount(touch.y).tolist() == [10, 10]
    found = found_with(replace(touch, rows=tuple(rows[:10] for rows in touch.rows)), 20)

    assert found.mend.startswith("choose --fold-count 10, ")


def test_no_more_fold_counts_are_tried_than_may_test_several_classes(
    make_set: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of groups of one class each two are needed; of very many counts some are left out."""
    tried: list[int] = []

    def refused(_: object, target: str, key: str, count: int, seed: int) -> Split:
        tried.append(count)
        raise BadSplit("a", "b", "c")

    monkeypatch.setattr("taxel.evaluation.audit.sides.by_group", refused)
    touch = make_set["array"](classes=2)
    found_with(in_groups(touch, [f"{i // 2}" for i in range(40)]), 20)  # four hold both classes
    assert tried == [*range(4 + 16 // 2, 1, -1)]
    tried.clear()
    found_with(in_groups(touch, [f"{i:02d}" for i in range(60)]), 60)

    assert (len(tried), tried[0], tried[-1]) == (16, 30, 2)


def test_folds_of_other_splits_keep_their_words(make_set: Make) -> None:
    """A table of folds has no --fold-count."""
    touch = at_positions(make_set["array"](classes=2), [["a", "b"], ["c", "d"]])
    pieces, sides = named_sides(touch, "group:position", 10, 4, 0)
    table = replace(sides, key=None, fold_count=None)
    found = one_class_folds(make_case(touch, (pieces, table), 10, 0))

    assert found.verdict == "leak"
    assert "fold-count" not in found.message + found.mend
    assert found.mend.startswith("deal out groups")
