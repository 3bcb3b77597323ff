"""Learn a grasp monitor for use: head on all cups, thresholds and scores on cups held out.

Knows nothing about files or screens.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from taxel.decisions.stability import StabilityConfig
from taxel.evaluation.early_warning.grasp_warnings import INNER_FOLDS, monitor_tracks
from taxel.evaluation.early_warning.tuning_stability import Tuned, tune
from taxel.evaluation.splits import TrialFold
from taxel.evaluation.transitions.data import CameraSet, Judged, judge_fold, tracks_of
from taxel.evaluation.transitions.tables import WindowScores, score_windows
from taxel.labels.rules import rule_named
from taxel.training.curves import Curve
from taxel.training.features import FrameFeatures
from taxel.training.heads import HeadConfig, TrainedHead, fit_head


@dataclass(frozen=True, slots=True, kw_only=True)
class LearntMonitor:
    """A head, its thresholds, and what both are worth on cups that the head had not seen."""

    head: TrainedHead
    """Trained on all pours."""
    stability: StabilityConfig
    tuned: Tuned | None
    """None where the recordings hold no truth to tune on: the thresholds are the defaults."""
    windows: WindowScores | None
    """Windows of cups held out; None where there are fewer than two cups."""
    curves: tuple[Curve, ...] = ()
    """How each head learned that left out some cups, and the last one on all."""


def learn_monitor(
    data: CameraSet,
    features: Sequence[FrameFeatures],
    config: HeadConfig,
    *,
    key: str = "cup",
    on_step: Callable[[str], None] = lambda _: None,
) -> LearntMonitor:
    """Train on all pours; tune and score on heads that left out groups of cups.

    Args:
        data: Pours with labels.
        features: Of the pours, in their order.
        config: How a head is trained.
        key: The group that is held out whole.
        on_step: Called with a line before each training.
    """
    cups = data.groups(key)
    names = sorted(set(cups.tolist()))
    judged: list[Judged] = []
    curves: list[Curve] = []
    if len(names) > 1:
        for part in np.array_split(np.array(names), min(INNER_FOLDS, len(names))):
            on_step(f"without {key} {', '.join(part)}")
            held = np.isin(cups, part)
            fold = TrialFold.of("+".join(part), np.flatnonzero(~held), np.flatnonzero(held))
            found, trained = judge_fold(features, data.labels, fold, config, watch=True)
            judged.append(found)
            curves.append(Curve(f"without {key} {', '.join(part)}", trained.history))
    tuned = None
    if judged and rule_named(data.rule).needs == "truth":
        tuned = tune(monitor_tracks(data, judged, config.frames))
    on_step("all cups")
    everything = np.arange(len(data.pours))
    head = fit_head(tracks_of(features, data.labels, everything), config)
    return LearntMonitor(
        head=head,
        stability=tuned.config if tuned else StabilityConfig(),
        tuned=tuned,
        windows=score_windows(judged) if judged else None,
        curves=(*curves, Curve(f"all {key}s", head.history)),
    )
