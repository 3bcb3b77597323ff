"""Inner folds hold out what the split holds out."""

from dataclasses import replace

import numpy as np
import pytest

from taxel.errors import BadSplit
from taxel.labels.trials import Trial
from taxel.training.choose import inner_folds as inner
from taxel.training.choose.inner_folds import (
    Held,
    groups_of,
    inner_folds,
    judged,
    learned_from,
    what_is_held,
    with_all,
    with_few,
)

ONE_CLASS = np.zeros(32, np.intp)


def trials(**groups: list[str]) -> list[Trial]:
    count = len(next(iter(groups.values())))
    return [
        Trial(recording=f"r{i}", start_s=0.0, end_s=1.0, labels={},
              groups={"trial": f"r{i}#0", "recording": f"r{i}"}
              | {key: values[i] for key, values in groups.items()})
        for i in range(count)
    ]  # fmt: skip


def test_the_coarsest_group_that_is_new_on_the_test_side_is_what_is_held_out():
    own = trials(object=["a", "b", "c", "d"] * 2, colour=["red", "blue"] * 4)
    train = [i for i, trial in enumerate(own) if trial.groups["object"] != "d"]
    test = [i for i, trial in enumerate(own) if trial.groups["object"] == "d"]

    assert what_is_held(own, ONE_CLASS[: len(own)], train, test) == Held("object")


def test_the_group_that_a_split_names_is_held_out_though_a_coarser_one_is_new_too():
    """The authors' own parts, as a column of many data sets gives them, are few."""
    own = trials(object=[f"o{i // 2}" for i in range(16)],
                 part=[["a", "b", "c", "test"][i // 4] for i in range(16)])  # fmt: skip
    sides = range(12), range(12, 16)

    assert what_is_held(own, ONE_CLASS[:16], *sides) == Held("part")
    assert what_is_held(own, ONE_CLASS[:16], *sides, "object") == Held("object")


def test_a_named_group_is_held_out_although_two_of_its_values_are_left():
    """Three objects, each held out in turn: single trials would be judged beside their own
    object's, which says nothing of an object to come."""
    own = trials(object=[f"o{i // 6}" for i in range(18)])
    sides = range(12), range(12, 18)

    held = what_is_held(own, ONE_CLASS[:18], *sides, "object")

    assert held == Held("object")
    assert what_is_held(own, ONE_CLASS[:18], *sides) == Held(None)
    y = np.tile([0, 1], 9)
    fold = inner_folds(own, y, range(12), held)
    assert [set(fold[:6]), set(fold[6:])] in ([{0}, {1}], [{1}, {0}])


def test_a_named_group_that_is_on_both_sides_is_not_what_is_held_out():
    own = trials(object=[f"o{i // 4}" for i in range(16)], hand=["left", "right"] * 8)

    assert what_is_held(own, ONE_CLASS[:16], range(12), range(12, 16), "hand") == Held("object")


def test_of_groups_that_part_alike_the_session_is_named():
    days = ["mon"] * 4 + ["tue"] * 4 + ["wed"] * 4 + ["thu"] * 4
    own = trials(celsius=[{"m": "18", "t": "21", "w": "19"}[day[0]] + day for day in days],
                 session=days)  # fmt: skip

    assert what_is_held(own, ONE_CLASS[:16], range(12), range(12, 16)) == Held("session")


def test_later_numbers_held_out_are_an_order():
    own = trials(number=[str(i) for i in range(10)])

    held = what_is_held(own, ONE_CLASS[:10], range(5), range(5, 10))

    assert held == Held("number", ordered=True)


def test_later_numbers_of_each_class_are_an_order_wherever_the_classes_lie():
    """Class 0 was recorded first, class 1 after it; of both the later half is tested."""
    own = trials(number=[str(i) for i in range(20)])
    y = np.arange(20) // 10

    assert what_is_held(own, y, [*range(5), *range(10, 15)], [*range(5, 10), *range(15, 20)]) == (
        Held("number", ordered=True)
    )
    assert not what_is_held(own, y, range(0, 20, 2), range(1, 20, 2)).ordered


def test_in_an_order_each_inner_fold_learns_from_what_came_before_it():
    fold = np.repeat(np.arange(5), 2)

    assert inner.tested_folds(fold, ordered=True) == [2, 3, 4]
    assert inner.tested_folds(fold, ordered=False) == [0, 1, 2, 3, 4]
    assert learned_from(fold, 3, ordered=True).tolist() == (fold < 3).tolist()
    assert judged(fold, np.arange(10) % 2, ordered=True).tolist() == (fold >= 2).tolist()


def test_inner_folds_part_no_group_and_leave_every_class_to_learn_from():
    own = trials(object=[f"o{i // 2}" for i in range(24)])
    y = np.array([i // 2 % 3 for i in range(24)])

    fold = inner_folds(own, y, range(24), Held("object"))

    assert all(fold[i] == fold[i + 1] for i in range(0, 24, 2))
    for number in set(fold):
        assert set(y[fold != number]) == {0, 1, 2}


def test_where_later_trials_are_held_out_inner_folds_are_successive():
    own = trials(number=[str(9 - i // 2) for i in range(20)])

    y = np.arange(20) % 2

    fold = inner_folds(own, y, range(20), Held("number", ordered=True))

    assert (np.diff(fold) <= 0).all()
    assert set(fold) == {0, 1, 2, 3, 4}


def test_a_class_of_one_trial_is_learned_from_but_not_judged():
    y = np.array([0, 0, 1, 1, 2])

    fold = inner_folds(trials(object=list("abcde")), y, range(5), Held(None))

    assert judged(fold, y).tolist() == [True] * 4 + [False]


def test_one_trial_of_each_class_is_not_enough_to_choose():
    with pytest.raises(BadSplit, match="two classes"):
        inner_folds(trials(object=["a", "b", "c"]), np.array([0, 1, 2]), range(3), Held(None))


def test_what_would_be_judged_by_a_model_of_one_class_is_not_judged():
    """All of class 1 is in the last object's fold: the others teach class 0 alone."""
    own = trials(object=["a"] * 4 + ["b"] * 4 + ["c"] * 3)
    y = np.array([0] * 8 + [0, 1, 1])

    fold = inner_folds(own, y, range(11), Held("object"))

    assert judged(fold, y).tolist() == [True] * 8 + [False] * 3


def test_a_trial_without_the_group_that_is_held_out_stands_alone():
    """A table of folds may hold out sessions and leave out a recording that has none."""
    own = trials(session=["m", "m", "t", "t", "w", "w", "s", "s"])
    own[7] = replace(own[7], groups={"trial": "r7#0", "recording": "r7"})
    y = np.arange(8) % 2

    groups = groups_of(own, Held("session")).tolist()
    assert len(set(groups)) == 5
    assert groups.count(groups[7]) == 1
    assert len(inner_folds(own, y, range(8), Held("session"))) == 8


def test_in_an_order_a_trial_without_a_number_comes_last():
    own = trials(number=[str(i) for i in range(12)])
    own[0] = replace(own[0], groups={"trial": "r0#0", "recording": "r0"})

    fold = inner_folds(own, np.arange(12) % 2, range(12), Held("number", ordered=True))

    assert fold[0] == fold.max()


def test_where_later_sessions_are_held_out_none_stands_on_both_sides_of_an_inner_fold():
    session = [str(1 + i // 20) for i in range(80)]
    own = trials(session=session)
    y = np.arange(80) % 2

    fold = inner_folds(own, y, range(80), Held("session", ordered=True))

    assert len(inner.tested_folds(fold, ordered=True)) == 2
    for number in inner.tested_folds(fold, ordered=True):
        learned = {session[i] for i in np.flatnonzero(learned_from(fold, number, ordered=True))}
        tested = {session[i] for i in np.flatnonzero(fold == number)}
        assert max(learned) < min(tested)


def test_a_class_of_one_session_is_judged_all_the_same():
    """Its later trials are: there is no later session of it."""
    own = trials(session=[str(1 + i // 10) for i in range(40)])
    y = np.arange(40) // 20

    fold = inner_folds(own[:30], y[:30], range(30), Held("session", ordered=True))

    assert set(y[:30][judged(fold, y[:30], ordered=True)].tolist()) == {0, 1}


def test_where_new_sessions_come_and_too_few_were_learned_from_that_is_known():
    """One day learned from and another tested; two are enough where the split names them."""
    days = trials(day=[f"d{i // 8}" for i in range(24)])
    sides = range(8), range(8, 16)

    assert what_is_held(days, ONE_CLASS[:24], *sides) == Held(None, new="day")
    assert what_is_held(days, ONE_CLASS[:24], *sides, "day") == Held(None, new="day")
    assert Held(None, new="day").words == "successive trials (too few days to hold one out)"
    two = what_is_held(days, ONE_CLASS[:24], range(16), range(16, 24), "day")
    assert two == Held("day")
    assert what_is_held(days, ONE_CLASS[:24], range(16), range(16, 24)) == Held(None, new="day")


def test_days_that_not_all_trials_name_are_new_all_the_same():
    own = trials(Day=[f"d{i // 8}" for i in range(16)])
    own[3].groups.pop("Day")

    assert what_is_held(own, ONE_CLASS[:16], range(8), range(8, 16), "Day") == Held(None, new="Day")


def test_days_on_both_sides_and_groups_that_are_no_sessions_are_not_new():
    mixed = trials(day=["a", "b"] * 8)
    parts = trials(half=[f"h{i // 8}" for i in range(16)])

    assert what_is_held(mixed, ONE_CLASS[:16], range(8), range(8, 16)) == Held(None)
    assert what_is_held(parts, ONE_CLASS[:16], range(8), range(8, 16)) == Held(None)


def test_blocks_of_the_only_day_do_not_show_what_another_day_does():
    own = trials(day=[f"d{i // 12}" for i in range(24)], block=[f"b{i // 3}" for i in range(24)])

    held = what_is_held(own, ONE_CLASS[:24], range(12), range(12, 24), "day")

    assert held == Held("block", new="day")
    assert held.words == "whole blocks (too few days to hold one out)"


def test_groups_of_which_each_class_has_one_cannot_be_held_out():
    """Whether objects to come differ as sessions do was not measured."""
    thirds = [str(i // 4) for i in range(12)]
    own = trials(session=thirds, object=thirds)
    of_one_class, mixed = np.arange(12) // 4, np.arange(12) % 2

    few = with_few(own, of_one_class, range(12), Held("session"))
    assert few == Held("session", new="session", single=True)
    assert few.words == "successive trials (too few sessions to hold one out)"
    assert with_few(own, mixed, range(12), Held("session")) == Held("session")
    assert with_few(own, mixed, range(12), Held(None)) == Held(None)
    objects = with_few(own, of_one_class, range(12), Held("object"))
    assert objects == Held("object", single=True)
    assert objects.words == "successive trials"


def test_in_the_end_two_days_are_held_out_though_each_fold_learns_from_one():
    """Later takes, and a table whose only training side is all that is learned from, stay so."""
    own = trials(day=[f"d{i // 8}" for i in range(16)])
    takes = trials(day=[f"d{i // 8}" for i in range(16)], take=[str(i) for i in range(16)])
    first, both = range(8), range(16)
    held = what_is_held(own, ONE_CLASS[:16], first, range(8, 16), "day")
    later = what_is_held(takes, ONE_CLASS[:16], first, range(8, 16), "take")

    assert with_all(own, first, both, held) == Held("day")
    assert with_all(own, first, first, held) == held == Held(None, new="day")
    assert with_all(takes, first, both, later) == later == Held("take", ordered=True, new="day")
