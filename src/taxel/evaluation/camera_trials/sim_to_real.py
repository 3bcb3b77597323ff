"""How far labels of simulated trials carry to real ones, alone and beside a few real objects.

One logistic regression on ranks, the probe's. Ranks are those of each domain's own rows, so that a
column's level and spread, which differ between simulator and camera, do not count; or those of all
labelled rows together. Knows nothing about images.

Background of our choices: docs/decisions/0059.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray
from sklearn.linear_model import LogisticRegression

from taxel.errors import BadDataset
from taxel.evaluation.camera_trials.encoder_study import few_trials
from taxel.evaluation.camera_trials.probe import PENALTIES, Rows
from taxel.evaluation.camera_trials.sides import TrialSplit
from taxel.evaluation.intervals import Interval, draw_rows, percentile_interval
from taxel.evaluation.rank_area import area
from taxel.training.camera_trials.blend import mean_of_crops, proba_of
from taxel.training.camera_trials.inner_folds import inner_folds
from taxel.training.camera_trials.learning import Learning
from taxel.training.camera_trials.member_weights import log_loss
from taxel.training.camera_trials.ranked import Ranked

Ranking = Literal["by domain", "together"]
Share = Literal["rows alike", "halves alike"]
SHARES: Final[tuple[Share, ...]] = ("rows alike", "halves alike")
"""What a simulated crop weighs: as a real one; or all of them together as all real ones. Inner
folds over the real objects choose."""
MIDDLE: Final[tuple[float, Share]] = 1e-3, "halves alike"
"""Penalty and share where there are too few objects for inner folds."""
Found = NDArray[np.float64]
"""Shape (draws, trials, classes): probabilities."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawScores:
    """Means over draws of the training objects, with 95 % CIs over the tested objects."""

    accuracy: float
    accuracy_interval: Interval
    auc: float
    auc_interval: Interval


@dataclass(frozen=True, slots=True)
class _Joined:
    """Ranked rows of both domains, to learn from."""

    rows: NDArray[np.float64]
    y: NDArray[np.intp]
    """Shape (n,): each row's class."""
    real: NDArray[np.bool_]
    """Shape (n,)."""
    trial: NDArray[np.intp]
    """Shape (n,): each row's trial in its domain."""

    def part(self, kept: NDArray[np.bool_]) -> _Joined:
        return _Joined(self.rows[kept], self.y[kept], self.real[kept], self.trial[kept])

    def weights(self, share: Share) -> NDArray[np.float64]:
        """Return each row's weight; they sum to the number of rows."""
        count = np.array([(~self.real).sum(), self.real.sum()])
        if share == "rows alike" or not count.all():
            return np.ones(len(self.y))
        return np.asarray((len(self.y) / 2 / count)[self.real.astype(int)], np.float64)


def transfer(
    simulated: Learning | None,
    real: Learning,
    split: TrialSplit,
    objects: int | None,
    *,
    draws: int = 1,
    ranking: Ranking = "by domain",
) -> Found:
    """Return predictions for each fold's test trials, draw by draw.

    Args:
        simulated: Labelled trials of the simulator; None learns from real ones alone.
        real: All real trials; of each fold only the training side is learned from.
        split: The folds.
        objects: Labelled real ones in training; None takes all, 0 none.
        draws: How often few objects are drawn.
        ranking: Whose ranks columns are turned into. By domain, those of real rows come from all
            images of the fold's training objects, whose labels that does not need.

    Raises:
        BadDataset: There is nothing to learn from, or no such draw of objects has every class.
    """
    probabilities = np.full((draws, len(real.y), real.classes), np.nan)
    for fold in split.folds:
        known, test = real.part(fold.train_rows), real.part(fold.test_rows)
        for draw in range(draws):
            labelled = None
            if objects is None:
                labelled = known
            elif objects:
                random = np.random.default_rng((0, draw))
                few = few_trials(real.y, real.groups, fold.train_rows, objects, random)
                labelled = real.part(few)
            probabilities[draw, fold.test_rows] = transfer_once(
                simulated, labelled, known.rows, test, ranking
            )
    return probabilities


def transfer_once(
    simulated: Learning | None,
    labelled: Learning | None,
    known: Rows,
    test: Learning,
    ranking: Ranking = "by domain",
    seed: int = 0,
) -> NDArray[np.float64]:
    """Learn from simulated and labelled real trials; return others' probabilities.

    Args:
        simulated: Of the simulator.
        labelled: Real ones, none of a test object.
        known: Real rows whose labels need not be known, none of a test object.
        test: What is predicted; its labels are not looked at.
        ranking: As for `transfer`.
        seed: Of inner folds.

    Returns:
        Shape (test trials, classes).

    Raises:
        BadDataset: There is nothing to learn from.
    """
    learning = [part for part in (simulated, labelled) if part is not None]
    if not learning:
        raise BadDataset("simulated or real trials to learn from", "neither", "give some")
    if ranking == "by domain":
        own, others = Ranked.of(learning[0].rows), Ranked.of(known)
    else:
        own = others = Ranked.of(np.concatenate([part.rows for part in learning]))
    ranked = [
        (own if part is simulated else others).apply(part.rows).astype(np.float64)
        for part in learning
    ]
    joined = _Joined(
        np.concatenate(ranked),
        np.concatenate([part.y[part.trial] for part in learning]),
        np.concatenate([np.full(len(part.trial), part is not simulated) for part in learning]),
        np.concatenate([part.trial for part in learning]),
    )
    middle = joined.rows.mean(axis=0)
    tested = others.apply(test.rows).astype(np.float64) - middle
    centred = joined.rows - middle
    if len(centred) < centred.shape[1]:
        # An L2 penalty's answer lies in the span of the rows: fewer directions, nothing lost.
        turned = np.linalg.qr(centred.T)[0]
        centred, tested = centred @ turned, tested @ turned
    joined = _Joined(centred, joined.y, joined.real, joined.trial)
    penalty, share = _chosen(
        joined, learning[-1], simulated is not None and labelled is not None, seed
    )
    return mean_of_crops(_probabilities(joined, penalty, share, tested, test.classes), test.trial)


def _chosen(joined: _Joined, judged: Learning, mixed: bool, seed: int) -> tuple[float, Share]:
    """Return penalty and share by inner folds over the groups of what is judged: the real trials
    where there are some, the simulated ones where there are none.
    """
    parts = inner_folds(judged.y, judged.groups, seed)
    losses: dict[tuple[float, Share], float] = {}
    if parts:
        for candidate in product(PENALTIES, SHARES if mixed else SHARES[:1]):
            held = np.full((len(judged.y), judged.classes), np.nan)
            for kept, out, trials in _inner(joined, parts):
                crops = _probabilities(kept, *candidate, out.rows, judged.classes)
                number = np.searchsorted(trials, out.trial).astype(np.intp)
                held[trials] = mean_of_crops(crops, number)
            seen = np.isfinite(held[:, 0])
            losses[candidate] = log_loss(held[seen], judged.y[seen])
    return min(losses, key=lambda candidate: losses[candidate]) if losses else MIDDLE


def _inner(
    joined: _Joined, parts: list[tuple[NDArray[np.intp], NDArray[np.intp]]]
) -> Iterator[tuple[_Joined, _Joined, NDArray[np.intp]]]:
    """Yield what is learned from, what is held out and the latter's trials, of each inner fold."""
    judged = joined.real if joined.real.any() else ~joined.real
    for _, held in parts:
        out = judged & np.isin(joined.trial, held)
        yield joined.part(~out), joined.part(out), np.sort(held)


def _probabilities(
    joined: _Joined, penalty: float, share: Share, rows: NDArray[np.floating], classes: int
) -> NDArray[np.float64]:
    model = LogisticRegression(C=penalty, max_iter=300)
    model.fit(joined.rows, joined.y, sample_weight=joined.weights(share))
    return proba_of(model, rows, classes)


def score_draws(
    y: NDArray[np.intp], found: Found, groups: NDArray[np.str_], seed: int = 0
) -> DrawScores:
    """Return accuracy and AUC, means over draws, with 95 % intervals over groups.

    Args:
        y: True class numbers, shape (trials,).
        found: Probabilities, shape (draws, trials, classes).
        groups: What is drawn again whole, such as objects, shape (trials,).
        seed: Of the intervals.
    """
    drawn = draw_rows(groups, seed)
    right = _right(y, found)
    return DrawScores(
        accuracy=float(right.mean()),
        accuracy_interval=percentile_interval([float(right[rows].mean()) for rows in drawn]),
        auc=_auc(y, found),
        auc_interval=percentile_interval([_auc(y[rows], found[:, rows]) for rows in drawn]),
    )


def gain(
    y: NDArray[np.intp], ours: Found, other: Found, groups: NDArray[np.str_], seed: int = 0
) -> DrawScores:
    """Return how much higher ours scores than another on the same trials, paired over groups.

    Args:
        y: True class numbers, shape (trials,).
        ours: Probabilities, shape (draws, trials, classes).
        other: Of the same trials, shape (draws, trials, classes).
        groups: What is drawn again whole, such as objects, shape (trials,).
        seed: Of the intervals.
    """
    drawn = draw_rows(groups, seed)
    more = _right(y, ours) - _right(y, other)
    return DrawScores(
        accuracy=float(more.mean()),
        accuracy_interval=percentile_interval([float(more[rows].mean()) for rows in drawn]),
        auc=_auc(y, ours) - _auc(y, other),
        auc_interval=percentile_interval(
            [_auc(y[rows], ours[:, rows]) - _auc(y[rows], other[:, rows]) for rows in drawn]
        ),
    )


def _right(y: NDArray[np.intp], found: Found) -> NDArray[np.float64]:
    """Return the share of draws in which each trial is right, shape (trials,)."""
    return np.asarray((found.argmax(axis=2) == y).mean(axis=0), np.float64)


def _auc(y: NDArray[np.intp], found: Found) -> float:
    return float(np.mean([area(y, each) for each in found]))
