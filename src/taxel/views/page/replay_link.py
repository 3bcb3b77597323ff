"""A recording as a station that a person winds to and fro: overview, cursor, images at the cursor.

Images are read again from the file when they are looked at (replay_index.py remembers where).
Nothing is judged here: the state of a replay is UNKNOWN and the page says REPLAY. Knows nothing
about browsers.

Background of our choices: docs/decisions/0018.
"""

from __future__ import annotations

import threading
from bisect import bisect_right
from collections import OrderedDict
from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.clock import Clock, SystemClock
from taxel.decisions.reasons import REASONS
from taxel.image_head import is_sound
from taxel.live.station.page_link import (
    draw_depth,
    need_depth_pictures,
    shown_unit,
    trace_gap_s,
)
from taxel.recordings.chunk_content import ChunkContent
from taxel.recordings.manifest import Manifest
from taxel.recordings.reader import read_manifest
from taxel.signals import DEPTH_PNG
from taxel.views.page.replay_index import read_chunk, read_index

_SHOWN_S = 30.0
"""Of traces before the cursor, seconds."""
_MAP_ROWS = 12
_BINS = 600
"""Of the overview, at most. Source: our choice; about one for two pixels."""
_MOST_SERIES = 12
"""Channels drawn in the overview, the first of them."""
_TINY_S = 1e-6
_CHUNKS_KEPT = 4
"""Opened chunks in memory, about 0.1 s of images each."""


class ReplayLink:
    """A finished recording behind the page; a `StationLink` and its `ReplayControls`.

    Args:
        path: The recording.
        clock: Moves the cursor while it plays.

    Raises:
        BadRecording: It is missing, no recording of taxel's, cut short, damaged, or empty.
        MissingExtra: It has depth images, which need OpenCV to be shown.
    """

    def __init__(self, path: Path | str, clock: Clock | None = None) -> None:
        self._path = path = Path(path)
        self._clock = clock or SystemClock()
        self._manifest = read_manifest(path)
        need_depth_pictures(self._manifest.cameras)
        self._index = read_index(path, self._manifest)
        self._start_s, self._end_s = self._index.start_s, self._index.end_s
        self._low, self._span = _scale(self._manifest, self._index.values)
        self._gap_s = trace_gap_s(self._manifest.sensor)
        self._after_gap = np.flatnonzero(np.diff(self._index.time_s) > self._gap_s) + 1
        """Rows before which nothing came for so long that no line leads to them."""
        self._lock = threading.Lock()
        self._cursor_s = self._start_s
        self._speed = 1.0
        self._drawn: tuple[int, int, bytes | None] = (-1, -1, None)
        """The depth image drawn last: its camera, its number, and how it is shown."""
        self._played_s: float | None = None
        self._opened: OrderedDict[int, ChunkContent] = OrderedDict()

    @property
    def cursor_s(self) -> float:
        """Where the cursor stands, seconds of the recording's clock."""
        with self._lock:
            return self._moved()

    def overview(self) -> dict[str, Any]:
        """Return the whole recording in bins: each channel's least and largest value.

        A recording without an array shows its images' bytes instead: a picture that fills with
        detail, as on contact, grows.
        """
        index = self._index
        moments = max(len(index.time_s), *(len(time_s) for time_s in index.frame_s), 0)
        number = max(1, min(_BINS, moments // 2))  # an empty bin would be a gap that is none
        bins = np.linspace(self._start_s, self._end_s, number + 1)
        return {
            "start_s": self._start_s,
            "end_s": self._end_s,
            "t": ((bins[1:] + bins[:-1]) / 2).tolist(),
            "series": self._series(bins),
            "bands": [
                {
                    "start_s": mark.start_s,
                    "end_s": mark.end_s,
                    "text": _text({**self._manifest.labels, **mark.labels}),
                }
                for mark in self._index.marks
            ],
        }

    def seek(self, time_s: float) -> None:
        """Put the cursor at a moment, or at the nearest end; it plays on if it played."""
        with self._lock:
            self._moved()
            self._cursor_s = float(np.clip(time_s, self._start_s, self._end_s))

    def play(self, speed: float) -> None:
        """Let the cursor run; from the start again if it stands at the end."""
        with self._lock:
            if self._moved() >= self._end_s:
                self._cursor_s = self._start_s
            self._speed = speed
            self._played_s = self._clock.now_s()

    def pause(self) -> None:
        """Hold the cursor."""
        with self._lock:
            self._moved()
            self._played_s = None

    def snapshot(self) -> dict[str, Any]:
        """Return the snapshot of `StationLink`, and `replay`.

        replay is {path, start_s, end_s, cursor_s, playing, speed, labels (here, as text)};
        `time_s` is the clock's, so that a page sees that the server lives while nothing plays.
        """
        with self._lock:
            cursor_s, playing = self._moved(), self._played_s is not None
        sensor = self._manifest.sensor
        here = {**self._manifest.labels}
        for mark in self._index.marks:
            if mark.start_s <= cursor_s <= mark.end_s:
                here |= mark.labels
        return {
            "time_s": self._clock.now_s(),
            "state": "UNKNOWN",
            "reason": REASONS["recording"].say(),
            "since_s": None,
            "probability": None,
            "slip": None,
            "alarms": [],
            "answers": [],
            "sources": [],
            "consumers": [],
            "latency_ms": {},
            "gripper": None,
            "recording": None,
            "cameras": [
                {"name": camera.name, "width": camera.width, "height": camera.height}
                for camera in self._manifest.cameras
            ],
            "array": {
                "name": sensor.name,
                "channels": list(sensor.channels),
                "unit": shown_unit(sensor),
                "rows": _MAP_ROWS,
            }
            if sensor.channels
            else None,
            "replay": {
                "path": self._path.name,
                "start_s": self._start_s,
                "end_s": self._end_s,
                "cursor_s": cursor_s,
                "playing": playing,
                "speed": self._speed,
                "labels": _text(here),
            },
        }

    def frame(self, camera: int) -> tuple[int, bytes] | None:
        """Return the image that was the newest at the cursor, and its number in the recording.

        None also where it is not such as its camera sends: a browser would decode it.
        """
        if not 0 <= camera < len(self._index.frame_s):
            return None
        number = bisect_right(self._index.frame_s[camera], self.cursor_s) - 1
        if number < 0:
            return None
        chunk, which, _ = self._index.frame_at[camera][number].tolist()
        jpeg = self._open(chunk).frames[which].jpeg
        seen = self._manifest.cameras[camera]
        if not is_sound(jpeg, seen):
            return None
        if seen.coding == DEPTH_PNG:
            if self._drawn[:2] != (camera, number):
                self._drawn = camera, number, draw_depth(jpeg, seen)
            return None if self._drawn[2] is None else (number, self._drawn[2])
        return number, jpeg

    def traces(self, since_s: float) -> dict[str, Any]:
        """Return the array between `since_s` and the cursor, both of the recording's clock."""
        cursor_s = self.cursor_s
        index = self._index
        least_s = cursor_s - _SHOWN_S
        after_s = least_s if since_s > cursor_s else max(since_s, least_s)
        first, last = np.searchsorted(index.time_s, [after_s, cursor_s], side="right").tolist()
        chosen = np.arange(first, last)
        chosen = chosen[chosen % 2 == 0]  # 50 a second; the same ones whenever they are asked for
        broken = self._after_gap[(self._after_gap >= first) & (self._after_gap < last)]
        time_s = np.concatenate([index.time_s[chosen], index.time_s[broken] - _TINY_S])
        nothing = np.full((len(broken), index.values.shape[1]), np.nan, np.float32)
        values = np.concatenate([index.values[chosen], nothing])
        order = np.argsort(time_s, kind="stable")
        rows = index.values[max(0, last - _MAP_ROWS) : last]
        if len(rows) and cursor_s - index.time_s[last - 1] > self._gap_s:
            rows = np.concatenate([rows[1:], np.full_like(rows[:1], np.nan)])  # what is now
        return {
            "time_s": cursor_s,
            "probability": {"t": [], "p": []},
            "sensors": {
                "t": time_s[order].tolist(),
                "values": values[order].T.tolist(),
            },
            "map": np.clip((rows - self._low) / self._span, 0.0, 1.0).tolist()
            if rows.size
            else None,
            "events": [
                {"t": mark.start_s, "text": _text(mark.labels)}
                for mark in index.marks
                if after_s < mark.start_s <= cursor_s
            ],
        }

    def acknowledge(self, seen: Collection[int]) -> None:
        """Do nothing: a recording raises no alarm."""

    def disarm(self) -> None:
        """Do nothing: a recording moves no gripper."""

    def record(self, on: bool, labels: dict[str, str]) -> str:
        """Refuse: it is a recording already."""
        return "this is a recording already"

    def _moved(self) -> float:
        """Move the cursor on if it plays; return where it stands. The lock is held."""
        if self._played_s is not None:
            now_s = self._clock.now_s()
            self._cursor_s += (now_s - self._played_s) * self._speed
            self._played_s = now_s
            if self._cursor_s >= self._end_s:
                self._cursor_s, self._played_s = self._end_s, None
        return self._cursor_s

    def _open(self, number: int) -> ChunkContent:
        """Return a chunk's content, from memory or read again."""
        with self._lock:
            if number in self._opened:
                self._opened.move_to_end(number)
                return self._opened[number]
        content = read_chunk(self._path, self._index.chunks[number], self._manifest)
        with self._lock:
            self._opened[number] = content
            while len(self._opened) > _CHUNKS_KEPT:
                self._opened.popitem(last=False)
        return content

    def _series(self, bins: NDArray[np.float64]) -> list[dict[str, Any]]:
        sensor, index = self._manifest.sensor, self._index
        if sensor.channels and len(index.time_s):
            rows = zip(sensor.channels, sensor.units, index.values.T, strict=True)
            return [
                {"name": name, "unit": unit, **_envelope(index.time_s, values, bins)}
                for name, unit, values in list(rows)[:_MOST_SERIES]
            ]
        sizes = zip(self._manifest.cameras, index.frame_s, index.frame_at, strict=True)
        return [
            {
                "name": f"{camera.name}, image size",
                "unit": "kB",
                **_envelope(time_s, (at[:, 2] / 1e3).astype(np.float32), bins),
            }
            for camera, time_s, at in sizes
        ]


def _scale(
    manifest: Manifest, values: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return what is 0 on the map and the span up to 1, a channel each."""
    width = len(manifest.sensor.channels)
    if manifest.sensor.full_scale:
        full = np.full(width, manifest.sensor.full_scale, np.float32)
        return np.zeros(width, np.float32), full
    finite = np.where(np.isfinite(values), values, np.float32(np.nan))
    least = np.fmin.reduce(finite, axis=0, initial=np.nan)
    most = np.fmax.reduce(finite, axis=0, initial=np.nan)
    known = np.isfinite(least)  # a channel that is never usable does not set the others' scale
    low: NDArray[np.float32] = np.where(known, least, np.float32(0.0)).astype(np.float32)
    span = np.where(known, np.maximum(most - least, np.float32(1e-9)), np.float32(1.0))
    return low, span.astype(np.float32)


def _envelope(
    time_s: NDArray[np.float64], values: NDArray[np.float32], bins: NDArray[np.float64]
) -> dict[str, list[float]]:
    """Return the least and the largest value of each bin; NaN where it has none."""
    good = np.isfinite(values)
    where = np.clip(np.searchsorted(bins, time_s[good], side="right") - 1, 0, len(bins) - 2)
    low, high = np.full(len(bins) - 1, np.inf), np.full(len(bins) - 1, -np.inf)
    np.minimum.at(low, where, values[good])
    np.maximum.at(high, where, values[good])
    low[~np.isfinite(low)], high[~np.isfinite(high)] = np.nan, np.nan
    return {"low": np.round(low, 4).tolist(), "high": np.round(high, 4).tolist()}


def _text(labels: Any) -> str:
    return ", ".join(f"{name} {value}" for name, value in labels.items())
