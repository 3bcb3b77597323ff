"""Claims about cameras that come back: the same one is taken again, another never.

The capture loop is the real one; the device says what the test lets it say, and nothing waits.
"""

import io
import json
import os
from collections.abc import Callable, Iterator
from dataclasses import replace
from types import SimpleNamespace

import pytest

from taxel.sources.camera_emulation import EmulatedCamera
from taxel.sources.cameras import process
from taxel.sources.cameras.capture import Buffer, CameraGiven, CameraGone, CameraRequest, another
from taxel.sources.cameras.process import OPEN, RUN, RUN_BY_SOCKET, CaptureJob, CaptureLoop
from taxel.sources.cameras.ring import REOPENED, FrameRing, make_ring
from taxel.sources.cameras.source import Cameras

REQUEST = CameraRequest(path="/dev/video0", width=320, height=240)
FIRST = CameraGiven(width=320, height=240, pixel_format="MJPG", rate_hz=25.0, card="GelSight Mini",
                    bus="usb-1", serial="A1")  # fmt: skip
LEFT, OTHER = b"\xff\xd8 first \xff\xd9", b"\xff\xd8 other \xff\xd9"
Loop = Callable[..., CaptureLoop]


class Device:
    """Gives what is in `now`; nothing while that is None."""

    def __init__(self) -> None:
        self.now: CameraGiven | None = FIRST
        self.opened, self.count = False, 0

    def open(self) -> CameraGiven:
        if self.now is None:
            raise CameraGone("no such device (ENODEV)")
        self.opened = True
        return self.now

    def next(self, timeout_s: float) -> Buffer:
        if self.now is None:
            raise CameraGone("no such device (ENODEV)")
        assert self.opened
        self.count += 1
        data = LEFT if self.now == FIRST else OTHER
        return Buffer(data=data, sequence=self.count, device_s=self.count / 25, monotonic=True,
                      damaged=False)  # fmt: skip

    def close(self) -> None:
        self.opened = False


@pytest.fixture
def device() -> Device:
    return Device()


@pytest.fixture
def loop_of(device: Device, monkeypatch: pytest.MonkeyPatch) -> Iterator[Loop]:
    """Make capture loops of the device; the wait between two tries is left out."""
    monkeypatch.setattr(process, "RETRY_S", 0.0)
    ring_fd = make_ring(1 << 16)
    bell, bell_in = os.pipe()
    os.set_blocking(bell_in, False)

    def make(**job: object) -> CaptureLoop:
        loop = CaptureLoop(
            CaptureJob(REQUEST, lambda _: device, os.dup(ring_fd), 1 << 16, bell_in, os.getppid(),
                       **job)
        )  # type: ignore[arg-type]  # fmt: skip
        monkeypatch.setattr(loop, "_over", lambda wait_s: False)
        return loop

    yield make
    for fd in (ring_fd, bell, bell_in):
        os.close(fd)


def begun(loop: CaptureLoop, monkeypatch: pytest.MonkeyPatch, word: bytes = RUN) -> CaptureLoop:
    """Let a loop open its camera and measure, as the parent says."""
    monkeypatch.setattr("sys.stdin", SimpleNamespace(buffer=io.BytesIO(OPEN + word)))
    assert loop._connect()
    return loop


def steps(loop: CaptureLoop, ring: FrameRing, count: int = 3) -> set[bytes]:
    for _ in range(count):
        loop._step()
    return {frame.jpeg for frame in ring.take()}


def last_state(capsys: pytest.CaptureFixture[str]) -> dict[str, str]:
    messages = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    return [line for line in messages if "state" in line][-1]


@pytest.mark.parametrize("restarted", [False, True])
def test_another_camera_at_the_address_counts_as_gone_until_the_first_is_back(
    device: Device,
    loop_of: Loop,
    restarted: bool,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Also where the capture process itself was started again meanwhile."""
    loop = begun(loop_of(), monkeypatch)
    if restarted:
        loop = loop_of(first=FIRST)
    ring = loop._ring
    assert steps(loop, ring) == {LEFT}
    reopened = ring.words[REOPENED]

    device.now = None
    assert steps(loop, ring) == set()
    assert last_state(capsys) == {"state": "gone", "why": "no such device (ENODEV)"}
    device.now = replace(FIRST, serial="B2")
    assert steps(loop, ring) == set()
    why = "another camera (serial B2) is at this address"
    assert last_state(capsys) == {"state": "gone", "why": why}
    assert not device.opened
    assert ring.words[REOPENED] == reopened
    device.now = FIRST
    assert steps(loop, ring) == {LEFT}
    assert last_state(capsys) == {"state": "running", "why": ""}
    assert ring.words[REOPENED] == reopened + 1


@pytest.mark.parametrize(("word", "came"), [(RUN, {OTHER}), (RUN_BY_SOCKET, set())])
def test_the_socket_decides_only_where_serial_numbers_are_shared(
    device: Device, loop_of: Loop, word: bytes, came: set[bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    loop = begun(loop_of(), monkeypatch, word)
    device.now = None
    steps(loop, loop._ring)
    device.now = replace(FIRST, bus="usb-2")
    assert steps(loop, loop._ring) == came


@pytest.mark.parametrize(
    ("first", "now", "shared", "what"),
    [
        ({}, {}, True, ""),
        ({}, {"serial": "B\x1b"}, False, r"serial B\x1b"),
        ({}, {"serial": ""}, False, "without a serial number"),
        ({"serial": ""}, {"serial": "B"}, False, "serial B"),
        ({}, {"bus": "usb-2"}, False, ""),
        ({}, {"bus": "usb-2"}, True, "plugged in at usb-2, not usb-1"),
        ({"serial": ""}, {"serial": "", "bus": "usb-2"}, False, "plugged in at usb-2, not usb-1"),
        ({"serial": "", "bus": ""}, {"serial": ""}, False, ""),
        ({"serial": "", "bus": ""}, {"serial": "", "width": 64}, False, "64×240, not 320×240"),
        ({}, {"card": "Webcam"}, False, "its name is Webcam"),
        ({}, {"node": "/dev/video4", "rate_hz": 30.0}, True, ""),
    ],
)
def test_what_shows_that_a_camera_is_another(
    first: dict[str, object], now: dict[str, object], shared: bool, what: str
) -> None:
    assert another(replace(FIRST, **first), replace(FIRST, **now), shared) == what


def test_cameras_that_share_a_serial_number_are_held_to_their_sockets() -> None:
    cheap = EmulatedCamera(images=(LEFT, OTHER), rate_hz=100.0, serial="0001")
    with Cameras("a,b", {}, cheap) as two:
        assert [link._serial_shared for link in two._links] == [True, True]
    with Cameras("a", {}, cheap) as single:
        assert [link._serial_shared for link in single._links] == [False]
