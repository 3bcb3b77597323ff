"""Claims about folds of whole groups of which each holds a single class."""

from collections.abc import Callable
from dataclasses import replace

import pytest

from taxel.evaluation.audit.audit import make_case
from taxel.evaluation.audit.finding import Finding
from taxel.evaluation.audit.shared import one_class_folds
from taxel.evaluation.audit.sides import named_sides
from taxel.evaluation.audit.touch_set import TouchSet

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


def test_where_no_fold_count_mends_it_that_is_stated(make_set: Make) -> None:
    """As where 50 ways to make fewer folds all leave a training part without a class."""
    touch = at_positions(make_set["array"](classes=2), [["a", "b"], ["c", "d"]])
    pieces, sides = named_sides(touch, "group:position", 10, 4, 0)
    assert sides.fold_count == 2
    found = one_class_folds(make_case(touch, (pieces, replace(sides, fold_count=None)), 10, 0))

    assert "no smaller --fold-count mends it" in found.mend
    assert "hold out another group" in found.mend


def test_folds_of_other_splits_keep_their_words(make_set: Make) -> None:
    """A table of folds has no --fold-count."""
    touch = at_positions(make_set["array"](classes=2), [["a", "b"], ["c", "d"]])
    pieces, sides = named_sides(touch, "group:position", 10, 4, 0)
    table = replace(sides, key=None, fold_count=None)
    found = one_class_folds(make_case(touch, (pieces, table), 10, 0))

    assert found.verdict == "leak"
    assert "fold-count" not in found.message + found.mend
    assert found.mend.startswith("deal out groups")
