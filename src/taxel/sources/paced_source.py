"""A source that a pacer lets out: what replays and simulators share. Knows no stream of its own."""

from __future__ import annotations

from collections.abc import Callable
from typing import Self

from taxel.signals import CameraInfo, Frame, Mark, Samples, SensorInfo
from taxel.sources.pacing import Pacer


class PacedSource:
    """A `Source` whose scans, frames and marks come from a pacer.

    Args:
        info: What the array is.
        cameras: Those whose frames the pacer gives.
        pacer: The stream, at its speed.
        close: Called once the pacer is closed.
    """

    def __init__(
        self,
        info: SensorInfo,
        cameras: tuple[CameraInfo, ...],
        pacer: Pacer,
        close: Callable[[], None] = lambda: None,
    ) -> None:
        self._info, self._cameras, self._pacer, self._close = info, cameras, pacer, close

    @property
    def info(self) -> SensorInfo:
        return self._info

    @property
    def cameras(self) -> tuple[CameraInfo, ...]:
        return self._cameras

    @property
    def ended(self) -> bool:
        return self._pacer.ended

    def begin(self) -> None:
        """Let the stream begin now instead of at opening; nothing may have been read yet."""
        self._pacer.begin()

    def read(self, timeout_s: float = 0.1) -> Samples:
        return self._pacer.read(timeout_s)

    def frames(self) -> list[Frame]:
        return self._pacer.frames()

    def marks(self) -> list[Mark]:
        return self._pacer.marks()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._pacer.close()
        self._close()
