"""A recogniser of camera trials in a station: its verdicts, where trials end, what it cannot know.

The model is a dummy that counts its looks; what cuts trials and joins crops is the real one.
"""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from taxel.bundles.trials import TrialContract
from taxel.clock import ManualClock
from taxel.live import trial_watch
from taxel.live.station import trial_watcher
from taxel.live.station.answers import Answers
from taxel.live.station.packets import unpack
from taxel.live.station.trial_watcher import TrialWatcher
from taxel.signals import CameraInfo, Frame, Mark

CAMERA = CameraInfo(name="gel", width=8, height=8, rate_hz=25.0)
CAME = {"put_s": 0.0, "taken_s": 0.0}
CONTRACT = TrialContract(
    target="outcome", classes=("hold", "slip"), crop=8, places=3, views=(), versions=(), cameras=1,
    width=8, height=8, rate_hz=25.0, mm_per_px=0.065, sharpness=1.0, threshold=None,
    data_digest="", measured={}, software="",
)  # fmt: skip


class Rig:
    """A watcher of crops of 8 frames, of which a new one begins every 4, on a manual clock."""

    def __init__(self, patch: pytest.MonkeyPatch, *, again: bool = False) -> None:
        self.clock, self.looks = ManualClock(100.0), 0
        self._sent: list[bytes] = []
        self._number = 0
        self.pulse = SimpleNamespace(dropped=0, beat=self._beat, stopping=False)
        self.patience_s: list[float] = []
        bundle = SimpleNamespace(contract=CONTRACT)
        patch.setattr(trial_watcher, "read_trial_bundle", lambda *_: bundle)
        patch.setattr(trial_watcher, "monotonic", self.clock.now_s)
        patch.setattr(trial_watch, "decode_frame", lambda *_: np.zeros((8, 8, 3), np.uint8))
        patch.setattr(trial_watch, "predict_crop", self._predict)
        job = SimpleNamespace(
            place=SimpleNamespace(name="recogniser", again=again), cameras=(CAMERA,), trust=None,
            device="cpu", least_confidence=0.5,
        )  # fmt: skip
        writer = SimpleNamespace(put=self._sent.append)
        self.watcher = TrialWatcher(Path("a.taxel"), cast("Any", job), cast("Any", writer), 0)

    def frames(self, count: int) -> list[Frame]:
        """Return the next frames of the camera, 25 a second."""
        begin, self._number = self._number, self._number + count
        return [
            Frame(camera=0, jpeg=b"%d" % i, counter=i, device_s=i / 25, arrival_s=100 + i / 25,
                  fitted_s=i / 25)
            for i in range(begin, begin + count)
        ]  # fmt: skip

    def take(self, *packets: Any) -> list[dict[str, Any]]:
        """Let packets come at once; return the notes that were sent."""
        self.watcher.take(list(packets), CAME, cast("Any", self.pulse))
        return self.notes()

    def one_by_one(self, count: int) -> list[dict[str, Any]]:
        """Let frames come one at a time, as from a camera."""
        found = []
        for frame in self.frames(count):
            self.clock.advance(0.04)
            found += self.take(frame)
        return found

    def notes(self) -> list[dict[str, Any]]:
        found, self._sent[:] = [cast("Any", unpack(content)) for content in self._sent], []
        return found

    def _predict(self, *_: Any) -> tuple[Any, float]:
        self.looks += 1
        return np.array([0.2, 0.8]), 0.0

    def _beat(self, patience_s: float = 0.0) -> None:
        self.patience_s.append(patience_s)


@pytest.fixture
def rig(monkeypatch: pytest.MonkeyPatch) -> Rig:
    return Rig(monkeypatch)


def mark(begin: int, end: int, **labels: str) -> Mark:
    return Mark(start_s=begin / 25, end_s=end / 25, labels=labels, groups={})


def test_a_verdict_builds_up_and_the_mark_gives_that_on_the_whole_trial(rig: Rig):
    running = rig.one_by_one(20)
    counted = [note for note in running if note["label"] == "UNKNOWN"]
    assert counted[0]["reason"] == "1 of the 8 frames of a crop"
    assert [note["of"] for note in running if note["label"] == "slip"] == [
        "1 crop so far", "2 crops so far", "3 crops so far", "4 crops so far",
    ]  # fmt: skip
    assert all(not note["last"] for note in running)

    whole, news = rig.take(mark(0, 19, outcome="hold"))
    assert (whole["label"], whole["last"], whole["truth"]) == ("slip", True, "hold")
    assert whole["of"] == "whole trial, 20 frames"
    assert whole["confidence"] == pytest.approx(0.8)
    assert rig.looks == 4 + 3
    assert news["kind"] == "news"
    assert news["text"] == "outcome: slip 0.80 (whole trial, 20 frames)"
    assert set(rig.patience_s) == {10.0}

    (next_one,) = rig.one_by_one(1)
    assert next_one["label"] == "UNKNOWN"
    assert (whole["touch"], next_one["touch"]) == (1, 2)
    assert next_one["of"] == "the trial before: slip 0.80 (whole trial, 20 frames)"


@pytest.mark.parametrize("end", [{"do": "new grasp"}, {"ended": 1.0}])
def test_a_new_grasp_and_the_sources_end_are_a_trials_end(rig: Rig, end: dict[str, Any]):
    rig.one_by_one(12)
    whole, _ = rig.take(end)
    assert whole["last"]
    assert whole["truth"] is None
    rig.watcher.end()  # nothing is under way
    assert rig.notes() == []


def test_marks_of_a_hand_and_of_a_persons_reaction_end_no_trial(rig: Rig):
    rig.one_by_one(12)
    assert rig.take(mark(0, 11, shape="ball"), mark(0, 11, reaction="put down")) == []


def test_where_it_falls_behind_old_crops_are_let_go_and_the_whole_trial_is_seen(rig: Rig):
    """41 frames at once: of the nine crops that end in them only the newest is looked at."""
    notes = rig.take(*rig.frames(41))
    assert rig.looks == 1
    assert [note["of"] for note in notes if note["label"] == "slip"] == ["1 crop so far"]
    whole, _ = rig.take(mark(0, 40, outcome="slip"))
    assert whole["of"] == "whole trial, 41 frames"
    assert rig.looks == 1 + 3


def test_a_trial_of_which_images_were_lost_has_no_verdict_and_the_next_one_has(rig: Rig):
    rig.one_by_one(12)
    rig.pulse.dropped = 3
    whole, _ = rig.take(*rig.frames(4), mark(0, 15, outcome="slip"))[-2:]
    assert whole["label"] == "UNKNOWN"
    assert whole["reason"] == "images of this trial were lost on the way"
    rig.one_by_one(12)
    whole, _ = rig.take(mark(16, 27, outcome="slip"))
    assert whole["label"] == "slip"


def test_what_a_process_that_follows_a_dead_one_cannot_know(monkeypatch: pytest.MonkeyPatch):
    rig = Rig(monkeypatch, again=True)
    notes = rig.one_by_one(12)
    assert {note["label"] for note in notes} == {"UNKNOWN"}
    whole, news = rig.take(mark(0, 11, outcome="slip"))
    assert whole["reason"] == "this recogniser was started again within the trial"
    assert news["text"].endswith(f"{whole['reason']})")
    rig.one_by_one(12)
    assert rig.take(mark(12, 23, outcome="slip"))[0]["label"] == "slip"


def test_without_its_camera_nothing_is_known_of_a_trial(rig: Rig):
    rig.one_by_one(12)
    rig.watcher.silent(105.0)
    (note,) = rig.notes()
    assert note["label"] == "UNKNOWN"
    assert "gel" in note["reason"]
    rig.watcher.silent(105.1)
    assert rig.notes() == []


def test_a_station_that_ends_before_its_source_gives_a_verdict_on_what_was_seen(rig: Rig):
    """The source is silent first: for a moment its cameras seemed to be gone."""
    rig.one_by_one(12)
    rig.pulse.stopping = True
    rig.watcher.silent(105.0)
    rig.watcher.end()
    whole, _ = rig.notes()
    assert whole["label"] == "slip"


def test_the_station_counts_whole_trials_alone(rig: Rig):
    answers = Answers([rig.watcher.what])
    for note in rig.one_by_one(20):
        answers.add(note)
    assert answers.newest()[0]["reason"] == "4 crops so far"
    for outcome in ("hold", "slip"):
        answers.add(rig.take(mark(0, 99, outcome=outcome))[0])
        rig.one_by_one(20)
    (row,) = answers.summary()
    assert (row["trials"], row["marked"], row["right"]) == (2, 2, 1)
    assert row["answers"] == {"slip": 2}
    assert "windows" not in row
