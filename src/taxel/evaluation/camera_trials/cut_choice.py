"""From which part of a trial crops are taken: all of it, or the part in which something moves.

Rest before and after the touch shows nothing; but the end may show the answer, as an empty hand
does. So trials are cut both ways, and inner folds of each training side choose; no test trial is
looked at. Knows nothing about images, files or screens.

Source: docs/decisions/0041.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.evaluation.camera_trials.sides import TrialSplit, order_of
from taxel.evaluation.camera_trials.trial_set import (
    LabelledTrials,
    Sight,
    TrialSet,
    load_trial_set,
)
from taxel.training.camera_trials.blend import inner_losses
from taxel.training.camera_trials.features import all_moves
from taxel.windows.camera_trials import CameraTrial
from taxel.windows.trial_layout import choose_layout

OnTrial = Callable[[str, int, int], None]
MOVING: Final = "features of the part in which something moves"
"""The pass over the trials that are cut so."""
MOTION: Final = "how much trials move"
"""The pass that looks whether any is cut so."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CutTrials:
    """Trials, cut as each training side chooses."""

    sides: tuple[TrialSet, ...]
    """For each training side: the trials as it is to learn from them, and as those that it is
    tested on are shown to it."""
    losses: tuple[tuple[float, float], ...] = ()
    """Each side's mean log-loss on inner folds, nats: of crops of whole trials, and of those of the
    part in which something moves; NaN where no trial can be held out. Empty where there was nothing
    to choose."""

    @property
    def moving(self) -> int:
        """How many sides learn from the part in which something moves."""
        return sum(own.layout.moving for own in self.sides)

    @property
    def usual(self) -> TrialSet:
        """The trials as most sides learn from them."""
        if 2 * self.moving > len(self.sides):
            return next(own for own in self.sides if own.layout.moving)
        return next((own for own in self.sides if not own.layout.moving), self.sides[0])


def load_ways(
    trials: Sequence[CameraTrial],
    target: str | None,
    cache: Path,
    *,
    crop: int | None = None,
    sight: Sight,
    moving: bool | None = None,
    on_trial: OnTrial = lambda name, done, of: None,
) -> tuple[TrialSet, ...]:
    """Return trials with their label, cut both ways and looked at, or one way if both are alike.

    Args:
        trials: At least two.
        target: The label; the only one where there is one, unless given.
        cache: Folder for what is computed.
        crop: Frames in a crop; chosen by the shortest trial unless given.
        sight: What they are looked at with; what helps to learn is not made yet.
        moving: Whether only the way is wanted that cuts the part in which something moves, or only
            that which cuts whole trials; both unless given.
        on_trial: Called with the pass over the trials, trials done and in all.

    Raises:
        BadDataset: As in `load_trial_set`.
        BadInput: Likewise.
    """
    plain = replace(sight, extras=False, asked=False, moving=False)
    load = partial(load_trial_set, trials, target, cache, crop=crop)
    if moving is not None:
        return (load(sight=replace(plain, moving=moving), on_trial=on_trial),)
    whole = load(sight=plain, on_trial=on_trial)
    slowest = min(trial.rate_hz for trial in trials)
    lengths = whole.lengths.tolist()
    layout = choose_layout(lengths, crop, rate_hz=slowest, moving=True)
    if layout.places == 1 or all_moves(trials, layout, cache, partial(on_trial, MOTION)):
        return (whole,)
    part = load(
        sight=replace(plain, moving=True), on_trial=lambda _, done, of: on_trial(MOVING, done, of)
    )
    return whole, part


def training_sides(
    trials: LabelledTrials, split: TrialSplit, *, folds: bool, final: bool
) -> list[NDArray[np.intp]]:
    """Return which trials are learned from, indices of shape (n,).

    Args:
        trials: All of them.
        split: How they are parted.
        folds: Whether models are tested; a side a fold.
        final: Whether a recogniser is kept; its side, the last, is the one fold's where there is
            one, else all trials.
    """
    sides = [fold.train_rows for fold in split.folds]
    last = sides[0] if len(sides) == 1 else np.arange(len(trials.y), dtype=np.intp)
    return [*(sides if folds else ()), *((last,) if final else ())]


def choose_cuts(
    ways: Sequence[TrialSet],
    split: TrialSplit,
    sides: Sequence[NDArray[np.intp]],
    seed: int,
    on_step: Callable[[str], None] = lambda line: None,
) -> CutTrials:
    """Return the trials, cut in the way that is better on the inner folds of each training side.

    Of whole trials where both are level, or nothing can be held out.

    Args:
        ways: The trials, cut in one way or in both.
        split: How they are parted.
        sides: Trials of each training side.
        seed: Of models and inner folds.
        on_step: Called with a line before each fit.
    """
    if len(ways) == 1:
        return CutTrials(sides=(ways[0],) * len(sides))
    found: dict[bytes, tuple[float, float]] = {}
    for number, side in enumerate(sides, start=1):
        if side.tobytes() not in found:
            label = f"which part of a trial, side {number} of {len(sides)}"
            step = partial(_step, on_step, label)
            whole, part = (_loss(way, split, side, seed, step) for way in ways)
            found[side.tobytes()] = whole, part
    losses = tuple(found[side.tobytes()] for side in sides)
    chosen = tuple(ways[part < whole] for whole, part in losses)
    return CutTrials(sides=chosen, losses=losses)


def completed(cut: CutTrials, finish: Callable[[TrialSet], TrialSet]) -> CutTrials:
    """Return the trials with what helps to learn, which is made for the chosen ways only.

    Args:
        cut: The trials.
        finish: What makes it.
    """
    made = {own.layout: finish(own) for own in {own.layout: own for own in cut.sides}.values()}
    return replace(cut, sides=tuple(made[own.layout] for own in cut.sides))


def _loss(
    trials: TrialSet,
    split: TrialSplit,
    side: NDArray[np.intp],
    seed: int,
    on_step: Callable[[str], None],
) -> float:
    order = order_of(split, trials.groups, trials.y)
    learning = trials.learning(trials.rows, split.group, order=order).part(side)
    losses = inner_losses(learning, trials.cameras, trials.widths, seed, on_step)
    known = losses[np.isfinite(losses)]
    return float(known.mean()) if len(known) else float("nan")


def _step(on_step: Callable[[str], None], label: str, line: str) -> None:
    on_step(f"{label}, {line}")
