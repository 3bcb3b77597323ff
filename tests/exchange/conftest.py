"""Small recordings of an array and two cameras, with marks, gaps and missing values.

On request with a camera that looks on: colour and depth. The tests of this folder may import from
it the check of LeRobot's layout.
"""

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from taxel.frame_codec import encode_depth, encode_jpeg
from taxel.recordings.manifest import NO_ARRAY, Manifest
from taxel.recordings.writer import Recorder
from taxel.signals import (
    CODING,
    DEPTH_PNG,
    ROLE,
    SCENE,
    CameraInfo,
    Frame,
    Mark,
    Samples,
    SensorInfo,
)

sys.path.insert(0, str(Path(__file__).parent))
CAMERAS = tuple(
    CameraInfo(name=name, width=32, height=24, rate_hz=25.0) for name in ("left", "right")
)
LOOKS_ON = (
    CameraInfo(name="scene", width=32, height=24, rate_hz=30.0, details={ROLE: SCENE}),
    CameraInfo(name="scene-depth", width=32, height=24, rate_hz=30.0,
               details={ROLE: SCENE, CODING: DEPTH_PNG, "depth_unit_m": "0.001"}),
)  # fmt: skip
ARRAY = SensorInfo(name="teng", channels=("thumb", "index", "palm"), units=("V",) * 3,
                   rate_hz=1000.0, full_scale=3.3)  # fmt: skip
MARKS = (
    Mark(start_s=100.2, end_s=100.6, labels={"grasp": "stable"}, groups={"cup": "ä"}),
    Mark(start_s=100.8, end_s=101.2, labels={"grasp": "slip"}),
)


def scans(seconds: float, seed: int, channels: int = 3) -> Samples:
    number = np.arange(round(1000 * seconds))
    values = np.random.default_rng(seed).random((len(number), channels)).astype(np.float32)
    validity = np.zeros(values.shape, np.uint8)
    validity[5, 1], values[5, 1] = 1, np.nan
    time_s = 100.0 + number / 1000
    return Samples(values=values, counter=number.astype(np.int64), device_s=time_s - 99,
                   arrival_s=time_s + 0.002, fitted_s=time_s, validity=validity)  # fmt: skip


def frame(camera: int, number: int, seed: int) -> Frame:
    y, x = np.mgrid[:24, :32]
    rgb = np.stack([x * 7 + number * 3, y * 9 + camera * 90, x + y + seed], 2) % 256
    jitter_s = np.random.default_rng(2 * number + camera).uniform(-0.002, 0.002)
    at_s = 100.003 + (number + 1) / 25 + jitter_s
    return Frame(camera=camera, jpeg=encode_jpeg(rgb.astype(np.uint8)), counter=number,
                 device_s=float("nan"), arrival_s=at_s + 0.01, fitted_s=at_s)  # fmt: skip


def depth_frame(camera: int, number: int) -> Frame:
    """Every pixel of depth is 60,000 and the frame's number."""
    at_s = 100.02 + (number + 1) / 30
    depth = np.full((24, 32), 60_000 + number, np.uint16)
    return Frame(camera=camera, jpeg=encode_depth(depth), counter=number,
                 device_s=at_s - 99, arrival_s=at_s + 0.01, fitted_s=at_s)  # fmt: skip


@pytest.fixture(scope="session")
def make() -> Callable[..., Path]:
    def write(
        path: Path, *, array: bool = True, cameras: bool = True, seconds: float = 1.6,
        seed: int = 0, scene: tuple[str, ...] = (),
        channels: tuple[str, ...] = ARRAY.channels
    ) -> Path:  # fmt: skip
        seen = (
            *(CAMERAS if cameras else ()),
            *(camera for camera in LOOKS_ON if camera.name in scene),
        )
        own = replace(ARRAY, channels=channels, units=("V",) * len(channels))
        manifest = Manifest(
            sensor=own if array else NO_ARRAY, cameras=seen,
            labels={"shape": "sphere"}, groups={"session": str(seed)},
            wall_anchor_ns=1_700_000_000_000_000_000,
        )  # fmt: skip
        with Recorder(path, manifest) as recorder:
            if array:
                recorder.write(scans(seconds, seed, len(channels)))
            for number in range(round(25 * seconds) if cameras else 0):
                recorder.frame(frame(0, number, seed))
                recorder.frame(frame(1, number, seed))
            for number in range(round(30 * seconds) if scene else 0):
                for camera, info in enumerate(seen):
                    if info.coding == DEPTH_PNG:
                        recorder.frame(depth_frame(camera, number))
                    elif info.scene:
                        recorder.frame(frame(camera, number, seed))
            for mark in MARKS:
                recorder.mark(mark)
        return path

    return write
