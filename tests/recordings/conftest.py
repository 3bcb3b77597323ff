"""Scans whose channel 0 is the scan's own number, so that lost and repeated ones are provable."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from taxel.recordings.manifest import Manifest
from taxel.recordings.writer import Recorder
from taxel.signals import Mark, Samples, SensorInfo

CHUNKS, SCANS_A_CHUNK, CHANNELS = 6, 20, 4


@pytest.fixture
def numbered() -> Callable[[int, int], Samples]:
    def make(first: int, count: int, channels: int = CHANNELS) -> Samples:
        number = np.arange(first, first + count)
        noise = np.random.default_rng(first).normal(size=(count, channels)).astype(np.float32)
        noise[:, 0] = number
        time_s = 50.0 + number / 1000.0
        return Samples(
            values=noise,
            counter=number.astype(np.int64),
            device_s=time_s - 49.0,
            arrival_s=time_s + 0.002,
            fitted_s=time_s,
            validity=np.zeros((count, channels), np.uint8),
        )

    return make


@pytest.fixture
def manifest() -> Manifest:
    sensor = SensorInfo(
        name="teng",
        channels=tuple(f"s{i}" for i in range(CHANNELS)),
        units=("V",) * CHANNELS,
        rate_hz=1000.0,
        full_scale=3.3,
        serial="sim 1",
        details={"wiring": "three boards"},
    )
    return Manifest(
        sensor=sensor,
        labels={"shape": "sphere"},
        groups={"session": "7"},
        created="2025-01-01T00:00:00+00:00",
        wall_anchor_ns=1_700_000_000_000_000_000,
    )


@pytest.fixture
def finished(tmp_path: Path, manifest: Manifest, numbered: Callable[..., Samples]) -> Path:
    """A recording of six chunks of twenty scans, and one chunk of one mark."""
    path = tmp_path / "finished.mcap"
    with Recorder(path, manifest) as recorder:
        for chunk in range(CHUNKS):
            recorder.write(numbered(chunk * SCANS_A_CHUNK, SCANS_A_CHUNK))
            recorder.flush()
        recorder.mark(Mark(start_s=50.0, end_s=50.05, labels={"grasp": "stable"}))
    return path
