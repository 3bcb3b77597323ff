"""Which camera nodes there are, what each offers, and which of a sensor's nodes can capture.

One sensor may have two nodes: one gives images, one only metadata. Knows nothing about streaming.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from taxel.errors import BadSource
from taxel.sources.cameras import v4l2_structs as v4l2
from taxel.sources.cameras.v4l2_kernel import Kernel, LinuxKernel

SYSFS = Path("/sys")
DEV = Path("/dev")
_MOST = 64
"""Entries of one list asked for at most: a driver that never says "no more" ends there."""


@dataclass(frozen=True, slots=True)
class Offer:
    """One size in one coding, with its rates."""

    pixel_format: str
    """Four letters."""
    width: int
    height: int
    rates_hz: tuple[float, ...]
    """Frames a second, highest first; empty where the driver does not say."""

    @property
    def is_jpeg(self) -> bool:
        """Whether `camera://` can use it."""
        return self.pixel_format in ("MJPG", "JPEG")

    def __str__(self) -> str:
        rates = "/".join(f"{rate:g}" for rate in self.rates_hz)
        return f"{self.width}×{self.height}" + (f" at {rates}" if rates else "")


@dataclass(frozen=True, slots=True, kw_only=True)
class FoundCamera:
    """A V4L2 node that can capture, or one that could not be queried (`problem` says why)."""

    path: str
    """The node, such as /dev/video0."""
    by_id: str = ""
    """Its lasting name under /dev/v4l/by-id; empty where there is none."""
    card: str = ""
    bus: str = ""
    serial: str = ""
    """USB serial number; empty where it has none."""
    offers: tuple[Offer, ...] = ()
    problem: str = ""
    """Why it could not be asked; empty where it could."""

    @property
    def address(self) -> str:
        """The `camera://` address; empty where it cannot serve as one."""
        best = self.best
        if best is None:
            return ""
        return f"camera://{self.by_id or self.path}?width={best.width}&height={best.height}"

    @property
    def best(self) -> Offer | None:
        """The JPEG size nearest to 640×480; None where there is none."""
        usable = [offer for offer in self.offers if offer.is_jpeg]
        return min(
            usable, key=lambda offer: abs(offer.width * offer.height - 640 * 480), default=None
        )

    def as_dict(self) -> dict[str, Any]:
        """Return plain values, with the address."""
        return {**asdict(self), "address": self.address}


def list_cameras(
    kernel: Kernel | None = None, dev: Path = DEV, sysfs: Path = SYSFS
) -> list[FoundCamera]:
    """Return the nodes that can capture, and those that could not be asked, by number."""
    kernel = LinuxKernel() if kernel is None else kernel
    names: dict[str, str] = {}
    for link in sorted((dev / "v4l" / "by-id").glob("*")):
        names.setdefault(os.path.realpath(link), str(link))
    found = []
    nodes = [node for node in dev.glob("video*") if node.name[5:].isdigit()]
    for node in sorted(nodes, key=lambda node: int(node.name[5:])):
        by_id = names.get(os.path.realpath(node), "")
        try:
            camera = _ask(str(node), by_id, kernel, sysfs)
        except OSError as error:
            problem = os.strerror(error.errno or 0).lower()
            camera = FoundCamera(path=str(node), by_id=by_id, problem=problem)
        if camera is not None:
            found.append(camera)
    return found


def capture_node(path: str, kernel: Kernel, sysfs: Path = SYSFS) -> str:
    """Return the node to open: the path's own, or the one of the same sensor that captures.

    Raises:
        BadSource: Neither it nor a node beside it can capture.
        OSError: It cannot be opened or asked.
    """
    node = os.path.realpath(path)
    if can_capture(node, kernel):
        return node
    for other in _siblings(node, sysfs):
        try:
            if can_capture(other, kernel):
                return other
        except OSError:
            continue
    raise BadSource(
        f"a node that gives images at {path}",
        "one that gives only metadata, as the second node of a sensor does",
        "run: taxel find",
    )


def can_capture(node: str, kernel: Kernel) -> bool:
    """Return whether a node gives images.

    Raises:
        OSError: It cannot be opened or asked.
    """
    fd = kernel.open(node)
    try:
        return _captures(_about(fd, kernel))
    finally:
        kernel.close(fd)


def usb_serial(node: str, sysfs: Path = SYSFS) -> str:
    """Return a USB camera's serial number; empty where there is none."""
    device = _device(node, sysfs)
    for folder in (device, *device.parents)[:4]:
        file = folder / "serial"
        if file.is_file():
            try:
                return file.read_text("utf-8", "replace").strip()
            except OSError:
                return ""
    return ""


def list_offers(fd: int, kernel: Kernel) -> list[Offer]:
    """Return the codings, sizes and rates of an open node, in the driver's order."""
    offers = []
    for form in _each(kernel, fd, v4l2.ENUM_FMT, v4l2.FormatDescription, type=v4l2.VIDEO_CAPTURE):
        coding = form.pixelformat
        sizes = _each(kernel, fd, v4l2.ENUM_FRAMESIZES, v4l2.FrameSize, pixel_format=coding)
        for size in sizes:
            # A single size lies in a union with a range: its two numbers are the first two.
            width, height = size.steps.min_width, size.steps.max_width
            if size.type != v4l2.DISCRETE:  # a range: its largest is given
                width, height = size.steps.max_width, size.steps.max_height
            rates = _rates(kernel, fd, coding, width, height)
            offers.append(Offer(v4l2.four_letters(coding), width, height, rates))
    return offers


def _rates(kernel: Kernel, fd: int, coding: int, width: int, height: int) -> tuple[float, ...]:
    periods = _each(
        kernel, fd, v4l2.ENUM_FRAMEINTERVALS, v4l2.FrameInterval,
        pixel_format=coding, width=width, height=height,
    )  # fmt: skip
    rates = {
        round(period.steps[0].denominator / period.steps[0].numerator, 3)
        for period in periods
        if period.steps[0].numerator
    }
    return tuple(sorted(rates, reverse=True))


def _each(kernel: Kernel, fd: int, request: int, kind: Any, **fields: int) -> Iterator[Any]:
    """Yield the entries of a list until the driver says that there is no more."""
    for index in range(_MOST):
        entry = kind(index=index, **fields)
        try:
            kernel.ioctl(fd, request, entry)
        except OSError as error:
            if error.errno in (errno.EINVAL, errno.ENOTTY, errno.ENODATA):
                return
            raise
        yield entry


def _ask(node: str, by_id: str, kernel: Kernel, sysfs: Path) -> FoundCamera | None:
    """Return what a node is; None where it gives no images."""
    fd = kernel.open(node)
    try:
        about = _about(fd, kernel)
        if not _captures(about):
            return None
        return FoundCamera(
            path=node,
            by_id=by_id,
            card=about.card.decode("utf-8", "replace"),
            bus=about.bus_info.decode("utf-8", "replace"),
            serial=usb_serial(node, sysfs),
            offers=tuple(list_offers(fd, kernel)),
        )
    finally:
        kernel.close(fd)


def _about(fd: int, kernel: Kernel) -> v4l2.Capability:
    about = v4l2.Capability()
    kernel.ioctl(fd, v4l2.QUERYCAP, about)
    return about


def _captures(about: v4l2.Capability) -> bool:
    """Return whether this very node captures: its sensor as a whole may, and the node not."""
    own = about.capabilities & v4l2.HAS_DEVICE_CAPS
    can = about.device_caps if own else about.capabilities
    return bool(can & v4l2.CAN_CAPTURE and can & v4l2.CAN_STREAM)


def _device(node: str, sysfs: Path) -> Path:
    return Path(os.path.realpath(sysfs / "class" / "video4linux" / Path(node).name / "device"))


def _siblings(node: str, sysfs: Path) -> list[str]:
    """Return the other nodes of the same sensor, by number."""
    folder, own = Path(node).parent, _device(node, sysfs)
    names = [
        entry.name
        for entry in (sysfs / "class" / "video4linux").glob("video*")
        if entry.name != Path(node).name and _device(entry.name, sysfs) == own
    ]
    return [str(folder / name) for name in sorted(names, key=lambda name: (len(name), name))]
