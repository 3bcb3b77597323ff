"""Rows of `taxel bench scale` about large folders: many recordings opened, many pours written.

Source of the goals: issue 19; background: docs/decisions/0050.
"""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import numpy as np

from taxel.bench.rows import Row, missing, row
from taxel.bench.scale.speed import QUIET
from taxel.jobs.local import LocalEngine
from taxel.jobs.running import use_engine
from taxel.recordings.manifest import Manifest
from taxel.recordings.reader import list_recordings, read_manifest
from taxel.recordings.writer import Recorder
from taxel.signals import Samples, SensorInfo
from taxel.sim.pour.cup_pour import CupPourConfig
from taxel.sources.simulated.pour_folder import write_pours

RECORDINGS = 10_000
"""As the issue asks."""
_GOAL_S = 2.0
MANY_POURS = CupPourConfig(
    cups=84, positions=("upper", "middle", "lower"), forces_n=(15.0, 25.0, 40.0, 50.0),
    duration_s=1.0, frame_hz=15.0,
)  # fmt: skip
"""1,008 pours of a second. Source: issue 19."""


def folder_rows() -> list[Row]:
    """Return how long a folder of many short recordings takes to list, and to open."""
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        folder = Path(scratch)
        content = _short(folder / "first.mcap")
        for number in range(RECORDINGS - 1):
            (folder / f"recording-{number:05d}.mcap").write_bytes(content)
        started, cpu_s = perf_counter(), process_time()
        files = list_recordings(folder)
        listed_s = perf_counter() - started
        for file in files:
            read_manifest(file)
        seconds, cpu_s = perf_counter() - started, process_time() - cpu_s
    note = f"the list alone {listed_s:.2f} s; {cpu_s:.2f} s of a core in all"
    name = f"{RECORDINGS:,} short recordings listed and each one's manifest read"
    if seconds > _GOAL_S >= cpu_s and os.getloadavg()[0] > QUIET:
        why = f"{seconds:.1f} s on a machine with a load of {os.getloadavg()[0]:.0f}; {note}"
        return [missing(name, "s", f"<= {_GOAL_S:g}", why)]
    return [row(name, seconds, "s", "<=", _GOAL_S, note)]


def memory_rows() -> list[Row]:
    """Return how memory of all processes grows from the first quarter of many pours to the last."""
    import psutil

    held: list[int] = []

    def look(_: dict[str, Any]) -> None:
        processes = [psutil.Process(), *psutil.Process().children(recursive=True)]
        held.append(sum(process.memory_info().rss for process in processes))

    with (
        tempfile.TemporaryDirectory(prefix="taxel-") as scratch,
        use_engine(LocalEngine(2)),
    ):
        rows = write_pours(Path(scratch) / "set", MANY_POURS, look)
    quarter = len(held) // 4
    parts = (held[quarter : 2 * quarter], held[-quarter:])
    early, late = (float(np.median(part)) for part in parts)
    note = f"{early / 2**20:.0f} MiB → {late / 2**20:.0f} MiB over {len(rows)} pours, 2 workers"
    name = "memory, last quarter of the pours over the second"
    return [row(name, late / early, "ratio", "<=", 1.05, note)]


def _short(path: Path) -> bytes:
    sensor = SensorInfo(name="pads", channels=("left", "right"), units=("V", "V"), rate_hz=100.0)
    with Recorder(path, Manifest.started_now(sensor)) as recorder:
        recorder.write(Samples.from_values(np.zeros((50, 2), np.float32), np.arange(50) / 100.0))
    return path.read_bytes()
