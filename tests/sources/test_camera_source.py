"""Claims about `camera://`: every frame as it came, honest rates, and no camera stops another.

Capture processes, shared memory and reopening are the real ones; only the device is emulated.
"""

import os
import signal
import subprocess
import sys
import time
from itertools import pairwise
from pathlib import Path

import pytest

from taxel.errors import BadSource
from taxel.frame_codec import decode_jpeg
from taxel.signals import Frame
from taxel.sources.camera_emulation import (
    CameraFault,
    EmulatedCamera,
    EmulatedPair,
    gel_images,
)
from taxel.sources.cameras.capture import CameraRequest
from taxel.sources.cameras.link import CameraLink
from taxel.sources.cameras.process import measure
from taxel.sources.cameras.ring import SLOTS, FrameRing, RingFrame, make_ring
from taxel.sources.cameras.source import Cameras, parse_cameras
from taxel.sources.opening import open_source

FAST_HZ = 100.0


@pytest.fixture(scope="module")
def images() -> tuple[bytes, ...]:
    return gel_images(12)


def cameras(left: EmulatedCamera, right: EmulatedCamera | None = None, **options: str) -> Cameras:
    bodies = {"a": left} if right is None else {"a": left, "b": right}
    return Cameras(",".join(bodies), options, EmulatedPair(bodies))


def watch(source: Cameras, seconds: float) -> list[Frame]:
    found, until_s = [], time.monotonic() + seconds
    while time.monotonic() < until_s:
        assert len(source.read(0.02)) == 0
        found += source.frames()
    return found


def wait_for(source: Cameras, condition, seconds: float = 8.0) -> list[Frame]:
    found, until_s = [], time.monotonic() + seconds
    while not condition(source.ledgers()):
        assert time.monotonic() < until_s, source.ledgers()
        source.read(0.02)
        found += source.frames()
    return found


def test_frames_come_whole_once_in_order_and_on_time(images):
    """A camera with padding behind its JPEGs: bytes, counters and stamps are the device's."""
    with cameras(EmulatedCamera(images=images, rate_hz=FAST_HZ, padding=512)) as source:
        frames = watch(source, 0.6)
        (ledger,) = source.ledgers()

    assert len(frames) > 40
    counters = [frame.counter for frame in frames]
    assert counters == sorted(set(counters))
    assert {frame.jpeg for frame in frames} == set(images)
    assert decode_jpeg(frames[0].jpeg, None).shape == (240, 320, 3)
    for frame in frames:
        assert frame.fitted_s == frame.device_s
        assert 0.003 < frame.arrival_s - frame.fitted_s < 0.5
    assert (ledger.bad, ledger.repeated, ledger.dropped) == (0, 0, 0)
    assert ledger.state == "running"


def test_the_rate_is_what_was_measured_beside_what_was_promised(images):
    """A camera that promises 100 and shows each image twice: frames and images are told apart."""
    with cameras(EmulatedCamera(images=images, rate_hz=FAST_HZ, repeats=2), rate_hz="90") as source:
        (info,) = source.cameras
        watch(source, 0.5)
        (ledger,) = source.ledgers()

    assert info.rate_hz == pytest.approx(FAST_HZ, rel=0.05)
    assert (info.details["asked_hz"], info.details["given_hz"]) == ("90", "100")
    assert float(info.details["measured_images_hz"]) == pytest.approx(50, rel=0.15)
    assert ledger.rate_hz == pytest.approx(FAST_HZ, rel=0.05)
    assert ledger.repeated == pytest.approx(ledger.frames / 2, abs=3)


def test_what_a_camera_loses_and_damages_is_counted_and_not_delivered(images):
    faults = (
        CameraFault(kind="stall", first=80, frames=3),
        CameraFault(kind="empty", first=90),
        CameraFault(kind="damaged", first=92),
        CameraFault(kind="cut", first=94, frames=2),
        CameraFault(kind="frozen", first=100, frames=4),
    )
    body = EmulatedCamera(images=images, rate_hz=FAST_HZ, faults=faults, buffers=64)
    with cameras(body) as source:
        frames = wait_for(source, lambda ledgers: ledgers[0].frames >= 70)
        (ledger,) = source.ledgers()

    missing = {80, 81, 82, 90, 92, 94, 95}
    assert not missing & {frame.counter for frame in frames}
    assert (ledger.bad, ledger.repeated) == (4, 4)
    assert ledger.lost == 3


@pytest.mark.slow
def test_one_camera_that_hangs_does_not_hold_up_the_other(images):
    """The driver of one does not return for 0.7 s; the other's frames come all the while."""
    hang = (CameraFault(kind="hang", first=130, frames=70),)
    well = EmulatedCamera(images=images, rate_hz=FAST_HZ, buffers=64)
    with cameras(EmulatedCamera(images=images, rate_hz=FAST_HZ, faults=hang), well) as source:
        frames = wait_for(source, lambda ledgers: ledgers[0].lost >= 60)
        hung, other = source.ledgers()

    gaps = {0: 0.0, 1: 0.0}
    for camera in gaps:
        times = [frame.arrival_s for frame in frames if frame.camera == camera]
        gaps[camera] = max(b - a for a, b in pairwise(times))
    assert gaps[0] > 0.5
    assert gaps[1] < 0.3
    assert (other.lost, other.dropped) == (0, 0)
    assert other.frames > hung.frames + 30


@pytest.mark.slow
def test_an_unplugged_camera_is_reopened_when_it_returns(images):
    gone = (CameraFault(kind="gone", first=100, frames=40),)
    well = EmulatedCamera(images=images, rate_hz=FAST_HZ, buffers=64)
    with cameras(EmulatedCamera(images=images, rate_hz=FAST_HZ, faults=gone), well) as source:
        wait_for(source, lambda ledgers: ledgers[0].state == "gone")
        assert source.ledgers()[0].why == "no such device (ENODEV)"
        assert not source.ended
        wait_for(source, lambda ledgers: ledgers[0].state == "running")
        source.frames()
        frames = watch(source, 0.2)
        back, other = source.ledgers()

    assert {frame.camera for frame in frames} == {0, 1}
    assert (back.reopened, other.reopened, other.lost) == (1, 0, 0)


def test_a_capture_process_that_dies_is_started_again(images):
    dies = (CameraFault(kind="killed", first=100),)
    well = EmulatedCamera(images=images, rate_hz=FAST_HZ, buffers=64)
    with cameras(EmulatedCamera(images=images, rate_hz=FAST_HZ, faults=dies), well) as source:
        wait_for(source, lambda ledgers: ledgers[0].state == "no process")
        wait_for(source, lambda ledgers: ledgers[0].state == "running")
        frames = watch(source, 0.2)
        back, other = source.ledgers()

    assert {frame.camera for frame in frames} == {0, 1}
    assert (back.restarted, other.restarted, other.lost) == (1, 0, 0)


def test_stamps_of_a_foreign_clock_are_fitted_to_the_hosts(images):
    """The device's clock began at 5 s when it was powered and runs 200 ppm fast."""
    body = EmulatedCamera(
        images=images, rate_hz=FAST_HZ, foreign_clock_s=5.0, drift_ppm=200.0, jitter_s=0.0
    )
    with cameras(body) as source:
        frames = watch(source, 0.6)
    for frame in frames:
        assert 5.0 < frame.device_s < 20.0
        assert frame.fitted_s <= frame.arrival_s < frame.fitted_s + 0.5
    steps = [b.fitted_s - a.fitted_s for a, b in pairwise(frames)]
    assert min(steps) >= 0.0
    assert sorted(steps)[len(steps) // 2] == pytest.approx(0.01, rel=0.02)


def test_while_nobody_reads_the_newest_are_kept_and_the_rest_is_counted(images):
    with cameras(EmulatedCamera(images=images, rate_hz=200.0)) as source:
        source.frames()
        time.sleep(0.4)
        frames = source.frames()
        (ledger,) = source.ledgers()

    assert 1 < len(frames) <= SLOTS
    assert ledger.dropped > 10
    assert time.monotonic() - frames[-1].arrival_s < 0.5
    assert frames[-1].counter - frames[0].counter == len(frames) - 1


def test_what_came_while_others_were_opened_is_let_go_and_not_called_dropped(images):
    """A fast camera waits for the slow one to be measured; its first frames are new ones."""
    fast = EmulatedCamera(images=images, rate_hz=FAST_HZ, buffers=64)
    with cameras(fast, EmulatedCamera(images=images, rate_hz=20.0)) as source:
        opened_s = time.monotonic()
        frames = watch(source, 0.1)
        ledger, _ = source.ledgers()

    assert ledger.frames > SLOTS
    assert ledger.dropped == 0
    assert frames[0].arrival_s > opened_s - 0.1


def test_reading_ends_with_a_frame_or_after_the_timeout(images):
    slow = EmulatedCamera(images=images, rate_hz=20.0)
    with cameras(slow) as source:
        source.read(1.0)
        source.frames()
        begun_s = time.monotonic()
        source.read(0.01)
        assert time.monotonic() - begun_s < 0.045
        source.read(2.0)
        assert len(source.frames()) >= 1


def test_closing_ends_the_processes_and_the_source(images):
    with cameras(EmulatedCamera(images=images, rate_hz=FAST_HZ)) as source:
        process = source._links[0]._process
        assert process.poll() is None
    assert process.returncode == 0
    assert (source.ended, source.frames(), source.ledgers()) == (True, [], ())
    assert len(source.read(5.0)) == 0


def test_capture_processes_end_with_a_parent_that_is_killed(tmp_path: Path):
    """kill -9 leaves nobody behind to close anything."""
    script = tmp_path / "parent.py"  # on purpose without a __main__ guard
    script.write_text(
        "from taxel.sources.camera_emulation import EmulatedCamera\n"
        "from taxel.sources.cameras.source import Cameras\n"
        "body = EmulatedCamera(images=(b'\\xff\\xd8 \\xff\\xd9',), rate_hz=100)\n"
        "source = Cameras('a', {}, body)\n"
        "print(source._links[0]._process.pid, flush=True)\n"
        "while True:\n    source.read(1.0)\n"
    )
    with subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE) as parent:
        child = int(parent.stdout.readline())
        os.kill(child, 0)
        parent.send_signal(signal.SIGKILL)
    until_s = time.monotonic() + 5.0
    while Path(f"/proc/{child}").exists() and not _is_zombie(child):
        assert time.monotonic() < until_s
        time.sleep(0.01)


def _is_zombie(process: int) -> bool:
    try:
        return Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[0] == "Z"
    except FileNotFoundError:
        return True


def test_a_capture_process_is_small(images):
    """Neither numpy nor an image library is loaded in it."""
    with cameras(EmulatedCamera(images=images, rate_hz=FAST_HZ)) as source:
        maps = Path(f"/proc/{source._links[0]._process.pid}/maps").read_text()
        assert "python" in maps  # what it has loaded can be read
        assert "numpy" not in maps
        assert "cv2" not in maps


def test_the_camera_for_which_the_bus_has_no_room_is_named(images):
    refused = ("USB bandwidth for b", "no room left on its bus", "ask for a smaller size")
    with pytest.raises(BadSource, match="USB bandwidth for b"):
        cameras(EmulatedCamera(images=images), EmulatedCamera(images=images, refuses=refused))


def test_a_camera_that_sends_nothing_usable_is_refused(images):
    mute = CameraFault(kind="cut", first=0, frames=10**6)
    device = EmulatedCamera(images=images, faults=(mute,))(
        CameraRequest(path="a", width=64, height=64)
    )
    device.open()
    with pytest.raises(BadSource, match=r"needed whole frames from a; got 0 within 0\.2 s"):
        measure(device, lambda _: False, "a", 0.2)


def test_a_node_that_is_missing_or_no_camera_is_one_plain_line():
    """By the real capture process and the real device class."""
    with pytest.raises(BadSource, match="a camera at /dev/none; got no such file"):
        open_source("camera:///dev/none")
    with pytest.raises(BadSource, match="a camera's device node; got /dev/null"):
        open_source("camera:///dev/null")


@pytest.mark.parametrize(
    ("name", "options", "line"),
    [
        ("0", {"fps": "30"}, "options of camera:// among width, height, rate_hz"),
        ("0,0", {}, "each camera's device once"),
        ("0,", {}, "each camera's device once"),
        ("0", {"width": "1.5"}, "width of camera:// as a whole number within 16 and 8192"),
        ("0", {"height": "0"}, "height of camera://"),
        ("0", {"rate_hz": "nan"}, "rate_hz of camera:// as a number within 1 and 1000"),
        ("0,1", {"names": "one"}, "2 different words"),
        ("0,1", {"names": "a,a"}, "2 different words"),
        ("0", {"names": "a/b"}, "1 different word"),
        ("0", {"mm_per_px": "-1"}, "mm_per_px of camera:// as one number above 0"),
    ],
)
def test_wrong_addresses_are_refused_in_one_line(name: str, options: dict[str, str], line: str):
    with pytest.raises(BadSource, match=line):
        parse_cameras(name, options)


def test_an_address_says_it_all():
    choice = parse_cameras("0,/dev/v4l/by-id/x", {"width": "320", "mm_per_px": "0.06"})

    assert choice.paths == ("/dev/video0", "/dev/v4l/by-id/x")
    assert (choice.names, choice.width, choice.height) == (("left", "right"), 320, 480)
    assert (choice.rate_hz, choice.mm_per_px) == (None, (0.06, 0.06))


def test_a_frame_that_was_half_overwritten_is_dropped_not_delivered():
    ring_fd = make_ring(1000)
    writer, reader = FrameRing(os.dup(ring_fd), 1000), FrameRing(ring_fd, 1000)
    for number in range(3):
        writer.put(RingFrame(bytes([number]) * 500, number, 0.0, 0.0, True))
    writer._memory[writer._place(1) + 64 + 250] ^= 1
    assert [frame.sequence for frame in reader.take()] == [0, 2]
    assert reader.dropped == 1
    assert not writer.put(RingFrame(bytes(1001), 4, 0.0, 0.0, True))
    for number in range(SLOTS + 5):
        writer.put(RingFrame(b"x", number, 0.0, 0.0, True))
    assert [frame.sequence for frame in reader.take()] == list(range(5, SLOTS + 5))
    assert reader.dropped == 6
    writer.close()
    reader.close()


def test_a_process_that_cannot_start_is_said(images, monkeypatch):
    monkeypatch.setattr(sys, "executable", "/bin/false")
    link = CameraLink(
        0, "left", CameraRequest(path="a", width=64, height=64), EmulatedCamera(images=images)
    )
    with pytest.raises(BadSource, match="capture process of a; got its end"):
        link.open()
    link.close()


def test_an_address_may_ask_for_grasps_to_be_found() -> None:
    assert parse_cameras("/dev/a", {"grasps": "found"}).finds_grasps
    assert not parse_cameras("/dev/a", {}).finds_grasps
    with pytest.raises(BadSource, match="found"):
        parse_cameras("/dev/a", {"grasps": "yes"})
