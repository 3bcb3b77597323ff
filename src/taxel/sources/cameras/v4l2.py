"""A camera by Video4Linux2: format and rate asked for and read back, buffers dequeued unopened.

Speaks to the kernel by `fcntl.ioctl` alone; all calls go through `Kernel`, so that tests put an
emulated driver there. Never tried on a real camera so far (docs/decisions/0015). Knows nothing
about processes, frames' health or other cameras.
"""

from __future__ import annotations

import contextlib
import errno
import os
from ctypes import c_int32
from pathlib import Path

from taxel.errors import BadSource
from taxel.sources.cameras import v4l2_structs as v4l2
from taxel.sources.cameras.capture import Buffer, CameraGiven, CameraGone, CameraRequest
from taxel.sources.cameras.v4l2_kernel import Kernel, LinuxKernel, Mapping
from taxel.sources.cameras.v4l2_nodes import SYSFS, capture_node, list_offers, usb_serial

BUFFERS = 8
"""Buffers in the driver's queue: at 60 Hz a pause of 130 ms costs nothing. Source: our choice,
docs/decisions/0015."""
_RATE_OFF = 0.01
"""Share by which the rate may differ from what was asked: 29.97 is 30. Source: our choice."""
_PASSING = (errno.ENODEV, errno.ENOENT, errno.ENXIO, errno.EIO, errno.EPROTO, errno.EPIPE)
"""Errors of a cable or plug: the device may come back."""


def open_v4l2(request: CameraRequest) -> V4l2Capture:
    """Return the real device of one camera, not yet opened."""
    return V4l2Capture(request)


class V4l2Capture:
    """One camera of the kernel's; fulfils `Capture`.

    Args:
        request: What to ask for.
        kernel: The system calls.
        sysfs: Where the kernel describes its devices.
    """

    def __init__(
        self, request: CameraRequest, kernel: Kernel | None = None, sysfs: Path = SYSFS
    ) -> None:
        self._request = request
        self._kernel = LinuxKernel() if kernel is None else kernel
        self._sysfs = sysfs
        self._fd = -1
        self._maps: list[Mapping] = []

    def open(self) -> CameraGiven:
        """Open, negotiate, map buffers, start; as `Capture.open`."""
        self.close()
        path = self._request.path
        try:
            node = capture_node(path, self._kernel, self._sysfs)
            self._fd = self._kernel.open(node)
            given = self._negotiate(node)
            self._start()
        except OSError as error:
            self.close()
            raise explain(error, path) from error
        except BaseException:
            self.close()
            raise
        return given

    def next(self, timeout_s: float) -> Buffer | None:
        """Dequeue the oldest filled buffer; as `Capture.next`."""
        try:
            if not self._kernel.wait(self._fd, timeout_s):
                return None
            buffer = v4l2.Buffer(type=v4l2.VIDEO_CAPTURE, memory=v4l2.MMAP)
            try:
                self._kernel.ioctl(self._fd, v4l2.DQBUF, buffer)
            except BlockingIOError:
                return None
            data = bytes(self._maps[buffer.index][: buffer.bytesused])
            found = Buffer(
                data=data,
                sequence=buffer.sequence,
                device_s=buffer.timestamp.seconds + buffer.timestamp.microseconds * 1e-6,
                monotonic=buffer.flags & v4l2.STAMP_MASK == v4l2.STAMP_MONOTONIC,
                damaged=bool(buffer.flags & v4l2.BUFFER_ERROR),
            )
            self._queue(buffer.index)
        except OSError as error:
            raise CameraGone(_reason(error)) from error
        return found

    def close(self) -> None:
        """Stop, unmap, close."""
        if self._fd < 0:
            return
        with contextlib.suppress(OSError):  # unplugged, or never started
            self._kernel.ioctl(self._fd, v4l2.STREAMOFF, c_int32(v4l2.VIDEO_CAPTURE))
        for mapping in self._maps:
            mapping.close()
        self._maps = []
        self._kernel.close(self._fd)
        self._fd = -1

    def _negotiate(self, node: str) -> CameraGiven:
        """Ask for MJPG, size and rate, and hold the camera to it."""
        asked, kernel, fd = self._request, self._kernel, self._fd
        about = v4l2.Capability()
        kernel.ioctl(fd, v4l2.QUERYCAP, about)
        form = v4l2.Format(type=v4l2.VIDEO_CAPTURE)
        pix = form.fmt.pix
        pix.width, pix.height = asked.width, asked.height
        pix.pixelformat, pix.field = v4l2.MJPG, v4l2.FIELD_ANY
        kernel.ioctl(fd, v4l2.S_FMT, form)
        kernel.ioctl(fd, v4l2.G_FMT, form)
        got = form.fmt.pix
        same = (got.width, got.height) == (asked.width, asked.height)
        if got.pixelformat not in (v4l2.MJPG, v4l2.JPEG) or not same:
            raise BadSource(
                f"MJPG frames of {asked.width}×{asked.height} from {asked.path}",
                f"{v4l2.four_letters(got.pixelformat)} of {got.width}×{got.height}",
                f"ask for one of its own with width= and height=: {self._offered()}",
            )
        rate_hz = self._set_rate(asked.rate_hz)
        wanted = asked.rate_hz
        if wanted is not None and rate_hz and abs(rate_hz / wanted - 1) > _RATE_OFF:
            raise BadSource(
                f"{wanted:g} frames/s of {asked.width}×{asked.height} from {asked.path}",
                f"{rate_hz:g}",
                f"leave rate_hz out, or ask for one of its own: {self._offered()}",
            )
        return CameraGiven(
            width=got.width,
            height=got.height,
            pixel_format=v4l2.four_letters(got.pixelformat),
            rate_hz=rate_hz,
            card=about.card.decode("utf-8", "replace"),
            bus=about.bus_info.decode("utf-8", "replace"),
            serial=usb_serial(node, self._sysfs),
            node=node,
        )

    def _set_rate(self, rate_hz: float | None) -> float | None:
        """Ask for a rate where one is wanted; return what the driver then promises."""
        parm = v4l2.StreamParm(type=v4l2.VIDEO_CAPTURE)
        try:
            self._kernel.ioctl(self._fd, v4l2.G_PARM, parm)
            if rate_hz is not None and parm.parm.capture.capability & v4l2.CAN_SET_RATE:
                parm.parm.capture.timeperframe = v4l2.Fraction(1000, round(rate_hz * 1000))
                self._kernel.ioctl(self._fd, v4l2.S_PARM, parm)
                self._kernel.ioctl(self._fd, v4l2.G_PARM, parm)
        except OSError as error:
            if error.errno not in (errno.ENOTTY, errno.EINVAL):
                raise
            return None  # the driver knows no rates
        period = parm.parm.capture.timeperframe
        if not period.numerator or not period.denominator:
            return None
        return float(period.denominator / period.numerator)

    def _start(self) -> None:
        """Map the driver's buffers, queue them all, and start."""
        wanted = v4l2.RequestBuffers(count=BUFFERS, type=v4l2.VIDEO_CAPTURE, memory=v4l2.MMAP)
        self._kernel.ioctl(self._fd, v4l2.REQBUFS, wanted)
        for index in range(wanted.count):  # a driver may grant more or fewer
            buffer = v4l2.Buffer(type=v4l2.VIDEO_CAPTURE, memory=v4l2.MMAP, index=index)
            self._kernel.ioctl(self._fd, v4l2.QUERYBUF, buffer)
            self._maps.append(self._kernel.map(self._fd, buffer.length, buffer.m.offset))
            self._queue(index)
        self._kernel.ioctl(self._fd, v4l2.STREAMON, c_int32(v4l2.VIDEO_CAPTURE))

    def _queue(self, index: int) -> None:
        buffer = v4l2.Buffer(type=v4l2.VIDEO_CAPTURE, memory=v4l2.MMAP, index=index)
        self._kernel.ioctl(self._fd, v4l2.QBUF, buffer)

    def _offered(self) -> str:
        """Return the camera's own sizes and rates, for a person."""
        offers = [offer for offer in list_offers(self._fd, self._kernel) if offer.is_jpeg]
        return "; ".join(str(offer) for offer in offers) or "it offers no MJPG at all"


def explain(error: OSError, path: str) -> BadSource | CameraGone:
    """Return what a failed call means to a person."""
    if error.errno == errno.ENOSPC:
        return BadSource(
            f"USB bandwidth for {path}",
            "no room left on its bus: the cameras opened before take it",
            "ask for a smaller size or rate, or plug it into another USB controller",
        )
    if error.errno == errno.EBUSY:
        return BadSource(
            f"{path} for taxel alone", "another program holds it", "close that program"
        )
    if error.errno in (errno.EACCES, errno.EPERM):
        return BadSource(
            f"permission to read and write {path}",
            "none",
            "join the group: sudo usermod -aG video $USER, then log in again",
        )
    if error.errno in _PASSING:
        return CameraGone(_reason(error))
    if error.errno in (errno.ENOTTY, errno.EINVAL):
        return BadSource("a camera's device node", f"{path}, which is not one", "run: taxel find")
    return BadSource(f"{path} to open as a camera", _reason(error), "run: taxel find")


def _reason(error: OSError) -> str:
    number = error.errno or 0
    return f"{os.strerror(number).lower()} ({errno.errorcode.get(number, number)})"
