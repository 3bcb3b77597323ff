"""What a slip warning learns from gels that shear as layers, or from both versions: poses, goal.

Exact poses of many training cups, made as wrong as images make them: the errors are fitted on
a rendered pour of each of some cups. Knows nothing about heads, thresholds or test cups.

Source: docs/decisions/0037.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Final

from taxel.evaluation.early_warning.learn_slip_warning import noisy_features, training_features
from taxel.training.slip.cups import (
    NOISE_CUPS,
    TRAINING_CUPS,
    PourRows,
    keep_runs,
    mild_bumps,
    noise_runs,
    other_part,
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
BOTH_CUPS: Final = 240
"""Training cups where both versions are learned from. Source: our choice: time."""
_PUSHES: Final = 2
"""Mild pushes of a cup on layers, at most. Source: our choice: time."""
LEARNED_ON: Final = "simulated poses on gels that shear as layers, docs/decisions/0037"
LEARNED_ON_BOTH: Final = "simulated poses on rigid gels and on layers, docs/decisions/0037"
"""What bundles say of their data."""


def both_features(
    folder: Path, cups: int = BOTH_CUPS, on_step: Callable[[str], None] = lambda _: None
) -> list[PourFeatures]:
    """Return training pours on rigid gels and on layers as images would give them.

    Args:
        folder: Where poses are kept; what is not there is simulated.
        cups: How many of `TRAINING_CUPS`; the first half of them has the other kinds on layers.
        on_step: Called with a line before each cup.

    Raises:
        RecordingFailed: The disk refused.
    """
    return [
        *training_features(folder, cups, on_step),
        *layer_features(folder, cups, on_step, others=cups // 2),
    ]


def layer_features(
    folder: Path,
    cups: int = LAYER_CUPS,
    on_step: Callable[[str], None] = lambda _: None,
    *,
    others: int = 0,
) -> list[PourFeatures]:
    """Return training pours on layers as images would give them.

    Args:
        folder: Where poses are kept; what is not there is simulated, five minutes of one core.
        cups: How many of `TRAINING_CUPS`.
        on_step: Called with a line before each cup.
        others: Of how many of these cups the other kinds and mild pushes are learned from, too.

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
    for number, cup in enumerate(TRAINING_CUPS[:cups]):
        on_step(f"layers of training cup {cup}")
        parts = {f"{cup}-layers-0.npz": paper_part(cup, 0)}
        if number < others:
            parts[f"{cup}-layers-other.npz"] = other_part(cup, 0) + mild_bumps(cup, _PUSHES)
        for name, runs in parts.items():
            features += noisy_features(keep_runs(folder / name, runs, layer_pours), noise, gel=2)
    return features
