"""What novelty scores are worth: AUROC, false rejection, coverage against accuracy.

Knows nothing about data sets, training or screens.

Background of our choices: docs/decisions/0027.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from sklearn.metrics import roc_auc_score

from taxel.evaluation.intervals import Interval, draw_rows, percentile_interval

OURS = "density"
"""The score that a bundle carries (docs/decisions/0027); the others are there to compare."""
SCORES = (OURS, "max softmax", "weak touch", "unusual level", "1-NN on raw windows")
"""1 − largest probability; minus the mean of all values; its distance from the training part's;
distance to the nearest training window."""
COVERAGES = (1.0, 0.95, 0.9, 0.8, 0.7, 0.5)
"""Shares of known touch that are answered, of which the accuracy is given."""
RESAMPLES = 200
"""Bootstrap resamples of whole groups. Source: our choice."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Auroc:
    """How well a score separates one kind of unknown object from the known."""

    score: str
    kind: str
    """What was not learned, such as "prism"."""
    windows: float
    """Area under the ROC curve over windows, 0…1."""
    grasps: float
    """The same over trials, a trial's windows joined."""
    interval: tuple[float, float]
    """95 % of `grasps`, whole groups resampled; NaN for the scores beside ours."""
    found_windows: float
    """Share of the unknown windows that are rejected as such, 0…1; NaN beside ours."""
    found_grasps: float
    """The same of trials."""
    unknown_windows: int
    unknown_grasps: int


@dataclass(frozen=True, slots=True, kw_only=True)
class CoverageCurve:
    """Accuracy over the known touch that is answered, by how much of it is."""

    score: str
    windows: tuple[float, ...]
    """One a coverage of `COVERAGES`."""
    grasps: tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class UnknownResult:
    """One target's figures."""

    target: str
    split: str
    groups: int
    known_windows: int
    known_grasps: int
    rejected_windows: float
    """Share of the known windows in held-out groups that are called unknown, 0…1."""
    rejected_grasps: float
    """The same of trials."""
    rejected_by_class: dict[str, float]
    """Class → share of its known trials that are called unknown."""
    aurocs: tuple[Auroc, ...]
    curves: tuple[CoverageCurve, ...]
    majority: CoverageCurve
    """Share of the commonest class among what `OURS` lets be answered: what `curves` must beat."""

    def auroc(self, kind: str, score: str = OURS) -> Auroc:
        """Return one kind's figures by one score."""
        return next(auroc for auroc in self.aurocs if (auroc.kind, auroc.score) == (kind, score))


@dataclass(frozen=True, slots=True)
class Scored:
    """Test windows, or trials, of all folds."""

    index: NDArray[np.intp]
    """Which it is, shape (n,): what no fold learns may be tested in several."""
    kind: NDArray[np.str_]
    """Shape (n,): empty for the known."""
    group: NDArray[np.str_]
    scores: dict[str, NDArray[np.float64]]
    """Score → the larger the more novel, shape (n,)."""
    rejected: NDArray[np.bool_]
    truth: NDArray[np.str_]
    answer: NDArray[np.str_]


def join_scored(parts: list[Scored]) -> Scored:
    """Return what all folds gave as one."""
    return Scored(
        np.concatenate([part.index for part in parts]),
        np.concatenate([part.kind for part in parts]),
        np.concatenate([part.group for part in parts]),
        {name: np.concatenate([part.scores[name] for part in parts]) for name in SCORES},
        np.concatenate([part.rejected for part in parts]),
        np.concatenate([part.truth for part in parts]),
        np.concatenate([part.answer for part in parts]),
    )


def result_of(target: str, split: str, windows: Scored, grasps: Scored) -> UnknownResult:
    """Return one target's figures from all test windows, and all test trials."""
    known = grasps.kind == ""
    return UnknownResult(
        target=target,
        split=split,
        groups=len(set(grasps.group[known])),
        known_windows=int((windows.kind == "").sum()),
        known_grasps=int(known.sum()),
        rejected_windows=float(windows.rejected[windows.kind == ""].mean()),
        rejected_grasps=float(grasps.rejected[known].mean()),
        rejected_by_class={
            str(name): float(grasps.rejected[known & (grasps.truth == name)].mean())
            for name in sorted(set(grasps.truth[known]))
        },
        aurocs=tuple(
            _auroc(name, kind, windows, grasps)
            for kind in sorted(set(grasps.kind) - {""})
            for name in SCORES
        ),
        curves=tuple(
            CoverageCurve(score=name, windows=_curve(windows, name), grasps=_curve(grasps, name))
            for name in (OURS, "max softmax")
        ),
        majority=CoverageCurve(score=OURS, windows=_commonest(windows), grasps=_commonest(grasps)),
    )


def _auroc(score: str, kind: str, windows: Scored, grasps: Scored) -> Auroc:
    found = [
        float(own.rejected[own.kind == kind].mean()) if score == OURS else float("nan")
        for own in (windows, grasps)
    ]
    return Auroc(
        score=score,
        kind=kind,
        windows=_area(windows, score, kind),
        grasps=_area(grasps, score, kind),
        interval=_interval(grasps, score, kind) if score == OURS else (np.nan, np.nan),
        found_windows=found[0],
        found_grasps=found[1],
        unknown_windows=len(set(windows.index[windows.kind == kind])),
        unknown_grasps=len(set(grasps.index[grasps.kind == kind])),
    )


def _area(scored: Scored, score: str, kind: str) -> float:
    part = (scored.kind == "") | (scored.kind == kind)
    return float(roc_auc_score(scored.kind[part] == kind, scored.scores[score][part]))


def _interval(scored: Scored, score: str, kind: str) -> Interval:
    """Return a 95 % interval by drawing whole groups again."""
    part = (scored.kind == "") | (scored.kind == kind)
    truth, value = scored.kind[part] == kind, scored.scores[score][part]
    return percentile_interval([
        float(roc_auc_score(truth[drawn], value[drawn]))
        for drawn in draw_rows(scored.group[part], resamples=RESAMPLES)
        if 0 < truth[drawn].sum() < len(drawn)
    ])  # fmt: skip


def _curve(scored: Scored, score: str) -> tuple[float, ...]:
    """Return the accuracy over the least novel shares of the known."""
    right = scored.answer == scored.truth
    return tuple(float(right[rows].mean()) for rows in _answered(scored, score))


def _commonest(scored: Scored) -> tuple[float, ...]:
    """Return the share of the commonest class among them."""
    _, classes = np.unique(scored.truth, return_inverse=True)
    return tuple(
        float(np.bincount(classes[rows]).max() / len(rows)) for rows in _answered(scored, OURS)
    )


def _answered(scored: Scored, score: str) -> list[NDArray[np.intp]]:
    """Return the rows of the known that are answered, the least novel, one a coverage."""
    known = np.flatnonzero(scored.kind == "")
    order = known[np.argsort(scored.scores[score][known], kind="stable")]
    return [order[: max(1, round(share * len(order)))] for share in COVERAGES]
