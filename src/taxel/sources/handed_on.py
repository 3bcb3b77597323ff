"""Another source, handed on: its frames seen on the way, or its scans turned into other units."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Self

from taxel.signals import CameraInfo, Frame, Mark, Samples, SensorInfo
from taxel.sources.contract import Source


class HandedOn:
    """Hands on another source; closes nothing.

    Args:
        source: What is read.
        see: Called with the cameras and the frames of each read; must not wait.
        info: What the array is once its scans are turned; the source's unless given.
        turn: Returns the scans of each read as they are handed on.
    """

    def __init__(
        self,
        source: Source,
        *,
        see: Callable[[Sequence[CameraInfo], Sequence[Frame]], None] = lambda cameras, frames: None,
        info: SensorInfo | None = None,
        turn: Callable[[Samples], Samples] = lambda samples: samples,
    ) -> None:
        self._source, self._see, self._info, self._turn = source, see, info, turn

    @property
    def info(self) -> SensorInfo:
        return self._info or self._source.info

    @property
    def cameras(self) -> tuple[CameraInfo, ...]:
        return self._source.cameras

    @property
    def ended(self) -> bool:
        return self._source.ended

    def read(self, timeout_s: float = 0.1) -> Samples:
        return self._turn(self._source.read(timeout_s))

    def frames(self) -> list[Frame]:
        found = self._source.frames()
        if found:
            self._see(self._source.cameras, found)
        return found

    def marks(self) -> list[Mark]:
        return self._source.marks()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Whoever opened the source closes it."""
