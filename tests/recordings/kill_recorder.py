"""A recorder in a process of its own, to be killed: scans at 1 kHz in real time.

Prints the number of each block's last scan as soon as it is handed over, so
that the killer knows what was produced. Not a test by itself.
"""

import sys
import time
from pathlib import Path

import numpy as np

from taxel.recordings.manifest import Manifest
from taxel.recordings.writer import Recorder
from taxel.signals import Samples, SensorInfo

CHANNELS, BLOCK = 12, 5


def main(path: Path) -> None:
    names = tuple(f"s{i}" for i in range(CHANNELS))
    sensor = SensorInfo(name="t", channels=names, units=("V",) * CHANNELS, rate_hz=1000.0)
    recorder = Recorder(path, Manifest.started_now(sensor))
    values = np.random.default_rng(0).random((BLOCK, CHANNELS)).astype(np.float32)
    start_s, first = time.monotonic(), 0
    while True:
        wait_s = start_s + (first + BLOCK) / 1000.0 - time.monotonic()
        time.sleep(max(0.0, wait_s))
        number = np.arange(first, first + BLOCK)
        block = values.copy()
        block[:, 0] = number
        recorder.write(Samples.from_values(block, number / 1000.0))
        first += BLOCK
        sys.stdout.write(f"{first - 1}\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
