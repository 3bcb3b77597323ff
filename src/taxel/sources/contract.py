"""What every source gives: samples and frames as they come, and the marks that belong to them.

Knows nothing about any one sensor.
"""

from __future__ import annotations

from types import TracebackType
from typing import Any, Protocol, Self, runtime_checkable

from taxel.signals import CameraInfo, Frame, Mark, Samples, SensorInfo


class Source(Protocol):
    """A sensor array, tactile cameras, or both, open. Use it in a `with` block.

    `read` states its freshness: it returns all scans that came since the last
    call, each exactly once and oldest first, and waits at most `timeout_s` for
    the first of them.
    """

    @property
    def info(self) -> SensorInfo:
        """What the array is."""
        ...

    @property
    def cameras(self) -> tuple[CameraInfo, ...]:
        """The tactile cameras, in the order of `Frame.camera`; none for a plain array."""
        ...

    @property
    def ended(self) -> bool:
        """True when no scan will ever come again, as at the end of a replay."""
        ...

    def read(self, timeout_s: float = 0.1) -> Samples:
        """Return the scans since the last call; none after `timeout_s` seconds of silence.

        Where there are cameras it also returns, with or without scans, when a frame came.
        """
        ...

    def frames(self) -> list[Frame]:
        """Return the frames that came since the last call, oldest first; never waits."""
        ...

    def marks(self) -> list[Mark]:
        """Return the marks that were completed since the last call (simulators and replays)."""
        ...

    def __enter__(self) -> Self: ...

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None: ...


@runtime_checkable
class WithBoards(Protocol):
    """A source that is read from boards and keeps a ledger of each."""

    def boards(self) -> list[dict[str, Any]]:
        """Return one ledger a board, in the order of the paths."""
        ...


def board_ledgers(source: Source) -> list[dict[str, Any]]:
    """Return one ledger a board of this source; none where it has no boards."""
    return source.boards() if isinstance(source, WithBoards) else []
