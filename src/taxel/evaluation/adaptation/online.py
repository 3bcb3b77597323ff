"""What learning on the fly gives: a session held out, its grasps corrected one after another.

Halfway the session's pads change, unknown to the run: so that there is a drift to notice.
Knows nothing about screens.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch

from taxel.evaluation.adaptation.held_sessions import (
    AdaptConfig,
    by_session,
    hold_out,
    predicted,
    run_of,
    windows_of,
)
from taxel.evaluation.adaptation.pads import ALL, draw_gains
from taxel.training.adapt.correcting import learn_corrections
from taxel.training.adapt.new_data import Grasps
from taxel.training.exemplars import Exemplars


@dataclass(frozen=True, slots=True)
class OnlinePoint:
    """One held-out session; shares 0…1."""

    target: str
    session: str
    changed: bool
    """Whether its pads changed halfway."""
    grasps: int
    prequential: float
    """Grasps predicted correctly, each before it was learned."""
    unlearned: float
    """The same grasps by the run that learns nothing."""
    before: float
    """Windows of grasps that were not learned (every fourth), by the run as it was."""
    after: float
    """The same after learning."""
    forgotten: float
    """The largest loss of a class on the other sessions' grasps that were never rehearsed."""
    drift_at: tuple[int, ...]
    """Grasps at which a drift was said to have begun."""
    tested: tuple[int, ...]
    """Windows of each class, by number, among those of grasps that were not learned."""


def measure_online(
    paths: Sequence[Path], config: AdaptConfig, on_step: Callable[[str], None] = lambda _: None
) -> list[OnlinePoint]:
    """Measure learning on the fly on data sets with several sessions.

    Raises:
        BadDataset: A data set has fewer than two sessions, or a target fewer than two classes.
        MissingExtra: river is not installed.
    """
    return by_session(_one_session, paths, config, "on the fly", on_step)


def _one_session(path: Path, config: AdaptConfig, target: str, session: str) -> list[OnlinePoint]:
    """Measure with one session held out; runs in a process of its own."""
    torch.set_num_threads(1)
    held = hold_out(path, config, target, session)
    classes, train, windows = held.classes, held.train, held.windows
    run = run_of(held.dataset, train, classes, target, config.recipe)
    assert run.exemplars is not None
    order = np.array(list(dict.fromkeys(windows.grasp)))
    rng = np.random.default_rng(held.number)
    gain = draw_gains(rng, ALL, windows.values.shape[2])
    points = []
    for changed in (False, True):
        stream = windows
        if changed:
            late = np.isin(windows.grasp, order[len(order) // 2 :])
            factor = np.where(late[:, None, None], gain, 1.0)
            stream = replace(windows, values=(windows.values * factor).astype(np.float32))
        kept = np.isin(stream.grasp, order[3::4])
        corrected = learn_corrections(run, _grasps(stream[~kept], classes))
        test, other = stream[kept], train[~np.isin(train.grasp, run.exemplars.grasp)]
        before, after = predicted(run, other) == other.y, predicted(corrected.run, other) == other.y
        lost = [
            float(before[other.y == c].mean() - after[other.y == c].mean())
            for c in np.unique(other.y)
        ]
        points.append(
            OnlinePoint(
                target, session, changed, corrected.grasps, corrected.prequential,
                corrected.unlearned,
                float((predicted(run, test) == test.y).mean()),
                float((predicted(corrected.run, test) == test.y).mean()),
                max(lost, default=float("nan")), tuple(drift.grasp for drift in corrected.drifts),
                tuple(np.bincount(test.y, minlength=len(classes)).tolist()),
            )
        )  # fmt: skip
    return points


def _grasps(stream: Exemplars, classes: Sequence[str]) -> Grasps:
    return Grasps(
        windows=windows_of(stream),
        label=tuple(classes[i] for i in stream.y),
        grasp=tuple(stream.grasp),
        session=tuple(stream.session),
        start_s=tuple(np.zeros(len(stream))),
        recording=("",) * len(stream),
        digest="",
    )
