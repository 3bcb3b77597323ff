"""Rows of `taxel bench scale` about speed: two cores against one, on a quiet machine only.

Source of the goals: issue 19; background: docs/decisions/0050.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from time import perf_counter

from taxel.bench.rows import Row, missing, row
from taxel.evaluation.checked import check_recipe
from taxel.jobs.local import LocalEngine
from taxel.jobs.running import use_engine, usual_workers
from taxel.sim.cup_pour import CupPourConfig
from taxel.sources.data_sets import simulate_presets
from taxel.sources.pour_folder import write_pours
from taxel.training.extractors import SlipExtractor
from taxel.training.feature_jobs import fill_cache
from taxel.training.recipes import find_recipe
from taxel.windows.camera_recordings import read_camera_recordings
from taxel.windows.rest import SETTLE

QUIET = 0.3
"""Most processes that may wish to run beside this one, by the system's mean of a minute. Source:
our choice, docs/decisions/0050."""
POURS = CupPourConfig(cups=2, positions=("upper", "middle", "lower"), forces_n=(15.0, 25.0, 50.0))
_SCANS = 20_000
_GOAL = ">= 1.8"
_SAID = {"simulation": "18 pours", "folds": "12 folds of touchnet", "extraction": "18 pours"}


def speed_rows() -> list[Row]:
    """Return how many times faster two workers are than one process."""
    load = os.getloadavg()[0]
    if load > QUIET or usual_workers() < 2:
        why = f"needs two cores for itself: {usual_workers()} here, load {load:.1f}; measure again"
        return [missing(_name(what), "ratio", _GOAL, why) for what in _SAID]
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        folder = Path(scratch)
        simulate_presets(folder, ("honest",), _SCANS, 1)
        return [
            _speed("simulation", lambda at: write_pours(folder / f"pours-{at}", POURS, workers=at)),
            _speed("folds", lambda at: _folds(folder / "honest", at)),
            _speed("extraction", lambda at: _extraction(folder, at)),
        ]


def _speed(what: str, work: Callable[[int], object]) -> Row:
    seconds = []
    for workers in (1, 2):
        started = perf_counter()
        with use_engine(LocalEngine(workers)):
            work(workers)
        seconds.append(perf_counter() - started)
    note = f"{seconds[0]:.0f} s alone, {seconds[1]:.0f} s with two workers and their start"
    return row(_name(what), seconds[0] / seconds[1], "ratio", ">=", 1.8, note)


def _folds(folder: Path, _: int) -> None:
    recipe = find_recipe("teng")
    recipe = replace(recipe, model="touchnet", train=replace(recipe.train, epochs=20))
    check_recipe(folder, recipe, folds=12, bars=())


def _extraction(folder: Path, workers: int) -> None:
    pours, own = read_camera_recordings(folder / "pours-1"), SlipExtractor(SETTLE)
    cache = folder / f"cache-{workers}"
    if workers == 1:
        from taxel.training.features import extract

        extract(pours, own, cache)
    else:
        fill_cache(pours, [own] * len(pours), cache)


def _name(what: str) -> str:
    return f"two cores against one, {what} ({_SAID[what]})"
