"""The recorder's link: what a supervisor does where a recorder dies, and what it says."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from taxel.actions.interlock import Interlock, InterlockConfig
from taxel.live.station.guard import Guard
from taxel.live.station.packets import notes_of, pack
from taxel.live.station.recorder_link import RecorderLink
from taxel.live.station.ring import Ring, RingReader, RingWriter
from taxel.recordings.trial_log import GraspTrial, log_of, read_trial_log

TRIAL = GraspTrial(number=1, began_s=0.0, ended_s=2.0, alarm="danger", alarm_s=1.0)


class Rig:
    """A link whose recorder is this test."""

    def __init__(self, stack: ExitStack, folder: Path) -> None:
        self.path, self.rest = folder / "a.mcap", folder / "a-2.mcap"
        self.guard = Guard(Interlock(InterlockConfig(min_n=15.0, max_n=50.0)))
        self.words: list[str] = []
        self.link = RecorderLink(self.guard, lambda _, text: self.words.append(text))
        to, news = (stack.enter_context(Ring(2**16)).name for _ in range(2))
        self._news = stack.enter_context(RingWriter(news))
        self._orders = stack.enter_context(RingReader(to))
        self.link.wire(stack.enter_context(RingWriter(to)), stack.enter_context(RingReader(news)))

    def begin(self, *, overwrite: bool = False) -> None:
        self.link.begin(self.path, {"object": "cup"}, {"session": "3"}, overwrite=overwrite)

    def says(self, path: Path | str, **more: Any) -> None:
        """Let the recorder report."""
        note = {"kind": "recording", "on": True, "path": str(path), "error": "", "lost": 0,
                "made": 7, "places": [[5, 0]], "logged": 0}  # fmt: skip
        self._news.put(pack(note | more))
        self.link.hear(1.0)

    def ordered(self) -> list[dict[str, Any]]:
        return notes_of(self._orders.take())

    def alarm(self) -> Any:
        return next(a for a in self.guard.alarms.alarms if a.kind == "recording")


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Rig]:
    with ExitStack() as stack:
        yield Rig(stack, tmp_path)


def test_a_dead_recorder_is_told_with_the_way_out_and_followed(rig: Rig):
    rig.begin(overwrite=True)
    rig.says(rig.path)
    (asked,) = rig.ordered()
    rig.link.ended("signal 9", True, 2.0)

    (words,) = rig.words
    assert words.startswith("NOT RECORDING: ")
    assert f"taxel recover {rig.path}.part --output {rig.path}" in words
    assert rig.alarm().on
    assert rig.link.newest["on"] is False
    assert rig.ordered() == []  # nobody is there yet that would hear it
    rig.link.runs()
    again = {"log": str(log_of(rig.path)), "made": 7, "places": [[5, 0]]}
    assert rig.ordered() == [asked | {"overwrite": False, "again": again}]
    rig.says(rig.rest)
    assert rig.words[1:] == [f"the recording goes on in {rig.rest}"]
    assert not rig.alarm().on
    rig.says(rig.rest, on=False)
    rig.link.close()
    assert rig.link.newest["incomplete"] == [str(rig.path)]
    assert rig.link.newest["error"].count("taxel recover") == 1
    assert rig.link.newest["whole"]  # the rest is; the summary called it "taken in" and not by name


def test_the_new_recorder_dies_too_and_both_files_are_named(rig: Rig):
    rig.begin()
    rig.says(rig.path)
    for path in (rig.path, rig.rest):
        rig.says(path)
        rig.link.ended("signal 9", True, 2.0)
        rig.link.runs()
    rig.link.close()
    assert rig.link.newest["incomplete"] == [str(rig.path), str(rig.rest)]
    assert [order["path"] for order in rig.ordered()] == [str(rig.path)] * 3


def test_what_a_dead_recorder_left_is_not_called_whole(rig: Rig):
    rig.begin()
    rig.says(rig.path)
    rig.link.ended("signal 9", False, 2.0)
    rig.link.close()
    assert not rig.link.newest["whole"]


def test_one_that_no_other_follows_leaves_nothing_on(rig: Rig):
    rig.begin()
    rig.says(rig.path)
    rig.ordered()
    rig.link.ended("signal 9", False, 2.0)
    rig.link.runs()
    assert rig.ordered() == []
    assert "another recorder" not in rig.words[0]
    assert rig.link.newest["error"]


def test_one_that_dies_as_it_completes_a_recording_is_not_told_to_go_on(rig: Rig):
    rig.begin()
    rig.says(rig.path)
    rig.link.end()
    rig.link.ended("signal 9", True, 2.0)
    rig.ordered()
    rig.link.runs()
    assert rig.ordered() == []
    assert "taxel recover" in rig.words[0]


def test_one_that_dies_without_a_recording_is_no_trouble_of_a_recording(rig: Rig):
    rig.begin()
    rig.says(rig.path)
    rig.link.end()
    rig.says(rig.path, on=False)
    rig.link.ended("signal 9", True, 2.0)
    rig.link.runs()
    rig.link.close()
    assert [order["do"] for order in rig.ordered()] == ["record", "end"]
    assert rig.words == []
    assert rig.link.newest["error"] == ""


def test_one_that_dies_before_it_began_begins_the_same_recording(rig: Rig):
    rig.begin(overwrite=True)
    rig.link.ended("signal 9", True, 2.0)
    rig.link.runs()
    _, order = rig.ordered()
    assert (order["path"], order["overwrite"]) == (str(rig.path), True)
    rig.says(rig.path)
    rig.says(rig.path, on=False)
    rig.link.close()
    assert rig.link.newest["error"] == ""


def test_grasps_that_end_while_nobody_records_are_logged_once_by_who_follows(rig: Rig):
    rig.begin()
    rig.says(rig.path)
    rig.link.keep_trial(TRIAL)
    rig.says(rig.path, logged=1)
    rig.link.ended("signal 9", True, 2.0)
    rig.link.keep_trial(TRIAL)
    rig.ordered()
    rig.link.runs()
    assert [order["do"] for order in rig.ordered()] == ["record", "trial"]
    rig.says(rig.rest, logged=1)
    rig.link.closing()
    rig.link.close()
    assert not log_of(rig.path).exists()


def test_grasps_that_no_recorder_logged_are_logged_at_the_end(rig: Rig):
    rig.begin()
    rig.says(rig.path)
    rig.link.ended("signal 9", True, 2.0)
    rig.link.keep_trial(TRIAL)
    rig.link.closing()
    rig.link.close()
    assert read_trial_log(log_of(rig.path)) == [TRIAL]


def test_grasps_that_the_disk_refuses_at_the_end_are_stated(rig: Rig):
    rig.begin()
    rig.says(rig.path)
    rig.link.ended("signal 9", True, 2.0)
    rig.link.keep_trial(TRIAL)
    log_of(rig.path).mkdir()
    rig.link.closing()
    rig.link.close()
    error = rig.link.newest["error"]
    assert f"needed to log 1 grasp in {log_of(rig.path)}; got Is a directory" in error


def test_a_disk_that_refuses_is_said_once_at_that_moment(rig: Rig):
    rig.begin()
    rig.says(rig.path)
    for _ in range(3):
        rig.says(rig.path, on=False, error="the disk is full", not_written=4)
    assert rig.words == ["NOT RECORDING: the disk is full"]
    assert rig.alarm().text == "the disk is full"
    rig.link.close()
    assert rig.link.newest["error"] == "the disk is full"


def test_a_disk_that_refused_is_not_forgotten_where_the_recorder_dies_later(rig: Rig):
    rig.begin()
    rig.says(rig.path, on=False, error="the disk is full", not_written=4)
    rig.link.ended("signal 9", True, 2.0)
    rig.link.runs()
    rig.says("", on=False, not_written=0)
    rig.link.close()
    newest = rig.link.newest
    assert (newest["error"], newest["not_written"]) == ("the disk is full", 4)
    assert newest["path"] == str(rig.path)


def test_the_first_loss_of_a_recorder_is_an_event_and_the_alarm_counts_on(rig: Rig):
    rig.begin()
    for lost in (1, 2, 5):
        rig.says(rig.path, lost=lost)
    assert rig.words == ["the recorder lost 1 message"]
    assert rig.alarm().text == "the recorder lost 5 messages"
