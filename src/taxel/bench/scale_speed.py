"""Rows of `taxel bench scale` about speed: two cores against one, on a quiet machine only.

Source of the goals: issue 19; background: docs/decisions/0050.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from time import perf_counter

from taxel.bench.rows import Row, missing, row
from taxel.bench.scale_plan import GOAL, WORKS
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
"""Most processes that may be running beside this one, by the system's mean of a minute. Source:
our choice, docs/decisions/0050."""
FEW = CupPourConfig(cups=2, positions=("upper", "middle", "lower"), forces_n=(15.0, 25.0, 50.0))
POURS = replace(FEW, cups=6)
"""A minute's work, in which the workers' start of two to four seconds is little.
Source: our choice, 0050."""
_SCANS, _FOLD_EPOCHS = 20_000, 400
_EPOCHS = (1, 3)
"""Of the two trainings whose difference is the time of two epochs, without start and features.
Source: our choice, 0050."""


def speed_rows() -> list[Row]:
    """Return how many times faster two workers are than one process."""
    load = os.getloadavg()[0]
    if load > QUIET or usual_workers() < 2:
        why = f"needs two cores for itself: {usual_workers()} here, load {load:.1f}; measure again"
        return [
            missing(name, "ratio", f">= {GOAL:g}" if kind == "cores" else "", why)
            for name, kind in WORKS.values()
        ]
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        folder = Path(scratch)
        simulate_presets(folder, ("honest",), _SCANS, 1)
        write_pours(folder / "few", FEW, workers=1)
        return [
            _speed("simulation", lambda at: write_pours(folder / f"pours-{at}", POURS, workers=at)),
            _speed("folds", lambda at: _folds(folder / "honest", at)),
            _speed("extraction", lambda at: _extraction(folder, at)),
            training_row(folder / "few", folder),
        ]


def _speed(what: str, work: Callable[[int], object]) -> Row:
    seconds = []
    for workers in (1, 2):
        started = perf_counter()
        with bound_to(workers), use_engine(LocalEngine(workers)):
            work(workers)
        seconds.append(perf_counter() - started)
    note = f"{seconds[0]:.0f} s on one core, {seconds[1]:.0f} s with two workers and their start"
    return row(WORKS[what][0], seconds[0] / seconds[1], "ratio", ">=", GOAL, note)


@contextmanager
def bound_to(cores: int) -> Iterator[None]:
    """Keep all of this process's threads on its first few cores until the block ends.

    One process alone may use more than one core, for OpenCV has threads of its own: two cores
    against one are only compared where the one is held to it. Does nothing outside Linux.

    Args:
        cores: How many cores there are for this process and those that it starts.
    """
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    own = os.sched_getaffinity(0)
    _bind(set(sorted(own)[:cores]))
    try:
        yield
    finally:
        _bind(own)


def _bind(cores: set[int]) -> None:
    for thread in os.listdir("/proc/self/task"):
        with suppress(ProcessLookupError):  # ended meanwhile
            os.sched_setaffinity(int(thread), cores)


def training_row(pours: Path, folder: Path) -> Row:
    """Return how many times faster two processes under torchrun train an epoch than one.

    Args:
        pours: Recordings to learn from.
        folder: For weights and features.
    """
    name, _ = WORKS["training"]
    if find_spec("lightning_fabric") is None:
        return missing(name, "ratio", "", "lightning-fabric is not installed")
    _train(pours, folder, 1, 1)  # which also extracts the features that all start from
    each = []
    for processes in (1, 2):
        short, long = (_train(pours, folder, processes, epochs) for epochs in _EPOCHS)
        each.append((long - short) / (_EPOCHS[1] - _EPOCHS[0]))
    if min(each) <= 0:
        why = "the start varied by more than two epochs take; measure again on a quiet machine"
        return missing(name, "ratio", "", why)
    note = f"{each[0]:.1f} s an epoch alone, {each[1]:.1f} s with two (gloo, on the processor)"
    return Row(name=name, value=each[0] / each[1], unit="ratio", goal="", ok=None, note=note)


def _train(pours: Path, folder: Path, processes: int, epochs: int) -> float:
    """Return the seconds of a training from its start to its end."""
    words = ["--backbone", "edge", "--frames", "2", "--epochs", str(epochs)]
    weights = folder / f"{processes}-{epochs}.safetensors"
    places = ["--cache", str(folder / "features"), "--output", str(weights)]
    run = [sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node",
           str(processes), "-m", "taxel.cli.main", "train-backbone", str(pours)]  # fmt: skip
    started = perf_counter()
    subprocess.run([*run, *words, *places], check=True, capture_output=True)
    return perf_counter() - started


def _folds(folder: Path, _: int) -> None:
    recipe = find_recipe("teng")
    recipe = replace(recipe, model="touchnet", train=replace(recipe.train, epochs=_FOLD_EPOCHS))
    check_recipe(folder, recipe, folds=12, bars=())


def _extraction(folder: Path, workers: int) -> None:
    pours, own = read_camera_recordings(folder / "pours-1"), SlipExtractor(SETTLE)
    cache = folder / f"cache-{workers}"
    if workers == 1:
        from taxel.training.features import extract

        extract(pours, own, cache)
    else:
        fill_cache(pours, [own] * len(pours), cache)
