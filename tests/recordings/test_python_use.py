"""Recordings from Python: what scripts and notebooks hand over."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from taxel.errors import BadInput
from taxel.frame_codec import encode_depth, encode_jpeg, encode_png
from taxel.recordings.manifest import Manifest
from taxel.recordings.reader import iterate_samples, list_recordings, read_manifest, read_recording
from taxel.recordings.writer import Recorder
from taxel.signals import CameraInfo, Frame, Mark, Samples, SensorInfo
from taxel.sources.opening import open_source

PADS = SensorInfo(name="pads", channels=("left", "right"), units=("N", "N"), rate_hz=10.0)
CAMERA = CameraInfo(name="left", width=4, height=4, rate_hz=10.0)
SCANS = Samples.from_values(np.arange(20.0).reshape(10, 2), np.arange(10) / 10)


def test_a_path_may_be_a_text(tmp_path: Path) -> None:
    """A recording is written, read, listed and replayed by its name."""
    name = str(tmp_path / "a.mcap")
    with Recorder(name, Manifest.started_now(PADS, now_s=0.0)) as recorder:
        recorder.write(SCANS)

    assert len(read_recording(name).samples) == 10
    assert read_manifest(name).sensor.name == "pads"
    assert list_recordings(str(tmp_path)) == [Path(name)]
    with open_source(Path(name)) as source:
        assert source.info.channels == ("left", "right")


@pytest.mark.parametrize("labels", [{"trial": 3}, {"shape": None}, {"shape": "\ud800"}, None])
def test_a_mark_that_cannot_be_written_costs_no_recording(tmp_path: Path, labels: object) -> None:
    """It is refused at once; scans before and after it are kept."""
    path = tmp_path / "a.mcap"
    with Recorder(path, Manifest.started_now(PADS, now_s=0.0)) as recorder:
        recorder.write(SCANS)
        with pytest.raises(BadInput, match="texts as a mark's labels and groups"):
            recorder.mark(Mark(start_s=0.0, end_s=1.0, labels=labels))  # type: ignore[arg-type]
        recorder.write(SCANS)

    assert len(read_recording(path).samples) == 20


@pytest.mark.parametrize(
    "change", [{"jpeg": np.zeros(3, np.uint8)}, {"counter": 1.5}, {"device_s": None}]
)
def test_a_frame_that_cannot_be_written_costs_no_recording(
    tmp_path: Path, change: dict[str, object]
) -> None:
    """It is refused at once; frames beside it are kept."""
    path = tmp_path / "a.mcap"
    frame = Frame(camera=0, jpeg=b"x", counter=0, device_s=0.0, arrival_s=0.0, fitted_s=0.0)
    with Recorder(path, Manifest.started_now(PADS, now_s=0.0, cameras=(CAMERA,))) as recorder:
        recorder.frame(frame)
        with pytest.raises(BadInput):
            recorder.frame(replace(frame, **change))  # type: ignore[arg-type]

    assert read_recording(path).statistics["cameras"]["left"]["frames"] == 1


def test_numbers_of_numpys_describe_a_sensor(tmp_path: Path) -> None:
    """A rate of 32 bits and a whole number are read again as they were."""
    info = replace(PADS, rate_hz=np.float32(12.5), full_scale=np.int64(5))
    with Recorder(tmp_path / "a.mcap", Manifest.started_now(info, now_s=0.0)) as recorder:
        recorder.write(SCANS)

    sensor = read_manifest(tmp_path / "a.mcap").sensor
    assert (sensor.rate_hz, sensor.full_scale) == (12.5, 5.0)


@pytest.mark.parametrize("label", [3, Path("a"), "\ud800"])
def test_a_manifest_that_cannot_be_written_is_refused(tmp_path: Path, label: object) -> None:
    """In one line, and nothing is left."""
    manifest = Manifest.started_now(PADS, labels={"shape": label}, now_s=0.0)  # type: ignore[dict-item]
    with pytest.raises(BadInput, match="that a recording can describe"):
        Recorder(tmp_path / "a.mcap", manifest)

    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("scans", [0, -1])
def test_blocks_hold_a_scan_at_least(tmp_path: Path, scans: int) -> None:
    """Nothing is yielded for none, and nothing left out without a word."""
    with Recorder(tmp_path / "a.mcap", Manifest.started_now(PADS, now_s=0.0)) as recorder:
        recorder.write(SCANS)

    with pytest.raises(BadInput, match="at least one scan in a block"):
        next(iterate_samples(tmp_path / "a.mcap", scans))


@pytest.mark.parametrize(
    "image",
    [
        np.full((4, 4, 3), 0.5, np.float32),
        np.zeros((4, 4), np.uint8),
        np.zeros((4, 4, 3), np.uint16),
        np.zeros((3, 4, 4), np.uint8),
        np.zeros((0, 4, 3), np.uint8),
    ],
    ids=str,
)
def test_only_colour_images_of_8_bits_are_encoded(image: np.ndarray) -> None:
    """Colours of 0…1 would else be black, and 16 bits cut."""
    for encode in (encode_jpeg, encode_png):
        with pytest.raises(BadInput, match=r"\(height, width, 3\), uint8"):
            encode(image)


@pytest.mark.parametrize("kind", [np.int64, np.float32, np.uint8])
def test_only_depth_of_16_bits_is_encoded(kind: type) -> None:
    """OpenCV would else keep 8 bits of it, without a word."""
    with pytest.raises(BadInput, match="uint16"):
        encode_depth(np.zeros((4, 4), kind))
