"""The page in a real browser, headless Chromium, driven over its own debugging socket.

Run as a program it serves the simulators' page to look at, or writes its pictures:
python tests/views/test_page_browser.py [FOLDER]. The states it walks through are invented.
"""

import base64
import contextlib
import json
import shutil
import subprocess
import sys
import threading
import time
from collections import deque
from pathlib import Path

import numpy as np
import pytest
from websockets.sync.client import connect

from taxel.signals import Samples
from taxel.sources.opening import open_source
from taxel.views.page.server import PageServer, serve_page

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
needs_chromium = pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed")
FLAGS = (
    "--headless=new --no-sandbox --disable-gpu --disable-quic --no-first-run --hide-scrollbars "
    "--disable-background-networking --disable-component-update --disable-sync "
    "--disable-extensions --mute-audio --remote-debugging-port=0"
).split()
STATES = {
    "STABLE": ("", 0.08), "WARNING": ("", 0.62), "UNSTABLE": ("", 0.93),
    "UNKNOWN": ("camera right has been frozen for 0.24 s", None),
    "STOP": ("inference gave no beat for 52 ms", None),
}  # fmt: skip


class SimStation:
    """A station fed by simulators: a hand, and two cameras; its state is set by hand."""

    def __init__(self, pour: str | None, hand: str | None) -> None:
        self.state = "STABLE"
        self.said: list[object] = []
        self.alarms: list[dict[str, object]] = []
        self.frozen_s: float | None = None
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
                0, {"kind": state, "text": texts[state], "level": level, "since_s": now,
                    "acknowledged": False},
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
        return {
            "time_s": now, "state": self.state, "reason": reason, "since_s": self._since_s,
            "probability": None if goal is None else self._traced[-1][1],
            "thresholds": {"clear": 0.3, "warn": 0.5, "unstable": 0.8},
            "alarms": self.alarms,
            "answers": [
                {"target": "shape", "label": "cylinder", "confidence": 0.94, "reason": ""},
                {"target": "material", "label": "unknown", "confidence": 0.41,
                 "reason": "below the confidence that is asked for"},
            ] if self._array else [],
            "sources": [
                {"name": "pour", "url": "sim://cup-pour", "kind": "cameras",
                 "state": "frozen" if late else "live", "rate_hz": cameras / run_s / 2,
                 "nominal_hz": 25, "produced": cameras, "lost": 3,
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
            "gripper": {"interlock": "closed", "armed": True, "force_n": 12.4,
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

    def acknowledge(self):
        self.said.append("acknowledge")
        self.alarms = [{**alarm, "acknowledged": True} for alarm in self.alarms]

    def record(self, on, labels):
        self.said.append(("record", on, labels))
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


class Browser:
    """Headless Chromium with one page."""

    def __init__(self, folder: Path, width: int = 1280, height: int = 720) -> None:
        self._process = subprocess.Popen(
            [str(CHROMIUM), *FLAGS, f"--user-data-dir={folder}", "about:blank"],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        self.complaints: list[str] = []
        self._number = 0
        self._open = contextlib.ExitStack()
        try:
            opening = connect(self._address(folder), max_size=None, open_timeout=20)
            self._socket = self._open.enter_context(opening)
            for domain in ("Page", "Runtime", "Log"):
                self.call(f"{domain}.enable")
            self.size(width, height)
        except BaseException:
            self._end()
            raise

    def __enter__(self) -> "Browser":
        return self

    def __exit__(self, *_: object) -> None:
        with contextlib.suppress(Exception):
            self.call("Browser.close")
        self._open.close()
        self._end()

    def call(self, method: str, **parameters: object) -> dict:
        self._number += 1
        self._socket.send(json.dumps({"id": self._number, "method": method, "params": parameters}))
        while True:
            answer = json.loads(self._socket.recv(timeout=20))
            if answer.get("id") == self._number:
                assert "error" not in answer, answer
                return answer["result"]
            self._note(answer)

    def size(self, width: int, height: int) -> None:
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height,
                  deviceScaleFactor=1, mobile=False)  # fmt: skip

    def open(self, url: str) -> None:
        self.call("Page.navigate", url=url)

    def ask(self, script: str) -> object:
        answer = self.call(
            "Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True
        )
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    def until(self, script: str, within_s: float = 10.0) -> object:
        """Return what a script gives as soon as that is true."""
        until_s = time.monotonic() + within_s
        while not (value := self.ask(script)):
            assert time.monotonic() < until_s, f"{script} stayed {value!r}; {self.complaints}"
            time.sleep(0.03)
        return value

    def key(self, key: str, text: str = "") -> None:
        code = {"A": 65, " ": 32, "ESCAPE": 27}.get(key.upper(), 0)
        for kind in ("keyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=key,
                      text=text if kind == "keyDown" else "", windowsVirtualKeyCode=code)  # fmt: skip

    def picture(self, path: Path) -> None:
        image = self.call("Page.captureScreenshot", format="png")["data"]
        path.write_bytes(base64.b64decode(image))

    def _address(self, folder: Path) -> str:
        told = folder / "DevToolsActivePort"
        until_s = time.monotonic() + 30
        while not (told.exists() and len(told.read_text().split()) == 2):
            assert time.monotonic() < until_s, "chromium did not start"
            time.sleep(0.05)
        port = told.read_text().split()[0]
        from urllib.request import urlopen

        while True:
            with urlopen(f"http://127.0.0.1:{port}/json/list") as answer:
                pages = [one for one in json.load(answer) if one["type"] == "page"]
            if pages:
                return str(pages[0]["webSocketDebuggerUrl"])
            time.sleep(0.05)

    def _note(self, event: dict) -> None:
        if event.get("method") == "Runtime.exceptionThrown":
            details = event["params"]["exceptionDetails"]
            self.complaints.append(str(details.get("exception", details))[:400])
        if event.get("method") == "Log.entryAdded":
            self.complaints.append(event["params"]["entry"]["text"])

    def _end(self) -> None:
        self._process.terminate()
        try:
            self._process.wait(10)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


def look(folder: Path) -> None:
    """Write a picture of each state in two sizes."""
    station = SimStation("sim://cup-pour", "sim://teng")
    profile = folder / "profile"
    try:
        with serve_page(station) as server, Browser(profile) as browser:
            browser.open(server.url)
            for state in ("STABLE", "WARNING", "UNSTABLE", "UNKNOWN", "STOP", "STABLE", "WARNING"):
                station.become(state)
                time.sleep(5)
                for width, height in ((1280, 720), (1920, 1080)):
                    browser.size(width, height)
                    time.sleep(0.7)
                    browser.picture(folder / f"{state}-{height}.png")
            browser.size(800, 1000)
            time.sleep(0.7)
            browser.picture(folder / "narrow.png")
            browser.size(3840, 2160)
            time.sleep(1)
            browser.picture(folder / "4k.png")
            browser.size(1920, 1080)
            browser.key("?", "?")
            time.sleep(0.5)
            browser.picture(folder / "help.png")
            browser.key("Escape")
            station.frozen_s = time.monotonic()
            time.sleep(1.2)
            browser.picture(folder / "stale.png")
            print(browser.complaints, server.ledger)
    finally:
        station.close()
        shutil.rmtree(profile, ignore_errors=True)


if __name__ == "__main__":
    target = Path(sys.argv[1])
    target.mkdir(exist_ok=True)
    look(target)
