"""What one board sent, lost and went through, counted; and its scans as they pass on.

Knows nothing about ports or frames.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(slots=True)
class Scans:
    """Scans of one board, oldest first. Arrays share their first axis."""

    seq: NDArray[np.int64]
    """Shape (n,): the board's count, unwrapped; rising."""
    device_s: NDArray[np.float64]
    """Shape (n,): the board's clock, seconds since its boot; NaN where it has none."""
    arrival_s: NDArray[np.float64]
    """Shape (n,): host monotonic, seconds."""
    fitted_s: NDArray[np.float64]
    """Shape (n,): when taken, host monotonic, seconds."""
    values: NDArray[np.float32]
    """Shape (n, channels), in the channels' unit."""
    flags: NDArray[np.uint8]
    """Shape (n, channels): `Validity` flags."""
    boot: int
    """Which boot these scans belong to, from 0: seq and device_s begin anew with each."""


@dataclass(slots=True, kw_only=True)
class BoardLedger:
    """Counts of one board's scans: recorded, lost and repeated.

    Scans due since its hello = scans + lost + lost_away; rows that hold its values =
    scans + repeated − early − late − skipped, once all rows were read.
    """

    path: str
    board: int = 0
    """The number that the board gives itself."""
    board_id: str = ""
    firmware: str = ""
    state: str = "connecting"
    """connecting, running, silent (open, and nothing comes), away (the port is gone), or
    refused (another board, or another setting, than at the start)."""
    scans: int = 0
    """Scans received."""
    lost: int = 0
    """Scans that the board's count says were due, and that never came, while it was connected."""
    lost_away: int = 0
    """The same, while the port was gone and the board ran on."""
    early: int = 0
    """Scans received before the first row, while the source was being opened."""
    late: int = 0
    """Scans that came after their row had been given: received, and not in the samples."""
    repeated: int = 0
    """Rows in which this board's scan stands a second time, since its clock is slower."""
    skipped: int = 0
    """Scans left out, since this board's clock is faster than that of the first board."""
    dropped: int = 0
    """Scans that the board says it took and could not send, since its boot."""
    bad: dict[str, int] = field(default_factory=dict)
    """Reason → frames or lines thrown away."""
    reconnects: int = 0
    """Times that the port vanished and came back."""
    reboots: int = 0
    """Times that the board started anew."""
    clock_ppm: float = float("nan")
    """How much slower the board's clock runs than the host's, parts per million; NaN for the
    first seconds."""
    received_bytes: int = 0
    overrun: int = 0
    """Chunks of bytes dropped since nobody read for a minute."""

    def losses(self) -> str:
        """Return in words what of its scans is not in the rows; empty where that is none."""
        found = {
            "lost": self.lost, "lost while its port was gone": self.lost_away,
            "too late for their rows (late_ms= sets how long these wait)": self.late,
            "not sent by the board": self.dropped,
            "damaged lines or messages": sum(n for why, n in self.bad.items() if why != "text"),
            "reconnects": self.reconnects, "restarts": self.reboots,
        }  # fmt: skip
        return ", ".join(f"{count} {what}" for what, count in found.items() if count)

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain values, for a page or a report, with its losses in words."""
        return asdict(self) | {"losses": self.losses()}


class ClockRate:
    """How fast a board's clock runs, from fitted times half a second apart, over 30 s."""

    _STEP_S = 0.5
    _SPAN_S = 30.0
    _LEAST_S = 2.0

    def __init__(self) -> None:
        self._points: list[tuple[float, float]] = []

    def add(self, device_s: float, fitted_s: float) -> float:
        """Take in one scan; return parts per million that the clock is slow, NaN at first."""
        points = self._points
        if not points or device_s - points[-1][0] >= self._STEP_S:
            points.append((device_s, fitted_s))
            if device_s - points[0][0] > self._SPAN_S:
                points.pop(0)
        first_device_s, first_fitted_s = points[0]
        span_s = device_s - first_device_s
        if span_s < self._LEAST_S:
            return float("nan")
        return ((fitted_s - first_fitted_s) / span_s - 1.0) * 1e6
