"""The page in a real browser, headless Chromium, driven over its own debugging socket.

Run as a program it writes the page's pictures, fed by the simulators or a recording:
python tests/views/test_page_browser.py FOLDER [RECORDING]. The states shown are invented.
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
from taxel.views.page.server import serve_page

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
needs_chromium = pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed")
FLAGS = [
    "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--hide-scrollbars", "--disable-background-networking", "--disable-component-update",
    "--disable-sync", "--disable-extensions", "--mute-audio", "--remote-debugging-port=0",
]  # fmt: skip
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
            typed = text if kind == "keyDown" else ""
            self.call(
                "Input.dispatchKeyEvent", type=kind, key=key, text=typed,
                windowsVirtualKeyCode=code,
            )  # fmt: skip

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
        entry = event["params"]["entry"] if event.get("method") == "Log.entryAdded" else {}
        if entry.get("level") == "error" and "favicon" not in entry["text"]:
            self.complaints.append(entry["text"])

    def _end(self) -> None:
        self._process.terminate()
        try:
            self._process.wait(10)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    if CHROMIUM is None:
        pytest.skip("chromium is not installed")
    with Browser(tmp_path_factory.mktemp("chromium")) as opened:
        yield opened


@pytest.fixture
def station():
    made = SimStation(None, None)
    made._array = {"name": "own", "channels": ["a", "b"], "unit": "V", "rows": 12}
    yield made
    made.close()


@pytest.fixture
def opened(browser, station):
    """A page on a station without cameras, in its first state."""
    browser.complaints.clear()
    with serve_page(station) as server:
        browser.open(server.url)
        browser.until(f"{WORD} === 'STABLE'")
        yield server
        browser.open("about:blank")
    assert browser.complaints == []


WORD = "document.getElementById('word')?.textContent"


def hidden(panel: str) -> str:
    return f"document.getElementById('{panel}').hidden"


def test_the_key_is_taken_out_of_the_address_and_never_into_a_request(browser, opened):
    assert browser.ask("location.href") == opened.origin + "/"
    assert browser.ask("document.cookie") == ""


@pytest.mark.parametrize("state", list(STATES))
def test_each_state_differs_in_word_sign_and_pattern_not_in_colour_alone(
    browser, opened, station, state
):
    station.become(state)

    browser.until(f"{WORD} === '{state}'")
    look = "getComputedStyle(document.getElementById('state'))"
    assert browser.ask("document.getElementById('symbol').getAttribute('href')") == f"#sym-{state}"
    has_pattern = browser.ask(f"{look}.backgroundImage !== 'none' || {look}.borderStyle !== 'solid'"
                              f" || {look}.borderColor !== {look}.backgroundColor")  # fmt: skip
    assert has_pattern == (state != "STABLE")
    assert browser.ask("document.getElementById('spoken').textContent").startswith(state)


def test_a_state_that_is_no_word_of_ours_is_shown_as_unknown(browser, opened, station):
    STATES["FINE"] = ("", 0.1)
    station.state = "FINE"
    try:
        browser.until(f"{WORD} === 'UNKNOWN'")
    finally:
        station.state = "STABLE"
        del STATES["FINE"]


def test_a_station_that_stands_still_is_stale_within_a_second_though_messages_still_come(
    browser, opened, station
):
    """The server lives and pushes on; what it shows no longer moves."""
    station.frozen_s = time.monotonic()
    stood = browser.ask(
        "new Promise(done => { const start = performance.now();"
        " const look = () => { const word = document.getElementById('word').textContent;"
        " if (word === 'STALE') done(performance.now() - start); else setTimeout(look, 10); };"
        " look(); })"
    )

    assert stood < 1000
    assert browser.ask("document.getElementById('board').classList.contains('lost')")
    assert browser.ask("document.title") == "STALE – taxel"
    station.frozen_s = None
    browser.until(f"{WORD} === 'STABLE'")


def test_a_server_that_is_gone_is_no_connection_never_the_last_state(browser, station):
    with serve_page(station) as server:
        browser.open(server.url)
        browser.until(f"{WORD} === 'STABLE'")
    browser.until(f"{WORD} === 'NO CONNECTION'", within_s=3)
    assert browser.ask("getComputedStyle(document.getElementById('probability')).opacity") == "0.32"
    browser.open("about:blank")


def test_without_the_key_the_page_says_what_is_missing(browser, station):
    with serve_page(station) as server:
        browser.call("Network.clearBrowserCookies")
        browser.open(server.origin)
        browser.until("document.getElementById('reason')?.textContent.startsWith('needed the key')")
        assert browser.ask(WORD) == "NO CONNECTION"
        browser.open("about:blank")


@pytest.mark.parametrize("key", ["a", " "])
def test_a_key_acknowledges_and_the_alarm_says_so(browser, opened, station, key):
    station.become("WARNING")
    browser.until("!document.getElementById('acknowledge').disabled")
    browser.key(key, key)

    browser.until("document.getElementById('acknowledge').disabled")
    assert station.said == ["acknowledge"]
    assert "acknowledged" in str(browser.ask("document.querySelector('#alarmlist').textContent"))


def test_r_records_with_the_labels_that_were_typed_and_r_in_a_field_is_a_letter(
    browser, opened, station
):
    browser.until("!!document.querySelector('#labels input')")
    browser.ask("document.querySelector('#labels input[name=object]').focus()")
    for letter in "ar":
        browser.key(letter, letter)
    browser.key("Escape")
    browser.key("r", "r")
    browser.until("!document.getElementById('recmark').hidden")
    browser.key("r", "r")
    browser.until("document.getElementById('recmark').hidden")

    assert station.said == [("record", True, {"object": "ar"}), ("record", False, {})]


def test_panels_that_do_not_apply_are_not_shown(browser, opened):
    browser.until(f"!{hidden('sensors')}")
    assert browser.ask(hidden("cameras"))
    assert browser.ask(hidden("replay"))
    assert browser.ask(hidden("handpanel"))  # two channels are no hand
    assert not browser.ask(hidden("probability"))


def test_the_gripper_is_shown_without_any_control(browser, opened):
    browser.until("!!document.querySelector('#gripper dd')")
    assert (
        browser.ask("document.querySelectorAll('#gripper :is(button, input, select, a)').length")
        == 0
    )


def test_the_sound_button_says_that_it_waits_then_sounds_then_is_muted(browser, opened):
    told = "document.getElementById('sound').textContent"
    assert str(browser.ask(told)).startswith("Click to enable sound")
    browser.key("x", "x")
    browser.until(f"{told}.startsWith('Sound on')")
    time.sleep(0.75)  # the press that enables sound does not mute it
    browser.key("m", "m")
    browser.until(f"{told}.startsWith('MUTED')")


def test_the_word_fits_its_field_at_every_size(browser, opened, station):
    fits = (
        "(() => { const field = document.querySelector('.words').getBoundingClientRect();"
        " const letters = document.createRange();"
        " letters.selectNodeContents(document.getElementById('word'));"
        " return letters.getBoundingClientRect().right <= field.right; })()"
    )
    try:
        for width, height in ((800, 900), (1280, 720), (1920, 1080), (3840, 2160)):
            browser.size(width, height)
            for state in ("UNKNOWN", "UNSTABLE", "WARNING"):
                station.become(state)
                browser.until(f"{WORD} === '{state}'")
                assert browser.ask(fits), (width, state)
            if width >= 1000:
                assert browser.ask("document.documentElement.scrollHeight <= innerHeight"), width
    finally:
        browser.size(1280, 720)


@needs_chromium
def test_both_simulators_are_seen_images_map_and_traces(browser):
    browser.complaints.clear()
    station = SimStation("sim://cup-pour?duration_s=2", "sim://teng")
    lit = (
        "(() => {{ const c = document.querySelector('{0}'); if (!c) return 0;"
        " const drawn = c.getContext('2d').getImageData(0, 0, c.width, c.height);"
        " return new Set(drawn.data).size; }})()"
    )
    try:
        with serve_page(station) as server:
            browser.open(server.url)
            for canvas in ("#cameras figure:nth-child(2) canvas", "#map", "#hand",
                           "#probability canvas", "#sensors canvas"):  # fmt: skip
                browser.until(f"{lit.format(canvas)} > 8")
            browser.open("about:blank")
    finally:
        station.close()
    assert browser.complaints == []


def wait_for_touch(station: SimStation, browser: Browser) -> None:
    """Wait, 6 s at most, for a moment in which the hand is pressed and both images are live."""
    until_s = time.monotonic() + 6
    while time.monotonic() < until_s:
        live = browser.ask("!document.querySelector('.quiet')")
        if live and station._scans[-1][1].mean() > 1.5:
            return
        time.sleep(0.01)


def look(folder: Path) -> None:
    """Write a picture of each state in two sizes."""
    station = SimStation("sim://cup-pour", "sim://teng")
    profile = folder / "profile"
    try:
        with serve_page(station) as server, Browser(profile) as browser:
            browser.open(server.url)
            for state in ("STABLE", "WARNING", "UNSTABLE", "UNKNOWN", "STOP", "STABLE", "WARNING"):
                station.become(state)
                time.sleep(4)
                for width, height in ((1280, 720), (1920, 1080)):
                    browser.size(width, height)
                    time.sleep(0.7)
                    wait_for_touch(station, browser)
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


def look_at(recording: Path, folder: Path) -> None:
    """Write a picture of a recording's replay."""
    from taxel.views.page.replay_link import ReplayLink

    link = ReplayLink(recording)
    with serve_page(link) as server, Browser(folder / "profile") as browser:
        browser.open(server.url)
        browser.until(f"{WORD} === 'REPLAY'")
        link.seek((link.overview()["start_s"] + link.overview()["end_s"]) / 2)
        time.sleep(1)
        browser.picture(folder / f"replay-{recording.stem}.png")
        print(browser.complaints)
    shutil.rmtree(folder / "profile", ignore_errors=True)


if __name__ == "__main__":
    target = Path(sys.argv[1])
    target.mkdir(exist_ok=True)
    if len(sys.argv) == 2:
        look(target)
    for name in sys.argv[2:]:
        look_at(Path(name), target)
