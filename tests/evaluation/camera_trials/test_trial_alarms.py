"""A recogniser of camera trials as an alarm: what live answers in time, and what that is worth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import NDArray
from rich.console import Console
from trial_makers import as_folder, write_trials

from taxel.bundles.trials import TrialContract
from taxel.cli.evaluation.trial_alarm import AlarmStudy, WatchedStudy
from taxel.decisions.trial_course import TrialCourse
from taxel.errors import BadInput
from taxel.evaluation.camera_trials.sides import interval_group
from taxel.evaluation.camera_trials.trial_alarms import LEVELS, TrialAlarms, trial_alarms
from taxel.live import trial_courses, trial_watch
from taxel.live.trial_courses import watch_trial
from taxel.live.trial_replay import TrialReplay
from taxel.live.trial_session import run_trial_session
from taxel.live.trial_watch import TrialAnswer
from taxel.windows.camera_trials import CameraTrial, read_camera_trials

CLASSES = ("hold", "slip")


def contract_of(trial: CameraTrial, crop: int = 4) -> TrialContract:
    return TrialContract(
        target="outcome", classes=CLASSES, crop=crop, places=3, views=("pixels",), versions=("",),
        cameras=len(trial.cameras), width=trial.width, height=trial.height, rate_hz=trial.rate_hz,
        mm_per_px=trial.mm_per_px, sharpness=1.3, threshold=10.0, data_digest="", measured={},
        software="",
    )  # fmt: skip


def by_brightness(
    _: object, images: Sequence[Sequence[NDArray[np.uint8]]]
) -> tuple[NDArray[np.float64], float]:
    """A model whose answer depends on the very images of a crop."""
    slip = float(np.mean([np.mean(own) for own in images])) / 255.0
    return np.array([1.0 - slip, slip]), 20.0 * slip


def test_a_course_holds_what_live_answers_while_the_trial_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = write_trials(tmp_path, objects=1, each=1, frames=11, write=as_folder)
    (trial, *_) = read_camera_trials(table)
    bundle = SimpleNamespace(contract=contract_of(trial))
    for module in (trial_courses, trial_watch):
        monkeypatch.setattr(module, "predict_crop", by_brightness)
    answers: list[TrialAnswer] = []
    with TrialReplay(trial) as source:
        run_trial_session(
            source, bundle, least_confidence=0.0,  # type: ignore[arg-type]
            on_answer=lambda answer, _: answers.append(answer),
        )  # fmt: skip
    live = [answer for answer in answers if answer.looked and not answer.last]

    course = watch_trial(bundle, trial)  # type: ignore[arg-type]

    assert len(live) == 4
    assert course.labels == tuple(answer.verdict.label for answer in live)
    np.testing.assert_array_equal(
        course.probabilities, [answer.verdict.probabilities for answer in live]
    )
    first_s = answers[0].time_s
    np.testing.assert_allclose(course.time_s, [answer.time_s - first_s for answer in live])
    assert course.length_s == pytest.approx(10 / trial.rate_hz)


def test_a_trial_shorter_than_a_crop_has_no_verdict(tmp_path: Path) -> None:
    table = write_trials(tmp_path, objects=1, each=1, frames=11, write=as_folder)
    (trial, *_) = read_camera_trials(table)
    bundle = SimpleNamespace(contract=contract_of(trial, crop=12))
    course = watch_trial(bundle, trial)  # type: ignore[arg-type]
    assert (course.labels, course.probabilities.shape) == ((), (0, 2))


def course_of(slip: Sequence[float], labels: Sequence[str] | None = None) -> TrialCourse:
    """A course with a look each second from 1 s on."""
    p = np.array(slip, float)
    named = tuple(CLASSES[int(own > 0.5)] for own in p) if labels is None else tuple(labels)
    return TrialCourse(
        time_s=np.arange(1.0, len(p) + 1), labels=named,
        probabilities=np.stack([1 - p, p], axis=1), length_s=float(len(p)),
    )  # fmt: skip


def printed(found: TrialAlarms) -> str:
    console = Console(width=120)
    with console.capture() as lines:
        console.print(WatchedStudy("outcome", found, "object").table())
    return lines.get()


def test_an_alarm_needs_the_class_and_its_confidence() -> None:
    courses = [
        course_of([0.2, 0.85, 0.97]),  # slips, found at 2 s, surely at 3 s
        course_of([0.65, 0.4, 0.4, 0.4]),  # slips, and was once taken for it
        course_of([0.1, 0.1, 0.1]),  # holds: its confidence is that of holding
        course_of([0.3, 0.995, 0.3], labels=("hold", "UNKNOWN", "hold")),  # holds: a novel touch
        course_of([0.1, 0.75, 0.3, 0.3]),  # holds, with a false alarm
    ]
    own = np.array([True, True, False, False, False])
    found = trial_alarms(courses, own, ["a", "a", "b", "c", "d"], "slip", 1)

    shares = {
        level.least_confidence: (level.right.alarmed, level.false.alarmed) for level in found.levels
    }
    assert shares == {
        0.5: (2, 1), 0.6: (2, 1), 0.7: (1, 1), 0.8: (1, 0), 0.9: (1, 0), 0.95: (1, 0),
        0.99: (0, 0),
    }  # fmt: skip
    at_once, surer = found.levels[0], found.levels[LEVELS.index(0.9)]
    assert (at_once.first_median_s, surer.first_median_s) == (1.5, 3.0)
    assert np.isnan(found.levels[-1].first_median_s)
    assert (at_once.right.of, at_once.false.of) == (2, 3)
    low, high = at_once.false.interval
    assert low < 1 / 3 < high

    # In the 3 s that all have: .97 and .65 against .1, .995 and .75; lengths 3 4 against 3 3 4.
    assert found.within_s == 3.0
    assert found.area == pytest.approx(3 / 6)
    assert found.length_area == pytest.approx(3.5 / 6)


def test_a_trial_without_a_verdict_so_early_leaves_no_area() -> None:
    short = TrialCourse(time_s=np.zeros(0), labels=(), probabilities=np.zeros((0, 2)), length_s=0.5)
    courses = [course_of([0.9, 0.9]), short]
    found = trial_alarms(courses, np.array([True, False]), ["a", "b"], "slip", 1)
    assert np.isnan(found.area)
    assert (found.levels[0].right.alarmed, found.levels[0].false.alarmed) == (1, 0)
    text = printed(found)
    assert "no alarm is possible while they run: 1 of 2 trials, counted as without one" in text
    assert "no AUC: not every trial has a verdict within 0.5 s, the length of the shortest" in text


def test_trials_of_the_class_alone_have_no_share_of_others() -> None:
    found = trial_alarms([course_of([0.9])] * 2, np.array([True, True]), ["a", "b"], "slip", 1)
    text = printed(found)
    assert "trials with an alarm for outcome slip while they run" in text
    assert "at its end, can raise an alarm too: not counted here" in text
    assert "shorter than a crop" not in text
    assert "AUC" not in text
    (line,) = [line for line in text.splitlines() if line.lstrip().startswith("0.5 ")]
    assert line.split() == ["0.5", "2", "of", "2", "(0.16", "to", "1.00)", "–", "1.0", "s"]


@pytest.mark.parametrize(
    ("label", "column", "got"),
    [("drop", "outcome", "--alarm drop"), ("slip", "kind", "none that has it")],
)
def test_a_class_that_is_never_recognised_is_refused_before_any_trial_is_watched(
    tmp_path: Path, label: str, column: str, got: str
) -> None:
    np.save(tmp_path / "0.npy", np.zeros((9, 20, 30), np.uint8))
    table = tmp_path / "t.csv"
    table.write_text(f"camera:gel,label:{column}\n0.npy,slip\n")
    trials = read_camera_trials(table)
    with pytest.raises(BadInput) as refused:
        AlarmStudy(
            label=label, contract=contract_of(trials[0]), trials=trials, group_of=interval_group
        )
    assert refused.value.got == got


def test_trials_without_the_label_do_not_change_what_intervals_are_resampled_by(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A recording of nothing beside the trials names no object: intervals became those of trials
    that stand alone, which are too narrow, under a score whose intervals were by object.
    """
    for number in range(5):
        np.save(tmp_path / f"{number}.npy", np.full((9, 20, 30), number, np.uint8))
    table = tmp_path / "t.csv"
    rows = [
        "0.npy,slip,mug",
        "1.npy,hold,mug",
        "2.npy,slip,cup",
        "3.npy,hold,cup",
        "4.npy,hold,mug",
    ]
    table.write_text("\n".join(["camera:gel,label:outcome,group:object", *rows]))
    *trials, last = read_camera_trials(table)
    trials.append(replace(last, labels={}, groups={}))

    def watch(_: object, __: object, watched: Sequence[CameraTrial], ___: object) -> list[object]:
        return [course_of([0.9]) for _ in watched]

    monkeypatch.setattr(trial_courses, "watch_side_by_side", watch)
    study = AlarmStudy(
        label="slip", contract=contract_of(trials[0]), trials=trials, group_of=interval_group
    )
    found = study.watched((table, ""), lambda done, of: None)

    assert found.resampled == "object"
    assert found.found.levels[0].right.of == found.found.levels[0].false.of == 2
    assert (found.foreign, found.record()["foreign"]) == (0, 0)


def test_alarms_in_trials_of_a_class_that_the_bundle_does_not_know_are_stated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A misspelt label, such as Slip, turned right alarms into false ones without a word."""
    for number in range(3):
        np.save(tmp_path / f"{number}.npy", np.full((9, 20, 30), number, np.uint8))
    table = tmp_path / "t.csv"
    table.write_text("camera:gel,label:outcome\n0.npy,slip\n1.npy,hold\n2.npy,Slip\n")
    trials = read_camera_trials(table)
    courses = [course_of([0.9]), course_of([0.1]), course_of([0.9])]
    monkeypatch.setattr(trial_courses, "watch_side_by_side", lambda *_: courses)
    study = AlarmStudy(
        label="slip", contract=contract_of(trials[0]), trials=trials, group_of=interval_group
    )
    found = study.watched((table, ""), lambda done, of: None)

    assert found.found.levels[0].false.of == 2
    assert found.record()["foreign"] == 1
    console = Console(width=120)
    with console.capture() as lines:
        console.print(found.table())
    assert "others: among them 1 whose outcome the bundle does not know" in lines.get()
