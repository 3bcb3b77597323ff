"""Rows of `taxel bench scale` about a search that is killed and started again.

Source of the goals: issue 19; background: docs/decisions/0050.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from taxel.bench.rows import Row, missing, row
from taxel.sources.simulated.data_sets import simulate_presets

TRIALS, _SCANS = 6, 6_000
_LONGEST_S = 1800.0
"""The most that a search of this size may take, seconds. Source: our choice,
docs/decisions/0050."""
_LOST_ROW = "trials lost when a search is killed with -9 and started again"


def search_rows() -> list[Row]:
    """Kill a search by `taxel tune`, start it again, and compare it with an unbroken one."""
    if find_spec("optuna") is None:
        return [missing(_LOST_ROW, "trials", "<= 1", "optuna is not installed")]
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        folder = Path(scratch)
        simulate_presets(folder, ("honest",), _SCANS, 1)
        uninterrupted = _run(folder, "whole")
        process = subprocess.Popen(
            _words(folder, "broken"), env=_environment(), stdout=subprocess.DEVNULL
        )
        _until(folder / "broken.tune.db", process, 2 * TRIALS)
        process.kill()
        process.wait()
        done = _count(folder / "broken.tune.db", "COMPLETE", "PRUNED")
        again = _run(folder, "broken")
        lost = _count(folder / "broken.tune.db", "FAIL")
    same = all(
        again[key] == uninterrupted[key] for key in ("settings", "outer_accuracy", "inner_accuracy")
    )
    trivial = max(uninterrupted["trivial"].values())
    inner, outer = uninterrupted["inner_accuracy"], uninterrupted["outer_accuracy"]
    as_is = uninterrupted["outer_as_is"]["scores"]["accuracy"]
    note = (
        f"killed with {done} trials finished; settings and scores afterwards "
        f"{'equal' if same else 'unlike'} those of an unbroken search"
    )
    scores = f"simulated sessions held out; the recipe as it is {as_is:.3f}, "
    scores += f"best trivial baseline {trivial:.3f}"
    return [
        row(_LOST_ROW, lost, "trials", "<=", 1.0, note),
        Row(name="outer accuracy, settings found without the fold", value=outer, unit="share",
            note=scores),
        Row(name="inner accuracy of the best trial, which was chosen by it", value=inner,
            unit="share", note=f"{TRIALS} trials a search"),
    ]  # fmt: skip


def _words(folder: Path, name: str) -> list[str]:
    return [
        sys.executable, "-m", "taxel.cli.main", "tune", str(folder / "honest"),
        "--output", str(folder / name), "--trials", str(TRIALS), "--fold-count", "3",
        "--settings", "learning-rate", "weight-decay", "--epochs", "5", "--workers", "1", "--json",
    ]  # fmt: skip


def _run(folder: Path, name: str) -> dict[str, Any]:
    done = subprocess.run(
        _words(folder, name), env=_environment(), capture_output=True, text=True, check=True
    )
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def _environment() -> dict[str, str]:
    path = [str(Path(__file__).parents[3]), os.environ.get("PYTHONPATH", "")]
    return os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, path))}


def _until(database: Path, process: subprocess.Popen[bytes], finished: int) -> None:
    """Wait until so many trials are finished."""
    until_s = time.monotonic() + _LONGEST_S
    while _count(database, "COMPLETE", "PRUNED") < finished:
        assert process.poll() is None, "the search ended before it was killed"
        assert time.monotonic() < until_s, "the search takes too long"
        time.sleep(0.05)


def _count(database: Path, *states: str) -> int:
    import sqlite3

    if not database.exists():
        return 0
    with sqlite3.connect(f"file:{database}?mode=ro", uri=True, timeout=30) as connection:
        try:
            found = [state for (state,) in connection.execute("SELECT state FROM trials")]
        except sqlite3.OperationalError:  # its tables are still being made
            return 0
    return sum(state in states for state in found)
