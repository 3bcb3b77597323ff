"""A station fed by simulators, for the page in a browser. The states shown are invented."""

import threading
import time
from collections import deque

import numpy as np

from taxel.signals import Samples
from taxel.sources.opening import open_source

STATES = {
    "STABLE": ("", 0.08), "WARNING": ("", 0.86), "UNSTABLE": ("", 0.96),
    "UNKNOWN": ("camera right has been frozen for 0.24 s", None),
    "STOP": ("inference gave no beat for 52 ms", None),
    "NO GRASP": ("the grasp has ended: nothing is held", None),
}  # fmt: skip


class SimStation:
    """A station fed by simulators: a hand, and two cameras; its state is set by hand."""

    def __init__(self, pour: str | None, hand: str | None) -> None:
        self.state = "STABLE"
        self.armed = True
        self.commands: list[object] = []
        self.alarms: list[dict[str, object]] = []
        self.frozen_s: float | None = None
        self.scored = True
        """As the monitor that comes with taxel: a warning's score, no probability."""
        self.events: deque[tuple[float, str]] = deque(maxlen=50)
        self.recording = {"on": False, "path": "", "seconds": 0.0, "bytes": 0, "error": ""}
        self._began_s = self._since_s = time.monotonic()
        self._p = 0.08
        self._traced: deque[tuple[float, float]] = deque(maxlen=2000)
        self._scans: deque[tuple[float, np.ndarray]] = deque(maxlen=4000)
        self._frames: dict[int, tuple[int, bytes]] = {}
        self._produced = [0, 0]
        self._stop = threading.Event()
        self._cameras: list[dict[str, object]] = []
        self._array: dict[str, object] | None = None
        self._threads = []
        for url, what in ((pour, self._see), (hand, self._feel)):
            if url:
                opened = threading.Event()
                thread = threading.Thread(target=what, args=(url, opened))
                thread.start()
                opened.wait(30)
                self._threads.append(thread)

    def close(self) -> None:
        self._stop.set()
        for thread in self._threads:
            thread.join()

    def become(self, state: str) -> None:
        now = time.monotonic()
        self.state, self._since_s = state, now
        self.events.append((now, state))
        level = "warning" if state == "WARNING" else "danger"
        texts = {
            "WARNING": "the grasp may be slipping: look at the cup",
            "UNSTABLE": "the grasp slips: 12.4 N of 20 N are used",
            "UNKNOWN": "nothing watches the grasp",
            "STOP": "inference hung; the gripper holds",
        }
        self.alarms = [alarm for alarm in self.alarms if not alarm["acknowledged"]][-2:]
        if state in texts:
            self.alarms.insert(
                0, {"key": len(self.events), "kind": state, "text": texts[state], "level": level,
                    "since_s": now, "acknowledged": False},
            )  # fmt: skip

    def snapshot(self):
        now = self.frozen_s or time.monotonic()
        reason, goal = STATES[self.state]
        self._p += ((goal or self._p) - self._p) * 0.08
        noise = 0.03 * np.sin(now * 9) * np.sin(now * 2.3)
        self._traced.append((now, float(np.clip(self._p + noise, 0, 1))))
        if self.recording["on"]:
            self.recording["seconds"] += 0.05
            self.recording["bytes"] += 61_000
        run_s = max(1e-3, now - self._began_s)
        cameras, scans = self._produced
        late = self.state == "UNKNOWN"
        number = None if goal is None else self._traced[-1][1]
        slip_mm = 0.45 * self._p**2
        return {
            "time_s": now, "state": self.state, "reason": reason, "since_s": self._since_s,
            "probability": None if self.scored else number, "scored": self.scored,
            "score": number if self.scored else None,
            "slip": {"slip_mm": slip_mm, "slip_rate_mm_s": slip_mm, "slip_seen": goal is not None},
            "thresholds": {"clear": 0.42, "warn": 0.84, "unstable": 0.92},
            "alarms": self.alarms,
            "answers": [
                {"target": "shape", "label": "cylinder", "confidence": 0.94, "reason": ""},
                {"target": "material", "label": "unknown", "confidence": 0.41,
                 "reason": "below the confidence that is asked for"},
            ] if self._array else [],
            "sources": [
                {"name": "pour", "url": "sim://cup-pour", "kind": "cameras",
                 "state": "frozen" if late else "live", "rate_hz": cameras / run_s / 2,
                 "nominal_hz": 60, "produced": cameras, "lost": 3,
                 "note": "right: the same image 6 times" if late else ""},
                {"name": "teng", "url": "sim://teng", "kind": "array", "state": "live",
                 "rate_hz": scans / run_s, "nominal_hz": 1000, "produced": scans, "lost": 0,
                 "note": "3 boards, clocks within 0.3 ms"},
            ],
            "consumers": [
                {"name": "inference", "consumed": scans - 12, "dropped": 0, "beat_age_s": 0.011,
                 "state": "gone" if self.state == "STOP" else "live"},
                {"name": "recorder", "consumed": scans, "dropped": 0, "beat_age_s": 0.02,
                 "state": "live"},
                {"name": "view", "consumed": scans - 900, "dropped": 880, "beat_age_s": 0.04,
                 "state": "live"},
            ],
            "latency_ms": {"capture to window": [0.6, 1.1, 1.9], "features": [4.2, 5.0, 6.8],
                           "decision": [0.1, 0.2, 0.3], "action": [0.3, 0.5, 0.9],
                           "all": [5.3, 6.6, 9.4]},
            "gripper": {"interlock": "closed", "armed": self.armed, "force_n": 12.4,
                        "commanded_n": 14.0, "motion": "holding", "note": ""},
            "recording": self.recording, "cameras": self._cameras, "array": self._array,
        }  # fmt: skip

    def frame(self, camera):
        return self._frames.get(camera)

    def traces(self, since_s):
        pairs = [(t, p) for t, p in list(self._traced) if t > since_s]
        scans = [(t, v) for t, v in list(self._scans) if t > since_s][::2]
        newest = [v for _, v in list(self._scans)[-12:]]
        values = np.array([v for _, v in scans]).T
        return {
            "time_s": max([since_s, *(t for t, _ in pairs), *(t for t, _ in scans)]),
            "probability": {"t": [t for t, _ in pairs], "p": [p for _, p in pairs]},
            "sensors": {"t": [t for t, _ in scans], "values": np.round(values, 3).tolist()},
            "map": (np.array(newest) / 3.3).tolist() if newest else None,
            "events": [{"t": t, "text": text} for t, text in list(self.events) if t > since_s],
        }

    def acknowledge(self, seen=()):
        self.commands.append("acknowledge")
        self.alarms = [{**alarm, "acknowledged": True} for alarm in self.alarms]

    def disarm(self):
        self.commands.append("disarm")
        self.armed = False

    def record(self, on, labels):
        self.commands.append(("record", on, labels))
        self.recording |= {"on": on, "path": "grasp-017.mcap", "seconds": 0.0, "bytes": 0}
        return ""

    def _see(self, url: str, opened: threading.Event) -> None:
        with open_source(url) as source:
            self._cameras = [
                {"name": c.name, "width": c.width, "height": c.height} for c in source.cameras
            ]
            opened.set()
            while not self._stop.is_set():
                source.read()
                for frame in source.frames():
                    self._produced[0] += 1
                    self._frames[frame.camera] = (self._produced[0], frame.jpeg)

    def _feel(self, url: str, opened: threading.Event) -> None:
        with open_source(url) as source:
            info = source.info
            self._array = {
                "name": info.name, "channels": list(info.channels), "unit": "V", "rows": 12,
            }  # fmt: skip
            opened.set()
            last_s = 0.0
            while not self._stop.is_set():
                samples: Samples = source.read()
                self._produced[1] += len(samples)
                for t, value in zip(samples.fitted_s.tolist(), samples.values, strict=True):
                    if t - last_s >= 0.0099:
                        last_s = t
                        self._scans.append((t, value))
