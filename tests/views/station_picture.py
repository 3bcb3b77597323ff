"""Take the picture of README and gallery from a running station, not from invented states.

python tests/views/station_picture.py PICTURE, after `taxel demo`; needs Chromium and quiet.
"""

import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from chromium import Browser

STATION = [
    "live", "cup-pour", "sim://cup-pour?force_n=15&seed=3", "--also", "demo/shape.taxel", "--also",
    "demo/material.taxel", "--beside", "sim://teng?seed=1", "--gripper", "sim", "--arm", "--page",
]  # fmt: skip
SETTLE_S = 12.0
"""After the start, in which processes still load and their first latencies are no measure."""
LONGEST_S = 180.0
STATE = "document.getElementById('word').textContent"
PRESSED = """(() => {
    const map = document.getElementById('hand');
    const bytes = map.getContext('2d').getImageData(0, 0, map.width, map.height).data;
    let bright = 0;
    for (let at = 0; at < bytes.length; at += 4) {
        if (bytes[at + 1] > 130 && bytes[at + 2] < 150) bright += 1;
    }
    return bright / (bytes.length / 4) > 0.04;
})()"""
"""Whether pads of the hand's map are green to yellow: it holds something."""
SHOWN = f"['WARNING', 'UNSTABLE'].includes({STATE}) && {PRESSED}"


def take(picture: Path) -> None:
    """Write the picture at a moment in which the cup slips and the hand holds something."""
    command = [sys.executable, "-m", "taxel.cli.main", *STATION]
    station = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert station.stdout is not None
    try:
        url = next(found[0] for line in station.stdout if (found := re.search(r"http://\S+", line)))
        # Chromium may still be writing its profile when the folder is removed.
        scratch = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        with scratch as folder, Browser(Path(folder)) as browser:
            browser.open(url)
            time.sleep(SETTLE_S)
            until_s = time.monotonic() + LONGEST_S
            while time.monotonic() < until_s:
                if browser.ask(SHOWN):
                    browser.picture(picture)
                    if browser.ask(SHOWN):  # still: so it was while the picture was taken
                        print(f"{picture}: {browser.ask(STATE)}")
                        return
                time.sleep(0.02)
            sys.exit(f"needed a warning within {LONGEST_S:g} s; got none; start again")
    finally:
        station.terminate()
        station.wait(10)


if __name__ == "__main__":
    take(Path(sys.argv[1]))
