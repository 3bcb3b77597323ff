"""Claims about replaying cameras: frames keep their spacing beside the scans, each given once."""

from pathlib import Path

import numpy as np
import pytest

from taxel.clock import ManualClock
from taxel.recordings import reader
from taxel.recordings.manifest import NO_ARRAY, Manifest
from taxel.recordings.writer import Recorder
from taxel.signals import CameraInfo, Frame, Mark, Samples, SensorInfo
from taxel.sources.opening import open_source

ARRAY = SensorInfo(name="truth", channels=("slip",), units=("um",), rate_hz=100.0)
CAMERAS = tuple(
    CameraInfo(name=name, width=320, height=240, rate_hz=25.0) for name in ("left", "right")
)
OPENED_S = 1000.0
FRAMES = 100


def frames_from(start_s: float) -> list[Frame]:
    """Two cameras at 25 Hz, the right one 3 ms later; both arrive 20 ms after they were taken."""
    found = []
    for number in range(FRAMES):
        for camera in (0, 1):
            time_s = start_s + number / 25 + 0.003 * camera
            found.append(
                Frame(camera=camera, jpeg=b"%d %d" % (camera, number), counter=number,
                      device_s=time_s - 60.0, arrival_s=time_s + 0.02, fitted_s=time_s)
            )  # fmt: skip
    return found


def record(
    path: Path, frames: list[Frame], scan_s: np.ndarray | None, marks: list[Mark] | None = None
) -> str:
    manifest = Manifest(
        sensor=NO_ARRAY if scan_s is None else ARRAY, cameras=CAMERAS, labels={"outcome": "slip"}
    )
    with Recorder(path, manifest) as recorder:
        for mark in marks or []:
            recorder.mark(mark)
            recorder.flush()
        if scan_s is not None:
            recorder.write(Samples.from_values(np.arange(len(scan_s))[:, None], scan_s))
        for number, frame in enumerate(frames):
            recorder.frame(frame)
            if number % 20 == 19:
                recorder.flush()
    return str(path)


def read_all(
    url: str, clock: ManualClock, timeout_s: float = 0.1
) -> tuple[Samples, list[Frame], list[Mark]]:
    parts, frames, marks = [], [], []
    with open_source(url, clock) as source:
        for _ in range(5000):
            parts.append(source.read(timeout_s))
            frames += source.frames()
            marks += source.marks()
            if source.ended:
                return Samples.join(parts), frames, marks
    raise AssertionError("the source never ended")


@pytest.mark.parametrize("speed", ["1", "8", "max"])
@pytest.mark.parametrize("array", [True, False])
def test_every_frame_comes_once_with_its_spacing(tmp_path: Path, speed: str, array: bool) -> None:
    """Bytes, counters, device times and distances are as recorded, at any speed."""
    frames = frames_from(50.0)
    path = record(tmp_path / "a.mcap", frames, 50.0 + np.arange(400) / 100 if array else None)
    samples, found, _ = read_all(f"replay://{path}?speed={speed}", ManualClock(OPENED_S))
    assert len(samples) == (400 if array else 0)
    assert [(f.camera, f.jpeg, f.counter) for f in found] == [
        (f.camera, f.jpeg, f.counter) for f in frames
    ]
    assert [f.device_s for f in found] == [f.device_s for f in frames]
    for name in ("fitted_s", "arrival_s"):
        moved = [getattr(f, name) - getattr(g, name) for f, g in zip(found, frames, strict=True)]
        assert moved == pytest.approx([OPENED_S - 50.0] * len(frames), abs=1e-9)


@pytest.mark.parametrize("first_s", [49.0, 50.0, 51.5])
def test_scans_and_frames_keep_their_distance(tmp_path: Path, first_s: float) -> None:
    """Whichever comes first lies at the moment of opening; the other keeps its distance."""
    path = record(tmp_path / "a.mcap", frames_from(first_s), 50.0 + np.arange(200) / 100)
    samples, found, _ = read_all(path, ManualClock(OPENED_S))
    assert min(samples.fitted_s[0], found[0].fitted_s) == pytest.approx(OPENED_S, abs=1e-9)
    assert found[0].fitted_s - samples.fitted_s[0] == pytest.approx(first_s - 50.0, abs=1e-9)


def test_a_frame_is_given_when_it_arrives_and_wakes_the_reader(tmp_path: Path) -> None:
    """A read returns for a frame alone: nobody waits for a scan that is seconds away."""
    path = record(tmp_path / "a.mcap", frames_from(50.0), np.array([50.0, 60.0]))
    clock = ManualClock(OPENED_S)
    with open_source(path, clock) as source:
        late_s = []
        for _ in range(20):
            source.read(5.0)
            late_s += [clock.now_s() - frame.arrival_s for frame in source.frames()]
    assert len(late_s) >= 18
    assert min(late_s) >= 0
    assert max(late_s) < 1e-6


def test_frames_that_nobody_fetched_wait(tmp_path: Path) -> None:
    path = record(tmp_path / "a.mcap", frames_from(50.0), np.array([50.0, 60.0]))
    clock = ManualClock(OPENED_S)
    with open_source(path, clock) as source:
        clock.advance(2.0)
        source.read(0.0)
        given = source.frames()
        assert [frame.counter for frame in given if frame.camera == 0] == list(range(50))
        assert source.frames() == []


@pytest.mark.parametrize("array", [True, False])
def test_a_mark_comes_with_the_last_of_its_scans_and_frames(tmp_path: Path, array: bool) -> None:
    """Neither before them nor only at the end of the recording."""
    marks = [Mark(start_s=50.2, end_s=51.0, labels={"k": "a"})]
    scan_s = 50.0 + np.arange(400) / 100 if array else None
    path = record(tmp_path / "a.mcap", frames_from(50.0), scan_s, marks)
    clock = ManualClock(OPENED_S)
    with open_source(path, clock) as source:
        frame_s = scans_s = OPENED_S
        while not (found := source.marks()):
            samples = source.read(0.1)
            scans_s = float(samples.fitted_s[-1]) if len(samples) else scans_s
            frame_s = max([frame_s, *(frame.fitted_s for frame in source.frames())])
    assert [dict(mark.labels) for mark in found] == [{"outcome": "slip", "k": "a"}]
    assert OPENED_S + 1.0 <= frame_s < OPENED_S + 1.1
    assert scans_s >= OPENED_S + 1.0 or not array


def test_a_labelled_recording_of_cameras_is_one_mark(tmp_path: Path) -> None:
    """From its first frame to its last, as for an array."""
    path = record(tmp_path / "a.mcap", frames_from(50.0), None)
    _, found, marks = read_all(path, ManualClock(OPENED_S))
    assert [(mark.start_s, dict(mark.labels)) for mark in marks] == [
        (OPENED_S, {"outcome": "slip"})
    ]
    assert marks[0].end_s == pytest.approx(found[-1].fitted_s)


def test_an_array_that_gave_nothing_does_not_hold_the_cameras_up(tmp_path: Path) -> None:
    """Times start at opening as ever, and the mark is there."""
    path = record(tmp_path / "a.mcap", frames_from(86400.0), np.zeros(0))
    _, found, marks = read_all(path, ManualClock(OPENED_S))
    assert len(found) == 2 * FRAMES
    assert found[0].fitted_s == pytest.approx(OPENED_S, abs=1e-9)
    assert len(marks) == 1


def test_opening_a_recording_of_cameras_does_not_read_it_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A chunk or two, however long it is."""
    path = record(tmp_path / "a.mcap", frames_from(50.0), None)
    opened = []
    whole = reader.open_chunk
    monkeypatch.setattr(reader, "open_chunk", lambda payload: opened.append(1) or whole(payload))
    with open_source(path, ManualClock(OPENED_S)):
        assert len(opened) <= 4


def test_closing_lets_go_of_the_frames(tmp_path: Path) -> None:
    path = record(tmp_path / "a.mcap", frames_from(50.0), None)
    with open_source(f"replay://{path}?speed=max", ManualClock(OPENED_S)) as source:
        source.read(0.1)
    assert source.ended
    assert (len(source.read()), source.frames(), source.marks()) == (0, [], [])
