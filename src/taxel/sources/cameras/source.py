"""`camera://`: tactile cameras over Video4Linux2, one capture process each, as a live source.

    camera:///dev/v4l/by-id/left,/dev/v4l/by-id/right?width=640&height=480&rate_hz=25
    camera://0,2?names=left,right                       (a number N is /dev/videoN)

JPEG goes through undecoded. Stamps are the host's monotonic clock, which a real camera cannot be
hurried on: the `clock` of other sources has no say here. Knows nothing about what frames show.
"""

from __future__ import annotations

import math
import os
import select
import sys
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Self

from taxel.errors import BadSource
from taxel.plain_text import number_of
from taxel.recordings.manifest import NO_ARRAY
from taxel.signals import FOUND, GRASPS, CameraInfo, Frame, Mark, Samples, SensorInfo
from taxel.sources.cameras.capture import CameraGiven, CameraRequest, CaptureFactory
from taxel.sources.cameras.link import CameraLedger, CameraLink

WIDTH_PX, HEIGHT_PX = 640, 480
"""Asked for unless the address says otherwise. Source: our choice, docs/decisions/0015."""
_LOOK_S = 0.05
"""Longest wait while a capture process is missing, so that it is started again in time."""
_LIMITS = {"width": (16, 8192), "height": (16, 8192), "rate_hz": (1, 1000)}
_OPTIONS = (*_LIMITS, "names", "mm_per_px", GRASPS)


@dataclass(frozen=True, slots=True, kw_only=True)
class CamerasChoice:
    """What an address asks for."""

    paths: tuple[str, ...]
    names: tuple[str, ...]
    """One a camera."""
    width: int = WIDTH_PX
    height: int = HEIGHT_PX
    rate_hz: float | None = None
    """None takes the rate that the camera has by itself."""
    mm_per_px: tuple[float | None, ...]
    """One a camera."""
    finds_grasps: bool = False
    """Find each grasp's start in the images, which begin with untouched gels."""


class Cameras:
    """One or more tactile cameras; a `Source` without an array.

    Each camera has its own process, so that one that stalls cannot stop the other. The frame
    rate is measured while it is opened: `CameraInfo.rate_hz` is what came, `details` say what
    was asked for and promised.

    Args:
        name: Device nodes joined by commas.
        options: As in the address: width, height (px), rate_hz, names, mm_per_px.
        factory: Makes the devices; the real ones unless given.

    Raises:
        BadSource: An option is wrong, or a camera is missing or gives something else.
    """

    def __init__(
        self, name: str, options: dict[str, str], factory: CaptureFactory | None = None
    ) -> None:
        if sys.platform != "linux":
            raise BadSource("Linux for camera://", sys.platform, "record there, replay here")
        if factory is None:
            from taxel.sources.cameras.v4l2 import open_v4l2

            factory = open_v4l2
        choice = parse_cameras(name, options)
        self._links: list[CameraLink] = []
        with ExitStack() as undo:
            undo.callback(self._close)
            for number, (path, camera_name) in enumerate(
                zip(choice.paths, choice.names, strict=True)
            ):
                request = CameraRequest(
                    path=path, width=choice.width, height=choice.height, rate_hz=choice.rate_hz
                )
                self._links.append(CameraLink(number, camera_name, request, factory))
            # One after another, so that the camera for which the bus has no room is named ...
            given = [link.open() for link in self._links]
            serials = [camera.serial for camera in given]
            for link, serial in zip(self._links, serials, strict=True):
                link.begin(serials.count(serial) > 1)  # ... and measured side by side, as they run
            self._cameras = tuple(
                _info(number, choice, given[number], link.measured())
                for number, link in enumerate(self._links)
            )
            for link in self._links:
                link.fresh()
            undo.pop_all()

    @property
    def info(self) -> SensorInfo:
        return NO_ARRAY

    @property
    def cameras(self) -> tuple[CameraInfo, ...]:
        return self._cameras

    @property
    def ended(self) -> bool:
        """True once closed: a camera that is gone may come back."""
        return not self._links

    def read(self, timeout_s: float = 0.1) -> Samples:
        """Wait for a frame of any camera, at most `timeout_s` seconds; there are no scans."""
        poll = select.poll()
        for link in self._links:
            if link.bell >= 0:
                poll.register(link.bell, select.POLLIN)
            else:
                timeout_s = min(timeout_s, _LOOK_S)
        if self._links:
            poll.poll(max(0.0, timeout_s) * 1e3)
        for link in self._links:
            link.silence()
        return Samples.empty(0)

    def frames(self) -> list[Frame]:
        """Return the frames since the last call, oldest first; never waits.

        Of a camera that nobody asks for long only the newest half second is kept.
        """
        found = [frame for link in self._links for frame in link.frames()]
        return sorted(found, key=lambda frame: frame.fitted_s)

    def marks(self) -> list[Mark]:
        return []

    def ledgers(self) -> tuple[CameraLedger, ...]:
        """Return each camera's ledger so far; empty once closed."""
        return tuple(link.ledger() for link in self._links)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._close()

    def _close(self) -> None:
        links, self._links = self._links, []
        for link in links:
            link.close()


def parse_cameras(name: str, options: dict[str, str]) -> CamerasChoice:
    """Return what an address asks for.

    Raises:
        BadSource: An option is unknown, of the wrong kind or outside its limits, or a camera is
            named twice.
    """
    for key in options:
        if key not in _OPTIONS:
            raise BadSource(
                f"options of camera:// among {', '.join(_OPTIONS)}", repr(key), "mend the address"
            )
    paths = tuple(f"/dev/video{part}" if part.isdecimal() else part for part in name.split(","))
    if not all(paths) or len({os.path.realpath(path) for path in paths}) < len(paths):
        raise BadSource(
            "each camera's device once, joined by commas", repr(name), "run: taxel find"
        )
    count = len(paths)
    if options.get(GRASPS, FOUND) != FOUND:
        raise _bad(GRASPS, f"{FOUND!r}, or left out", options[GRASPS])
    return CamerasChoice(
        paths=paths,
        names=_names(options.get("names"), count),
        width=int(_number("width", options.get("width", str(WIDTH_PX)), whole=True)),
        height=int(_number("height", options.get("height", str(HEIGHT_PX)), whole=True)),
        rate_hz=_number("rate_hz", options["rate_hz"]) if "rate_hz" in options else None,
        mm_per_px=_sizes(options.get("mm_per_px"), count),
        finds_grasps=GRASPS in options,
    )


def _names(text: str | None, count: int) -> tuple[str, ...]:
    """Return a name a camera: those given, or left and right where there are two."""
    if text is None:
        few = {1: ("camera",), 2: ("left", "right")}
        return few.get(count) or tuple(f"camera-{number + 1}" for number in range(count))
    names = tuple(part.strip() for part in text.split(","))
    sound = all(name and name.replace("-", "").replace("_", "").isalnum() for name in names)
    if len(names) != count or len(set(names)) < count or not sound:
        raise _bad("names", f"{number_of(count, 'different word')} joined by commas", text)
    return names


def _sizes(text: str | None, count: int) -> tuple[float | None, ...]:
    """Return each camera's pixel size, millimetres, from one number for all or one for each."""
    if text is None:
        return (None,) * count
    try:
        sizes = tuple(float(part) for part in text.split(","))
    except ValueError:
        sizes = ()
    if len(sizes) not in (1, count) or not all(0 < size < math.inf for size in sizes):
        raise _bad("mm_per_px", "one number above 0, or one a camera joined by commas", text)
    return sizes if len(sizes) == count else sizes * count


def _number(key: str, text: str, whole: bool = False) -> float:
    low, high = _LIMITS[key]
    try:
        value = int(text) if whole else float(text)
    except ValueError:
        value = math.nan
    if not low <= value <= high:
        raise _bad(key, f"a {'whole ' * whole}number within {low} and {high}", text)
    return value


def _bad(key: str, needed: str, got: str) -> BadSource:
    return BadSource(f"{key} of camera:// as {needed}", repr(got), "mend the address")


def _info(
    number: int, choice: CamerasChoice, given: CameraGiven, measured: tuple[float, float]
) -> CameraInfo:
    """Return a camera's description: measured size and rates, and those asked for and promised."""
    rate_hz, images_hz = measured

    def shown(rate: float | None) -> str:
        return "" if rate is None else f"{rate:.4g}"

    return CameraInfo(
        name=choice.names[number],
        width=given.width,
        height=given.height,
        rate_hz=round(rate_hz, 3),
        mm_per_px=choice.mm_per_px[number],
        serial=given.serial,
        details={
            "path": choice.paths[number],
            "node": given.node,
            "card": given.card,
            "bus": given.bus,
            "pixel_format": given.pixel_format,
            "asked_hz": shown(choice.rate_hz),
            "given_hz": shown(given.rate_hz),
            "measured_hz": shown(rate_hz),
            "measured_images_hz": shown(images_hz),
        }
        | ({GRASPS: FOUND} if choice.finds_grasps else {}),
    )
