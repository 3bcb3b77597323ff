"""Write the page's pictures, fed by the simulators or a recording.

python tests/views/page_pictures.py FOLDER [RECORDING]; the states shown are invented.
"""

import shutil
import sys
import time
from pathlib import Path

from chromium import WORD, Browser
from page_station import SimStation

from taxel.views.page.replay_link import ReplayLink
from taxel.views.page.server import serve_page


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
