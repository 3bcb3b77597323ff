"""Headless Chromium with the page in it, driven over its own debugging socket."""

import base64
import contextlib
import json
import shutil
import subprocess
import time
from pathlib import Path
from urllib.request import urlopen

from websockets.sync.client import connect

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
FLAGS = [
    "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--hide-scrollbars", "--disable-background-networking", "--disable-component-update",
    "--disable-sync", "--disable-extensions", "--mute-audio", "--remote-debugging-port=0",
]  # fmt: skip
WORD = "document.getElementById('word')?.textContent"
"""The word that the page shows."""


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
        place = folder / "DevToolsActivePort"
        until_s = time.monotonic() + 30
        while not (place.exists() and len(place.read_text().split()) == 2):
            assert time.monotonic() < until_s, "chromium did not start"
            time.sleep(0.05)
        port = place.read_text().split()[0]
        while True:
            with urlopen(f"http://127.0.0.1:{port}/json/list") as answer:
                pages = [page for page in json.load(answer) if page["type"] == "page"]
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
