"""The recorder's desk: what it keeps beside the frames, and what it says where it cannot."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import ExitStack
from copy import copy
from dataclasses import asdict
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from taxel.errors import BadRecording
from taxel.live.station import recording
from taxel.live.station.packets import pack, unpack
from taxel.live.station.recording import Recorded, Recording, choose_recorded
from taxel.live.station.ring import Ring, RingReader, RingWriter
from taxel.recordings.reader import iterate_slips, read_recording
from taxel.recordings.trial_log import GraspTrial, append_trial, log_of, read_trial_log
from taxel.recordings.writer import Recorder
from taxel.signals import CameraInfo, Mark, Samples, SensorInfo
from taxel.sim.pour.state import TRUTH_CHANNELS

HAND = SensorInfo(name="hand", channels=("a", "b"), units=("V", "V"), rate_hz=100.0)
NONE = SensorInfo(name="none", channels=(), units=(), rate_hz=0.0)
LEFT = CameraInfo(name="left", width=32, height=24, rate_hz=60.0)
TRIAL = GraspTrial(number=1, began_s=0.0, ended_s=2.0, alarm="danger", alarm_s=1.0)
SLIP = {"slip_mm": 0.4, "slip_rate_mm_s": 0.1, "slip_compliance": 0.2, "slip_mm_sd": 0.01,
        "slip_rate_mm_s_sd": 0.1, "slip_compliance_sd": 0.1, "slip_seen": True}  # fmt: skip


class Rig:
    """A desk over one hand's ring, ordered by hand."""

    def __init__(self, stack: ExitStack, folder: Path) -> None:
        self.path = folder / "a.mcap"
        source = stack.enter_context(Ring(2**16)).name
        self.source = stack.enter_context(RingWriter(source))
        self._sit_down(stack, source)

    def follower(self, stack: ExitStack) -> Rig:
        """Return a rig whose desk follows this one's, over the same source."""
        other = copy(self)
        other._sit_down(stack, self._ring)
        return other

    def _sit_down(self, stack: ExitStack, source: str) -> None:
        self._ring, news = source, stack.enter_context(Ring(2**16)).name
        self._news = stack.enter_context(RingReader(news))
        seen = Recorded(
            ring=source, row=0, sensor=HAND, cameras=(), array=True, first_camera=0
        )  # fmt: skip
        job = Recording(place=cast("Any", None), sources=(seen,), orders="", news=news)
        self.reader = stack.enter_context(RingReader(source))
        writer = stack.enter_context(RingWriter(news))
        self.desk = recording._Desk(job, [self.reader], writer)
        stack.callback(self.desk.finish, "the test is over")
        self.pulse: Any = SimpleNamespace(beat=lambda: None, consumed=0, dropped=0, produced=0)

    def obey(self, do: str, **more: Any) -> dict[str, Any]:
        """Give an order; return the newest news, empty where there are none."""
        self.desk.obey({"do": do, **more})
        return self.news()

    def begin(self, **more: Any) -> dict[str, Any]:
        return self.obey("record", path=str(self.path), labels={"object": "cup"}, **more)

    def scans(self, count: int = 5) -> None:
        times = np.arange(count) / 100.0
        self.source.put(pack(Samples.from_values(np.ones((count, 2)), times, full_scale=3.3)))
        assert self.desk.follow(self.pulse)

    def news(self) -> dict[str, Any]:
        found = self._news.newest()
        return cast("dict[str, Any]", unpack(found)) if found is not None else {}


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Rig]:
    with ExitStack() as stack:
        yield Rig(stack, tmp_path)


def test_slip_and_marks_are_kept_beside_the_scans_while_a_recording_is_on(rig: Rig):
    rig.obey("slip", time_s=0.5, who="monitor/0", slip=SLIP)
    assert rig.begin()["on"]
    rig.scans()
    rig.source.put(pack(Mark(start_s=0.0, end_s=0.03, labels={"outcome": "held"})))
    rig.source.put(pack({"kind": "source"}))
    rig.desk.follow(rig.pulse)
    assert rig.obey("slip", time_s=0.02, who="monitor/0", slip=SLIP) == {}
    news = rig.obey("end")

    assert (news["on"], news["error"], news["kept"]) == (False, "", 2)
    found = read_recording(rig.path)
    assert found.manifest.labels == {"object": "cup"}
    assert len(found.samples) == 5
    assert [mark.labels for mark in found.marks] == [{"outcome": "held"}]
    (slip,) = iterate_slips(rig.path)
    assert (slip.time_s, slip.who, slip.values["slip_mm"]) == (0.02, "monitor/0", 0.4)


def test_a_group_given_for_the_recording_goes_before_that_of_a_mark(rig: Rig):
    """Of the next recording, too, which may belong to another session, or to none."""
    mark = Mark(start_s=0.0, end_s=0.03, labels={}, groups={"session": "live", "grasp": "1"})
    for groups, left in (({"session": "mine"}, {"grasp": "1"}), ({}, dict(mark.groups))):
        rig.begin(groups=groups, overwrite=True)
        rig.scans()
        rig.source.put(pack(mark))
        rig.desk.follow(rig.pulse)
        rig.obey("end")
        found = read_recording(rig.path)
        assert found.manifest.groups == groups
        assert [own.groups for own in found.marks] == [left]


def test_a_grasp_is_logged_beside_the_recording_and_not_without_one(rig: Rig):
    rig.obey("trial", trial=asdict(TRIAL))
    assert not log_of(rig.path).exists()
    rig.begin()
    rig.obey("trial", trial=asdict(TRIAL))
    assert read_trial_log(log_of(rig.path)) == [TRIAL]


def test_a_recording_that_replaces_another_does_not_inherit_its_log(rig: Rig):
    rig.path.touch()
    append_trial(log_of(rig.path), TRIAL)
    assert rig.begin(overwrite=True)["on"]
    assert not log_of(rig.path).exists()


def test_a_log_that_cannot_be_written_is_reported_and_the_recording_goes_on(rig: Rig):
    rig.begin()
    log_of(rig.path).mkdir()
    news = rig.obey("trial", trial=asdict(TRIAL))
    assert news["on"]
    assert news["error"] == f"needed to write {log_of(rig.path)}; got Is a directory."


def test_a_recording_that_cannot_begin_is_reported_and_nothing_is_recorded(rig: Rig):
    rig.path.write_bytes(b"mine")
    news = rig.begin()
    assert not news["on"]
    assert "a.mcap" in news["error"]
    assert rig.path.read_bytes() == b"mine"


def test_a_second_recording_is_not_begun_while_one_is_on(rig: Rig, tmp_path: Path):
    rig.begin()
    news = rig.obey("record", path=str(tmp_path / "b.mcap"))
    assert news["path"] == str(rig.path)
    assert not (tmp_path / "b.mcap").exists()


def test_an_order_that_is_no_note_or_none_that_is_known_changes_nothing(rig: Rig):
    rig.desk.obey(Mark(start_s=0.0, end_s=1.0, labels={}))
    assert rig.news() == {}
    assert rig.obey("dance")["on"] is False


class FullDisk:
    """A recorder whose disk refuses everything."""

    size = handed = written = 0

    def write(self, samples: Samples) -> None:
        raise BadRecording("room on the disk", "none", "make room")

    def slip(self, note: object) -> None:
        raise BadRecording("room on the disk", "none", "make room")

    def close(self, ended: str) -> None:
        raise BadRecording("room on the disk", "none", "make room")

    def statistics(self) -> dict[str, Any]:
        return {}


@pytest.mark.parametrize("at", ["a scan", "the end"])
def test_a_disk_that_fills_ends_the_recording_in_words_and_what_follows_is_no_error(
    rig: Rig, monkeypatch: pytest.MonkeyPatch, at: str
):
    monkeypatch.setattr(recording, "Recorder", lambda *_, **__: FullDisk())
    rig.begin()
    if at == "a scan":
        rig.scans()
    else:
        rig.desk.finish("cleanly")
    news = rig.news()
    assert not news["on"]
    assert "room on the disk" in news["error"]
    rig.scans()
    assert rig.pulse.produced == 0


def test_what_comes_after_the_disk_refused_is_counted_as_not_written(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
):
    """Until the next recording, or until somebody ends this one."""
    whole = recording.Recorder
    monkeypatch.setattr(recording, "Recorder", lambda *_, **__: FullDisk())
    rig.begin()
    rig.scans()
    rig.scans()
    rig.source.put(pack({"kind": "source"}))  # which no recording holds
    rig.scans()
    news = rig.obey("dance")
    assert (news["not_written"], news["kept"]) == (3, 0)
    rig.obey("end")
    rig.scans()
    assert rig.obey("dance")["not_written"] == 3
    monkeypatch.setattr(recording, "Recorder", whole)
    assert rig.begin()["not_written"] == 0


def test_a_dead_recorders_recording_goes_on_beside_it_with_what_it_may_not_have_written(
    rig: Rig, tmp_path: Path
):
    begun = rig.begin()
    rig.scans()
    rig.scans()
    unfinished = rig.path.with_name("a.mcap.part")
    places = rig.obey("dance")["places"]
    assert places[0][0] <= 2
    before = unfinished.read_bytes()
    for name in ("a-2.mcap", "a-3.mcap.part", "a-4.trials.csv"):
        (tmp_path / name).write_text("mine")
    log = log_of(rig.path)
    append_trial(log, TRIAL)

    with ExitStack() as stack:
        after = rig.follower(stack)
        again = {"places": begun["places"], "made": 2, "log": str(log)}
        after.desk.obey({"do": "record", "path": str(rig.path), "again": again})
        assert after.news()["path"] == str(tmp_path / "a-5.mcap")
        after.desk.follow(after.pulse)
        assert (after.pulse.produced, after.pulse.consumed, after.pulse.dropped) == (4, 2, 0)
        after.obey("trial", trial=asdict(TRIAL))
        after.obey("end")
    assert unfinished.read_bytes()[: len(before)] == before
    assert len(read_recording(tmp_path / "a-5.mcap").samples) == 10
    assert read_trial_log(log) == [TRIAL, TRIAL]
    assert not log_of(tmp_path / "a-5.mcap").exists()
    kept = ("a-2.mcap", "a-3.mcap.part", "a-4.trials.csv")
    assert {(tmp_path / name).read_text() for name in kept} == {"mine"}


def test_slip_that_the_disk_refuses_is_reported_with_the_next_news(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(recording, "Recorder", lambda *_, **__: FullDisk())
    rig.begin()
    rig.obey("slip", time_s=0.5, who="monitor/0", slip=SLIP)
    assert "room on the disk" in rig.obey("dance")["error"]


def test_of_several_arrays_the_one_without_cameras_is_recorded_and_the_others_are_named():
    sources = [("r0", 0, HAND, (LEFT,)), ("r1", 1, NONE, (LEFT, LEFT)), ("r2", 2, HAND, ())]
    chosen, left = choose_recorded(sources)
    assert [source.array for source in chosen] == [False, False, True]
    assert [source.first_camera for source in chosen] == [0, 1, 3]
    assert left == "hand"
    truth = SensorInfo(name="truth", channels=TRUTH_CHANNELS,
                       units=("N",) * len(TRUTH_CHANNELS), rate_hz=60.0)  # fmt: skip
    _, left = choose_recorded([("r0", 0, HAND, ()), ("r1", 1, truth, (LEFT,))])
    assert left == "truth (what the simulator knows of forces and slip)"
    only_cameras, left = choose_recorded([("r1", 1, NONE, (LEFT,))])
    assert (only_cameras[0].array, left) == (False, "")


def test_a_long_recordings_end_gives_signs_of_life_while_its_file_grows(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
):
    """Else the recorder counts as silent after 2.5 s, and is killed by the end of a station."""
    heard = threading.Semaphore(0)
    whole = Recorder.close

    def close(recorder: Recorder, ended: str) -> None:
        for _ in range(3):
            recorder.mark(Mark(start_s=0.0, end_s=1.0, labels={}))
            recorder.flush()
            assert heard.acquire(timeout=10.0)  # each piece that is written gives a sign
        whole(recorder, ended)

    rig.begin()
    rig.scans()
    rig.desk._beat = heard.release
    monkeypatch.setattr(Recorder, "close", close)
    assert rig.obey("end")["error"] == ""
    assert len(read_recording(rig.path).marks) == 3
