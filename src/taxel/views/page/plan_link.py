"""A plan of trials on the page: the next one, what to do now, how far the plan is.

Fulfils `StationLink`; filled by whoever records, from another thread. Images are those of the
cameras while a trial is read. Knows nothing about HTTP, plans' files or what settles a grasp.

Background of our choices: docs/decisions/0046.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Collection, Sequence
from time import monotonic
from typing import Any

from taxel.jpeg_head import fits
from taxel.signals import CameraInfo, Frame

_WAITING = 4
"""A person's steps that wait to be taken; more are refused. Source: our choice."""


class PlanLink:
    """What the page knows of a plan that is recorded.

    Args:
        trials: How many trials the plan has.
        asks: True where a person says that they are ready.
    """

    def __init__(self, trials: int, *, asks: bool) -> None:
        self._lock = threading.Lock()
        self._shown: dict[str, Any] = {
            "word": "WAIT", "why": "opening the cameras", "number": None, "of": trials, "done": 0,
            "words": "", "balance": "", "asks": False,
        }  # fmt: skip
        self._asks = asks
        self._discards = False
        self._since_s = monotonic()
        self._steps: deque[str] = deque()
        self._cameras: tuple[CameraInfo, ...] = ()
        self._frames: dict[int, tuple[int, bytes]] = {}

    # What the recording holds.

    def show(
        self,
        word: str,
        why: str = "",
        *,
        waits: bool = False,
        discards: bool = False,
        **values: Any,
    ) -> None:
        """Say what to do now.

        Args:
            word: In capitals, such as POUR NOW.
            why: In words.
            waits: A person's step is waited for.
            discards: There is a last trial, which a step may discard or make again.
            values: More of what is shown: number, words, done, balance.
        """
        with self._lock:
            more = values | {"word": word, "why": why, "asks": waits and self._asks}
            self._since_s = monotonic()
            self._discards = discards
            self._shown = self._shown | more
            if not waits:
                self._steps.clear()

    def see(self, cameras: Sequence[CameraInfo], frames: Sequence[Frame]) -> None:
        """Take in images that were read."""
        with self._lock:
            self._cameras = tuple(cameras)
            for frame in frames:
                camera = cameras[frame.camera]
                if fits(frame.jpeg, (camera.width, camera.height)):  # a browser would decode it
                    before = self._frames.get(frame.camera, (0, b""))[0]
                    self._frames[frame.camera] = (before + 1, frame.jpeg)

    def next_step(self) -> str:
        """Return a person's oldest step that was not taken, of `messages.STEPS`; "" without any."""
        with self._lock:
            return self._steps.popleft() if self._steps else ""

    # What the page asks.

    def snapshot(self) -> dict[str, Any]:
        """Return the plan as it stands; see `StationLink.snapshot`."""
        with self._lock:
            return {
                "time_s": monotonic(), "state": "NONE", "reason": "", "since_s": self._since_s,
                "probability": None, "slip": None, "alarms": [], "answers": [], "sources": [],
                "consumers": [], "latency_ms": {}, "gripper": None, "recording": None,
                "cameras": [
                    {"name": camera.name, "width": camera.width, "height": camera.height}
                    for camera in self._cameras
                ],
                "array": None, "plan": dict(self._shown),
            }  # fmt: skip

    def frame(self, camera: int) -> tuple[int, bytes] | None:
        """Return a camera's newest image."""
        return self._frames.get(camera)

    def traces(self, since_s: float) -> dict[str, Any]:
        """Return nothing but the time: a plan has no curves."""
        return {"time_s": monotonic(), "probability": {"t": [], "p": []},
                "sensors": {"t": [], "values": []}, "map": None, "events": []}  # fmt: skip

    def step(self, what: str) -> str:
        """Take a person's step; return why not where nobody waits for one."""
        with self._lock:
            if not self._shown["asks"] or len(self._steps) >= _WAITING:
                return "no trial waits for that now"
            if what != "ready" and not self._discards:
                return "there is no last trial to discard now"
            self._steps.append(what)
        return ""

    def acknowledge(self, seen: Collection[int]) -> None:
        """There are no alarms."""

    def disarm(self) -> str:
        """Refuse: nothing is armed, and a gripper is the recording program's own."""
        return "nothing is armed while a plan is recorded; a gripper keeps what it holds"

    def record(self, on: bool, labels: dict[str, str]) -> str:
        """Refuse: the plan says what is recorded."""
        return "the plan says what is recorded"
