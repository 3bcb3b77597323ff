"""Rows of `taxel bench audit`: a new class from 5 grasps, changed pads, corrections on the fly.

Knows nothing about how they are printed.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from time import perf_counter

import numpy as np
import torch

from taxel.bench.rows import Row, accuracy_row, row
from taxel.evaluation.adaptation.held_sessions import (
    CHOSEN,
    AdaptConfig,
    default_config,
    run_of,
    windows_of,
)
from taxel.evaluation.adaptation.new_class import GraspsPoint, first_grasps, measure_new_class
from taxel.evaluation.adaptation.online import OnlinePoint, measure_online
from taxel.evaluation.adaptation.pads import PadPoint, measure_pads
from taxel.sources.simulated.data_sets import simulate_presets, simulate_unknown
from taxel.training.adapt.last_layer import adapt_last_layer
from taxel.training.exemplars import all_exemplars
from taxel.training.loop import TrainConfig
from taxel.windows.dataset import load_dataset

SCANS = 160_000
"""Scans a class. Source: TENG thesis, section 3.5.1."""
SETS = (2, 3)
"""Seeds of the simulated data sets; what was chosen was chosen on seeds 0 and 1."""
UNKNOWN = {"shape": "prism", "material": "rubber"}
"""Target → the object that the thesis had not learned. Source: thesis, section 4.3."""
POINTS_TO_FULL = 3.0
POINTS_LOST = 2.0
SECONDS = 5.0
"""Goals. Source: our choice, docs/decisions/0028."""
_SPLIT = "session held out"


def adapt_time_rows() -> list[Row]:
    """Measure how long learning a class from 5 grasps takes: some seconds of work."""
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        simulate_presets(Path(scratch), ("honest",), SCANS // 4, SETS[0])
        config = default_config()
        recipe = replace(config.recipe, train=TrainConfig(epochs=1))  # time, not accuracy
        dataset = load_dataset(Path(scratch) / "honest", recipe.window, target="shape")
        classes = dataset.classes("shape")
        everything = all_exemplars(dataset, classes, "shape")
        run = run_of(dataset, everything[everything.y < 2], classes[:2], "shape", recipe)
        new = first_grasps(everything[everything.y == 2], 5, "", 0)
        torch.set_num_threads(1)
        times = []
        for _ in range(3):
            started = perf_counter()
            adapt_last_layer(
                run, windows_of(new), [classes[2]] * len(new), list(new.grasp), list(new.session)
            )
            times.append(perf_counter() - started)
    assert run.exemplars is not None
    note = f"{len(run.exemplars)} rehearsed windows, {len(new)} new, one thread"
    return [
        row("sim honest: time to learn a class from 5 grasps", min(times), "s", "<=", SECONDS, note)
    ]


def new_class_rows() -> list[Row]:
    """Measure what is learned from a few grasps, over two sets: about a quarter of an hour."""
    with _sets() as paths:
        return new_classes_of(paths, default_config())


def unknown_object_rows() -> list[Row]:
    """Measure how well a prism and rubber are recognised after a few grasps of them."""
    rows = []
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        path = Path(scratch) / "set"
        simulate_unknown(path, SCANS, SETS[0])
        for target, name in UNKNOWN.items():
            config = replace(
                default_config(), targets=(target,), grasps=(1, 3, 5, 10), methods=(CHOSEN,),
                new_classes=(name,),
            )  # fmt: skip
            points = measure_new_class([path], config)
            rows += [_recognised_row(name, n, [point for point in points if point.grasps == n])
                     for n in config.grasps]  # fmt: skip
    return rows


def _recognised_row(name: str, grasps: int, points: list[GraspsPoint]) -> Row:
    full = _mean(p.full for p in points)
    note = (
        f"all classes {_mean(p.accuracy for p in points):.3f}, by training on all data "
        f"{full:.3f}; old classes {_mean(p.before for p in points):.3f} alone, "
        f"{_mean(p.old for p in points):.3f} beside it; {points[0].target}, windows"
    )
    title = f"sim honest, {name} predicted correctly after {grasps} grasps, {_SPLIT}"
    return accuracy_row(title, _mean(p.new for p in points), note)


def pad_rows() -> list[Row]:
    """Measure changed pads before and after a few touches."""
    with _sets() as paths:
        return pads_of(paths, default_config())


def online_rows() -> list[Row]:
    """Measure grasps that are corrected one by one."""
    with _sets() as paths:
        return corrections_of(paths, default_config())


def new_classes_of(paths: Sequence[Path], config: AdaptConfig) -> list[Row]:
    """Return the rows of new classes for data sets that are there."""
    points = measure_new_class(paths, config)
    rows: list[Row] = []
    for target in config.targets:
        own = [point for point in points if point.target == target]
        rows += _goal_rows(target, own) + _curve_rows(target, own) + _method_rows(target, own)
    return rows


def pads_of(paths: Sequence[Path], config: AdaptConfig) -> list[Row]:
    """Return the rows of changed pads for data sets that are there."""
    points, rows = measure_pads(paths, config), []
    for target in config.targets:
        rows += _pad_rows(target, [point for point in points if point.target == target])
    return rows


def corrections_of(paths: Sequence[Path], config: AdaptConfig) -> list[Row]:
    """Return the rows of corrections on the fly for data sets that are there."""
    points, rows = measure_online(paths, config), []
    for target in config.targets:
        rows += _online_rows(target, [point for point in points if point.target == target])
    return rows


@contextmanager
def _sets() -> Iterator[list[Path]]:
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        for seed in SETS:
            simulate_presets(Path(scratch) / str(seed), ("honest",), SCANS, seed)
        yield [Path(scratch) / str(seed) / "honest" for seed in SETS]


def _goal_rows(target: str, points: list[GraspsPoint]) -> list[Row]:
    five = [point for point in points if point.method == CHOSEN and point.grasps == 5]
    name = f"sim honest, new {target} from 5 grasps, {_SPLIT}"
    short = 100 * _mean(p.full - p.accuracy for p in five)
    lost = 100 * _mean(p.before - p.old for p in five)
    full_lost = 100 * _mean(p.before - p.full_old for p in five)
    each = "; ".join(
        f"{new} {_mean(p.accuracy for p in part):.3f} (full {_mean(p.full for p in part):.3f})"
        for new in sorted({point.new_class for point in five})
        for part in [[point for point in five if point.new_class == new]]
    )
    beside = (
        f"old classes {_mean(p.before for p in five):.3f} alone, "
        f"{_mean(p.old for p in five):.3f} beside the new one; training on all classes "
        f"from the start loses {full_lost:.1f} by the same measure"
    )
    took = f"training on all: {_mean(p.full_seconds for p in five):.1f} s"
    return [
        row(f"{name}: points below training on all data", short, "points", "<=",
            POINTS_TO_FULL, each),
        row(f"{name}: points lost on the old classes", lost, "points", "<=", POINTS_LOST, beside),
        row(f"{name}: time", max(point.seconds for point in five), "s", "<=", SECONDS, took),
    ]  # fmt: skip


def _curve_rows(target: str, points: list[GraspsPoint]) -> list[Row]:
    rows = []
    for grasps in sorted({point.grasps for point in points}):
        own = [point for point in points if point.method == CHOSEN and point.grasps == grasps]
        note = (
            f"old {_mean(p.old for p in own):.3f}, new {_mean(p.new for p in own):.3f}"
            f"; all data {_mean(p.full for p in own):.3f}"
        )
        name = f"sim honest, new {target} from {grasps} grasps, {_SPLIT}"
        rows.append(accuracy_row(name, _mean(p.accuracy for p in own), note))
    return rows


def _method_rows(target: str, points: list[GraspsPoint]) -> list[Row]:
    rows = []
    for method in dict.fromkeys(point.method for point in points if point.method != CHOSEN):
        own = [point for point in points if point.method == method]
        note = (
            f"old {_mean(p.old for p in own):.3f}, new {_mean(p.new for p in own):.3f}"
            f", {_mean(p.seconds for p in own):.2f} s"
        )
        name = f"sim honest, new {target} from 5 grasps, {method}, {_SPLIT}"
        rows.append(accuracy_row(name, _mean(p.accuracy for p in own), note))
    return rows


def _pad_rows(target: str, points: list[PadPoint]) -> list[Row]:
    rows = []
    for case in dict.fromkeys(point.case for point in points):
        for touches in sorted({point.touches for point in points}):
            own = [point for point in points if (point.case, point.touches) == (case, touches)]
            note = (
                f"{_mean(p.before for p in own):.3f} before these touches, "
                f"{_mean(p.unchanged for p in own):.3f} on the pads as they were; "
                f"{sum(session.grasps for session in own)} grasps, of which "
                f"{_mean(p.found for p in own):.1%} gave windows "
                f"({_mean(p.found_unchanged for p in own):.1%} as they were); "
                "one without counts as wrong"
            )
            name = f"sim honest, {case}, {touches} touches: {target}, {_SPLIT}"
            rows.append(accuracy_row(name, _mean(p.after for p in own), note))
    return rows


def _online_rows(target: str, points: list[OnlinePoint]) -> list[Row]:
    rows = []
    for changed in (False, True):
        own = [point for point in points if point.changed == changed]
        what = "pads changed halfway" if changed else "pads as they were"
        found = sum(bool(session.drift_at) for session in own)
        tested = np.sum([session.tested for session in own], axis=0)
        note = (
            f"of {sum(session.grasps for session in own):,} grasps, each before it was learned; "
            f"{_mean(p.unlearned for p in own):.3f} without learning; windows of grasps "
            f"never learned {_mean(p.before for p in own):.3f} → "
            f"{_mean(p.after for p in own):.3f} (majority {tested.max() / tested.sum():.3f}); "
            f"largest loss of a class on other sessions "
            f"{100 * _mean(p.forgotten for p in own):.1f} points, mean over sessions; drift "
            f"detected in {found} of {len(own)} sessions"
        )
        name = f"sim honest, corrected on the fly, {what}: {target}, {_SPLIT}"
        rows.append(accuracy_row(name, _mean(p.prequential for p in own), note))
    return rows


def _mean(values: Iterable[float]) -> float:
    return float(np.nanmean(list(values)))
