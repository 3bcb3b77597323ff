"""Marks come between the moments where they lie, however late or fast a recording is read."""

from math import inf
from pathlib import Path

import numpy as np
import pytest

from taxel.clock import ManualClock
from taxel.live.frame_loop import frames_and_marks, moments_and_marks
from taxel.recordings.manifest import Manifest
from taxel.recordings.writer import Recorder
from taxel.signals import CameraInfo, Frame, Mark, Samples, SensorInfo
from taxel.sources.opening import open_source
from taxel.windows.pairs import FramePairer

CAMERAS = tuple(
    CameraInfo(name=name, width=320, height=240, rate_hz=25.0) for name in ("left", "right")
)
TRUTH = SensorInfo(name="truth", channels=("slip",), units=("um",), rate_hz=25.0)
MOMENTS, GRASPS = 10, 3
LENGTH_S, PAUSE_S = (MOMENTS - 1) / 25, 0.5


def begin_s(grasp: int) -> float:
    return grasp * (LENGTH_S + PAUSE_S)


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """Grasps of ten moments: a scan and a frame of each camera; marks end with the last."""
    path = tmp_path / "grasps.mcap"
    with Recorder(path, Manifest(sensor=TRUTH, cameras=CAMERAS, labels={})) as recorder:
        for grasp in range(GRASPS):
            for number in range(MOMENTS):
                time_s = begin_s(grasp) + number / 25
                recorder.write(Samples.from_values(np.ones((1, 1)), np.array([time_s])))
                for camera in (0, 1):
                    counter = grasp * MOMENTS + number
                    recorder.frame(
                        Frame(camera=camera, jpeg=b"%d" % counter, counter=counter,
                              device_s=time_s, arrival_s=time_s, fitted_s=time_s)
                    )  # fmt: skip
            recorder.mark(
                Mark(start_s=begin_s(grasp), end_s=begin_s(grasp) + LENGTH_S,
                     labels={"outcome": str(grasp)})
            )  # fmt: skip
            recorder.flush()
    return path


def expected() -> list[str]:
    return [
        item
        for grasp in range(GRASPS)
        for item in [*(str(grasp * MOMENTS + n) for n in range(MOMENTS)), f"mark {grasp}"]
    ]


def name_of(found: object) -> str:
    if isinstance(found, Mark):
        return f"mark {found.labels['outcome']}"
    assert not isinstance(found, Frame)
    return found.frames[0].jpeg.decode()  # type: ignore[attr-defined]


@pytest.mark.parametrize("speed", ["1", "max"])
def test_each_mark_comes_behind_its_last_moment_and_before_the_next_grasp(
    recording: Path, speed: str
):
    with open_source(f"replay://{recording}?speed={speed}", ManualClock()) as source:
        found = [name_of(item) for item in
                 moments_and_marks(source, FramePairer(2), lambda frame: None)]  # fmt: skip

    assert found == expected()


def test_a_person_may_end_it_before_the_source_ends(recording: Path):
    asked: list[bool] = []

    def stopped() -> bool:
        asked.append(True)
        return len(asked) > 3

    with open_source(f"replay://{recording}?speed=1", ManualClock()) as source:
        found = list(moments_and_marks(source, FramePairer(2), lambda _: None, None, stopped))
        assert not source.ended
    assert 0 < len(found) < MOMENTS


def test_a_read_that_comes_late_keeps_marks_where_they_lie(recording: Path):
    """Everything fell due while nobody read: one read gives frames of three grasps."""
    clock = ManualClock()
    with open_source(f"replay://{recording}", clock) as source:
        clock.sleep(60.0)
        found = [name_of(item) for item in
                 moments_and_marks(source, FramePairer(2), lambda frame: None)]  # fmt: skip

    assert found == expected()


def test_the_mark_waits_for_the_second_camera_s_last_frame(recording: Path):
    """Frames are given one by one; the mark ends when both of its last moment are out."""
    last_s = -inf
    given: list[str] = []
    with open_source(f"replay://{recording}?speed=max", ManualClock()) as source:
        while not source.ended:
            source.read(0.0)
            for item in frames_and_marks(source, last_s):
                last_s = item.fitted_s if isinstance(item, Frame) else last_s
                given.append("mark" if isinstance(item, Mark) else item.jpeg.decode())

    first = given.index("mark")
    assert given[:first].count(str(MOMENTS - 1)) == 2
    assert str(MOMENTS) not in given[:first]
