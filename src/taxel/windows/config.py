"""How samples become windows: the time grid, the gate, the length and the layout.

This is the one place where the common time grid is defined. Knows nothing
about samples' values, files or models.

Background of our choices: docs/decisions/0003.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from taxel.foreign.records import own_numbers

GRID_RATE_HZ = 100.0
"""Rows a second of an array window; 12 rows span 120 ms. Source: our choice
(the thesis does not say), docs/decisions/0003."""
LARGEST_AGE_S = 0.030
"""A value older than this is stale, seconds. Source: our choice, docs/decisions/0003."""
LARGEST_AGE_PERIODS = 3.0
"""Or so many periods of the sensor's own rate, where these last longer: as many as 30 ms are on the
grid of 100 Hz, so that a lost scan or a late one leaves no window out. Source: as above."""
SLOW_GRID = 1 / 3
"""A grid below this share of the sensor's own rate is said to be slow. Source: our choice."""
MOST_RATE_CHANGE = 1.25
"""Where a sensor's own scans are rows, recordings' rates may differ by this factor, as `live`
allows: beyond it a window lasts another time. Source: our choice."""
MOST_FILLED = 0.25
"""Largest share of a window's values that are filled in, 0…1. Source: our choice, so that a tenth
of lost scans silences hardly a window of 75 rows, docs/decisions/0040."""
GATE_V = 1.55
"""Contact threshold, volts. Source: TENG thesis, section 3.5.1."""
FULL_SCALE_V = 3.3
"""Largest voltage, for scaling to 0…1. Source: TENG thesis, section 3.6.1."""

WAVELET = "db2"
"""Wavelet to denoise by where one is asked for: the shortest that takes a slope for signal
and not for noise. Source: our choice, docs/decisions/0024."""


def largest_age_s(rate_hz: float) -> float:
    """Return when a value is too old for a row of the grid, seconds.

    Args:
        rate_hz: The sensor's own rate, hertz; 0 where it is not known.
    """
    return max(LARGEST_AGE_S, LARGEST_AGE_PERIODS / rate_hz if rate_hz > 0 else 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class WindowConfig:
    """What a window is. Saved with every run and inside every bundle."""

    steps: int = 12
    """Rows in a window."""
    stride: int = 12
    """Rows from one window's start to the next; equal to `steps` means no overlap."""
    grid_hz: float | None = GRID_RATE_HZ
    """Rate of the common time grid, hertz; None takes the sensor's own scans as rows.
    A sensor whose nominal rate is the grid's gives its scans as rows too."""
    max_age_s: float | None = None
    """A value older than this at a row's time is not used, seconds. None: `largest_age_s` of the
    sensor's own rate; data sets state it by their recordings' usual one, and bundles store that."""
    gate: float | None = None
    """Only rows with a channel above this count, in the channels' unit; None takes all."""
    gate_follow_s: float | None = None
    """Each channel's gate follows its rest and noise, measured over so many of the last seconds
    (`following.py`); None keeps the gate as it is. Source: TENG thesis, section 4.3; 0047."""
    subtract: str | None = None
    """Name of a channel that touches nothing: row by row it is taken from all channels, before the
    gate; its own column becomes 0. None subtracts nothing. Source: thesis, section 2.6; 0047."""
    max_gap_s: float = 0.8
    """Rows further apart than this never share a window, seconds."""
    layout: Literal["A", "B"] = "B"
    """B: a window is `steps` whole scans. A: `steps` × channels single values in a row
    that are each above the gate, whatever channel they came from (kept for comparison)."""
    pad: bool = False
    """True: a stretch shorter than a window gives one window, padded and masked."""
    tare: bool = False
    """True: the window's first row is taken from all its rows."""
    channels: tuple[str, ...] | None = None
    """Names of the channels to take, in this order; None takes all."""
    wavelet: str | None = None
    """Name of the wavelet that each channel of a finished window is denoised by, such as
    "db2"; needs PyWavelets. None leaves windows as they are."""
    segment: float | None = None
    """Values of a finished window that are not above this are background and set to 0, in the
    channels' unit, for channels that rest at 0; after the wavelet, before `tare`. None keeps
    all."""

    fill: float = MOST_FILLED
    """Short gaps of a window (`gaps.py`) are filled in where at most this share of its values is
    missing, stale or NaN, 0…1; past it the window stays unusable. 0 fills none. Layout B only."""
    reference: str | None = None
    """Reference touches, "KEY=VALUE:COUNT" such as "object=cylinder-glass:3": a data set's
    sessions are each brought to one level by their first touches of a known object, which are
    then left out; a bundle is brought to a new session by taxel adapt. None takes values as
    they are. Source: our choice, docs/decisions/0026."""
    level_follow: str | None = None
    """"KEY:TOUCHES" such as "session:10": each touch's channels are scaled by the level of its
    session's earlier touches, beside which the usual level counts as much as so many; `level_follow
    .py`. None takes values as they are. Source: our choice, docs/decisions/0061."""

    def __post_init__(self) -> None:
        own_numbers(self)
        if self.layout not in ("A", "B"):
            raise ValueError(f"needed layout A or B; got {self.layout!r}")
        if self.grid_hz is not None and not 0 < self.grid_hz < math.inf:
            raise ValueError(f"needed a grid above 0 Hz, or None; got {self.grid_hz}")
        if self.channels is not None and not self.channels:
            raise ValueError("needed at least one channel, or None for all; got none")
        if self.steps < 1 or self.stride < 1:
            raise ValueError(
                f"needed steps and stride of at least 1; got {self.steps} and {self.stride}"
            )
        if self.layout == "A" and self.gate is None:
            raise ValueError("needed a gate for layout A; got None")
        if self.gate_follow_s is not None and not (self.gate_follow_s > 0 and (self.gate or 0) > 0):
            raise ValueError(
                f"needed a gate above 0 to follow, over more than 0 s; got {self.gate} and "
                f"{self.gate_follow_s} s"
            )
        if self.layout == "A" and self.wavelet is not None:
            raise ValueError("needed layout B for a wavelet: in A a column is no channel; got A")
        if not 0.0 <= self.fill < 1.0:
            raise ValueError(f"needed a share of at least 0 and below 1 for fill; got {self.fill}")
        if self.level_follow is not None and (self.layout == "A" or self.reference is not None):
            other = "layout B" if self.layout == "A" else "no reference touches"
            raise ValueError(f"needed {other} where levels follow; got {self.level_follow!r}")
        if self.segment is not None and not math.isfinite(self.segment):
            raise ValueError(f"needed a finite level for segment; got {self.segment}")


TENG_WINDOW = WindowConfig(gate=GATE_V)
"""The thesis's window: 12 scans × 12 sensors above 1.55 V (sections 3.5.1 and 3.6.1)."""
