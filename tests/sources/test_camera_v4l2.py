"""Claims about V4L2: formats are held to, buffers given back, errors are plain lines.

The driver is emulated behind `Kernel`, at the level of its requests on the real structures; a real
camera was not at hand.
"""

import errno
import os
from collections import deque
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taxel.errors import BadSource
from taxel.sources.cameras import v4l2_structs as v4l2
from taxel.sources.cameras.capture import CameraGone, CameraRequest, whole_jpeg
from taxel.sources.cameras.v4l2 import V4l2Capture
from taxel.sources.cameras.v4l2_kernel import LinuxKernel
from taxel.sources.cameras.v4l2_nodes import list_cameras

JPEG = b"\xff\xd8 an image \xff\xd9"


class EmulatedDriver:
    """A UVC-like driver for some nodes: negotiates, queues and fills buffers, and fails."""

    def __init__(self, nodes: dict[str, dict] | None = None) -> None:
        self.nodes = {"/dev/video0": {}} if nodes is None else nodes
        self.sizes = {v4l2.MJPG: [(640, 480), (320, 240)], v4l2.four_cc("YUYV"): [(640, 480)]}
        self.rates = (30, 25, 10)
        self.rate = (1, 30)
        self.pix = (640, 480, v4l2.four_cc("YUYV"))
        self.granted = 4
        self.fails: dict[int, int] = {}  # request → error number
        self.ready: deque[tuple[bytes, int, tuple[int, int], int]] = deque()
        self.queued: deque[int] = deque()
        self.memory = [bytearray(4096) for _ in range(8)]
        self.open_fds: dict[int, str] = {}
        self.streaming, self.maps = False, 0

    def open(self, path: str) -> int:
        if path not in self.nodes:
            raise OSError(errno.ENOENT, "none")
        if "refuses" in self.nodes[path]:
            raise OSError(self.nodes[path]["refuses"], "refused")
        fd = 100 + len(self.open_fds)
        self.open_fds[fd] = path
        return fd

    def close(self, fd: int) -> None:
        del self.open_fds[fd]
        self.queued.clear()  # as a driver frees what a closed file had

    def map(self, fd: int, length: int, offset: int):
        driver, memory = self, self.memory[offset // 4096]

        class Mapped:
            def __getitem__(self, part: slice) -> bytes:
                return bytes(memory[part])

            def close(self) -> None:
                driver.maps -= 1

        self.maps += 1
        return Mapped()

    def wait(self, fd: int, timeout_s: float) -> bool:
        return bool(self.ready) or v4l2.DQBUF in self.fails

    def ioctl(self, fd: int, request: int, arg) -> None:
        if request in self.fails:
            raise OSError(self.fails[request], "failed")
        done = (name for name in dir(self) if name.startswith("do_"))
        name = next(name for name in done if getattr(v4l2, name[3:].upper()) == request)
        getattr(self, name)(fd, arg)

    def do_querycap(self, fd, arg):
        arg.card, arg.bus_info = b"GelSight Mini", b"usb-0000:00:14.0-1"
        metadata = self.nodes[self.open_fds[fd]].get("metadata", False)
        arg.capabilities = v4l2.CAN_CAPTURE | v4l2.CAN_STREAM | v4l2.HAS_DEVICE_CAPS
        arg.device_caps = v4l2.CAN_STREAM | (0x00800000 if metadata else v4l2.CAN_CAPTURE)

    def do_enum_fmt(self, fd, arg):
        arg.pixelformat = self.entry(list(self.sizes), arg.index)

    def do_enum_framesizes(self, fd, arg):
        size = self.entry(self.sizes[arg.pixel_format], arg.index)
        arg.type, (arg.steps.min_width, arg.steps.max_width) = v4l2.DISCRETE, size

    def do_enum_frameintervals(self, fd, arg):
        arg.type, arg.steps[0] = v4l2.DISCRETE, v4l2.Fraction(1, self.entry(self.rates, arg.index))

    def do_s_fmt(self, fd, arg):
        """A driver changes what it cannot do to the nearest that it can."""
        pix = arg.fmt.pix
        coding = pix.pixelformat if pix.pixelformat in self.sizes else next(iter(self.sizes))
        size = min(self.sizes[coding], key=lambda size: abs(size[0] - pix.width))
        self.pix = (*size, coding)
        self.do_g_fmt(fd, arg)

    def do_g_fmt(self, fd, arg):
        arg.fmt.pix.width, arg.fmt.pix.height, arg.fmt.pix.pixelformat = self.pix

    def do_g_parm(self, fd, arg):
        arg.parm.capture.capability = v4l2.CAN_SET_RATE
        arg.parm.capture.timeperframe = v4l2.Fraction(*self.rate)

    def do_s_parm(self, fd, arg):
        period = arg.parm.capture.timeperframe
        wanted = period.denominator / period.numerator
        self.rate = (1, min(self.rates, key=lambda rate: abs(rate - wanted)))

    def do_reqbufs(self, fd, arg):
        arg.count = min(arg.count, self.granted) if self.granted < 4 else self.granted

    def do_querybuf(self, fd, arg):
        arg.length, arg.m.offset = 4096, arg.index * 4096

    def do_qbuf(self, fd, arg):
        assert arg.index not in self.queued
        self.queued.append(arg.index)

    def do_dqbuf(self, fd, arg):
        if not self.ready:
            raise BlockingIOError(errno.EAGAIN, "none")
        data, arg.sequence, stamp, arg.flags = self.ready.popleft()
        arg.index = self.queued.popleft()
        arg.timestamp.seconds, arg.timestamp.microseconds = stamp
        arg.bytesused = len(data)
        self.memory[arg.index][: len(data)] = data

    def do_streamon(self, fd, arg):
        assert (arg.value, len(self.queued)) == (v4l2.VIDEO_CAPTURE, self.granted)
        self.streaming = True

    def do_streamoff(self, fd, arg):
        self.streaming = False
        self.queued.clear()

    @staticmethod
    def entry(values, index):
        if index >= len(values):
            raise OSError(errno.EINVAL, "no more")
        return values[index]


def capture(driver, path: str = "/dev/video0", sysfs: Path = Path("/nowhere"), **asked):
    request = CameraRequest(path=path, **{"width": 640, "height": 480, **asked})
    return V4l2Capture(request, driver, sysfs)


def test_mjpg_size_and_rate_are_asked_for_and_read_back():
    driver = EmulatedDriver()
    given = capture(driver, width=320, height=240, rate_hz=25).open()

    assert (given.width, given.height, given.pixel_format) == (320, 240, "MJPG")
    assert (given.rate_hz, given.card) == (25.0, "GelSight Mini")
    assert driver.streaming


def test_without_a_rate_the_cameras_own_is_reported():
    driver = EmulatedDriver()
    driver.rate = (1001, 30000)

    assert capture(driver).open().rate_hz == pytest.approx(29.97, abs=0.001)


def test_another_size_is_refused_with_what_the_camera_offers():
    driver = EmulatedDriver()
    with pytest.raises(BadSource, match=r"640×480 at 30/25/10; 320×240 at 30/25/10") as caught:
        capture(driver, width=1280, height=720).open()

    assert "needed MJPG frames of 1280×720" in str(caught.value)
    assert (driver.open_fds, driver.maps) == ({}, 0)


def test_a_camera_without_mjpg_is_refused():
    driver = EmulatedDriver()
    driver.sizes.pop(v4l2.MJPG)
    with pytest.raises(BadSource, match=r"got YUYV of 640×480.*it offers no MJPG at all"):
        capture(driver).open()


def test_another_rate_is_refused_but_a_rounded_one_is_not():
    driver = EmulatedDriver()
    with pytest.raises(BadSource, match=r"needed 60 frames/s .*got 30"):
        capture(driver, rate_hz=60.0).open()
    driver.rates = (30000 / 1001,)
    driver.do_s_parm = lambda fd, arg: setattr(driver, "rate", (1001, 30000))

    assert capture(driver, rate_hz=30.0).open().rate_hz == pytest.approx(29.97, abs=0.001)


@pytest.mark.parametrize("granted", [2, 6])
def test_as_many_buffers_as_the_driver_grants_are_used(granted: int):
    driver = EmulatedDriver()
    driver.granted = granted
    device = capture(driver)
    device.open()
    for number in range(20):
        driver.ready.append((JPEG, number, (5, 0), v4l2.STAMP_MONOTONIC))
        assert device.next(0.0).sequence == number
    assert len(driver.queued) == driver.maps == granted


def test_a_buffer_keeps_its_bytes_stamp_sequence_and_flags():
    driver = EmulatedDriver()
    device = capture(driver)
    device.open()
    assert device.next(0.0) is None
    driver.ready.append((JPEG, 7, (12, 250_000), v4l2.STAMP_MONOTONIC))
    driver.ready.append((b"", 9, (12, 500_000), v4l2.BUFFER_ERROR))
    good, bad = device.next(0.0), device.next(0.0)

    assert (good.data, good.sequence, good.device_s) == (JPEG, 7, 12.25)
    assert (good.monotonic, good.damaged) == (True, False)
    assert (bad.data, bad.sequence, bad.monotonic, bad.damaged) == (b"", 9, False, True)


def test_closing_gives_everything_back_and_may_be_done_twice():
    driver = EmulatedDriver()
    device = capture(driver)
    device.open()
    device.close()
    device.close()

    assert (driver.open_fds, driver.maps, driver.streaming) == ({}, 0, False)


def test_a_camera_that_is_unplugged_says_so_and_can_be_opened_again():
    driver = EmulatedDriver()
    device = capture(driver)
    device.open()
    driver.fails = dict.fromkeys((v4l2.DQBUF, v4l2.STREAMOFF), errno.ENODEV)
    with pytest.raises(CameraGone, match="no such device"):
        device.next(0.0)
    device.close()
    driver.fails = {}
    driver.ready.append((JPEG, 0, (1, 0), 0))
    device.open()

    assert device.next(0.0).sequence == 0


@pytest.mark.parametrize(
    ("request_number", "number", "line"),
    [
        (v4l2.STREAMON, errno.ENOSPC, "USB bandwidth for /dev/video0.*smaller size or rate"),
        (v4l2.S_FMT, errno.EBUSY, "another program holds it"),
        (v4l2.QUERYCAP, errno.ENOTTY, "needed a camera's device node"),
    ],
)
def test_what_fails_is_said_in_one_plain_line(request_number: int, number: int, line: str):
    driver = EmulatedDriver()
    driver.fails = {request_number: number}
    with pytest.raises(BadSource, match=line):
        capture(driver).open()
    assert driver.open_fds == {}


def test_without_permission_the_group_is_named():
    with pytest.raises(BadSource, match="usermod -aG video"):
        capture(EmulatedDriver({"/dev/video0": {"refuses": errno.EACCES}})).open()


def test_a_driver_without_rates_is_taken_as_it_is():
    driver = EmulatedDriver()
    driver.fails = {v4l2.G_PARM: errno.ENOTTY}

    assert capture(driver, rate_hz=30.0).open().rate_hz is None


def make_sysfs(root: Path, nodes: dict[str, str], serial: str = "") -> Path:
    """Write the part of sysfs that tells which node belongs to which USB device."""
    for node, device in nodes.items():
        interface = root / "devices" / device / "1-1:1.0"
        (interface / "video4linux" / node).mkdir(parents=True)
        (root / "devices" / device / "serial").write_text(serial + "\n")
        link = root / "class" / "video4linux" / node
        link.mkdir(parents=True)
        (link / "device").symlink_to(interface)
    return root


def test_a_metadata_node_leads_to_its_sensors_capture_node(tmp_path: Path):
    """Not to another sensor's, and not to a second metadata node."""
    nodes = {"/dev/video0": {}, "/dev/video1": {"metadata": True}, "/dev/video2": {},
             "/dev/video3": {"metadata": True}, "/dev/video10": {}}  # fmt: skip
    places = {f"video{n}": "b" if n in (2, 3, 10) else "a" for n in (0, 1, 2, 3, 10)}
    sysfs = make_sysfs(tmp_path, places, "GSM-28T1")
    given = capture(EmulatedDriver(nodes), "/dev/video3", sysfs).open()

    assert (given.node, given.serial) == ("/dev/video2", "GSM-28T1")


def test_a_lone_metadata_node_is_refused(tmp_path: Path):
    sysfs = make_sysfs(tmp_path, {"video1": "a"})
    with pytest.raises(BadSource, match="only metadata"):
        capture(EmulatedDriver({"/dev/video1": {"metadata": True}}), "/dev/video1", sysfs).open()


def test_listing_names_each_camera_once_with_its_lasting_name_and_offers(tmp_path: Path):
    """Metadata nodes are left out; a node that refuses is listed with the reason."""
    dev = tmp_path / "dev"
    (dev / "v4l" / "by-id").mkdir(parents=True)
    names = {n: str(dev / f"video{n}") for n in (0, 1, 2)}
    for name in names.values():
        Path(name).touch()
    link = dev / "v4l" / "by-id" / "usb-GelSight-video-index0"
    link.symlink_to(names[0])
    driver = EmulatedDriver(
        {names[0]: {}, names[1]: {"metadata": True}, names[2]: {"refuses": errno.EACCES}}
    )
    sysfs = make_sysfs(tmp_path / "sys", {"video0": "a", "video1": "a"}, "28T1")
    found, refused = list_cameras(driver, dev, sysfs)

    assert (found.path, found.by_id, found.serial) == (names[0], str(link), "28T1")
    assert [str(offer) for offer in found.offers if offer.is_jpeg] == [
        "640×480 at 30/25/10", "320×240 at 30/25/10",
    ]  # fmt: skip
    assert found.address == f"camera://{link}?width=640&height=480"
    assert (refused.path, refused.problem, refused.address) == (names[2], "permission denied", "")
    assert driver.open_fds == {}


def test_the_real_kernel_says_what_is_no_camera(tmp_path: Path):
    """By the real system calls: a device that is none, a file, and nothing at all."""
    with pytest.raises(
        BadSource, match="needed a camera's device node; got /dev/null, which is not one"
    ):
        capture(LinuxKernel(), "/dev/null").open()
    (tmp_path / "file").touch()
    with pytest.raises(BadSource, match="needed a camera's device node"):
        capture(LinuxKernel(), str(tmp_path / "file")).open()
    with pytest.raises(CameraGone, match="no such file"):
        capture(LinuxKernel(), str(tmp_path / "none")).open()


@pytest.mark.skipif(os.geteuid() == 0, reason="nothing is forbidden to root")
def test_the_real_kernel_says_what_is_forbidden(tmp_path: Path):
    (tmp_path / "video0").touch(mode=0o000)
    with pytest.raises(BadSource, match="usermod -aG video"):
        capture(LinuxKernel(), str(tmp_path / "video0")).open()


def test_a_real_mapping_gives_the_files_bytes(tmp_path: Path):
    """The same call maps a driver's buffer."""
    (tmp_path / "buffer").write_bytes(bytes(4096) + JPEG + bytes(4096 - len(JPEG)))
    kernel = LinuxKernel()
    fd = kernel.open(str(tmp_path / "buffer"))
    mapped = kernel.map(fd, 4096, 4096)
    try:
        assert mapped[: len(JPEG)] == JPEG
    finally:
        mapped.close()
        kernel.close(fd)


@pytest.mark.parametrize(
    ("data", "whole"),
    [(JPEG, JPEG), (JPEG + bytes(300), JPEG), (JPEG[:-2], b""), (JPEG[1:], b""), (b"", b"")],
)
def test_a_jpeg_is_whole_with_both_marks_and_loses_its_padding(data: bytes, whole: bytes):
    assert whole_jpeg(data) == whole


@settings(max_examples=300, deadline=None)
@given(st.lists(st.sampled_from([b"\xff", b"\xd8", b"\xd9", b"\x00", b"\xff\xd8", b"\xff\xd9"])))
def test_whatever_a_driver_leaves_in_a_buffer_only_a_whole_beginning_of_it_is_taken(parts):
    data = b"".join(parts)
    whole = whole_jpeg(data)

    assert data.startswith(whole)
    assert whole == b"" or (whole[:2] == b"\xff\xd8" and whole[-2:] == b"\xff\xd9")
    assert b"\xff\xd9" not in data[len(whole) :] or not data.startswith(b"\xff\xd8")
