"""The audit of what a run was tested on: its recordings under its own split.

Knows nothing about how leaks are found, or about pages.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.bundles.contract import Contract
from taxel.errors import BadInput
from taxel.evaluation.audit.audit import audit
from taxel.evaluation.audit.finding import Audit
from taxel.evaluation.audit.reading import read_touch
from taxel.evaluation.audit.sides import Sides
from taxel.evaluation.audit.touch_set import Pieces, TouchSet, cut_pieces
from taxel.labels.trials import held_out
from taxel.training.predictions import Predictions
from taxel.training.run import Run


def audit_run(
    run: Run, data: Path, folder: Path, on_step: Callable[[str], None] = lambda _: None
) -> Audit:
    """Return all findings in a run's recordings, under the split that it was tested under.

    Args:
        run: A run with predictions.
        data: Its recordings.
        folder: The run's own folder, whose stored scaling is looked at.
        on_step: Called with what is looked for next.

    Raises:
        BadInput: The run has no predictions, or the recordings are others.
    """
    found = run.predictions
    if found is None:
        raise BadInput(
            "a run with test predictions to audit its split",
            "one without: it was adapted, or trained with --no-check",
            "leave --audit out, or look at the recordings with: taxel audit",
        )
    touch = read_touch(data, run.contract.target, lambda *_: None)
    steps = _rows(run.contract, touch)
    split = sides_of(found, touch, steps)
    return audit(touch, data.name, split, run=folder, steps=steps, on_step=on_step)


def _rows(contract: Contract, touch: TouchSet) -> int:
    """Return how many rows a window of the run spans in the first recording, the contract's."""
    window = contract.window
    every = touch.every.get(touch.trials[0].recording, 1)
    own_hz = contract.rate_hz / every
    share = own_hz / window.grid_hz if window.grid_hz and own_hz > 0 else 1 / every
    return max(2, round(window.steps * share))


def sides_of(found: Predictions, touch: TouchSet, steps: int) -> tuple[Pieces, Sides]:
    """Return what stood on which side of each fold: windows of whole trials, or single windows.

    Raises:
        BadInput: The recordings lack a trial that was tested.
    """
    owner = _same_trials(found, touch)
    tested = np.zeros_like(found.trained)
    np.add.at(tested, (found.fold, found.trial), 1)
    if ((tested > 0) & (found.trained > 0)).any():
        pieces = _windows(found, touch, owner, steps)
        folds = [(np.flatnonzero(found.fold != f), np.flatnonzero(found.fold == f))
                 for f in range(len(found.folds))]  # fmt: skip
    else:
        pieces = cut_pieces(touch, steps, steps)
        folds = [
            (
                np.flatnonzero(np.isin(pieces.trial, owner[found.trained[fold] > 0])),
                np.flatnonzero(np.isin(pieces.trial, owner[tested[fold] > 0])),
            )
            for fold in range(len(found.folds))
        ]
    claimed = held_out(found.split, found.trials)
    known = () if claimed is None else (claimed,)
    return pieces, Sides(name=found.split, folds=tuple(folds), claimed=known)


def _same_trials(found: Predictions, touch: TouchSet) -> NDArray[np.intp]:
    """Return each of the run's trials as an index into the recordings' trials."""
    names = [(trial.recording.removesuffix(".mcap"), trial.start_s) for trial in found.trials]
    known = {(trial.groups["recording"], trial.start_s): i for i, trial in enumerate(touch.trials)}
    if not set(names) <= set(known):
        raise BadInput(
            "the recordings that the run was tested on", "others, without its trials",
            "name them with --data",
        )  # fmt: skip
    return np.array([known[name] for name in names], np.intp)


def _windows(found: Predictions, touch: TouchSet, owner: NDArray[np.intp], steps: int) -> Pieces:
    """Return the single windows that were tested, in the order of the predictions."""
    trial = owner[found.trial]
    first = np.array(
        [
            np.searchsorted(touch.time_s[own], start - 1e-6)
            for own, start in zip(trial, found.start_s, strict=True)
        ],
        np.intp,
    )
    rows = np.array([len(touch.rows[own]) for own in trial], np.intp)
    first = np.minimum(first, rows - 1)
    n = len(found)
    return Pieces(
        trial=trial,
        first=first,
        stop=np.minimum(first + steps, rows),
        view=np.full(n, ""),
        label_s=np.full(n, np.nan),
    )
