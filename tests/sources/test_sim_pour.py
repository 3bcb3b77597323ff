"""Claims about the simulated pour as a live source."""

import os
import threading

import numpy as np
import pytest

from taxel.clock import ManualClock, SystemClock
from taxel.errors import BadSource
from taxel.frame_codec import decode_jpeg
from taxel.signals import Frame, Mark
from taxel.sim.pour.cups import PourRun
from taxel.sim.pour.state import LAYER_CHANNELS
from taxel.sources.opening import open_source
from taxel.sources.simulated.pour import SimPour
from taxel.sources.simulated.stepped_pour import SteppedPour


def test_grasps_come_one_after_another_with_frames_truth_and_marks() -> None:
    frames, scans, marks = [], 0, []
    with open_source("sim://cup-pour?runs=2&duration_s=1&speed=max&force_n=25") as source:
        assert [camera.name for camera in source.cameras] == ["left", "right"]
        while not source.ended:
            scans += len(source.read())
            frames += source.frames()
            marks += source.marks()
        marks += source.marks()
    assert (scans, len(frames), len(marks)) == (120, 240, 2)
    times = np.array([frame.fitted_s for frame in frames if frame.camera == 0])
    assert np.all(np.diff(times) > 0)
    assert {mark.groups["force_n"] for mark in marks} == {"25"}
    assert decode_jpeg(frames[0].jpeg, None).shape == (240, 320, 3)


@pytest.mark.slow
def test_the_same_address_gives_the_same_pictures() -> None:
    def first() -> list[bytes]:
        found: list[bytes] = []
        with open_source("sim://cup-pour?runs=1&duration_s=1&speed=max&seed=3") as source:
            while not source.ended:
                source.read()
                found += [frame.jpeg for frame in source.frames()]
        return found

    assert first() == first()


@pytest.mark.slow
def test_gels_of_version_2_look_otherwise_and_say_more() -> None:
    """The cups' own truth stays; slip, annulus and turn of each gel's face come beside it."""
    found = []
    for gel in (1, 2):
        frames, truth = [], []
        address = f"sim://cup-pour?cup=4001&force_n=15&runs=1&duration_s=1&speed=max&gel={gel}"
        with open_source(address) as source:
            while not source.ended:
                truth.append(source.read().values)
                frames += [frame.jpeg for frame in source.frames()]
            found.append((source.info.channels, np.concatenate(truth), frames))
    (few, first, plain), (many, second, sheared) = found
    assert many == (*few, *LAYER_CHANNELS)
    np.testing.assert_array_equal(second[:, : len(few)], first)
    assert len(plain) == len(sheared)
    assert plain[-1] != sheared[-1]


@pytest.mark.parametrize(
    "options",
    [
        "cup=x",
        "force_n=0",
        "kind=drop",
        "position=left",
        "runs=0",
        "colour=red",
        "duration_s=0.1",
        "gel=3",
        "gel=1.5",
    ],
)
def test_a_wrong_option_is_refused(options: str) -> None:
    with pytest.raises(BadSource):
        open_source(f"sim://cup-pour?{options}")


class RunningClock(ManualClock, SystemClock):
    """Is moved by hand, yet counts as a clock that runs by itself."""


@pytest.mark.slow
def test_the_end_of_a_grasp_is_reported_while_the_next_cup_is_still_made(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """On a busy machine that takes longer than the pause between two cups."""
    may_go_on, make = threading.Event(), SimPour._make

    def make_slowly(self: SimPour, number: int) -> tuple[PourRun, SteppedPour]:
        if number:
            assert may_go_on.wait(60.0)
        return make(self, number)

    monkeypatch.setattr(SimPour, "_make", make_slowly)
    clock = RunningClock(10.0)
    with open_source("sim://cup-pour?duration_s=1&runs=2", clock) as source:
        frames: list[Frame] = []
        marks: list[Mark] = []
        while not marks and clock.now_s() < 20.0:
            source.read(0.01)
            frames += source.frames()
            marks += source.marks()
        ended_s = clock.now_s()
        waiting = len(frames)
        may_go_on.set()
        while not source.ended:
            source.read(0.01)
            frames += source.frames()
            marks += source.marks()

    assert waiting == 2 * 60
    assert ended_s - max(frame.arrival_s for frame in frames[:waiting]) < 0.05
    assert (len(frames), len(marks)) == (2 * waiting, 2)


@pytest.mark.skipif(not hasattr(os, "getpriority"), reason="no niceness here")
@pytest.mark.parametrize("address", ["sim://cup-pour?runs=1", "sim://cup-pour?runs=2&speed=max"])
def test_a_cup_that_is_waited_for_stands_back_for_nobody(
    address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first one, and all of them where nothing else is done meanwhile."""
    priorities: list[int] = []
    make = SimPour._make

    def make_noted(self: SimPour, number: int) -> tuple[PourRun, SteppedPour]:
        priorities.append(os.getpriority(os.PRIO_PROCESS, threading.get_native_id()))
        return make(self, number)

    monkeypatch.setattr(SimPour, "_make", make_noted)
    with open_source(address) as source:
        assert isinstance(source, SimPour)
        source._made.result()

    own = os.getpriority(os.PRIO_PROCESS, threading.get_native_id())
    assert priorities == [own] * (2 if "max" in address else 1)


def test_cameras_whose_gels_are_untouched_at_first_say_so() -> None:
    with open_source("sim://cup-pour?speed=max&runs=1&duration_s=1&approach=yes") as source:
        assert all(camera.finds_grasps for camera in source.cameras)
        assert source.info.channels[-1] == "grasp"
    with pytest.raises(BadSource, match="yes or no"):
        open_source("sim://cup-pour?approach=perhaps")
    with pytest.raises(BadSource, match="1 with an approach"):
        open_source("sim://cup-pour?approach=yes&gel=2")
