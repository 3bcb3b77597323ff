"""Rows of `taxel bench scale` about other people's tools: who opens a recording, what comes back.

Knows nothing about engines or workers.

Source of the goals: issue 19; background: docs/decisions/0051.
"""

from __future__ import annotations

import os
import subprocess
import tempfile
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
from mcap.reader import make_reader

from taxel.bench.rows import Row, missing, row
from taxel.errors import MissingExtra
from taxel.recordings.manifest import Manifest
from taxel.recordings.reader import iterate_frames, read_recording
from taxel.recordings.writer import Recorder
from taxel.signals import CameraInfo, Frame, Mark, Samples, SensorInfo

Measure = Callable[[], list[Row]]
LEROBOT_PYTHON = "TAXEL_LEROBOT_PYTHON"
"""Environment variable: a Python that has LeRobot (docs/how-to/lerobot.md has the recipe)."""
CHANNELS, RATE_HZ, CAMERA_HZ = 12, 1000, 25
"""A TENG hand and two GelSight Minis. Source: docs/decisions/0003 and 0012."""
_MINUTES = 10
"""As the issue asks."""
_SHORT_S = 4
"""Length of recordings that are read as a whole. Source: our choice, docs/decisions/0051."""
_LOAD = """
import json, sys, torch
from lerobot.datasets.lerobot_dataset import LeRobotDataset
data = LeRobotDataset("taxel/bench", root=sys.argv[1])
loader = torch.utils.data.DataLoader(data, batch_size=16, shuffle=True)
print(json.dumps(sum(len(batch["index"]) for batch in loader)))
"""


def quick_steps() -> list[tuple[str, Measure]]:
    """Return the measurements of a normal run."""
    return [("readers of recordings", reader_rows), ("LeRobot and back", lerobot_rows)]


def full_steps(_: Path | None) -> list[tuple[str, Measure]]:
    """Return what takes longer: ten minutes through a viewer's decoder, LeRobot's own reader."""
    return [("ten minutes of frames", decoder_rows), ("LeRobot's reader", loader_rows)]


def reader_rows() -> list[Row]:
    """Return how many messages each reader of others finds, beside how many there are."""
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        path = _recording(Path(scratch) / "a.mcap", _SHORT_S)
        wanted = _SHORT_S * (RATE_HZ + 4 * CAMERA_HZ) + 1
        return [_reader_row(name, read, path, wanted) for name, read in READERS.items()]


def lerobot_rows() -> list[Row]:
    """Return what differs after an export to LeRobot and an import of it."""
    name = "LeRobot and back: scans, images, labels or groups that differ"
    if find_spec("pyarrow") is None:
        return [missing(name, "", "<= 0", "pyarrow is not installed (taxel[export])")]
    from taxel.exchange.lerobot_read import import_lerobot
    from taxel.exchange.lerobot_write import write_lerobot

    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        folder = Path(scratch)
        path = _recording(folder / "a.mcap", _SHORT_S)
        write_lerobot([path], folder / "set")
        (back,) = import_lerobot(folder / "set", folder / "back")
        return [row(name, _differences(path, back), "", "<=", 0, f"{_SHORT_S} s, JPEG by bytes")]


def loader_rows() -> list[Row]:
    """Return how many frames LeRobot's own reader and a DataLoader give of an export."""
    name, frames = "LeRobot's reader and a DataLoader: frames", _SHORT_S * CAMERA_HZ
    python = os.environ.get(LEROBOT_PYTHON)
    if python is None:
        return [missing(name, "frames", f">= {frames}", f"{LEROBOT_PYTHON} names no Python")]
    from taxel.exchange.lerobot_write import write_lerobot

    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        folder = Path(scratch)
        write_lerobot([_recording(folder / "a.mcap", _SHORT_S)], folder / "set")
        words = [python, "-c", _LOAD, str(folder / "set")]
        run = subprocess.run(words, capture_output=True, text=True)
        found = int(run.stdout.splitlines()[-1]) if run.returncode == 0 else 0
        note = "" if run.returncode == 0 else run.stderr.strip()[-200:]
        return [row(name, found, "frames", ">=", frames, note)]


def decoder_rows() -> list[Row]:
    """Return what a frame costs Foxglove's decoder in the last minute of ten, over the first."""
    name = f"{_MINUTES} min, two cameras and a hand: a frame's cost, last minute over the first"
    if find_spec("mcap_ros2") is None:
        return [missing(name, "ratio", "<= 1.2", "mcap-ros2-support is not installed")]
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        path = _recording(Path(scratch) / "a.mcap", 60 * _MINUTES)
        ids: set[str] = set()
        costs_s = np.array(_decode(path, ids)).reshape(_MINUTES, -1).mean(axis=1)
    note = f"{1e6 * costs_s.mean():.0f} µs a frame; {len(ids)} frame_id"
    return [row(name, costs_s[-1] / costs_s[0], "ratio", "<=", 1.2, note)]


def _decode(path: Path, ids: set[str]) -> list[float]:
    """Return the CPU seconds that each image takes, all minutes equally many; collect frame_ids."""
    from mcap_ros2.decoder import DecoderFactory

    factory, costs_s = DecoderFactory(), []
    decode: Any = None
    with path.open("rb") as file:
        topics = ["/camera/left", "/camera/right"]
        for schema, channel, message in make_reader(file).iter_messages(topics=topics):
            decode = decode or factory.decoder_for(channel.message_encoding, schema)
            started = process_time()
            image = decode(message.data)
            costs_s.append(process_time() - started)
            ids.add(image.header.frame_id)
    return costs_s


def _differences(before: Path, after: Path) -> int:
    ours, theirs = read_recording(before), read_recording(after)
    frames = [
        [sorted((f.fitted_s, f.jpeg) for f in iterate_frames(p, camera)) for camera in (0, 1)]
        for p in (before, after)
    ]
    pairs = [
        (ours.samples.values.tobytes(), theirs.samples.values.tobytes()),
        (ours.samples.validity.tobytes(), theirs.samples.validity.tobytes()),
        (ours.samples.fitted_s.tobytes(), theirs.samples.fitted_s.tobytes()),
        (ours.manifest, theirs.manifest), (ours.marks, theirs.marks), (frames[0], frames[1]),
    ]  # fmt: skip
    return sum(mine != other for mine, other in pairs)


def _reader_row(name: str, read: Callable[[Path], int], path: Path, wanted: int) -> Row:
    row_name = f"recording read by {name}"
    try:
        return row(row_name, read(path), "messages", ">=", wanted)
    except (ModuleNotFoundError, MissingExtra) as error:
        return missing(row_name, "messages", f">= {wanted}", f"{error.name} is not installed")


def _by_rosbags(path: Path) -> int:
    from rosbags.highlevel import AnyReader

    with AnyReader([path]) as reader:
        decoded = (reader.deserialize(content, c.msgtype) for c, _, content in reader.messages())
        return sum(1 for _ in decoded)


def _by_mcap_ros2(path: Path) -> int:
    from mcap_ros2.decoder import DecoderFactory

    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        return sum(1 for _ in reader.iter_decoded_messages())


READERS: dict[str, Callable[[Path], int]] = {
    "rosbags": _by_rosbags, "mcap-ros2-support": _by_mcap_ros2,
}  # fmt: skip
"""Package → how many messages it decodes; tests/recordings/test_mcap_interop.py asks three more."""


def _recording(path: Path, seconds: int) -> Path:
    """Write a hand and two cameras, with a mark; images are small and differ."""
    from taxel.frame_codec import encode_jpeg

    sensor = SensorInfo(
        name="teng", channels=tuple(f"finger-{i}" for i in range(CHANNELS)),
        units=("V",) * CHANNELS, rate_hz=float(RATE_HZ),
    )  # fmt: skip
    cameras = tuple(
        CameraInfo(name=name, width=64, height=48, rate_hz=float(CAMERA_HZ))
        for name in ("left", "right")
    )
    manifest = Manifest(sensor=sensor, cameras=cameras, labels={"shape": "sphere"},
                        groups={"session": "1"})  # fmt: skip
    rng = np.random.default_rng(0)
    images = [encode_jpeg(rng.integers(0, 256, (48, 64, 3), np.uint8)) for _ in range(50)]
    with Recorder(path, manifest) as recorder:
        for second in range(seconds):
            at_s = second + np.arange(RATE_HZ) / RATE_HZ
            values = rng.random((RATE_HZ, CHANNELS))
            recorder.write(Samples.from_values(values, at_s))
            for number in range(second * CAMERA_HZ, (second + 1) * CAMERA_HZ):
                _frames(recorder, number, images)
        recorder.mark(Mark(start_s=0.5, end_s=1.5, labels={"grasp": "stable"}))
    return path


def _frames(recorder: Recorder, number: int, images: list[Any]) -> None:
    for camera in (0, 1):
        at_s = (number + 1) / CAMERA_HZ
        recorder.frame(
            Frame(camera=camera, jpeg=images[(2 * number + camera) % len(images)], counter=number,
                  device_s=float("nan"), arrival_s=at_s, fitted_s=at_s)
        )  # fmt: skip
