"""How well camera trials are recognised, beside simple methods, length, first frame.

A label holds for a whole trial, whose length may predict it too: crops have a fixed length and
place, and controls that see only the length or the first frame are judged on the same sides.
Nothing is chosen on a test trial. Knows nothing about images, files or screens.

Background of our choices: docs/decisions/0041.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.evaluation.camera_trials.contenders import Contender, Probabilities
from taxel.evaluation.camera_trials.sides import TrialSplit, order_of
from taxel.evaluation.camera_trials.trial_set import TrialSet
from taxel.evaluation.intervals import NO_INTERVAL, draw_rows, percentile_interval
from taxel.evaluation.rank_area import area
from taxel.evaluation.run_scores import reliability
from taxel.training.camera_trials.member_weights import log_loss

LEAST_DRAWS = 0.95
"""Share of the draws that must have an AUC for its interval to be given. Our choice, 0041."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraTrialScores:
    """Scores of some tested trials; all but the loss are 0…1."""

    trials: int
    accuracy: float
    accuracy_interval: tuple[float, float]
    """95 %, whole groups resampled."""
    balanced: float
    """Mean of the classes' recalls."""
    auc: float
    """One class against the rest, mean over classes; NaN where a class is absent."""
    auc_interval: tuple[float, float]
    loss: float
    """Mean log-loss, nats."""
    calibration_error: float
    """Expected, over ten bins of confidence."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialResult:
    """One model's cross-validated scores on camera trials."""

    name: str
    leaks: str
    whole: CameraTrialScores
    """By trial, all its crops together."""
    places: tuple[CameraTrialScores, ...]
    """By one crop alone, in the order of `PLACES`; empty where there is one only."""
    probabilities: Probabilities
    """Shape (trials, classes); NaN where a trial was never tested."""


@dataclass(frozen=True, slots=True)
class Difference:
    """Ours less another contender's, on the same trials; intervals 95 %, groups resampled."""

    other: str
    accuracy: float
    accuracy_interval: tuple[float, float]
    auc: float
    auc_interval: tuple[float, float]
    loss: float
    loss_interval: tuple[float, float]


def judge_trials(
    trials: TrialSet,
    split: TrialSplit,
    seed: int,
    contenders: Sequence[Contender],
    on_step: Callable[[str], None] = lambda line: None,
    cuts: Sequence[TrialSet] = (),
) -> list[TrialResult]:
    """Judge contenders on each side's test trials.

    Args:
        trials: The trials.
        split: Which are learned from and which tested on.
        seed: Of the models and inner folds.
        contenders: What to judge.
        on_step: Called with a line before each fit.
        cuts: The trials as each fold cuts them, with as many crops of each; as they are for all
            unless given.
    """
    each = cuts or (trials,) * len(split.folds)
    return [_judge(each, split, seed, contender, on_step) for contender in contenders]


def _judge(
    cuts: Sequence[TrialSet],
    split: TrialSplit,
    seed: int,
    contender: Contender,
    on_step: Callable[[str], None],
) -> TrialResult:
    trials = cuts[0]
    order = order_of(split, trials.groups, trials.y)
    crops = np.full((len(trials.cut.trial), len(trials.classes)), np.nan)
    probabilities = np.full((len(trials.y), len(trials.classes)), np.nan)
    for fold, own in zip(split.folds, cuts, strict=True):
        label = f"{contender.name}, {fold.name}"
        on_step(label)
        learning = own.learning(contender.rows(own), split.group, contender.extras(own), order)
        model = contender.model(own, seed, lambda line, label=label: on_step(f"{label}, {line}"))  # type: ignore[misc]
        model.fit(learning.part(fold.train_rows))
        test = learning.part(fold.test_rows)
        crops[np.isin(trials.cut.trial, fold.test_rows)] = model.crops(test.rows)
        probabilities[fold.test_rows] = model.trials(test.rows, test.trial)
    tested = np.flatnonzero(np.isfinite(probabilities[:, 0]))
    groups, places = trials.values_of(split.group), []
    if trials.layout.places > 1:
        for place in range(trials.layout.places):
            own = crops[trials.cut.place == place][tested]
            places.append(score_trials(trials.y[tested], own, groups[tested]))
    return TrialResult(
        name=contender.name,
        leaks=contender.leaks,
        whole=score_trials(trials.y[tested], probabilities[tested], groups[tested]),
        places=tuple(places),
        probabilities=probabilities,
    )


def rival(results: Sequence[TrialResult]) -> TrialResult:
    """Return what the recogniser is compared with: the bar that names most trials rightly.

    Args:
        results: As `contenders_for` orders them; bars are those that do not leak.
    """
    found = [result for result in results[1:] if not result.leaks]
    return max(found, key=lambda result: result.whole.accuracy, default=results[1])


def rivals(results: Sequence[TrialResult]) -> list[TrialResult]:
    """Return what the recogniser is compared with: the `rival`, and what is more accurate still.

    Bars may be far behind a control, as where a first frame alone names the class: the difference
    to a bar alone would then flatter.

    Args:
        results: As `contenders_for` orders them.
    """
    first = rival(results)
    best = max(results[1:], key=lambda result: result.whole.accuracy, default=first)
    return [first, best] if best.whole.accuracy > first.whole.accuracy else [first]


def score_trials(
    y: NDArray[np.intp], probabilities: Probabilities, groups: NDArray[np.str_], seed: int = 0
) -> CameraTrialScores:
    """Return scores of probabilities, shape (n, classes), against classes, shape (n,)."""
    right = probabilities.argmax(axis=1) == y
    drawn = draw_rows(groups, seed)
    bins = reliability(probabilities, right)
    return CameraTrialScores(
        trials=len(y),
        accuracy=float(right.mean()),
        accuracy_interval=percentile_interval([float(right[d].mean()) for d in drawn]),
        balanced=float(np.mean([right[y == kind].mean() for kind in np.unique(y)])),
        auc=area(y, probabilities),
        auc_interval=_interval([area(y[d], probabilities[d]) for d in drawn]),
        loss=log_loss(probabilities, y),
        calibration_error=sum(b.windows * abs(b.confidence - b.accuracy) for b in bins) / len(y),
    )


def _interval(found: list[float]) -> tuple[float, float]:
    """Return the middle 95 % of the draws; none where many gave no value (NaN), as those of few
    sessions that lack a class have no AUC: the others are no sample of all.
    """
    known = np.isfinite(found).sum()
    enough = known > 0 and known >= LEAST_DRAWS * len(found)
    return percentile_interval(found) if enough else NO_INTERVAL


def difference(
    trials: TrialSet, split: TrialSplit, ours: TrialResult, other: TrialResult, seed: int = 0
) -> Difference:
    """Return how much better ours is, on the trials that both were tested on."""
    both = np.isfinite(ours.probabilities[:, 0]) & np.isfinite(other.probabilities[:, 0])
    y, groups = trials.y[both], trials.values_of(split.group)[both]
    mine, others = ours.probabilities[both], other.probabilities[both]
    drawn = draw_rows(groups, seed)

    def compared(
        measure: Callable[[NDArray[np.intp], Probabilities], float],
    ) -> tuple[float, tuple[float, float]]:
        found = [measure(y[d], mine[d]) - measure(y[d], others[d]) for d in drawn]
        return measure(y, mine) - measure(y, others), _interval(found)

    accuracy, auc, loss = compared(_accuracy), compared(area), compared(_loss)
    return Difference(other.name, *accuracy, *auc, *loss)


def by_group(
    trials: TrialSet, split: TrialSplit, result: TrialResult
) -> dict[str, tuple[int, int]]:
    """Return each group's right and tested trials, fewest right first."""
    groups = trials.values_of(split.group)
    tested = np.isfinite(result.probabilities[:, 0])
    right = tested & (result.probabilities.argmax(axis=1) == trials.y)
    counts = {
        str(name): (int(right[groups == name].sum()), int(tested[groups == name].sum()))
        for name in np.unique(groups[tested])
    }
    return dict(sorted(counts.items(), key=lambda item: item[1][0] / item[1][1]))


def _accuracy(y: NDArray[np.intp], probabilities: Probabilities) -> float:
    return float((probabilities.argmax(axis=1) == y).mean())


def _loss(y: NDArray[np.intp], probabilities: Probabilities) -> float:
    return log_loss(probabilities, y)
