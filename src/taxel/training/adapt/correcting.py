"""A recording of corrected grasps, learned from in their order: answers first, learns second.

Knows nothing about screens or versions.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.bundles.levels import TouchLevel
from taxel.training.adapt.drift import Drift, DriftWatch
from taxel.training.adapt.last_layer import exemplars_of
from taxel.training.adapt.new_data import Grasps, by_class, read_grasps
from taxel.training.adapt.online import OnlineConfig, OnlineLearner
from taxel.training.exemplars import Exemplars
from taxel.training.loop import predict
from taxel.training.run import Run
from taxel.windows.windower import Windows


@dataclass(frozen=True, slots=True, kw_only=True)
class Corrected:
    """What learning from a recording gave."""

    run: Run
    grasps: int
    prequential: float
    """Share of grasps predicted correctly, each before its answer was learned, 0…1."""
    unlearned: float
    """The same by the run as it was, which learned nothing, 0…1."""
    drifts: tuple[Drift, ...]
    """Turns for the worse of the run as it was: learning would hide them."""
    starts: tuple[float, ...]
    """Each grasp's start on its recording's clock, seconds."""
    order: tuple[str, ...]
    """Each grasp's name, in the order in which they were learned."""


def learn_corrections(
    run: Run,
    grasps: Grasps,
    config: OnlineConfig | None = None,
    *,
    watch: bool = True,
    on_grasp: Callable[[int], None] = lambda _: None,
) -> Corrected:
    """Answer and learn grasp by grasp.

    Args:
        run: Trained, with exemplars; it is not changed.
        grasps: Labelled grasps of classes that the run knows, in their order.
        config: How it learns.
        watch: Whether to watch for drift, which needs river.
        on_grasp: Called with the number of each grasp, from 0.

    Raises:
        BadInput: The run has no exemplars.
        BadDataset: A label is no class of the run.
        MissingExtra: `watch`, and river is not installed.
    """
    learner, still = OnlineLearner(run, config), OnlineLearner(run, config)
    drift = DriftWatch() if watch else None
    order = tuple(dict.fromkeys(grasps.grasp))
    names = np.array(grasps.grasp)
    classes = run.contract.classes
    right, unlearned, drifts, starts = [], [], [], []
    for number, name in enumerate(order):
        rows = np.flatnonzero(names == name)
        windows, label = grasps.windows[rows], grasps.label[rows[0]]
        before = still.answer(windows)
        right.append(learner.answer(windows).label == label)
        session, recording = grasps.session[rows[0]], grasps.recording[rows[0]]
        learner.correct(windows, label, name, session, recording)
        unlearned.append(before.label == label)
        starts.append(grasps.start_s[rows[0]])
        doubt = 1.0 - float(before.probabilities[:, classes.index(label)].mean())
        found = drift.add(doubt) if drift is not None else None
        if found is not None:
            drifts.append(found)
        on_grasp(number)
    return Corrected(
        run=learner.learned(),
        grasps=len(order),
        prequential=float(np.mean(right)),
        unlearned=float(np.mean(unlearned)),
        drifts=tuple(drifts),
        starts=tuple(starts),
        order=order,
    )


def run_probabilities(run: Run, windows: Windows) -> NDArray[np.float64]:
    """Return class probabilities, shape (n, classes), of unscaled windows at the run's level."""
    scaled = run.contract.scaling.apply(windows.values, windows.mask)
    each = [predict(network, scaled, windows.mask) for network in run.networks]
    return np.asarray(np.mean(each, axis=0))


def measured(
    before: Run, after: Run, test: Path | None, touches: TouchLevel | None
) -> tuple[dict[str, float], dict[str, float]]:
    """Return class → accuracy of a run before and after it learned, as `by_class` gives it.

    Args:
        before: The run.
        after: What it became.
        test: Labelled recordings; the exemplars of `after` unless given, which flatters.
        touches: The level of those sessions in `test` that hold no touches of their own.

    Raises:
        BadDataset, BadBundle, BadRecording: As `read_grasps` says.
    """
    if test is None:
        windows, label = exemplar_labels(after, exemplars_of(after))
    else:
        tested = read_grasps([test], before.contract, touches, by_session=True)
        windows, label = tested.windows, tested.label
    known = before.contract.classes
    was, now = (
        by_class(run_probabilities(run, windows), run.contract.classes, label, known)
        for run in (before, after)
    )
    return was, now


def exemplar_labels(run: Run, exemplars: Exemplars) -> tuple[Windows, tuple[str, ...]]:
    """Return exemplars as windows with the names of their classes."""
    n = len(exemplars)
    none: NDArray[np.float64] = np.zeros(n)
    ones = np.ones(n, np.float32)
    windows = Windows(exemplars.values, exemplars.mask, ones, 0 * ones, none, none)
    return windows, tuple(run.contract.classes[i] for i in exemplars.y)
