"""How well the slip signal alone ranks trials: nothing is learned, labels only score it.

A trial is as suspicious as its crops in the mean: how fast the object moves over the gel beside how
fast the gel moves, and how fast it once moved at most. Knows nothing about models or folds.

Source: docs/decisions/0041, which lists the formulas that were looked at.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.evaluation.camera_trials.crossval import CameraTrialScores, score_trials
from taxel.evaluation.camera_trials.trial_set import load_trial_set
from taxel.training.trial_blend import mean_of_crops
from taxel.windows.camera_trials import read_camera_trials
from taxel.windows.trial_crops import SLIP

_SOFT_MM_S: Final = 0.05
"""Added to a rate before its logarithm: the noise of one. Source: our choice."""
_LAGS: Final = (2, 4)
"""Images over which rates are taken. Source: our choice, decision 41."""
_SHARE: Final = 0.25
"""How much the largest rate counts beside the ratio. Source: decision 41."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SignalScore:
    """What the signal is worth."""

    name: str
    auc: float
    interval: tuple[float, float]
    """95 %, whole objects resampled."""
    others: Mapping[str, float]
    """Plainer summaries and controls → AUC."""


def signal_of(shown: NDArray[np.float32]) -> dict[str, NDArray[np.float64]]:
    """Return summaries of crops by name, each of shape (n,): the larger, the more like slip.

    Args:
        shown: Shape (n, frames, cameras, columns), columns as `SLIP`.
    """
    column = {name: number for number, name in enumerate(SLIP)}

    def logs(name: str) -> NDArray[np.float64]:
        return np.log(np.abs(shown[..., column[name]].astype(np.float64)) + _SOFT_MM_S)

    ratio = np.mean(
        [(logs(f"slip_rate_{lag}") - logs(f"gel_rate_{lag}")).mean(axis=1) for lag in _LAGS], axis=0
    )
    most = logs("slip_rate_mm_s").max(axis=1)
    furthest = logs("slip_mm").max(axis=1)
    each = {
        "slip rate over gel rate, and largest rate": ratio + _SHARE * most,
        "slip rate over gel rate": ratio,
        "largest rate": most,
        "largest slip": furthest,
    }
    return {name: values.mean(axis=1) for name, values in each.items()}


def signal_auc(folder: Path, cache: Path, positive: str = "slip") -> SignalScore:
    """Score the slip signal by trial, at crops of fixed length and place.

    Args:
        folder: Camera trials with the label outcome and the group object.
        cache: Folder for features.
        positive: The outcome that should rank high.
    """
    trials = load_trial_set(
        read_camera_trials(folder), "outcome", cache, views=("pixels", "slip", "stills")
    )
    y = (trials.y == trials.classes.index(positive)).astype(np.intp)
    objects = np.array([own["object"] for own in trials.groups])
    found = signal_of(trials.cut.shown["slip"])
    first, *plainer = found
    best = _scored(_by_trial(found[first], trials.cut.trial), y, objects)
    others = {
        name: _scored(_by_trial(found[name], trials.cut.trial), y, objects).auc for name in plainer
    }
    others["control: the trial's length"] = _scored(-trials.lengths.astype(float), y, objects).auc
    still = trials.cut.shown["stills"][trials.cut.place == 0, 0, :, :48].std(axis=2).mean(axis=1)
    apart = _scored(still.astype(float), y, objects).auc
    others["control: the first frame's contrast"] = max(apart, 1 - apart)
    return SignalScore(name=first, auc=best.auc, interval=best.auc_interval, others=others)


def _by_trial(crops: NDArray[np.float64], trial: NDArray[np.intp]) -> NDArray[np.float64]:
    return mean_of_crops(crops[:, None], trial)[:, 0]


def _scored(
    values: NDArray[np.float64], y: NDArray[np.intp], objects: NDArray[np.str_]
) -> CameraTrialScores:
    """Return scores of ranks: as a probability each value has its place among all."""
    place = np.argsort(np.argsort(values)) / max(1, len(values) - 1)
    return score_trials(y, np.stack([1 - place, place], axis=1), objects)
