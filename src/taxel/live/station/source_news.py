"""How a source does, in its own process: rate, losses, silence. Knows nothing about rings.

Background of our choices: docs/decisions/0019.
"""

from __future__ import annotations

from collections import deque
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np

from taxel.live.station.worker import LONGEST_WHY
from taxel.plain_text import number_of
from taxel.signals import Frame, Samples, Validity
from taxel.sources.cameras.link import CameraLedger
from taxel.sources.contract import Source

REPORT_S = 0.25
"""How often it is reported. Source: our choice."""
_SPAN_S = 2.0
"""The rate's span, seconds. Source: our choice."""
_STALE_S = 0.5
"""Silence after which a source is stale, seconds, beside the pause that its cameras say they make
between two grasps. Source: our choice."""


@runtime_checkable
class _Cameras(Protocol):
    """A source that knows why one of its cameras is gone."""

    def ledgers(self) -> tuple[CameraLedger, ...]: ...


def short_name(url: str) -> str:
    """Return what a person calls a source: the simulator's name, a recording's, or its kind."""
    scheme, found, rest = url.partition("://")
    name = (rest if found else scheme).partition("?")[0]
    if scheme == "sim":
        return name
    return {"serial": "boards", "camera": "cameras", "realsense": "scene"}.get(
        scheme if found else "", Path(name).stem
    )


class SourceNews:
    """Counts what a source gives.

    Args:
        source: The open source.
        url: Its address.
    """

    def __init__(self, source: Source, url: str) -> None:
        self._source = source
        self._name, self._url = short_name(url), url
        self._cameras = len(source.cameras)
        self._stale_s = _STALE_S + max((camera.pause_s for camera in source.cameras), default=0.0)
        self._came: deque[tuple[float, int]] = deque()
        self._last: dict[int, int] = {}
        self._produced = self._lost = self._unusable = 0
        self._heard_s = self._reported_s = -np.inf

    def add(self, samples: Samples, frames: list[Frame], now_s: float) -> None:
        """Take in what came."""
        if len(samples):
            self._count(-1, samples.counter)
            self._unusable += int(np.count_nonzero(~samples.usable.all(axis=1)))
        for frame in frames:
            self._count(frame.camera, np.array([frame.counter]))
        count = len(frames) if self._cameras else len(samples)
        if count:
            # Rows go on without boards that are gone: what is missing was not heard.
            if len(frames) or not (samples.validity & np.uint8(Validity.MISSING)).all():
                self._heard_s = now_s
            self._came.append((now_s, count))
        self._produced += len(samples) + len(frames)

    def due(self, now_s: float) -> bool:
        """True when it is time to report."""
        return now_s - self._reported_s >= REPORT_S

    def note(self, now_s: float) -> dict[str, Any]:
        """Return how it does."""
        self._reported_s = now_s
        while self._came and now_s - self._came[0][0] > _SPAN_S:
            self._came.popleft()
        span_s = now_s - self._came[0][0] if self._came else 0.0
        # The first batch came at the span's beginning, so that it lies outside.
        came = sum(count for _, count in list(self._came)[1:])
        rate_hz = came / span_s if span_s > 0 else 0.0
        info, cameras = self._source.info, self._source.cameras
        state = "live" if now_s - self._heard_s <= self._stale_s else "stale"
        return {
            "kind": "source", "name": self._name, "url": self._url,
            "kind_of": "cameras" if cameras else "array",
            "state": "ended" if self._source.ended else state,
            "rate_hz": rate_hz / max(1, self._cameras),
            "nominal_hz": cameras[0].rate_hz if cameras else info.rate_hz,
            "produced": self._produced, "lost": self._lost,
            "note": "; ".join(self._notes()),
        }  # fmt: skip

    def failed(self, error: Exception, now_s: float) -> dict[str, Any]:
        """Return the last note of a source that raised an error."""
        why = str(error).partition("\n")[0] or type(error).__name__
        return self.note(now_s) | {"state": "failed", "rate_hz": 0.0, "note": why[:LONGEST_WHY]}

    def _notes(self) -> list[str]:
        """Return what is wrong, and why where the source knows."""
        notes = (
            [f"{number_of(self._unusable, 'row')} with missing values"] if self._unusable else []
        )
        if isinstance(self._source, _Cameras):
            notes += [
                f"{camera.name}: {camera.why}" for camera in self._source.ledgers() if camera.why
            ]
        return notes

    def _count(self, stream: int, counter: np.ndarray[Any, np.dtype[np.int64]]) -> None:
        """Count what the device counted and did not arrive."""
        steps = np.diff(counter, prepend=self._last.get(stream, int(counter[0]) - 1))
        self._lost += int(np.clip(steps - 1, 0, None).sum())
        self._last[stream] = int(counter[-1])
