"""A recorder in a process of its own, to be killed: scans at 1 kHz in real time.

The child prints the number of each block's last scan as soon as it is handed
over, so that the killer knows what was produced. Knows nothing about goals.
"""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from taxel.recordings.manifest import Manifest
from taxel.recordings.part_file import part_path
from taxel.recordings.reader import read_recording
from taxel.recordings.recovery import recover
from taxel.recordings.writer import Recorder
from taxel.signals import Samples, SensorInfo

CHANNELS, BLOCK = 12, 5
RATE_HZ = 1000.0


def kill_once(path: Path, after_scans: int) -> float:
    """Record in a child, kill -9 it, recover; return the seconds lost.

    Args:
        path: Where the child records to.
        after_scans: Kill when so many scans were produced.

    Raises:
        ValueError: What was recovered is not the first scans, whole and in order.
    """
    command = [sys.executable, __file__, str(path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as child:
        assert child.stdout is not None
        last = -1
        while last < after_scans:
            last = int(child.stdout.readline())
        child.kill()
        rest = child.stdout.read().split(b"\n")[:-1]
        last = int(rest[-1]) if rest else last
    recovered = path.with_suffix(".saved.mcap")
    recover(part_path(path), recovered)
    numbers = read_recording(recovered).samples.values[:, 0].astype(int)
    if not np.array_equal(numbers, np.arange(len(numbers))):
        raise ValueError("needed the first scans, whole and in order; got others")
    return (last + 1 - len(numbers)) / RATE_HZ


def kill_often(folder: Path, kills: int, seed: int = 9) -> list[float]:
    """Return the seconds lost at each of some kills at seeded random moments."""
    moments = np.random.default_rng(seed).integers(60, 500, kills)
    return [kill_once(folder / f"{i}.mcap", int(after)) for i, after in enumerate(moments)]


def record_until_killed(path: Path) -> None:
    """Record without end; channel 0 carries the scan's number."""
    names = tuple(f"s{i}" for i in range(CHANNELS))
    sensor = SensorInfo(name="t", channels=names, units=("V",) * CHANNELS, rate_hz=RATE_HZ)
    recorder = Recorder(path, Manifest.started_now(sensor))
    values = np.random.default_rng(0).random((BLOCK, CHANNELS)).astype(np.float32)
    start_s, first = time.monotonic(), 0
    while True:
        wait_s = start_s + (first + BLOCK) / RATE_HZ - time.monotonic()
        time.sleep(max(0.0, wait_s))
        number = np.arange(first, first + BLOCK)
        block = values.copy()
        block[:, 0] = number
        recorder.write(Samples.from_values(block, number / RATE_HZ))
        first += BLOCK
        sys.stdout.write(f"{first - 1}\n")
        sys.stdout.flush()


if __name__ == "__main__":
    record_until_killed(Path(sys.argv[1]))
