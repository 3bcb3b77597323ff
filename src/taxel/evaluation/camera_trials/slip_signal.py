"""How well the slip signal alone ranks trials: nothing is learned, labels only score it.

A trial is as suspicious as its crops in the mean: how fast the object moves over the gel beside how
fast the gel moves, and how fast it once moved at most. Which of some formulas that is was chosen
on every other object, so that the rest have an AUC of their own. Knows nothing about models or
folds.

Source: docs/decisions/0041, which lists the formulas that were looked at.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.stats import rankdata

from taxel.evaluation.camera_trials.crossval import CameraTrialScores, score_trials
from taxel.evaluation.camera_trials.trial_set import Sight, load_trial_set
from taxel.evaluation.intervals import Interval
from taxel.gel.slip_signal import TURN_MM
from taxel.training.camera_trials.blend import mean_of_crops
from taxel.windows.camera_trials import read_camera_trials
from taxel.windows.trial_crops import MOVES

_SOFT_MM_S: Final = 0.05
"""Added to a rate before its logarithm: the noise of one. Source: our choice."""
_LAG: Final = 2
"""Images over which rates are taken. Source: our choice on half of the objects, decision 41."""
_SHARE: Final = 0.25
"""How much the largest rate counts beside the ratio. Source: likewise."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SignalScore:
    """What the signal is worth."""

    name: str
    auc: float
    """By trial, all objects."""
    interval: Interval
    """95 %, whole objects resampled."""
    apart_auc: float
    """Of the objects on which no formula was chosen."""
    apart_interval: Interval
    apart: tuple[int, int]
    """Those objects and their trials."""
    others: Mapping[str, float]
    """Plainer summaries and controls → AUC, all objects."""


def signal_of(
    shown: NDArray[np.float32], rate_hz: NDArray[np.float64]
) -> dict[str, NDArray[np.float64]]:
    """Return summaries of crops by name, each of shape (n,): the larger, the more like slip.

    Args:
        shown: Shape (n, frames, cameras, columns), columns as `MOVES`.
        rate_hz: Shape (n,): frames a second.
    """
    column = {name: number for number, name in enumerate(MOVES)}

    def motion(part: str) -> NDArray[np.float64]:
        names = (f"{part}_x_mm", f"{part}_y_mm", f"{part}_turn")
        return shown[..., [column[name] for name in names]].astype(np.float64) * (1, 1, TURN_MM)

    per_s = rate_hz[:, None, None] / _LAG
    gel = motion("gel")
    slip = motion("object") - gel
    slips, gives = (
        np.linalg.norm(moved[:, _LAG:] - moved[:, :-_LAG], axis=-1) * per_s for moved in (slip, gel)
    )
    ratio = (np.log(slips + _SOFT_MM_S) - np.log(gives + _SOFT_MM_S)).mean(axis=1)
    most = np.log(slips.max(axis=1) + _SOFT_MM_S)
    signals = {
        "slip rate over gel rate, and largest rate": ratio + _SHARE * most,
        "slip rate over gel rate": ratio,
        "largest rate": most,
        "largest slip": np.linalg.norm(slip, axis=-1).max(axis=1),
    }
    return {name: values.mean(axis=1) for name, values in signals.items()}


def chosen_on(objects: NDArray[np.str_]) -> NDArray[np.bool_]:
    """Return which trials the formula was chosen on: every other object by name, the first too.

    `objects` and the flags have the shape (trials,).
    """
    return np.isin(objects, np.unique(objects)[::2])


def signal_auc(folder: Path, cache: Path, positive: str = "slip") -> SignalScore:
    """Score the slip signal by trial, at crops of fixed length and place.

    Args:
        folder: Camera trials with the label outcome and the group object.
        cache: Folder for features.
        positive: The outcome that should rank high.
    """
    read = read_camera_trials(folder)
    trials = load_trial_set(read, "outcome", cache, sight=Sight(views=("moves", "stills")))
    y = (trials.y == trials.classes.index(positive)).astype(np.intp)
    objects = np.array([own["object"] for own in trials.groups])
    rate_hz = np.array([trial.rate_hz for trial in read])[trials.cut.trial]
    signals = {
        name: _by_trial(values, trials.cut.trial)
        for name, values in signal_of(trials.cut.shown["moves"], rate_hz).items()
    }
    first, *plainer = signals
    on_all = score_ranks(signals[first], y, objects)
    unseen = ~chosen_on(objects)
    apart = score_ranks(signals[first][unseen], y[unseen], objects[unseen])
    others = {name: score_ranks(signals[name], y, objects).auc for name in plainer}
    others["control: the trial's length"] = score_ranks(
        -trials.lengths.astype(float), y, objects
    ).auc
    still = trials.cut.shown["stills"][trials.cut.place == 0, 0, :, :48].std(axis=2).mean(axis=1)
    contrast = score_ranks(still.astype(float), y, objects).auc
    others["control: the first frame's contrast"] = max(contrast, 1 - contrast)
    return SignalScore(
        name=first,
        auc=on_all.auc,
        interval=on_all.auc_interval,
        apart_auc=apart.auc,
        apart_interval=apart.auc_interval,
        apart=(len(np.unique(objects[unseen])), int(unseen.sum())),
        others=others,
    )


def _by_trial(crops: NDArray[np.float64], trial: NDArray[np.intp]) -> NDArray[np.float64]:
    return mean_of_crops(crops[:, None], trial)[:, 0]


def score_ranks(
    values: NDArray[np.float64], y: NDArray[np.intp], objects: NDArray[np.str_]
) -> CameraTrialScores:
    """Return scores of ranks: as a probability each value has its place among all.

    Equal values share a place, else the order of files would count.

    Args:
        values: Shape (trials,): the larger, the more like class 1.
        y: Shape (trials,), 0 or 1.
        objects: Shape (trials,), resampled whole.
    """
    place = (rankdata(values) - 1) / max(1, len(values) - 1)
    return score_trials(y, np.stack([1 - place, place], axis=1), objects)
