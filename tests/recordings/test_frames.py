"""Claims about recordings with cameras: every frame comes back as it was, whatever happens."""

import contextlib
import errno
import io
import json
import os
import signal
import subprocess
import sys
import threading
import time
import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from taxel.errors import BadInput, RecordingFailed
from taxel.recordings import frame_layout
from taxel.recordings.chunk_content import decode_chunk
from taxel.recordings.manifest import NO_ARRAY, Manifest
from taxel.recordings.part_file import part_path
from taxel.recordings.reader import iterate_blocks, iterate_frames, read_manifest, read_recording
from taxel.recordings.recovery import recover
from taxel.recordings.summary import summarise
from taxel.recordings.tally import camera_line
from taxel.recordings.writer import QUEUE_BYTES, Recorder
from taxel.signals import CameraInfo, Frame, Mark, Samples, SensorInfo

CAMERAS = tuple(
    CameraInfo(
        name=name, width=320, height=240, rate_hz=60.0, mm_per_px=0.065, serial=f"GSM-{name}"
    )
    for name in ("left", "right")
)
TRUTH = SensorInfo(name="truth", channels=("slip",), units=("um",), rate_hz=60.0)


def frame(camera: int, number: int, size: int = 500) -> Frame:
    noise = np.random.default_rng(number * 2 + camera).bytes(size + number % 5)
    return Frame(
        camera=camera,
        jpeg=b"\xff\xd8" + noise + b"\xff\xd9",
        counter=number,
        device_s=number / 60 + 1e-10,
        arrival_s=number / 60 + 0.0123456789,
        fitted_s=number / 60 + 1 / 3,
    )


def manifest(sensor: SensorInfo = TRUTH) -> Manifest:
    return Manifest.started_now(sensor, groups={"cup": "3"}, now_s=0.0, cameras=CAMERAS)


def write(path: Path, count: int = 100, size: int = 500) -> list[Frame]:
    frames = []
    with Recorder(path, manifest()) as recorder:
        for number in range(count):
            for camera in (0, 1):
                frames.append(frame(camera, number, size))
                recorder.frame(frames[-1])
            recorder.write(Samples.from_values(np.full((1, 1), number), np.array([number / 60])))
        recorder.mark(Mark(start_s=0.0, end_s=1.0, labels={"outcome": "hold"}))
    return frames


def by_camera(frames: list[Frame]) -> list[list[Frame]]:
    return [[frame for frame in frames if frame.camera == camera] for camera in (0, 1)]


def test_frames_come_back_exactly(tmp_path: Path) -> None:
    frames = write(tmp_path / "a.mcap")
    assert read_manifest(tmp_path / "a.mcap").cameras == CAMERAS
    assert by_camera(list(iterate_frames(tmp_path / "a.mcap"))) == by_camera(frames)
    assert list(iterate_frames(tmp_path / "a.mcap", camera=1)) == by_camera(frames)[1]
    recording = read_recording(tmp_path / "a.mcap")
    assert len(recording.samples) == 100
    assert len(recording.marks) == 1
    assert recording.statistics["cameras"]["left"]["frames"] == 100


def test_a_recording_may_hold_cameras_only(tmp_path: Path) -> None:
    with Recorder(tmp_path / "a.mcap", manifest(NO_ARRAY)) as recorder:
        recorder.frame(frame(0, 0))
    assert len(list(iterate_frames(tmp_path / "a.mcap"))) == 1
    assert read_recording(tmp_path / "a.mcap").samples.values.shape == (0, 0)


def test_a_day_without_a_device_clock_comes_back(tmp_path: Path) -> None:
    odd = Frame(
        camera=0, jpeg=b"", counter=-1, device_s=float("nan"), arrival_s=86400.1, fitted_s=-5.0
    )
    with Recorder(tmp_path / "a.mcap", manifest()) as recorder:
        recorder.frame(odd)
    (found,) = iterate_frames(tmp_path / "a.mcap")
    assert np.isnan(found.device_s)
    assert (found.jpeg, found.counter, found.arrival_s, found.fitted_s) == (b"", -1, 86400.1, -5.0)


def test_a_frame_without_its_times_is_refused() -> None:
    """Half a frame is damage, never a frame with made-up times."""
    _, image, times = frame_layout.encode_frame(frame(0, 0), "left", 2, 0, 0)
    for half in (image, times, image + times + image[:11] + b"\1" + image[12:]):
        with pytest.raises(ValueError, match="differ in number"):
            decode_chunk(half, 1, len(CAMERAS))


def test_info_counts_repeats_and_losses(tmp_path: Path) -> None:
    with Recorder(tmp_path / "a.mcap", manifest()) as recorder:
        for number in (0, 1, 2, 5, 6):
            recorder.frame(frame(0, number))
        recorder.frame(replace(frame(0, 7), jpeg=frame(0, 6).jpeg))
    left, right = summarise(tmp_path / "a.mcap")["cameras"]
    assert (left["frames"], left["repeated"]) == (6, 1)
    assert "1 repeated (the camera had no newer image), 2 lost" in camera_line(left)
    assert (left["counter_gaps"], left["lost_frames"]) == (1, 2)
    assert left["duration_s"] == pytest.approx(7 / 60)
    assert (right["frames"], right["rate_hz"]) == (0, None)


def test_a_frame_of_no_camera_is_refused(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "a.mcap", manifest())
    with pytest.raises(BadInput, match="2 cameras"):
        recorder.frame(frame(2, 0))
    recorder.discard()


@pytest.mark.parametrize(
    "times", [{"arrival_s": 1.8e10}, {"arrival_s": 1.7e12}, {"fitted_s": 3e9}, {"counter": 2**63}]
)
def test_a_frame_of_an_impossible_time_does_not_end_the_recording(times, tmp_path: Path) -> None:
    """Milliseconds taken for seconds: the recorder's thread cannot write them, so it is refused."""
    own = replace(manifest(), wall_anchor_ns=10**18)
    with Recorder(tmp_path / "a.mcap", own) as recorder:
        recorder.frame(frame(0, 0))
        with pytest.raises(BadInput, match="in seconds"):
            recorder.frame(replace(frame(0, 1), **times))
        recorder.frame(frame(0, 2))
    assert [found.counter for found in iterate_frames(tmp_path / "a.mcap")] == [0, 2]


def test_a_message_of_an_unknown_channel_is_passed_over(tmp_path: Path) -> None:
    """A recording of a later taxel may hold more than this one knows."""
    frames = write(tmp_path / "a.mcap", count=3)
    content = b"".join(frame_layout.encode_frame(replace(frames[0], camera=9), "x", 2, 0, 0)[1:])
    content += b"".join(frame_layout.encode_frame(frames[1], "right", 2, 0, 0)[1:])
    assert decode_chunk(content, 1, len(CAMERAS)).frames == [frames[1]]


@pytest.mark.data
def test_a_full_disk_is_said_and_what_fitted_is_kept(tmp_path: Path) -> None:
    """The first refusal is raised again by every later frame; whole chunks can be recovered."""
    path, room = tmp_path / "a.mcap", [300_000]

    class SmallDisk(io.FileIO):
        def write(self, content) -> int:
            fits = memoryview(content)[: room[0]]
            if len(content) and not len(fits):
                raise OSError(errno.ENOSPC, "No space left on device")
            room[0] -= len(fits)
            return super().write(fits)

    recorder = Recorder(path, manifest(), opener=lambda part: SmallDisk(part, "wb"))
    number = 0
    with contextlib.suppress(RecordingFailed):
        while number < 1000:
            recorder.frame(frame(0, number, 5000))
            recorder.flush()
            number += 1
    assert 40 < number < 1000
    room[0] = 1 << 30
    with pytest.raises(RecordingFailed, match="the disk is full"):
        recorder.frame(frame(0, 0))
    with pytest.raises(RecordingFailed):
        recorder.close()
    assert not path.exists()
    assert recover(part_path(path), path).frames == number
    assert [kept.counter for kept in iterate_frames(path)] == list(range(number))


def test_frames_that_the_disk_does_not_take_are_bounded_and_said(tmp_path: Path) -> None:
    """A disk that stands still: 64 MiB wait, then one line says so; memory does not grow on."""
    gate, closed = threading.Event(), threading.Event()

    class Stuck(io.FileIO):
        def write(self, content) -> int:
            if len(content) > 100_000:
                gate.wait(30)
            return super().write(content)

        def close(self) -> None:
            super().close()
            closed.set()

    recorder = Recorder(
        tmp_path / "a.mcap", manifest(), stall_s=0.05, opener=lambda part: Stuck(part, "wb")
    )
    large = replace(frame(0, 0), jpeg=np.random.default_rng(0).bytes(1 << 20))
    handed = 0
    while not recorder.failed and handed < 200:
        with contextlib.suppress(RecordingFailed):
            recorder.frame(large)
            handed += 1
    with pytest.raises(RecordingFailed, match="stood still"):
        recorder.frame(large)
    gate.set()
    recorder.discard()
    assert closed.wait(10)
    assert handed == QUEUE_BYTES // (1 << 20)


def test_frames_are_read_in_constant_memory(tmp_path: Path) -> None:
    """40 MB of frames, of which a chunk or two are held at a time."""
    write(tmp_path / "a.mcap", count=400, size=50_000)
    tracemalloc.start()
    try:
        assert sum(len(frame.jpeg) for frame in iterate_frames(tmp_path / "a.mcap")) > 40_000_000
        assert tracemalloc.get_traced_memory()[1] < 5_000_000
    finally:
        tracemalloc.stop()


@pytest.mark.data
def test_lost_time_is_counted_by_frames_where_there_is_no_array(tmp_path: Path) -> None:
    """Ten chunks of ten frames at 60 Hz, one damaged: ten frames' time is missing."""
    with Recorder(tmp_path / "a.mcap", manifest(NO_ARRAY)) as recorder:
        for number in range(100):
            recorder.frame(frame(0, number, 5000))
            if number % 10 == 9:
                recorder.flush()
    content = bytearray((tmp_path / "a.mcap").read_bytes())
    content[len(content) // 2] ^= 0xFF
    (tmp_path / "a.mcap").write_bytes(content)
    report = recover(tmp_path / "a.mcap", tmp_path / "b.mcap")
    assert (report.frames, report.damaged_stretches) == (90, 1)
    assert report.time_lost_s == pytest.approx(10 / 60)


@pytest.mark.data
def test_damage_costs_its_own_chunk_only(tmp_path: Path) -> None:
    frames = write(tmp_path / "a.mcap", size=20_000)
    content = bytearray((tmp_path / "a.mcap").read_bytes())
    content[len(content) // 2] ^= 0xFF
    (tmp_path / "a.mcap").write_bytes(content)
    report = recover(tmp_path / "a.mcap", tmp_path / "b.mcap")
    found = list(iterate_frames(tmp_path / "b.mcap"))
    assert report.frames == len(found)
    assert 0 < len(frames) - len(found) <= 16  # a chunk of 256 KiB holds 13 or 14 frames
    for kept, written in zip(by_camera(found), by_camera(frames), strict=True):
        assert [frame for frame in written if frame in kept] == kept
    assert sum(len(block.samples) for block in iterate_blocks(tmp_path / "b.mcap")) == 100


@pytest.mark.data
def test_a_killed_recorder_loses_a_tenth_of_a_second_of_frames_at_most(tmp_path: Path) -> None:
    """The child says what it handed over more than 0.1 s ago; all of that is found."""
    child = (
        "import json,sys,time;from pathlib import Path;"
        "sys.path.insert(0,sys.argv[2]);"
        "from test_frames import *;"
        "r=Recorder(Path(sys.argv[1]),manifest());n=0\n"
        "while True:\n"
        "    r.frame(frame(0,n,8000));r.frame(frame(1,n,8000));n+=1\n"
        "    print(json.dumps([n,time.monotonic()]),flush=True);time.sleep(0.005)\n"
    )
    path = tmp_path / "a.mcap"
    here = str(Path(__file__).parent)
    with subprocess.Popen(
        [sys.executable, "-c", child, str(path), here], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        handed = [json.loads(process.stdout.readline()) for _ in range(120)]
        os.kill(process.pid, signal.SIGKILL)
        killed_s = time.monotonic()
        rest = process.stdout.read().splitlines()
    handed += [json.loads(line) for line in rest if line.endswith("]")]
    recover(path.with_name("a.mcap.part"), path)
    kept = by_camera(list(iterate_frames(path)))
    due = max(number for number, at_s in handed if at_s < killed_s - 0.1)
    assert min(map(len, kept)) >= due
