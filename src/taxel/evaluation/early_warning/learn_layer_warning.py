"""What a slip warning learns from gels that shear as layers: their poses, and the goal.

Exact poses of many training cups, made as wrong as images make them: the errors are fitted on
a rendered pour of each of some cups. Knows nothing about heads, thresholds or test cups.

Source: docs/decisions/0037.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Final

from taxel.evaluation.early_warning.learn_slip_warning import noisy_features
from taxel.training.slip.cups import (
    NOISE_CUPS,
    TRAINING_CUPS,
    PourRows,
    keep_runs,
    noise_runs,
    paper_part,
    seen_pours,
)
from taxel.training.slip.heads import Goal, PourFeatures
from taxel.training.slip.layer_poses import layer_pours
from taxel.training.slip.pose_noise import fit_noises

LAYER_CUPS: Final = 120
"""Training cups of version 2, three of the paper's pours into each: many cups say more than many
pours. Source: our choice: time."""
GOAL: Final[Goal] = "slip in 0.75 s"
"""What is learned on version 2. Source: training cups out of fold, decision 37."""
LEARNED_ON: Final = "simulated poses on gels that shear as layers, docs/decisions/0037"
"""What bundles say of their data."""


def layer_features(
    folder: Path, cups: int = LAYER_CUPS, on_step: Callable[[str], None] = lambda _: None
) -> list[PourFeatures]:
    """Return training pours on layers as images would give them.

    Args:
        folder: Where poses are kept; what is not there is simulated, five minutes of one core.
        cups: How many of `TRAINING_CUPS`.
        on_step: Called with a line before each cup.

    Raises:
        RecordingFailed: The disk refused.
    """
    seen: list[PourRows] = []
    exact: list[PourRows] = []
    for cup in NOISE_CUPS:
        on_step(f"images of training cup {cup}, gel 2")
        runs = noise_runs(cup)
        seen += keep_runs(folder / f"{cup}-noise-gel-2.npz", runs, partial(seen_pours, gel=2))
        exact += keep_runs(folder / f"{cup}-noise-layers.npz", runs, layer_pours)
    noise = fit_noises(seen, exact)
    features: list[PourFeatures] = []
    for cup in TRAINING_CUPS[:cups]:
        on_step(f"layers of training cup {cup}")
        runs = paper_part(cup, 0)
        features += noisy_features(
            keep_runs(folder / f"{cup}-layers-0.npz", runs, layer_pours), noise
        )
    return features
