"""A screen of raw touch: a trace a channel, the array's map, the last rows; no model.

Knows nothing about sources or files.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from taxel.signals import UNUSABLE, Samples, SensorInfo, Validity
from taxel.views.terminal import array_map, heat_map, sparkline

_KEPT_S = 4.0
"""Seconds of trace on the screen."""
_IMAGE_ROWS = 12
_MOST_TRACES = 24


class TraceScreen:
    """Collects samples and draws them.

    Args:
        info: The array.
        row_hz: Rows a second of the image on the right.
    """

    def __init__(self, info: SensorInfo, row_hz: float = 100.0) -> None:
        self._info = info
        self._every = max(1, round(info.rate_hz / row_hz))
        self._kept: Samples = Samples.empty(len(info.channels))
        self._low = np.zeros(len(info.channels), np.float32)
        self._high = np.full(len(info.channels), info.full_scale or 0.0, np.float32)
        self.scans = 0
        self.lost = 0
        self._last_counter: int | None = None
        self._flags = {flag: 0 for flag in Validity if flag}

    def add(self, samples: Samples) -> None:
        """Take in new scans."""
        if not len(samples):
            return
        counter = samples.counter
        before = counter[0] if self._last_counter is None else self._last_counter + 1
        steps = np.diff(counter, prepend=before - 1) - 1
        self.lost += int(steps[steps > 0].sum()) if counter[0] >= 0 else 0
        self._last_counter = int(counter[-1])
        self.scans += len(samples)
        for flag in self._flags:
            self._flags[flag] += int(((samples.validity & np.uint8(flag)) != 0).any(axis=1).sum())
        joined = Samples.join([self._kept, samples])
        self._kept = joined[joined.fitted_s > joined.fitted_s[-1] - _KEPT_S]
        shown = np.where(samples.usable, samples.values, np.nan)
        if np.isfinite(shown).any():
            self._low = np.fmin(self._low, np.nanmin(shown, axis=0, initial=np.inf))
            self._high = np.fmax(self._high, np.nanmax(shown, axis=0, initial=-np.inf))

    @property
    def rate_hz(self) -> float:
        """Measured rate of the scans on the screen, hertz; NaN for fewer than two."""
        time_s = self._kept.fitted_s
        span_s = float(time_s[-1] - time_s[0]) if len(time_s) > 1 else 0.0
        return (len(time_s) - 1) / span_s if span_s > 0 else float("nan")

    def render(self, width: int) -> RenderableType:
        """Return the screen for a terminal of some width."""
        if not len(self._kept):
            return Text("no scans yet")
        side = Group(
            Text("now" + (": fingers across, distal on top" if self._twelve else "")),
            array_map(self._now(), *self._range()),
            Text(f"\nlast {_IMAGE_ROWS} rows at 100 Hz, oldest on top"),
            heat_map(self._rows(), *self._range()),
        )
        grid = Table.grid(padding=(0, 2))
        grid.add_row(self._traces(width), side)
        return Group(self._headline(), grid)

    def summary(self) -> list[str]:
        """Return plain lines for where there is no terminal."""
        values = np.where(self._kept.usable, self._kept.values, np.nan)
        lines = [self._headline().plain]
        for column, name in enumerate(self._info.channels):
            own = values[:, column]
            if not np.isfinite(own).any():
                lines.append(f"  {name:<18} no usable value")
                continue
            lines.append(
                f"  {name:<18} {np.nanmin(own):10.3f} … {np.nanmax(own):10.3f} "
                f"{self._info.units[column]}"
            )
        return lines

    @property
    def _twelve(self) -> bool:
        return len(self._info.channels) == 12

    def _headline(self) -> Text:
        info = self._info
        flags = ", ".join(
            f"{count} {str(flag.name).lower().replace('_', ' ')}"
            for flag, count in self._flags.items()
            if count
        )
        return Text(
            f"{info.name} ({info.serial or 'no serial number'}): {self.scans:,} scans, "
            f"{self.rate_hz:.1f} Hz measured ({info.rate_hz:g} nominal), {self.lost} lost"
            + (f", scans with values {flags}" if flags else "")
        )

    def _traces(self, width: int) -> Table:
        table = Table.grid(padding=(0, 1))
        values = self._kept.values
        room = max(16, width - 82)
        for column, name in enumerate(self._info.channels[:_MOST_TRACES]):
            low, high = float(self._low[column]), float(self._high[column])
            usable = bool((self._kept.validity[-1, column] & np.uint8(UNUSABLE)) == 0)
            now = f"{values[-1, column]:8.2f}" if usable else "       –"
            line = sparkline(values[:, column], room, low, high)
            table.add_row(name, Text(line, style="cyan"), f"{now} {self._info.units[column]}")
        hidden = len(self._info.channels) - _MOST_TRACES
        if hidden > 0:
            table.add_row(f"and {hidden} more", "", "")
        return table

    def _now(self) -> NDArray[np.float32]:
        usable = self._kept.usable[-1]
        return np.where(usable, self._kept.values[-1], np.float32(np.nan))

    def _rows(self) -> NDArray[np.float32]:
        rows = self._kept[:: self._every][-_IMAGE_ROWS:] if len(self._kept) else self._kept
        return np.where(rows.usable, rows.values, np.float32(np.nan))

    def _range(self) -> tuple[float, float]:
        return float(self._low.min()), float(self._high.max())
