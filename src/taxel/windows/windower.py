"""Cut samples into windows: the same code for whole recordings and for live streams.

Knows nothing about files, labels, splits or models.
"""

from __future__ import annotations

from collections.abc import Iterable
from copy import copy
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from taxel.signals import UNUSABLE, Samples, SensorInfo, Validity
from taxel.windows.config import WindowConfig, largest_age_s
from taxel.windows.denoise import cleaner
from taxel.windows.following import GateFollower, GateMove
from taxel.windows.gaps import fill_gaps
from taxel.windows.gate import above_gate
from taxel.windows.grid import Grid, Rows

_Kind = TypeVar("_Kind", bound=np.generic)
_UNUSABLE, _SATURATED = np.uint8(UNUSABLE), np.uint8(Validity.SATURATED)

_NONE_FILLED = np.zeros(0, np.float32)


@dataclass(frozen=True, slots=True)
class Windows:
    """Windows of touch, oldest first."""

    values: NDArray[np.float32]
    """Shape (n, steps, channels), rows oldest first, in the channels' units; 0 where
    a row is padding or a value not usable."""
    mask: NDArray[np.bool_]
    """Shape (n, steps): True where the row was measured, False where it is padding."""
    usable: NDArray[np.float32]
    """Shape (n,): share of the measured rows' values that may be used, 0…1, before any is
    filled in."""
    saturated: NDArray[np.float32]
    """Shape (n,): largest share of saturated rows in any one channel, 0…1."""
    start_s: NDArray[np.float64]
    """Shape (n,): time of the first row, fitted clock, seconds."""
    end_s: NDArray[np.float64]
    """Shape (n,): time of the last measured row, fitted clock, seconds."""
    filled: NDArray[np.float32] = field(default_factory=lambda: _NONE_FILLED)
    """Shape (n,): share of the measured rows' values that were filled in, 0…1: all that were not
    usable, or none. Zeros unless given."""

    def __post_init__(self) -> None:
        if len(self.filled) != len(self.values):
            object.__setattr__(self, "filled", np.zeros(len(self.values), np.float32))

    @property
    def ready(self) -> NDArray[np.bool_]:
        """Shape (n,): True where all values may be used, or those that may not were filled in."""
        return np.asarray((self.usable >= 1.0) | (self.filled > 0.0))

    def __len__(self) -> int:
        return len(self.values)

    def __getitem__(self, part: slice | NDArray[np.bool_] | NDArray[np.intp]) -> Windows:
        """Return the windows that a slice, a mask or an index array selects."""
        return Windows(
            self.values[part],
            self.mask[part],
            self.usable[part],
            self.saturated[part],
            self.start_s[part],
            self.end_s[part],
            self.filled[part],
        )

    @property
    def padded(self) -> int:
        """How many windows are shorter than their length and were padded."""
        return int((~self.mask.all(axis=1)).sum())

    @staticmethod
    def join(parts: Iterable[Windows]) -> Windows:
        """Return the windows of several parts one after another.

        Raises:
            ValueError: There are no parts, or their shapes differ.
        """
        runs = list(parts)
        return Windows(
            np.concatenate([run.values for run in runs]),
            np.concatenate([run.mask for run in runs]),
            np.concatenate([run.usable for run in runs]),
            np.concatenate([run.saturated for run in runs]),
            np.concatenate([run.start_s for run in runs]),
            np.concatenate([run.end_s for run in runs]),
            np.concatenate([run.filled for run in runs]),
        )


class Windower:
    """Turn samples into windows, call by call.

    However a stream is cut into calls, the windows are the same; a whole
    recording is the stream given in one call, followed by `flush`.

    Args:
        config: What a window is.
        sensor: The array that the samples come from.

    Raises:
        ValueError: The array lacks a channel that the configuration names, or a window is
            too short for its wavelet.
        MissingExtra: The configuration asks for a wavelet, and PyWavelets is not installed.
    """

    def __init__(self, config: WindowConfig, sensor: SensorInfo) -> None:
        self._config = config
        self._clean = cleaner(config)
        self._columns = sensor.indices(config.channels) if config.channels else None
        self._channels = len(sensor.only(config.channels).channels)
        age_s = largest_age_s(sensor.rate_hz) if config.max_age_s is None else config.max_age_s
        self._grid = Grid(config.grid_hz, sensor.rate_hz, age_s)
        own = sensor.only(config.channels)
        self._untouched = own.indices((config.subtract,))[0] if config.subtract else None
        self._follower: GateFollower | None = None
        if config.gate_follow_s is not None and config.gate is not None:
            rate_hz = config.grid_hz or sensor.rate_hz
            self._follower = GateFollower(config.gate, config.gate_follow_s, rate_hz, own.channels)
        self._single = config.layout == "A"
        factor = self._channels if self._single else 1
        self._length, self._stride = config.steps * factor, config.stride * factor
        width = 1 if self._single else self._channels
        self._none = _no_rows(width)
        self._pending = self._none
        self._last_s: float | None = None
        self._skip = 0
        self._whole = False

    def push(self, samples: Samples) -> Windows:
        """Return the windows that these scans complete, shape (n, steps, channels); n may be 0."""
        if not len(samples):
            return self._shape([])
        if self._columns is not None:
            samples = samples.only(self._columns)
        rows = self._gate(self._less_untouched(self._grid.push(samples)))
        if not len(rows):
            return self._shape([])
        done: list[Windows] = []
        if self._last_s is not None and rows.time_s[0] - self._last_s > self._config.max_gap_s:
            done += self._stretch(self._pending, ended=True)
        self._last_s = float(rows.time_s[-1])
        before = len(self._pending)  # unbroken in itself, and up to the first new row
        known = _join_rows(self._pending, rows) if before else rows
        start = 0
        for gap in self._gaps(rows.time_s):
            end = before + gap
            done += self._stretch(_cut_rows(known, start, end), ended=True)
            start = end
        done += self._stretch(_cut_rows(known, start, len(known)), ended=False)
        return self._shape(done)

    def _gaps(self, time_s: NDArray[np.float64]) -> list[int]:
        """Return the rows before which a gap lies."""
        if len(time_s) < 2:
            return []
        found: list[int] = (np.flatnonzero(np.diff(time_s) > self._config.max_gap_s) + 1).tolist()
        return found

    @property
    def missing(self) -> int:
        """How many rows (layout A: values) the next window still waits for."""
        return self._length + self._skip - len(self._pending)

    def rehearse(self, samples: Samples) -> Windows:
        """Do what `push` would do, and forget it: brings code and data into the caches."""
        twin = copy(self)
        twin._grid = copy(self._grid)
        twin._follower = self._follower.still() if self._follower is not None else None
        return twin.push(samples)

    def flush(self) -> Windows:
        """End the stretch, as at a recording's end; return its padded window if there is one."""
        self._last_s = None
        return self._shape(self._stretch(self._pending, ended=True))

    def gate_moves(self) -> list[GateMove]:
        """Return how the gates were moved since the last call; none where they do not follow."""
        return [] if self._follower is None else self._follower.take_moves()

    def _less_untouched(self, rows: Rows) -> Rows:
        """Take the untouched channel from all, where the configuration names one."""
        if self._untouched is None or not len(rows):
            return rows
        column = slice(self._untouched, self._untouched + 1)
        # What the untouched channel does not know, or knows at its end only, no channel knows.
        flags = rows.flags | (rows.flags[:, column] & (_UNUSABLE | _SATURATED))
        values = rows.values - rows.values[:, column]
        values[(flags & _UNUSABLE) != 0] = 0.0
        return Rows(rows.time_s, values, flags)

    def _gate(self, rows: Rows) -> Rows:
        if self._follower is None or not len(rows):
            return self._above(rows, self._config.gate)
        parts = [self._above(part, gates) for part, gates in self._follower.parts(rows)]
        joined = parts[0]
        for part in parts[1:]:
            joined = _join_rows(joined, part)
        return joined

    def _above(self, rows: Rows, gate: float | NDArray[np.float32] | None) -> Rows:
        if gate is None or not len(rows):
            return rows
        # What is not usable is 0 in rows: only below 0 could it open the gate.
        least = self._config.gate or 0.0
        above = above_gate(rows.values, rows.usable if least < 0.0 else None, gate)
        if self._single:
            row, _ = np.nonzero(above)
            return Rows(rows.time_s[row], rows.values[above][:, None], rows.flags[above][:, None])
        if len(rows) == 1:  # the usual case live
            return rows if above.any() else _cut_rows(rows, 0, 0)
        return _pick_rows(rows, np.flatnonzero(above.any(axis=1)))

    def _stretch(self, rows: Rows, *, ended: bool) -> list[Windows]:
        """Cut one unbroken stretch; keep what a later row may still complete."""
        done: list[Windows] = []
        length, stride = self._length, self._stride
        skipped = min(self._skip, len(rows))
        rows, self._skip = _cut_rows(rows, skipped, len(rows)), self._skip - skipped
        count = (len(rows) - length) // stride + 1 if len(rows) >= length else 0
        if count:
            done.append(self._filled(_windows_of(rows, length, stride, count), rows, stride))
            self._whole = True
            used = min(count * stride, len(rows))
            self._skip = count * stride - used
            rows = _cut_rows(rows, used, len(rows))
        if not ended:
            self._pending = rows
            return done
        if self._config.pad and not self._whole and len(rows):
            done.append(self._filled(_padded_window(rows, length), rows, stride))
        self._pending, self._skip, self._whole = self._none, 0, False
        return done

    def _filled(self, windows: Windows, rows: Rows, stride: int) -> Windows:
        """Fill the short gaps of finished windows of one stretch; the same however it was cut."""
        bad = np.flatnonzero(windows.usable < 1.0)
        if self._single or not self._config.fill or not len(bad):
            return windows
        usable = rows.usable
        # Copies: without overlap the windows are a view of the rows, and of the samples.
        values, filled = windows.values.copy(), windows.filled.copy()
        for index in bad:
            measured = int(windows.mask[index].sum())
            part = slice(index * stride, index * stride + measured)
            whole = fill_gaps(values[index, :measured], usable[part], self._length,
                              self._config.fill)  # fmt: skip
            if whole is not None:
                values[index, :measured] = whole
                filled[index] = 1.0 - windows.usable[index]
        return replace(windows, values=values, filled=filled)

    def _shape(self, parts: list[Windows]) -> Windows:
        steps, channels = self._config.steps, self._channels
        if not parts:
            return _no_windows(steps, channels)
        cut = parts[0] if len(parts) == 1 else Windows.join(parts)
        if not self._single and not self._config.tare and self._clean is None:
            return cut
        values, mask = cut.values, cut.mask
        if self._single:
            values = values.reshape(len(cut), steps, channels)
            mask = np.asarray(mask.reshape(len(cut), steps, channels).all(axis=2))
            measured: NDArray[np.bool_] = np.asarray(mask.any(axis=1))
            if self._config.pad and not measured.all():
                values, mask, cut = values[measured], mask[measured], cut[measured]
        if self._clean is not None:
            values = self._clean(values, mask)
        if self._config.tare:
            values = (values - values[:, :1]) * mask[:, :, None]
        return replace(cut, values=values, mask=mask)


def cut_windows(samples: Samples, config: WindowConfig, sensor: SensorInfo) -> Windows:
    """Return all windows of a whole recording.

    Args:
        samples: The recording's scans.
        config: What a window is.
        sensor: The array that the samples come from.
    """
    windower = Windower(config, sensor)
    return Windows.join([windower.push(samples), windower.flush()])


def _windows_of(rows: Rows, length: int, stride: int, count: int) -> Windows:
    if count == 1:
        return _one_window(rows, length)
    values = np.ascontiguousarray(_slide(rows.values, length, stride, count))
    usable = _slide(rows.usable, length, stride, count)
    saturated = _slide(rows.saturated, length, stride, count)
    first = np.arange(count) * stride
    return Windows(
        values,
        np.ones((count, length), bool),
        usable.mean(axis=(1, 2), dtype=np.float32),
        saturated.mean(axis=1, dtype=np.float32).max(axis=1),
        rows.time_s[first],
        rows.time_s[first + length - 1],
    )


def _one_window(rows: Rows, length: int) -> Windows:
    """Return the first window alone: the live path's usual case, kept short."""
    share, worst = 1.0, 0.0
    flags = rows.flags[:length]
    if flags.any():  # counted: NumPy's means of booleans take ten times longer
        share = 1.0 - np.count_nonzero(flags & _UNUSABLE) / flags.size
        worst = int(((flags & _SATURATED) != 0).sum(axis=0).max()) / length
    return Windows(
        rows.values[None, :length].copy(),
        np.ones((1, length), bool),
        np.array([share], np.float32),
        np.array([worst], np.float32),
        rows.time_s[:1],
        rows.time_s[length - 1 : length],
    )


def _slide(values: NDArray[_Kind], length: int, stride: int, count: int) -> NDArray[_Kind]:
    """Return overlapping stretches as a view, shape (count, length, channels)."""
    view = sliding_window_view(values, length, axis=0)[::stride][:count]
    return np.moveaxis(view, 2, 1)


def _padded_window(rows: Rows, length: int) -> Windows:
    n, channels = rows.values.shape
    values = np.zeros((1, length, channels), np.float32)
    values[0, :n] = rows.values
    mask = np.zeros((1, length), bool)
    mask[0, :n] = True
    return Windows(
        values,
        mask,
        np.array([rows.usable.mean()], np.float32),
        np.array([rows.saturated.mean(axis=0).max()], np.float32),
        rows.time_s[:1],
        rows.time_s[-1:],
    )


def _no_windows(steps: int, channels: int) -> Windows:
    none32, none64 = np.zeros(0, np.float32), np.zeros(0)
    return Windows(
        np.zeros((0, steps, channels), np.float32),
        np.zeros((0, steps), bool),
        none32,
        none32,
        none64,
        none64,
    )


def _no_rows(channels: int) -> Rows:
    return Rows(np.zeros(0), np.zeros((0, channels), np.float32), np.zeros((0, channels), np.uint8))


def _cut_rows(rows: Rows, start: int, end: int) -> Rows:
    if start == 0 and end == len(rows):
        return rows
    return Rows(rows.time_s[start:end], rows.values[start:end], rows.flags[start:end])


def _pick_rows(rows: Rows, index: NDArray[np.intp]) -> Rows:
    if len(index) == len(rows):
        return rows
    return Rows(rows.time_s[index], rows.values[index], rows.flags[index])


def _join_rows(first: Rows, second: Rows) -> Rows:
    return Rows(
        np.concatenate([first.time_s, second.time_s]),
        np.concatenate([first.values, second.values]),
        np.concatenate([first.flags, second.flags]),
    )
