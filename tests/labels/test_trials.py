"""Claims about trials: each mark is one, a mark's own words win, and every one has its own name."""

from pathlib import Path

import pytest

from taxel.errors import BadDataset
from taxel.labels.class_order import RESERVED, figures_as_classes, in_order, refuse_reserved
from taxel.labels.trials import (
    Trial,
    coarsest_group,
    held_out,
    lone_group,
    span_at,
    trials_of,
)
from taxel.recordings.manifest import Manifest
from taxel.signals import Mark, SensorInfo
from taxel.windows.checks import check_classes

MANIFEST = Manifest(
    sensor=SensorInfo(name="t", channels=("a",), units=("V",), rate_hz=100.0),
    labels={"sign": "A", "hand": "left"},
    groups={"session": "3"},
)
PATH = Path("somewhere/else/B_1.mcap")


def test_a_recording_without_marks_is_one_trial_as_a_whole():
    (trial,) = trials_of(PATH, MANIFEST, [], 2.0, 9.5)
    assert (trial.recording, trial.start_s, trial.end_s, trial.duration_s) == (
        "B_1.mcap",
        2.0,
        9.5,
        7.5,
    )
    assert dict(trial.labels) == {"sign": "A", "hand": "left"}
    assert dict(trial.groups) == {"session": "3", "recording": "B_1", "trial": "B_1#0"}


def test_a_marks_own_words_win_and_the_recordings_fill_in():
    mark = Mark(start_s=1.0, end_s=2.0, labels={"sign": "B"}, groups={"session": "4", "grasp": "7"})
    (trial,) = trials_of(PATH, MANIFEST, [mark], 0.0, 5.0)
    assert dict(trial.labels) == {"sign": "B", "hand": "left"}
    assert (trial.groups["session"], trial.groups["grasp"]) == ("4", "7")


def test_no_mark_can_pretend_to_be_another_recording_or_trial():
    """Splits hang on these two: a mark that names them itself is overruled."""
    mark = Mark(start_s=1.0, end_s=2.0, labels={}, groups={"recording": "x", "trial": "y"})
    (trial,) = trials_of(PATH, MANIFEST, [mark], 0.0, 5.0)
    assert (trial.groups["recording"], trial.groups["trial"]) == ("B_1", "B_1#0")


def test_trials_come_oldest_first_each_with_a_name_of_its_own():
    marks = [Mark(start_s=float(s), end_s=s + 0.5, labels={}) for s in (3, 1, 2)]
    trials = trials_of(PATH, MANIFEST, marks, 0.0, 5.0)
    assert [trial.start_s for trial in trials] == [1.0, 2.0, 3.0]
    assert [trial.groups["trial"] for trial in trials] == ["B_1#0", "B_1#1", "B_1#2"]
    assert [mark.start_s for mark in marks] == [3.0, 1.0, 2.0]


def made(*groups: dict[str, str]) -> list[Trial]:
    return [
        Trial(recording="r", start_s=i, end_s=i + 1.0, labels={}, groups={**own, "trial": str(i)})
        for i, own in enumerate(groups)
    ]


@pytest.mark.parametrize(
    ("groups", "split", "expected"),
    [
        ([{"session": "a", "file": "1"}, {"session": "b", "file": "2"}], "", "session"),
        ([{"session": "a", "file": "1"}, {"session": "a", "file": "2"}], "", "file"),
        ([{"session": "a", "recording": "1"}, {"recording": "2"}], "", "recording"),
        ([{"session": "a"}, {"session": "a"}], "session held out", "trial"),
    ],
)
def test_the_coarsest_group_is_one_that_all_have_and_of_which_there_are_two(
    groups: list[dict[str, str]], split: str, expected: str
):
    assert coarsest_group(made(*groups), split) == expected


def test_what_is_held_out_is_drawn_as_a_whole_unless_it_lies_within_a_session():
    both = [{"session": s, "object": o} for s in "ab" for o in "12"]
    assert coarsest_group(made(*both), "object held out") == "object"
    assert coarsest_group(made(*both), "random windows (leaks)") == "session"
    own = [{"session": s, "object": s + o} for s in "ab" for o in "12"]
    assert coarsest_group(made(*own), "object held out") == "session"


def test_a_split_names_what_it_holds_out_with_or_without_its_table():
    """A table's name, and what a comparison tested, may stand around it."""
    trials = made({"session": "a", "object": "1"}, {"session": "b", "object": "2"})
    named = ("object held out", "x.csv, object held out", "object held out; tested: y.csv")
    for split in (*named, "x.csv; tested: y.csv, object held out"):
        assert held_out(split, trials) == "object", split
    for split in ("folds.csv", "random windows (leaks)", "cup held out", "an object held out"):
        assert held_out(split, trials) is None, split


def test_what_is_tested_once_is_named():
    """The session, or what the split holds out: an interval within it promises too much."""
    single = made(*({"session": "a", "object": o, "file": o} for o in "123"))
    two = made({"session": "a", "object": "1"}, {"session": "b", "object": "1"})

    assert (lone_group(single), lone_group(single, "object held out")) == ("session", "session")
    assert (lone_group(two), lone_group(two, "object held out")) == (None, "object")
    assert lone_group(made({"file": "1"}, {"file": "2"})) is None


def test_a_label_of_measured_figures_is_named_as_such():
    """Many numbers with hardly a trial each; neither names nor few digits are meant."""
    forces = [f"{n / 30:.3f}" for n in range(90)] * 2
    note = figures_as_classes(forces, "force_n")

    assert note is not None
    assert "its 90 values in 180 trials" in note
    assert "no regression" in note
    assert figures_as_classes([f"k{n}" for n in range(90)], "name") is None
    assert figures_as_classes([str(n) for n in range(10)] * 3, "digit") is None
    assert figures_as_classes(["1", "2", "3"], "grip") is None
    assert figures_as_classes([f"{n}_{n + 1}" for n in range(20)], "day_and_run") is None


def test_what_stands_for_no_answer_is_no_class():
    """Else it could not be told whether a model names the class, or nothing."""
    refuse_reserved(("cup", "unknown", "UNKNOWN 2"), "object")
    with pytest.raises(BadDataset, match=r"classes of 'object'.*got UNKNOWN, which stands for no"):
        refuse_reserved(("cup", RESERVED), "object")
    trials = [Trial(recording="a.mcap", start_s=0.0, end_s=1.0, labels={"object": name}, groups={})
              for name in ("cup", "UNKNOWN")]  # fmt: skip
    with pytest.raises(BadDataset, match="stands for no answer"):
        check_classes(trials, "object")


def test_a_moment_belongs_to_the_stretch_that_holds_it_though_its_neighbour_is_near():
    """At 2 kHz the last scan of one trial is half a millisecond before the next one's first."""
    spans = [(0.0, 0.0995), (0.1, 0.1995), (0.2, 0.2995)]

    assert [span_at(moment, spans, 1e-3) for moment in (0.0, 0.1, 0.2)] == [0, 1, 2]
    assert span_at(0.0998, spans, 1e-3) == 1  # between them: the nearer
    assert span_at(0.3004, spans, 1e-3) == 2
    assert span_at(0.302, spans, 1e-3) is None
    assert span_at(0.1, [], 1e-3) is None
    assert span_at(0.1, [(0.0, 0.1), (0.1, 0.2)], 1e-3) == 1  # both hold it: the one that begins


def test_a_trial_lasts_no_longer_than_its_recording():
    """A recorder that is stopped within a grasp keeps the mark's end, which was never recorded."""
    spans = ((1.0, 2.0), (4.0, 7.0), (6.0, 8.0))
    marks = [Mark(start_s=start, end_s=end, labels={}) for start, end in spans]
    trials = trials_of(PATH, MANIFEST, marks, 0.0, 5.0)
    assert [trial.duration_s for trial in trials] == [1.0, 1.0, 0.0]
    assert [trial.start_s for trial in trials] == [1.0, 4.0, 6.0]


@pytest.mark.parametrize(
    ("names", "order"),
    [
        (["1_10", "2_1"], ("1_10", "2_1")),  # 110 and 21 in Python
        (["10", "2", "-1.5"], ("-1.5", "2", "10")),
        (["2", "10", "inf"], ("10", "2", "inf")),
    ],
)
def test_classes_stand_as_numbers_only_where_all_are_written_as_such(names, order):
    assert in_order(names) == order
