"""Claims about the simulated pour as a live source."""

import numpy as np
import pytest

from taxel.errors import BadSource
from taxel.frame_codec import decode_jpeg
from taxel.sources.opening import open_source


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
    assert decode_jpeg(frames[0].jpeg).shape == (240, 320, 3)


def test_the_same_address_gives_the_same_pictures() -> None:
    def first() -> list[bytes]:
        found: list[bytes] = []
        with open_source("sim://cup-pour?runs=1&duration_s=1&speed=max&seed=3") as source:
            while not source.ended:
                source.read()
                found += [frame.jpeg for frame in source.frames()]
        return found

    assert first() == first()


@pytest.mark.parametrize(
    "options",
    ["cup=x", "force_n=0", "kind=drop", "position=left", "runs=0", "colour=red", "duration_s=0.1"],
)
def test_a_wrong_option_is_refused(options: str) -> None:
    with pytest.raises(BadSource):
        open_source(f"sim://cup-pour?{options}")
