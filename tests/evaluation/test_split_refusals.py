"""What a split is refused for, in full: thin classes, trials without windows, unknown names (0049).

A refusal is what a user reads in place of a result, so its count, its example and its advice are
tested, not only that it is raised.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from make_dataset import make_dataset

from taxel.errors import BadSplit
from taxel.evaluation.splits import TrialFold, by_group, by_share, check_classes, parse_split
from taxel.labels.trials import Trial
from taxel.windows.checks import MORE_WINDOWS
from taxel.windows.dataset import Dataset

GROUPS = "groups are number, recording, session, trial"
SPLITS = (
    "a split: random, group:KEY, order:KEY:LAST, order:KEY:LAST:END or order:KEY:70%[:by-class]"
)


def words_of(refusal: BadSplit) -> tuple[str, str, str]:
    """Return what was needed, what was got and what helps."""
    return refusal.needed, refusal.got, refusal.mend


def trial_of(labels: dict[str, str], session: str, number: int = 9) -> Trial:
    """Return a trial to stand among those without windows."""
    groups = {"recording": session, "session": session, "trial": f"{session}#{number}"}
    return Trial(recording=f"{session}.mcap", start_s=10.0 * number, end_s=10.0 * number + 1.0,
                 labels=labels, groups=groups)  # fmt: skip


def with_shapes(dataset: Dataset, shapes: Sequence[str]) -> Dataset:
    """Return the data set with other classes, one a trial."""
    trials = [replace(trial, labels={"shape": shape})
              for trial, shape in zip(dataset.trials, shapes, strict=True)]  # fmt: skip
    return replace(dataset, trials=tuple(trials))


def one_box() -> Dataset:
    """Return two sessions with cups and mugs, and a single box: the second trial of session s1."""
    return with_shapes(make_dataset(sessions=2, trials_a_session=4),
                       ["cup", "mug", "cup", "mug", "mug", "box", "cup", "mug"])  # fmt: skip


def test_a_class_of_one_group_says_where_to_record_it_too() -> None:
    """Nothing of it is lost in `empty`, so nothing is said of windows."""
    with pytest.raises(BadSplit) as caught:
        by_group(make_dataset(sessions=3, one_session_a_class=True), "shape", "session", 3, seed=0)

    assert words_of(caught.value) == (
        "at least two groups 'session' for every class of 'shape'", "one (s0) for 'c0'",
        "record 'c0' in another session too, or hold out another group",
    )  # fmt: skip


def test_a_class_whose_other_groups_gave_no_window_is_not_said_to_lack_groups() -> None:
    """Counted are its own trials of other groups: no other class's, none of the same group."""
    dataset = make_dataset(sessions=5, one_session_a_class=True)
    empty = (
        trial_of({"shape": "c2"}, "s0"), trial_of({"shape": "c2"}, "s7"),
        trial_of({"shape": "c2"}, "s2"), trial_of({"shape": "c1"}, "s8"),
        trial_of({"shape": "c3"}, "s8"), trial_of({}, "s9"),
    )  # fmt: skip
    with pytest.raises(BadSplit) as caught:
        by_group(replace(dataset, empty=empty), "shape", "session", 3, seed=0)

    assert words_of(caught.value) == (
        "windows of at least two groups 'session' for every class of 'shape'",
        "one (s2) for 'c2': 2 trials of its other groups gave no window: too short, below the gate "
        "or not usable",
        MORE_WINDOWS,
    )  # fmt: skip


@pytest.mark.parametrize("sessions", [2, 3])
def test_trials_without_windows_do_not_stop_a_class_of_two_groups_or_more(sessions: int) -> None:
    """Their groups are lost, but those with windows can be held out."""
    empty = (trial_of({"shape": "c0"}, "s8"), trial_of({"shape": "c1"}, "s9"))
    dataset = replace(make_dataset(sessions=sessions), empty=empty)

    split = by_group(dataset, "shape", "session", 5, seed=0)

    assert [fold.name for fold in split.folds] == [f"without s{n}" for n in range(sessions)]
    assert split.key == "session"


def test_a_class_of_one_trial_is_named_with_where_it_is() -> None:
    """More groups would not help it: it has one trial, which cannot stand on both sides."""
    with pytest.raises(BadSplit) as caught:
        by_group(one_box(), "shape", "session", 2, seed=0)

    assert words_of(caught.value) == (
        "at least two trials of every class of 'shape', to learn from and to test",
        "one of 'box' (s1.mcap, from 50.0 s)", "record 'box' again, or leave that trial out",
    )  # fmt: skip


def test_a_class_of_one_trial_with_windows_says_how_many_gave_none() -> None:
    """They are of its own group, so no group of it is lost; another class's are not counted."""
    empty = (
        trial_of({"shape": "box"}, "s1"), trial_of({"shape": "box"}, "s1", 10),
        trial_of({"shape": "mug"}, "s1"), trial_of({"shape": "apple"}, "s1"),
        trial_of({"shape": "mug"}, "s0"), trial_of({}, "s1"),
    )  # fmt: skip
    with pytest.raises(BadSplit) as caught:
        by_group(replace(one_box(), empty=empty), "shape", "session", 2, seed=0)

    assert words_of(caught.value) == (
        "at least two trials of every class of 'shape', to learn from and to test",
        "one of 'box' (s1.mcap, from 50.0 s): 2 trials of its other trials gave no window: "
        "too short, below the gate or not usable",
        MORE_WINDOWS,
    )  # fmt: skip


def test_trials_without_windows_are_counted_by_a_joined_label_too() -> None:
    """`empty` keeps the labels of the recordings, the trials have the joined one as well."""
    dataset = make_dataset(sessions=2, trials_a_session=2, classes=2, one_session_a_class=True)
    trials = tuple(
        replace(trial, labels={"shape+skin": f"{trial.labels['shape']} wet"})
        for trial in dataset.trials
    )
    empty = (trial_of({"shape": "c0", "skin": "wet"}, "s7"),
             trial_of({"shape": "c0", "skin": "dry"}, "s8"))  # fmt: skip
    with pytest.raises(BadSplit, match=r"one \(s0\) for 'c0 wet': 1 trial of its other groups"):
        by_group(replace(dataset, trials=trials, empty=empty), "shape+skin", "session", 2, seed=0)


def test_classes_that_are_measured_figures_are_said_to_be_so() -> None:
    """To record a figure of 0.5 N again is no advice: the figures want to be sorted into ranges."""
    dataset = with_shapes(make_dataset(sessions=2), [f"{n}.5" for n in range(12)])

    with pytest.raises(BadSplit) as caught:
        by_group(dataset, "shape", "session", 2, seed=0)

    assert caught.value.got == "one of '0.5' (s0.mcap, from 0.0 s)"
    assert caught.value.mend.startswith("'shape' looks like a measured figure: its 12 values in 12")


def in_turns(key: str) -> Dataset:
    """Return ten trials of two classes in turns, numbered by a group backwards: 10, 9, … 1."""
    dataset = make_dataset(sessions=2, trials_a_session=5)
    trials = [
        replace(trial, labels={"shape": f"c{i % 2}"}, groups={**trial.groups, key: str(10 - i)})
        for i, trial in enumerate(dataset.trials)
    ]
    return replace(dataset, trials=tuple(trials))


@pytest.mark.parametrize("key", ["day", "order", "50%"])
def test_a_share_trains_on_the_first_by_the_group_that_is_named(key: str) -> None:
    """Also by a group that is called as the split or as a share is."""
    split = parse_split(f"order:{key}:60%", in_turns(key), "shape", 3, 0)

    assert (split.name, split.key, split.final) == (f"{key} up to 6 (60 %) → above", key, None)
    (fold,) = split.folds
    assert isinstance(fold, TrialFold)
    assert fold.name == split.name
    assert fold.train == frozenset(range(4, 10))
    assert fold.test == frozenset(range(4))


def test_a_share_from_python_is_the_one_that_the_text_names() -> None:
    dataset = in_turns("day")

    assert by_share(dataset, "shape", "day", "60%") == parse_split("order:day:60%", dataset,
                                                                   "shape", 3, 0)  # fmt: skip


@pytest.mark.parametrize(("key", "last", "trained"), [("day", "4", 4), ("order", "6.5", 6)])
def test_an_order_up_to_a_number_is_by_the_group_that_is_named(
    key: str, last: str, trained: int
) -> None:
    split = parse_split(f"order:{key}:{last}", in_turns(key), "shape", 3, 0)

    assert (split.name, split.key) == (f"{key} up to {last} → above", key)
    assert len(split.folds) == 1
    np.testing.assert_array_equal(split.folds[0].windows(in_turns(key))[0],
                                  np.arange(30 - 3 * trained, 30))  # fmt: skip


@pytest.mark.parametrize("text", [
    "group:number:50%", "a:number:50%", "sort:number:50%", "number:50%:order", "number:50%",
    "number:3:order", "order:number:50%:60%", "order", "order:50%", "random:random", "group",
])  # fmt: skip
def test_words_that_are_no_split_are_repeated_with_the_groups_there_are(text: str) -> None:
    with pytest.raises(BadSplit) as caught:
        parse_split(text, make_dataset(), "shape", 3, 0)

    assert words_of(caught.value) == (SPLITS, repr(text), f"for group:KEY, {GROUPS}")


@pytest.mark.parametrize("text", ["session", "number"])
def test_a_bare_group_is_answered_with_how_to_name_it(text: str) -> None:
    with pytest.raises(BadSplit) as caught:
        parse_split(text, make_dataset(), "shape", 3, 0)

    assert words_of(caught.value) == (SPLITS, repr(text), f"say group:{text}")


def test_groups_that_some_trials_lack_are_not_offered() -> None:
    dataset = make_dataset(sessions=2)
    first, *others = dataset.trials
    dataset = replace(dataset, trials=(replace(first, groups={**first.groups, "day": "1"}),
                                       *others))  # fmt: skip
    with pytest.raises(BadSplit) as caught:
        parse_split("day", dataset, "shape", 3, 0)

    assert caught.value.mend == f"for group:KEY, {GROUPS}"


def fold_of(train: set[int], test: set[int]) -> TrialFold:
    return TrialFold("own", frozenset(train), frozenset(test))


def test_a_training_part_of_one_class_is_refused() -> None:
    """Trials 0 and 3 are of c0, 1 and 4 of c1: two classes are enough, one is not."""
    dataset = make_dataset(sessions=1)

    check_classes(dataset, "shape", fold_of({0, 1}, {3, 4}))
    with pytest.raises(BadSplit) as caught:
        check_classes(dataset, "shape", fold_of({0}, {3}))
    assert words_of(caught.value) == (
        "at least two classes of 'shape' to train on in own",
        "c0 only",
        "add recordings of another",
    )


def test_classes_that_are_tested_and_not_learned_are_all_named() -> None:
    with pytest.raises(BadSplit) as caught:
        check_classes(make_dataset(sessions=1), "shape", fold_of({0}, {1, 2, 3}))

    assert words_of(caught.value) == (
        "every tested class of 'shape' in the training part of own", "none of c1, c2",
        "train on it too, or leave it out of the test part",
    )  # fmt: skip


def test_more_folds_of_groups_than_windows_of_a_class_are_refused() -> None:
    """scikit-learn refuses them too, without saying what helps; each group once is no such case."""
    dataset = make_dataset(sessions=20, trials_a_session=1, windows_a_trial=1, classes=2)
    dataset = with_shapes(dataset, ["can", "mug"] * 10)
    assert len(by_group(dataset, "shape", "session", 20, 0).folds) == 20
    with pytest.raises(BadSplit) as caught:
        by_group(dataset, "shape", "session", 19, 0)

    assert words_of(caught.value) == (
        "at least 19 windows of a class for 19 folds", "10 at most", "choose at most 10 folds"
    )  # fmt: skip
    assert len(by_group(dataset, "shape", "session", 10, 0).folds) == 10
