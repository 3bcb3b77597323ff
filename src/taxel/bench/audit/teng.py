"""Rows of `taxel bench audit --full`: what section 2 and 4.3 of the TENG thesis speak of.

Material across shapes; force, size, contact angle and fatigue; a gate that follows; an untouched
channel taken away. Knows nothing about how they are printed.

Background of our choices: docs/decisions/0047.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.bench.audit.robustness import loss_words, points_at
from taxel.bench.rows import Row
from taxel.evaluation.baselines import trivial_accuracies
from taxel.evaluation.crossval import FoldResult, run_fold
from taxel.evaluation.metrics import accuracy_interval
from taxel.evaluation.robustness.conditions import (
    BASE,
    GRASPS,
    LEVELS,
    NewSessions,
    settings_at,
    simulate_at,
)
from taxel.evaluation.robustness.curve import (
    CLEAN,
    FaultPoint,
    SessionAnswers,
    loss_between,
    point_of,
)
from taxel.evaluation.robustness.touches import Model, Recorded, judge, train_model
from taxel.evaluation.splits import TrialFold
from taxel.sources.simulated.data_sets import DATA_SET_RATE_HZ, write_sessions
from taxel.sources.simulated.teng_options import checked_config
from taxel.training.fitting import Job
from taxel.training.loop import TrainConfig
from taxel.training.recipes import find_recipe
from taxel.windows.config import TENG_WINDOW, WindowConfig
from taxel.windows.dataset import Dataset, load_dataset

SCANS = 160_000
"""Scans a class. Source: TENG thesis, section 3.5.1."""
TRAIN_SEED = 1
NEW = NewSessions(seed=15_023, sessions=10, scans=15_000)
RECIPE = "teng-referenced"
UNTOUCHED = "index-middle"
"""The nearly silent second sensor stands for a channel that touches nothing. Source: TENG thesis,
section 4.1; our choice, docs/decisions/0047."""
PICKUPS_V = (0.0, 0.1, 0.3)
"""Interference alike on all leads, volts. Our choice, docs/decisions/0047."""
FOLLOW_S = 30.0
DRIFTS_V = (0.4, 0.8, 1.6, 2.0)
"""How much higher all channels rest at the end of a session, volts: the last two are above the
thesis's gate. Our choice, docs/decisions/0047."""


def across_rows() -> list[Row]:
    """Learn material on cylinders alone; predict it of the other shapes, each session held out."""
    rows = []
    for name, window in (("cnn2d", TENG_WINDOW), (f"cnn2d, {RECIPE}", find_recipe(RECIPE).window)):
        dataset = _honest({}, window, "material")
        cylinders = np.array([trial.labels["shape"] == "cylinder" for trial in dataset.trials])
        # As many grasps as of cylinders: more data would be another reason for another accuracy.
        third = np.zeros(len(cylinders), bool)
        order = np.random.default_rng(0).permutation(len(cylinders))
        third[order[: int(cylinders.sum())]] = True
        for learned, chosen in (("cylinders", cylinders), ("as many of all shapes", third)):
            results = _sessions_held_out(dataset, chosen, "material")
            for tested, mask in (("cylinders", cylinders), ("the other shapes", ~cylinders)):
                what = f"learned on {learned}, tested on {tested}"
                text = f"sim honest, {name}: material, {what}"
                rows.append(_scored(text, dataset, results, mask, "material"))
    return rows


def grasp_rows() -> list[Row]:
    """Measure what force, size, contact angle and fatigue cost a recogniser."""
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        _write(Path(scratch) / "train", {"seed": TRAIN_SEED})
        recipe = find_recipe(RECIPE)
        models = {
            target: train_model(Path(scratch) / "train", replace(recipe, target=target))
            for target in ("shape", "material")
        }
    places = [(name, level) for name in GRASPS for level in LEVELS[name][1]]
    answers: dict[str, dict[tuple[str, float], SessionAnswers]] = {target: {} for target in models}
    for name, level in [(CLEAN, 0.0), *places]:
        settings = dict(BASE) if name == CLEAN else settings_at(name, level)
        sessions = simulate_at(settings, NEW)
        for target, model in models.items():
            answers[target][name, level] = judge(model, sessions)
    return [
        _cost(target, name, own)
        for target, own in answers.items()
        for name in GRASPS
    ]  # fmt: skip


def follow_rows() -> list[Row]:
    """Let rest drift upwards in every session; windows cut outside touch, gate fixed and not."""
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        _write(Path(scratch) / "train", {"seed": TRAIN_SEED})
        fixed = train_model(Path(scratch) / "train", find_recipe(RECIPE))
    window = replace(fixed.contract.window, gate_follow_s=FOLLOW_S)
    follows = Model(replace(fixed.contract, window=window), fixed.probabilities)
    sessions = simulate_at(dict(BASE), NEW)
    rows = []
    for drift_v in (0.0, *DRIFTS_V):
        drifted = [_drifting(session, drift_v) for session in sessions]
        for name, model in (("fixed gate", fixed), ("gate that follows", follows)):
            point = point_of(judge(model, drifted), "drift", drift_v, "V")
            rows += _gate_rows(f"sim, new sessions, rest {drift_v:g} V higher at the end, {name}",
                               point)  # fmt: skip
    return rows


def reference_rows() -> list[Row]:
    """Interference alike on all leads: shape as it is, and less the untouched channel."""
    rows = []
    for pickup_v in PICKUPS_V:
        for name, window in (
            ("as it is", TENG_WINDOW),
            ("less the second sensor", replace(TENG_WINDOW, subtract=UNTOUCHED)),
        ):
            dataset = _honest({"pickup_v": pickup_v}, window, "shape")
            every = np.ones(len(dataset.trials), bool)
            results = _sessions_held_out(dataset, every, "shape")
            text = f"sim honest, {pickup_v:g} V picked up by all leads, cnn2d: shape, {name}"
            rows.append(_scored(text, dataset, results, every, "shape"))
    return rows


def _honest(settings: Mapping[str, Any], window: WindowConfig, target: str) -> Dataset:
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        _write(Path(scratch) / "set", settings)
        return load_dataset(Path(scratch) / "set", window, target=target)


def _write(folder: Path, settings: Mapping[str, Any]) -> None:
    config = checked_config(scans_per_class=SCANS, rate_hz=DATA_SET_RATE_HZ, **settings)
    write_sessions(folder, config, lambda _: None)


def _sessions_held_out(
    dataset: Dataset, chosen: NDArray[np.bool_], target: str
) -> list[FoldResult]:
    """Train on the chosen trials of all sessions but one, predict all of the one."""
    session = dataset.group("session")
    job = Job(model="cnn2d", target=target, train=TrainConfig())
    results = []
    for name in np.unique(session):
        train = frozenset(np.flatnonzero((session != name) & chosen).tolist())
        test = frozenset(np.flatnonzero(session == name).tolist())
        results.append(run_fold(dataset, TrialFold(str(name), train, test), job))
    return results


def _scored(
    name: str,
    dataset: Dataset,
    results: Sequence[FoldResult],
    trials: NDArray[np.bool_],
    target: str,
) -> Row:
    """Return the accuracy over the windows of some trials, with its trivial baselines."""
    test = np.concatenate([result.test for result in results])
    inside = trials[dataset.trial[test]]
    right = np.concatenate([result.probabilities.argmax(axis=1) == result.y for result in results])[
        inside
    ]
    own = dataset.trial[test][inside]
    low, high = accuracy_interval(right, dataset.group("session")[own])
    session = dataset.group("session")
    folds = tuple(
        TrialFold(
            str(held),
            frozenset(np.flatnonzero(session != held).tolist()),
            frozenset(np.flatnonzero((session == held) & trials).tolist()),
        )
        for held in np.unique(session)
    )
    trivial = trivial_accuracies(dataset, target, folds)
    each = ", ".join(f"{key} {value:.3f}" for key, value in trivial.items())
    note = f"95 % {low:.3f} … {high:.3f} by session; {len(right)} windows; trivial: {each}"
    return Row(name=f"{name}, session held out", value=float(right.mean()), unit="accuracy",
               note=note)  # fmt: skip


def _cost(target: str, name: str, answers: Mapping[tuple[str, float], SessionAnswers]) -> Row:
    unit, levels = LEVELS[name]
    base = answers[CLEAN, 0.0]
    each = {level: loss_between(base, answers[name, level], grasps=False) for level in levels}
    worst = max(each, key=lambda level: each[level].points)
    majority = np.bincount(base.y).max() / len(base.y)
    note = (
        f"worst at {worst:g}: {loss_words(each[worst])}; at {points_at(each)}; "
        f"majority {majority:.3f}; learned at 0.5 to 5 N, 28 to 40 mm, new pads"
    )
    text = f"{name} {levels[0]:g} … {levels[-1]:g} {unit}, points lost at worst"
    return Row(name=f"sim, new sessions, {target} by windows, {RECIPE}: {text}",
               value=each[worst].points, unit="points", note=note)  # fmt: skip


def _drifting(recorded: Recorded, drift_v: float) -> Recorded:
    """Return a recording in which rest rises evenly to `drift_v` at its end."""
    ramp = np.linspace(0.0, drift_v, len(recorded.samples), dtype=np.float32)[:, None]
    top = np.float32(recorded.sensor.full_scale or np.inf)
    values = np.minimum(recorded.samples.values + ramp, top).astype(np.float32)
    return replace(recorded, samples=replace(recorded.samples, values=values))


def _gate_rows(name: str, point: FaultPoint) -> list[Row]:
    note = f"95 % {point.low:.3f} … {point.high:.3f} by session; {point.windows} windows"
    return [
        Row(name=f"{name}: windows cut outside touch", value=point.outside, unit="1/min",
            note=f"{RECIPE}, gate {TENG_WINDOW.gate} V, {FOLLOW_S:g} s"),
        Row(name=f"{name}: shape", value=point.accuracy, unit="accuracy",
            note=f"{note}; whole grasps {point.grasps:.3f}"),
    ]  # fmt: skip
