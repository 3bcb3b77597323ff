"""A screen of raw touch: a trace a channel, the array's map, the last rows; no model.

Knows nothing about sources or files.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from taxel.plain_text import number_of, short_names, visible
from taxel.signals import Samples, SensorInfo, Validity
from taxel.views.terminal import (
    array_map,
    hand_fingers,
    heat_map,
    short_number,
    sparkline,
)
from taxel.views.trace_buffer import TraceBuffer, measured_rate_hz, span_s, usable_values

_KEPT_S = 4.0
"""Seconds of trace on the screen; more for slow arrays."""
_IMAGE_ROWS = 12
"""Rows of the image, as many as a window of the thesis has."""
_ROW_HZ = 100.0
"""Rows a second of the image, as in windows (docs/decisions/0003)."""
_WIDE_CHANNELS = 16
"""Up to this many channels the image has square pixels; above, narrow ones."""
_SIDE = 34
"""Most characters for the map and the image."""
_NAME = 15
"""Most characters of a channel's name."""
_LEAST_SPARK, _MOST_SPARK = 10, 80
"""Characters of a trace."""


class TraceScreen:
    """Collects samples and draws them.

    Args:
        info: The array.
    """

    def __init__(self, info: SensorInfo) -> None:
        self._info = info
        self._names = [visible(name) for name in info.channels]
        self._units = [visible(unit) for unit in info.units]
        self.buffer = TraceBuffer(info, span_s(info, _KEPT_S))

    def add(self, samples: Samples) -> None:
        """Take in new scans."""
        self.buffer.add(samples)

    def render(self, width: int, height: int = 24) -> RenderableType:
        """Return the screen for a terminal of some size, in characters."""
        kept = self.buffer.kept
        if not len(kept):
            return Text(f"{visible(self._info.name)}: no scans yet", style="dim")
        low, high = self.buffer.scale()
        grid = Table.grid(padding=(0, 2))
        room = width - _SIDE - 2
        traces = self._traces(kept, (low, high), room, height - 4)
        grid.add_row(traces, self._side(kept, (low, high)))
        return Group(self._headline(kept), self._health(), grid)

    def summary(self) -> list[str]:
        """Return plain lines for where there is no terminal."""
        lines = [self._headline(self.buffer.kept).plain, self._health().plain]
        for channel in self.buffer.ranges():
            name = f"  {visible(channel.name):<18}"
            if not np.isfinite(channel.most):
                lines.append(f"{name} no usable value")
                continue
            lines.append(
                f"{name} {channel.least:10.3f} … {channel.most:10.3f} {visible(channel.unit)}, "
                f"now {channel.latest:.3f}".replace("now nan", "now not usable")
            )
        return lines

    def _headline(self, kept: Samples) -> Text:
        info, rate_hz = self._info, measured_rate_hz(kept)
        text = Text(no_wrap=True, overflow="ellipsis")
        text.append(visible(info.name), "bold")
        text.append(f" {visible(info.serial)}" if info.serial else "", "dim")
        measured = f"{rate_hz:.1f}" if np.isfinite(rate_hz) else "–"
        text.append(f"  {measured} scans/s")
        text.append(f" (nominal {info.rate_hz:g})", "dim")
        text.append(f"  {number_of(self.buffer.scans, 'scan', ',')}")
        return text

    def _health(self) -> Text:
        lost, flags = self.buffer.lost, self.buffer.flags
        text = Text(no_wrap=True, overflow="ellipsis")
        text.append(f"{lost:,} lost", "bold red" if lost else "green")
        text.append("  ")
        if not flags:
            text.append("all values good", "green")
        words = ", ".join(
            f"{name} in {number_of(count, 'scan', ',')}" for name, count in flags.items()
        )
        text.append(words if flags else "", "yellow")
        return text

    def _traces(
        self,
        kept: Samples,
        scale: tuple[NDArray[np.float32], NDArray[np.float32]],
        room: int,
        rows: int,
    ) -> Table:
        """Return as many traces as fit, in columns side by side where one is too tall."""
        count = len(self._info.channels)
        name_width = min(_NAME, max(map(len, self._names)))
        unit_width = max(map(len, self._units))
        fixed = name_width + unit_width + 11
        most_columns = max(1, room // (fixed + _LEAST_SPARK))
        columns = min(most_columns, -(-count // max(rows, 1)))
        shown = min(count, columns * max(rows - 1, 1) if count > columns * rows else count)
        tall = -(-shown // columns)
        spark = int(np.clip(room // columns - fixed, _LEAST_SPARK, _MOST_SPARK))
        cells = self._cells(kept, spark)
        lines = [
            self._trace(column, cells[:, column], kept, scale, (name_width, spark, unit_width))
            for column in range(shown)
        ]
        table = Table.grid(padding=(0, 2, 0, 0))
        for row in range(tall):
            table.add_row(*lines[row::tall])
        if shown < count:
            table.add_row(Text(f"and {count - shown} more", style="dim"))
        return table

    def _trace(
        self,
        column: int,
        cells: NDArray[np.float32],
        kept: Samples,
        scale: tuple[NDArray[np.float32], NDArray[np.float32]],
        widths: tuple[int, int, int],
    ) -> Text:
        name_width, spark, unit_width = widths
        name = self._names[column]
        if len(name) > name_width:
            name = name[: name_width - 1] + "…"
        value = float(usable_values(kept[-1:])[0, column])
        saturated = bool(kept.validity[-1, column] & np.uint8(Validity.SATURATED))
        low, high = float(scale[0][column]), float(scale[1][column])
        text = Text(no_wrap=True)
        text.append(f"{name:<{name_width}} ")
        text.append(sparkline(cells, spark, low, high), "cyan")
        text.append(f" {short_number(value):>6}", "bold red" if saturated else "bold")
        text.append(f" {self._units[column]:<{unit_width}}", "dim")
        return text

    def _side(
        self, kept: Samples, scale: tuple[NDArray[np.float32], NDArray[np.float32]]
    ) -> RenderableType:
        parts: list[RenderableType] = []
        fingers = hand_fingers(self._info.channels)
        parts.append(Text("now, distal on top" if fingers else "now", style="dim"))
        if fingers:
            heads = "".join(f"{finger:<7}" for finger in short_names(fingers, 6))
            parts.append(Text(heads.rstrip(), style="dim", no_wrap=True))
        parts.append(array_map(usable_values(kept[-1:])[0], *scale))
        image = _image(kept, self._info.rate_hz)
        low, high = scale
        if image.shape[1] > _SIDE:
            image, low, high = _narrowed(image, scale)
        across = "sensors across" if len(self._info.channels) <= _SIDE else "sensors in groups"
        parts.append(Text())
        parts.append(Text(f"{across}, last {self._span()}", style="dim"))
        parts.append(heat_map(image, low, high, 2 if image.shape[1] <= _WIDE_CHANNELS else 1))
        return Group(*parts)

    def _cells(self, kept: Samples, width: int) -> NDArray[np.float32]:
        """Return the largest usable value of each cell of time, shape (at most width, channels).

        Cells lie on fixed moments, so that a trace moves on without flickering.
        """
        cell_s = self.buffer.kept_s / width
        if self._info.rate_hz > 0:
            cell_s = max(cell_s, 1.0 / self._info.rate_hz)
        count = min(width, max(1, round(self.buffer.kept_s / cell_s)))
        place = np.floor(kept.fitted_s / cell_s).astype(np.int64)
        index = place - place[-1] + count - 1
        inside = index >= 0
        cells = np.full((count, kept.values.shape[1]), np.nan, np.float32)
        np.fmax.at(cells, index[inside], usable_values(kept)[inside])
        return cells

    def _span(self) -> str:
        """Return how long the image's rows take, where the array's rate is known."""
        rate_hz = min(_ROW_HZ, self._info.rate_hz)
        return f"{_IMAGE_ROWS / rate_hz:.2g} s" if rate_hz > 0 else f"{_IMAGE_ROWS} scans"


def _image(kept: Samples, rate_hz: float) -> NDArray[np.float32]:
    """Return the latest rows at the windows' rate, oldest on top, shape (rows, channels)."""
    every = max(1, round(rate_hz / _ROW_HZ))
    rows = usable_values(kept)[::-1][::every][:_IMAGE_ROWS][::-1]
    image = np.full((_IMAGE_ROWS, rows.shape[1]), np.nan, np.float32)
    image[_IMAGE_ROWS - len(rows) :] = rows
    return image


def _narrowed(
    image: NDArray[np.float32], scale: tuple[NDArray[np.float32], NDArray[np.float32]]
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """Merge neighbouring columns by their largest share, so that the image fits; scale 0…1."""
    shares = (image - scale[0]) / np.maximum(scale[1] - scale[0], np.float32(1e-9))
    groups = np.array_split(np.arange(shares.shape[1]), _SIDE)
    merged = np.stack([np.fmax.reduce(shares[:, group], axis=1) for group in groups], axis=1)
    return merged, np.zeros(_SIDE, np.float32), np.ones(_SIDE, np.float32)
