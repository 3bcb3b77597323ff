"""What a slip warning learns from gels that shear as layers, or from both versions: poses, goal.

Images of training cups are rendered, JPEG-coded and followed as live, so that what is learned from
is as wrong as what is met. Knows nothing about heads, thresholds or test cups.

Source: docs/decisions/0037.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Final

from taxel.jobs.running import as_done
from taxel.sim.pour.cup_pour import Gel
from taxel.sim.pour.cups import PourRun
from taxel.training.slip.cups import (
    TRAINING_CUPS,
    keep_runs,
    mild_bumps,
    moving_part,
    other_part,
    paper_part,
    seen_pours,
)
from taxel.training.slip.heads import Goal, PourFeatures
from taxel.training.slip.rim_features import ring_features

LAYER_CUPS: Final = 128
"""Training cups of version 2 whose images are rendered. Source: our choice: time."""
GOAL: Final[Goal] = "slip in 0.75 s"
"""What is learned on version 2 alone. Source: training cups out of fold, docs/decisions/0037."""
BOTH_CUPS: Final = 240
"""The same where both versions are learned from. Source: training cups, docs/decisions/0037."""
MOVING_CUPS: Final = 120
"""Of `BOTH_CUPS` those with which a gripper moves, too. Source: our choice: time."""
_PARTS: Final = (0, 1)
"""Of the four parts of a cup's paper's pours: many cups say more than many pours."""
_PUSHES: Final = 2
"""Mild pushes of a cup, at most. Source: our choice: time."""
LEARNED_ON: Final = "images of simulated gels that shear as layers, docs/decisions/0037"
LEARNED_ON_BOTH: Final = "images of simulated rigid gels and of layers, docs/decisions/0037"
"""What bundles say of their data."""


def both_features(
    folder: Path, cups: int = BOTH_CUPS, on_step: Callable[[str], None] = lambda _: None
) -> list[PourFeatures]:
    """Return training pours on rigid gels and on layers, followed in images.

    Args:
        folder: Where poses are kept; what is not there is rendered, on all cores.
        cups: How many of `TRAINING_CUPS`.
        on_step: Called with a line after each cup.

    Raises:
        RecordingFailed: The disk refused.
    """
    return [
        *_features(folder, cups, 1, on_step, others=True),
        *_features(folder, cups, 2, on_step, others=True),
    ]


def layer_features(
    folder: Path, cups: int = LAYER_CUPS, on_step: Callable[[str], None] = lambda _: None
) -> list[PourFeatures]:
    """Return training pours of the paper's on layers, followed in images; see `both_features`."""
    return _features(folder, cups, 2, on_step, others=False)


def _features(
    folder: Path, cups: int, gel: Gel, on_step: Callable[[str], None], *, others: bool
) -> list[PourFeatures]:
    jobs = [(folder, cup, gel, others) for cup in TRAINING_CUPS[:cups]]
    for number, _ in as_done(_render, jobs):
        on_step(f"images of training cup {jobs[number][1]}, gel {gel}")
    return [
        found
        for job in jobs
        for path, runs in _files(*job)
        for found in ring_features(keep_runs(path, runs), gel)
    ]


def _render(folder: Path, cup: int, gel: Gel, others: bool) -> None:
    """Follow the images of a cup's pours that are not kept yet."""
    import cv2

    cv2.setNumThreads(1)
    for path, runs in _files(folder, cup, gel, others):
        keep_runs(path, runs, lambda these: seen_pours(these, gel))


def _files(folder: Path, cup: int, gel: Gel, others: bool) -> list[tuple[Path, list[PourRun]]]:
    """Return where the poses of a cup's pours are kept, and what is tried."""
    version = "" if gel == 1 else "-gel-2"
    files = [
        (folder / f"{cup}-images-{part}{version}.npz", paper_part(cup, part)) for part in _PARTS
    ]
    if others:
        runs = other_part(cup, 0) + mild_bumps(cup, _PUSHES)
        files.append((folder / f"{cup}-images-other{version}.npz", runs))
        if cup in TRAINING_CUPS[:MOVING_CUPS]:
            files.append((folder / f"{cup}-images-moving{version}.npz", moving_part(cup)))
    return files
