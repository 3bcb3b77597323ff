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
from time import perf_counter, sleep

import numpy as np

from taxel.bench.rows import Row, missing, row
from taxel.bench.scale.plan import GOAL, WORKS
from taxel.evaluation.camera_trials.trial_set import Sight, load_trial_set
from taxel.evaluation.checked import check_recipe
from taxel.jobs.local import LocalEngine
from taxel.jobs.running import use_engine, usual_workers
from taxel.sim.pour.cup_pour import CupPourConfig
from taxel.sources.simulated.data_sets import simulate_presets
from taxel.sources.simulated.pour_folder import write_pours
from taxel.training.camera_trials.blend import fit_blend
from taxel.training.camera_trials.image_network import find_image_network
from taxel.training.frames.extractors import SlipExtractor
from taxel.training.frames.jobs import fill_cache
from taxel.training.recipes import find_recipe
from taxel.windows.camera_recordings import CameraRecording, read_camera_recordings
from taxel.windows.camera_trials import CameraTrial, read_camera_trials
from taxel.windows.rest import SETTLE

QUIET = 0.3
"""Most processes that may be running beside this one, by the system's mean of a minute. Source:
our choice, docs/decisions/0050."""
FEW = CupPourConfig(cups=2, positions=("upper", "middle", "lower"), forces_n=(15.0, 25.0, 50.0))
POURS = replace(FEW, cups=6)
"""A minute's work, in which the workers' start of two to four seconds is little.
Source: our choice, 0050."""
_SCANS, _FOLD_EPOCHS = 20_000, 400
ROUNDS = {"simulation": 3, "folds": 1, "extraction": 3, "camera trials": 3}
"""How often one and two workers follow each other: neighbours on a shared machine move a ratio by
a tenth, and the median is given. A round of folds takes five minutes. Source: our choice, 0050."""
_PATIENCE_S, _LOOK_S = 240.0, 5.0
"""How long the machine may take to become quiet, since a measurement before this one counts in the
mean of a minute, and how often it is looked at, seconds. Source: our choice."""
_EPOCHS = (1, 11)
"""Of the two trainings whose difference is the time of ten epochs, without start and features.
Source: our choice, 0050."""


def full_steps() -> list[tuple[str, Callable[[], list[Row]]]]:
    """Return the measurements, each by itself: together they take twenty minutes."""
    return [
        ("two cores against one: simulation", lambda: _if_quiet("simulation", _simulation)),
        ("two cores against one: folds", lambda: _if_quiet("folds", _folds)),
        ("two cores against one: extraction", lambda: _if_quiet("extraction", _extraction)),
        ("two cores against one: camera trials", lambda: _if_quiet("camera trials", _trials)),
        ("two cores against one: training", lambda: _if_quiet("training", _training)),
    ]


def _if_quiet(what: str, measure: Callable[[Path], Row]) -> list[Row]:
    """Return the row, or why it cannot be measured now."""
    name, kind = WORKS[what]
    load = _load_at_rest()
    if load > QUIET or usual_workers() < 2:
        why = f"needs two cores for itself: {usual_workers()} here, load {load:.1f}; measure again"
        return [missing(name, "ratio", f">= {GOAL:g}" if kind == "cores" else "", why)]
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        return [measure(Path(scratch))]


def _load_at_rest() -> float:
    """Return the machine's load once it is quiet, or after some minutes."""
    until = perf_counter() + _PATIENCE_S
    while (load := os.getloadavg()[0]) > QUIET and perf_counter() < until:
        sleep(_LOOK_S)
    return load


def _simulation(folder: Path) -> Row:
    return _speed(
        "simulation", lambda to, workers: write_pours(folder / to, POURS, workers=workers)
    )


def _folds(folder: Path) -> Row:
    simulate_presets(folder, ("honest",), _SCANS, 1)
    recipe = find_recipe("teng")
    recipe = replace(recipe, model="touchnet", train=replace(recipe.train, epochs=_FOLD_EPOCHS))
    return _speed("folds", lambda *_: check_recipe(folder / "honest", recipe, folds=12, bars=()))


def _extraction(folder: Path) -> Row:
    write_pours(folder / "pours", POURS, workers=2)
    pours = read_camera_recordings(folder / "pours")
    return _speed("extraction", lambda to, workers: _features(pours, folder / to, workers))


def _trials(folder: Path) -> Row:
    write_pours(folder / "pours", FEW, workers=2)
    trials = read_camera_trials(folder / "pours")
    return _speed("camera trials", lambda to, _: _learn_trials(trials, folder / to))


def _training(folder: Path) -> Row:
    write_pours(folder / "few", FEW, workers=1)
    return training_row(folder / "few", folder)


def _speed(what: str, work: Callable[[str, int], object]) -> Row:
    """Return the median of the rounds' ratios.

    Args:
        what: A key of `WORKS`.
        work: Does it, given a name that no other run has, and how many workers.
    """
    alone: list[float] = []
    shared: list[float] = []
    for turn in range(ROUNDS[what]):
        for workers, seconds in ((1, alone), (2, shared)):
            started = perf_counter()
            with bound_to(workers), use_engine(LocalEngine(workers)):
                work(f"{turn}-{workers}", workers)
            seconds.append(perf_counter() - started)
    ratios = np.array(alone) / np.array(shared)
    note = (
        f"{np.median(alone):.0f} s on one core, {np.median(shared):.0f} s with two workers and "
        f"their start; median of {len(ratios)}, {ratios.min():.2f} to {ratios.max():.2f}"
    )
    return row(WORKS[what][0], float(np.median(ratios)), "ratio", ">=", GOAL, note)


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
        why = "the start varied by more than ten epochs take; measure again on a quiet machine"
        return missing(name, "ratio", "", why)
    note = f"{each[0]:.1f} s an epoch alone, {each[1]:.1f} s with two (gloo, on the processor)"
    return Row(name=name, value=each[0] / each[1], unit="ratio", note=note)


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


def _learn_trials(read: list[CameraTrial], cache: Path) -> None:
    """Look at all that `train-trials` looks at, and fit its blend."""
    sight = Sight(network=find_image_network(), extras=True)
    trials = load_trial_set(read, "outcome", cache, sight=sight)
    learning = trials.learning(trials.rows, "position", trials.extras)
    fit_blend(learning, trials.cameras, trials.widths, 0)


def _features(pours: list[CameraRecording], cache: Path, workers: int) -> None:
    own = SlipExtractor(SETTLE)
    if workers == 1:
        from taxel.training.frames.features import extract

        extract(pours, own, cache)
    else:
        fill_cache(pours, [own] * len(pours), cache)
