"""Later trials are tested, a share of them: whole numbers, and of each class where it needs be."""

from dataclasses import replace

import numpy as np
import pytest
from make_dataset import make_dataset

from taxel.errors import BadDataset, BadSplit
from taxel.evaluation.camera_trials.sides import split_trials
from taxel.evaluation.first_share import first_share
from taxel.evaluation.splits import parse_split
from taxel.training.choose.inner_folds import Held, inner_folds, what_is_held


def test_trials_of_one_number_stay_together():
    numbers = np.array(["1", "1", "2", "2", "10", "10", "10", "10"])

    first, name = first_share("day", numbers, np.arange(8) % 2, "60%")

    assert first.tolist() == [True] * 4 + [False] * 4
    assert name == "day up to 2 (50 %) → above"


def test_of_classes_recorded_one_after_another_the_first_of_each_is_trained_on():
    y = np.repeat(["mug", "can"], 10)

    first, name = first_share("n", np.arange(20).astype(str), y, "70%")

    assert first.tolist() == ([True] * 7 + [False] * 3) * 2
    assert "of each class" in name


def test_where_trials_of_classes_alternate_later_trials_are_tested_whatever_their_class():
    """Each trial has a number of its own; each class's own first would be partly later ones."""
    y = np.array(["mug", "can", "mug", "mug", "can", "mug", "mug", "can", "mug", "mug"])

    first, name = first_share("n", np.arange(10).astype(str), y, "60%")

    assert first.tolist() == [True] * 6 + [False] * 4
    assert name == "n up to 5 (60 %) → above"


@pytest.mark.parametrize("text", ["0%", "100%", "x%", "-3%"])
def test_a_share_that_is_none_is_refused(text: str):
    with pytest.raises(BadSplit, match="between 0% and 100%"):
        first_share("n", np.arange(4).astype(str), np.arange(4) % 2, text)


def test_sessions_that_classes_share_stay_whole_though_one_class_ends_early():
    sessions = np.array([*range(1, 11), *range(1, 11), *range(1, 7)]).astype(str)
    y = np.repeat(["mug", "can", "box"], [10, 10, 6])

    first, name = first_share("session", sessions, y, "60%")

    assert not set(sessions[first]) & set(sessions[~first])
    assert "up to 6 (69 %)" in name


def test_a_class_that_is_tested_and_never_learned_is_refused():
    y = np.repeat(["mug", "can", "box"], [6, 6, 1])
    numbers = np.array([*range(6), *range(6), 5]).astype(str)

    with pytest.raises(BadSplit, match="none of box; choose a larger share"):
        first_share("n", numbers, y, "50%")


def test_what_is_no_number_or_one_number_only_is_refused():
    y = np.arange(4) % 2
    with pytest.raises(BadSplit, match=r"numbers in the group 'n'; got 'nan'"):
        first_share("n", np.array(["1", "2", "nan", "3"]), y, "50%")
    with pytest.raises(BadSplit, match=r"numbers in the group 'day'"):
        first_share("day", np.array(["mon", "tue"] * 2), y, "50%")
    with pytest.raises(BadSplit, match="two or more numbers in the group 'n'; got 1 only"):
        first_share("n", np.array(["1"] * 4), y, "50%")


def test_arrays_and_cameras_take_a_share():
    dataset = make_dataset()
    (fold,) = parse_split("order:number:50%", dataset, "shape", 5, 0).folds
    numbers = dataset.group("number").astype(float)

    assert fold.test
    assert numbers[sorted(fold.train)].max() < numbers[sorted(fold.test)].min()
    groups = [{"take": str(i)} for i in range(10)]
    (sides,) = split_trials(groups, np.arange(10) % 2, "order:take:60%", 5, 0).folds
    assert sides.test == {6, 7, 8, 9}


def test_inner_folds_are_ordered_where_each_classes_first_are_trained_on():
    dataset = make_dataset()
    trials = [
        replace(trial, groups=trial.groups | {"take": str(i)})
        for i, trial in enumerate(sorted(dataset.trials, key=lambda t: t.labels["shape"]))
    ]
    y = np.unique([trial.labels["shape"] for trial in trials], return_inverse=True)[1]
    first, _ = first_share("take", np.arange(len(y)).astype(str), y, "60%")

    held = what_is_held(trials, y, np.flatnonzero(first), np.flatnonzero(~first), "take")

    assert held == Held("take", ordered=True)


def test_a_group_named_without_its_word_is_advised():
    with pytest.raises(BadSplit, match="say group:session"):
        parse_split("session", make_dataset(), "shape", 5, 0)
    with pytest.raises(BadSplit, match="for group:KEY, groups are "):
        parse_split("sessions", make_dataset(), "shape", 5, 0)
    with pytest.raises(BadSplit, match="say group:take"):
        split_trials([{"take": "1"}, {"take": "2"}], np.arange(2), "take", 5, 0)


def test_touches_marked_in_one_recording_are_split_by_the_time_at_which_they_begin():
    """They have no number of their own; inner folds hold out later ones, too."""
    dataset = make_dataset()
    trials = tuple(
        replace(trial, recording="long", start_s=9.5 * place, end_s=9.5 * place + 8)
        for place, trial in enumerate(dataset.trials)
    )
    marked = replace(dataset, trials=trials)
    y = np.arange(len(trials)) % 2

    split = parse_split("order:time:70%", marked, "shape", 5, 0)
    (fold,) = split.folds

    assert split.key == "time"
    starts = marked.group("time").astype(float)
    assert starts[sorted(fold.train)].max() < starts[sorted(fold.test)].min()
    held = what_is_held(trials, y, sorted(fold.train), sorted(fold.test), split.key)
    assert held == Held("time", ordered=True)
    places = inner_folds(trials, y, sorted(fold.train), held)
    assert (np.diff(places) >= 0).all()
    assert len(set(places)) > 2


def test_a_group_that_is_called_time_is_what_its_name_says():
    dataset = make_dataset()
    trials = tuple(
        replace(trial, groups={**trial.groups, "time": str(100 - place)})
        for place, trial in enumerate(dataset.trials)
    )

    found = replace(dataset, trials=trials).group("time")

    assert found.tolist() == [str(100 - place) for place in range(len(trials))]


def test_recordings_with_clocks_of_their_own_have_no_time_to_split_by():
    """Nine seconds of each are no order; nor is a group that some trials have."""
    dataset = make_dataset()
    with pytest.raises(BadDataset, match="6 recordings, each with a clock of its own"):
        parse_split("order:time:70%", dataset, "shape", 5, 0)

    first, *others = dataset.trials
    some = replace(first, groups={**first.groups, "time": "9"})
    with pytest.raises(BadDataset, match="the group 'time' on every trial"):
        replace(dataset, trials=(some, *others)).group("time")


def test_names_with_an_underscore_are_no_numbers():
    """Python reads 1_10, a day and a run, as 110: days 2 and 3 came before it."""
    sessions = np.array(["1_9", "1_10", "2_1", "2_2"])
    with pytest.raises(BadSplit, match="'1_9' is a name"):
        first_share("session", sessions, np.arange(4) % 2, "50%")
    with pytest.raises(BadSplit, match=r"got text \('x-1#0' is no number\)"):
        first_share("trial", np.array(["3", "x-1#0", "4", "5"]), np.arange(4) % 2, "50%")
    trials = [replace(own, groups={**own.groups, "session": sessions[place % 4]})
              for place, own in enumerate(make_dataset().trials)]  # fmt: skip
    train = [i for i, own in enumerate(trials) if own.groups["session"] != "1_10"]
    test = [i for i, own in enumerate(trials) if own.groups["session"] == "1_10"]

    assert not what_is_held(trials, np.arange(len(trials)) % 2, train, test, "session").ordered


TAKES = np.array([*range(1, 51), *range(1, 11)]).astype(str)
"""Of two classes, one with five times as many."""
OF_TAKES = np.repeat(["mug", "can"], [50, 10])


def test_by_class_the_later_trials_of_each_are_tested_however_many_numbers_it_has():
    """Without it, the class with few is wholly trained on."""
    first, name = first_share("take", TAKES, OF_TAKES, "70%", by_class=True)

    assert (first[:50].sum(), first[50:].sum()) == (35, 7)
    assert name == "take, first 70 %, of each class → later"
    assert not set(OF_TAKES[~first_share("take", TAKES, OF_TAKES, "70%")[0]]) & {"can"}


def test_by_class_also_where_classes_share_some_numbers_and_one_begins_late():
    """Where the first of all lack a class, the refusal names the split by class."""
    numbers = np.array([*range(1, 51), *range(50, 81)]).astype(str)
    y = np.repeat(["mug", "can"], [50, 31])
    with pytest.raises(BadSplit, match=r"none of can.*order:take:70%:by-class tests the later"):
        first_share("take", numbers, y, "50%")

    first, _ = first_share("take", numbers, y, "70%", by_class=True)

    assert (first[y == "mug"].sum(), first[y == "can"].sum()) == (35, 22)


def test_by_class_each_class_needs_two_numbers():
    with pytest.raises(
        BadSplit, match=r"two or more numbers .* in every class; got 1 only for can"
    ):
        first_share("take", np.array(["1", "2", "3", "1", "1"]),
                    np.repeat(["mug", "can"], [3, 2]), "70%", by_class=True)  # fmt: skip


@pytest.mark.parametrize(
    "key",
    ["session", "day", "object", "date", "operator", "participant", "user", "run", "block", "Day",
     "file", "recording", "cut_from"],
)  # fmt: skip
def test_by_class_no_session_may_be_on_both_sides(key: str):
    """Takes may: take 8 of one class is another recording than take 8 of another."""
    with pytest.raises(BadSplit, match=f"each {key} on one side; got 8 on both"):
        first_share(key, TAKES, OF_TAKES, "70%", by_class=True)


def test_arrays_and_cameras_take_a_share_by_class_alike():
    dataset = make_dataset()
    y = np.array([trial.labels["shape"] for trial in dataset.trials])
    trials = [replace(trial, groups=trial.groups | {"take": str(sum(y[:i] == y[i]))})
              for i, trial in enumerate(dataset.trials)]  # fmt: skip
    dataset = replace(dataset, trials=trials)
    (fold,) = parse_split("order:take:50%:by-class", dataset, "shape", 5, 0).folds
    numbers = np.unique(y, return_inverse=True)[1]
    groups = [trial.groups for trial in trials]

    (sides,) = split_trials(groups, numbers, "order:take:50%:by-class", 5, 0, sorted(set(y))).folds

    assert (fold.train, fold.test) == (sides.train, sides.test)
    assert {y[i] for i in fold.test} == {y[i] for i in fold.train} == set(y)


@pytest.mark.parametrize("text", ["order:number:50%:by", "order:number:5:by-class", "group:x:50%"])
def test_a_misspelt_share_by_class_is_refused(text: str):
    dataset = make_dataset()
    with pytest.raises(BadSplit, match=r"order:KEY:70%\[:by-class\]"):
        parse_split(text, dataset, "shape", 5, 0)
    with pytest.raises(BadSplit, match=r"order:KEY:70%\[:by-class\]"):
        split_trials([{"number": str(i)} for i in range(4)], np.arange(4) % 2, text, 5, 0)


def test_a_class_that_is_only_later_is_sent_to_the_split_by_class():
    """In both kinds of data."""
    dataset = make_dataset()
    with pytest.raises(BadSplit, match="order:take:70%:by-class tests the later trials of each"):
        split_trials([{"take": str(i)} for i in range(4)], np.array([0, 0, 1, 1]), "order:take:1",
                     5, 0)  # fmt: skip
    y = np.array([trial.labels["shape"] for trial in dataset.trials])
    ranks = np.argsort(np.argsort(y, kind="stable"), kind="stable")
    trials = [replace(trial, groups=trial.groups | {"take": str(rank)})
              for trial, rank in zip(dataset.trials, ranks, strict=True)]  # fmt: skip
    with pytest.raises(BadSplit, match="order:take:70%:by-class tests the later trials of each"):
        parse_split("order:take:2", replace(dataset, trials=trials), "shape", 5, 0)


def test_a_group_that_by_class_refuses_is_not_sent_there():
    """A day is the same day for both classes."""
    with pytest.raises(BadSplit) as refused:
        split_trials([{"Day": str(i)} for i in range(4)], np.array([0, 0, 1, 1]), "order:Day:1", 5,
                     0)  # fmt: skip
    assert "by-class" not in str(refused.value)
