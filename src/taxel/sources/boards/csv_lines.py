"""From lines of numbers to scans: the sketches that people already have.

    1,2,3        1 <tab> 2 <tab> 3        1 2 3        names in a first line, where there are any

A line is a scan. Without a column of time, a line is taken to have been measured when
it arrived, and those that come together one period apart. Knows nothing about ports.

Background of our choices: docs/decisions/0014.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from taxel.signals import flag_values
from taxel.sources.boards.ledger import BoardLedger, ClockRate, Scans
from taxel.sources.boards.port import Chunk
from taxel.sources.fitted_time import FittedTime
from taxel.wire.counters import unwrap

_NUMBER = re.compile(rb"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")
_NOT_A_NUMBER = {b"nan": math.nan, b"inf": math.inf, b"-inf": -math.inf, b"ovf": math.nan}
"""How Arduino's print writes floats that are none. Source: Print.cpp, printFloat."""
_BETWEEN = re.compile(rb"[,;\t ]+")
_BETWEEN_TEXT = re.compile(r"[,;\t ]+")
_DIGIT = re.compile(rb"[0-9]")
_NO_NAME = re.compile(r"[-+.0-9]|[^\w]*$")
"""How what is no channel's name begins, or all of it: damage of a line of numbers."""
_WRAP = 2**32
"""A printed clock counts so far. Source: Arduino's millis() and micros(), unsigned long."""
_LONGEST_LINE = 4096
"""Bytes without an end of line that are thrown away. Our choice."""
_MEASURED_S = 1.0
"""How long lines are watched at connecting, seconds. Our choice: 2 % at 50 Hz."""
_LEAST_LINES = 3
_STALE_S = 0.03
"""What comes so soon after opening may have lain in a buffer since who knows when, seconds."""
_JUMP_S = 1.0
"""A printed clock that gains this on the host's, or steps back by it, began anew, seconds."""
_AHEAD_S, _AHEAD_PERIODS = 0.02, 5
"""A printed clock may have gone on by so much more than the arrivals, seconds and lines: more needs
a second line that says so. Source: docs/decisions/0014, as of boards that count."""
_A_SECOND = {"ms": 1e3, "us": 1e6}


class CsvStream:
    """One board that prints a line of numbers for each scan.

    Until it is `ready` it watches for a second (for three lines where the rate is known): the
    usual number of columns, their names, and the rate at which lines come. Then a line with
    another number of columns, or with what is no number, is bad, counted, and leaves a
    missing scan; a line of words leaves none. A single line whose printed clock runs ahead of the
    host's is bad, too.

    Args:
        path: Its port, for the ledger.
        time: The unit of the first column, ms or us since boot; none where there is no such column.
        rate_hz: Lines a second where known, else measured.
        channels: Names, where known; else those of the header line, or c0, c1, …
        full_scale: From where a value counts as saturated, in its own unit.
    """

    def __init__(
        self,
        path: str,
        *,
        time: str = "none",
        rate_hz: float | None = None,
        channels: tuple[str, ...] = (),
        full_scale: float | None = None,
    ) -> None:
        self.ledger = BoardLedger(path=path)
        self.rate_hz = rate_hz or 0.0
        self.channels = channels
        self.heard = b""
        self._known_rate = rate_hz
        self._per_second = _A_SECOND.get(time)
        self._full_scale = full_scale
        self._rest = self._separator = b""
        self._whole_lines = False
        self._header: tuple[list[str], bytes] = [], b""
        self._held: tuple[int, list[float]] | None = None
        self._watched: list[tuple[float, list[float]]] = []
        self._columns = 0
        self._seq = -1
        self._boot = 0
        self._bad = {"line": 0, "columns": 0, "text": 0}
        self._last: tuple[int, float] | None = None
        self._last_fitted_s = self._last_device_s = self._stale_until_s = -math.inf
        self._least_delay_s = math.inf
        self._fit, self._rate = FittedTime(), ClockRate()

    @property
    def ready(self) -> bool:
        """True once the columns and the rate are known."""
        return self._columns > 0

    @property
    def confirmed(self) -> bool:
        """The same: what is watched is scans already."""
        return self.ready

    def feed(self, chunks: Sequence[Chunk]) -> list[Scans]:
        """Take in what came, oldest first; return the scans that it completes."""
        done: list[Scans] = []
        for chunk in chunks:
            if chunk.gone or chunk.opened:
                self._port_changed(chunk)
                continue
            if chunk.arrival_s < self._stale_until_s:
                continue
            self.ledger.received_bytes += len(chunk.data)
            self.heard = (self.heard + chunk.data)[:200]
            done += self._lines(self._split(chunk.data), chunk.arrival_s)
        self.ledger.bad = dict(self._bad)
        return done

    def _port_changed(self, chunk: Chunk) -> None:
        self._rest, self._whole_lines = b"", False
        self._stale_until_s = chunk.arrival_s + _STALE_S
        if chunk.gone:
            self.ledger.state = "away"
        elif self.ready:
            self.ledger.reconnects += 1

    def _split(self, data: bytes) -> list[bytes]:
        """Return the lines that are now whole; the first after opening may be half a line."""
        *lines, self._rest = (self._rest + data).replace(b"\r", b"\n").split(b"\n")
        if len(self._rest) > _LONGEST_LINE:
            self._bad["line"] += 1
            self._rest, self._whole_lines = b"", False
        if lines and not self._whole_lines:
            self._whole_lines, lines = True, lines[1:]
        return [line.strip() for line in lines if line.strip()]

    def _lines(self, lines: list[bytes], arrival_s: float) -> list[Scans]:
        rows: list[tuple[int, list[float]]] = []
        for line in lines:
            numbers = numbers_of(line)
            if not self.ready:
                self._watch(numbers, line, arrival_s)
            elif numbers is None and (self._is_header(line) or not _DIGIT.search(line)):
                self._bad["text"] += 1
            else:
                self._seq += 1
                if numbers is None or len(numbers) != self._columns:
                    self._lose("line" if numbers is None else "columns")
                else:
                    rows.append((self._seq, numbers))
        rows = self._credible(rows, arrival_s)
        return self._scans(rows, arrival_s) if rows else []

    def _is_header(self, line: bytes) -> bool:
        """Return whether it is the line of names once more."""
        names = names_of(line)
        return bool(names) and names == self._header[0]

    def _lose(self, why: str) -> None:
        self._bad[why] += 1
        self.ledger.lost += 1

    def _credible(
        self, rows: list[tuple[int, list[float]]], arrival_s: float
    ) -> list[tuple[int, list[float]]]:
        """Return the rows whose printed clock may be believed; one that runs ahead waits for the
        next, which goes on from it or shows that it was damaged.
        """
        if self._per_second is None or self._last is None:
            return rows
        kept: list[tuple[int, list[float]]] = []
        began = float(self._last[0] % _WRAP)
        most = (_AHEAD_S + _AHEAD_PERIODS / self.rate_hz + max(0.0, arrival_s - self._last[1])) * (
            self._per_second
        )
        for row in rows:
            if self._held is not None:
                (seq, numbers), self._held = self._held, None
                if 0 <= _step(numbers[0], row[1][0]) <= most:
                    kept.append((seq, numbers))
                else:
                    self._lose("line")
            if most < _step(began, row[1][0]) < _JUMP_S * self._per_second:
                self._held = row
                continue
            kept.append(row)
        return kept

    def _watch(self, numbers: list[float] | None, line: bytes, arrival_s: float) -> None:
        if numbers is None:
            if names := names_of(line):
                self._header = names, _between(line)
            return
        self._separator = _between(line)
        watched = self._watched
        watched.append((arrival_s, numbers))
        span_s = arrival_s - watched[0][0]
        if len(watched) < _LEAST_LINES or (not self._known_rate and span_s < _MEASURED_S):
            return
        (columns, _), *_ = Counter(len(row) for _, row in watched).most_common(1)
        timed = self._per_second is not None
        if columns <= timed:
            return
        self._columns = columns
        self.rate_hz = self._known_rate or self._measured(columns, span_s)
        names, separator = self._header
        if len(names) != columns or (columns > 1 and separator != self._separator):
            names = []
        given = names[timed:] or [f"c{i}" for i in range(columns - timed)]
        self.channels = self.channels or tuple(given)
        self.ledger.state, self._watched = "silent", []

    def _measured(self, columns: int, span_s: float) -> float:
        """Return lines a second: by the board's own clock where it prints one."""
        rows = [row for _, row in self._watched if len(row) == columns]
        if self._per_second is not None and len(rows) > 1:
            own_s = (rows[-1][0] - rows[0][0]) / self._per_second
            if own_s > 0:
                return (len(rows) - 1) / own_s
        return (len(self._watched) - 1) / span_s

    def _scans(self, rows: list[tuple[int, list[float]]], arrival_s: float) -> list[Scans]:
        seq = np.array([seq for seq, _ in rows], np.int64)
        table = np.array([row for _, row in rows])
        came_s = np.full(len(rows), arrival_s)
        self.ledger.scans += len(rows)
        self.ledger.state = "running"
        if self._per_second is None:
            device_s = np.full(len(rows), np.nan)
            fitted_s = came_s - (seq[-1] - seq) / self.rate_hz
            fitted_s = np.maximum(fitted_s, self._last_fitted_s)
            self._last_fitted_s = float(fitted_s[-1])
        else:
            device_s = self._own_time(table[:, 0], arrival_s)
            fitted_s = np.minimum(self._fit.of(device_s, came_s), came_s)
            self.ledger.clock_ppm = self._rate.add(float(device_s[-1]), float(fitted_s[-1]))
            table = table[:, 1:]
        with np.errstate(over="ignore"):  # beyond float32 is infinite, and flagged so
            values = table.astype(np.float32)
        return [
            Scans(
                seq=seq,
                device_s=device_s,
                arrival_s=came_s,
                fitted_s=fitted_s,
                values=values,
                flags=flag_values(values, self._full_scale),
                boot=self._boot,
            )
        ]

    def _own_time(self, column: NDArray[np.float64], arrival_s: float) -> NDArray[np.float64]:
        """Return the printed clock in seconds, unwrapped; one that steps back began anew."""
        per_second = self._per_second or 1.0
        column = np.clip(np.nan_to_num(column), -(2.0**53), 2.0**53)  # a signed long wraps below 0
        whole = column.astype(np.int64)
        fraction = column - whole
        raw = (whole & 0xFFFFFFFF).astype(np.uint32)
        near = int(raw[0])
        if self._last is not None:
            near = self._last[0] + round((arrival_s - self._last[1]) * per_second)
        ticks = unwrap(raw, near)
        back = self._last is not None and ticks[0] < self._last[0] - _JUMP_S * per_second
        if back or self._gained(arrival_s - float(ticks[-1]) / per_second):
            self.ledger.reboots += 1
            self._boot += 1
            self._restart()
            ticks = unwrap(raw, int(raw[0]))
        self._last = (int(ticks[-1]), arrival_s)
        device_s = np.maximum.accumulate((ticks + fraction) / per_second)
        device_s = np.maximum(device_s, self._last_device_s)
        self._least_delay_s = min(self._least_delay_s, arrival_s - float(device_s[-1]))
        self._last_device_s = float(device_s[-1])
        return np.asarray(device_s)

    def _gained(self, delay_s: float) -> bool:
        """Whether the printed clock is further ahead of the host's than ever a scan was."""
        return delay_s < self._least_delay_s - _JUMP_S and self._least_delay_s < math.inf

    def _restart(self) -> None:
        self._fit, self._rate = FittedTime(), ClockRate()
        self._last_device_s, self._least_delay_s = -math.inf, math.inf


def numbers_of(line: bytes) -> list[float] | None:
    """Return the numbers of a line; None where any of its fields is none."""
    numbers = []
    for part in _BETWEEN.split(line.strip(b" \t,;")):
        if _NUMBER.fullmatch(part):
            numbers.append(float(part))
        elif part.lower() in _NOT_A_NUMBER:
            numbers.append(_NOT_A_NUMBER[part.lower()])
        else:
            return None
    return numbers


def names_of(line: bytes) -> list[str]:
    """Return the channels' names that a header line holds; none where it is no header.

    A name begins with no digit and comes once; else the line is damaged or says something else.
    """
    try:
        parts = [part.strip("\"'") for part in _BETWEEN_TEXT.split(line.decode().strip(" \t,;"))]
    except UnicodeDecodeError:
        return []
    if len(set(parts)) < len(parts) or any(
        _NO_NAME.match(part) or not part.isprintable() for part in parts
    ):
        return []
    return parts


def _between(line: bytes) -> bytes:
    """Return what parts a line's fields: a comma, a semicolon, or blanks."""
    return next((mark for mark in (b",", b";") if mark in line), b" ")


def _step(before: float, after: float) -> float:
    """Return how far a printed clock went on, in its unit, past its wrap too; NaN counts as 0."""
    step = (np.nan_to_num(after) - np.nan_to_num(before)) % _WRAP
    return float(step if step < _WRAP / 2 else step - _WRAP)
