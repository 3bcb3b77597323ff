"""What a run's stored predictions are worth: scores, intervals by group, reliability.

Knows nothing about recordings, networks or pages.

Background of our choices: docs/decisions/0025.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest

from taxel.decisions.recognition import RecogniseConfig
from taxel.evaluation.metrics import Scores, accuracy_interval, by_trial, near_chance, score
from taxel.evaluation.paired import LEVEL, coarsest_of, smallest_p, tested_of
from taxel.labels.trials import lone_group
from taxel.plain_text import noun_of, number_of, several
from taxel.training.predictions import Predictions

BINS = 10
"""Bins of confidence in a reliability diagram. Source: our choice, the usual one."""
LEAST_UNNAMED = 0.01
"""Share of test windows that live would not name, 0…1, up to which that is not said. Source: our
choice, docs/decisions/0039."""
FEW_NAMED = 0.5
"""Below this share of test windows that are sure enough to be named, 0…1, that is a warning.
Source: our choice, docs/decisions/0039: a recogniser that is silent on most touch is not what was
asked."""
_SAME_S = 1e-3
"""Times that differ by less are one time, seconds: hides rounding of clocks and rates."""
_MOST_GROUPS = 40
"""A group with more values than this is too fine to be drawn or listed."""


@dataclass(frozen=True, slots=True)
class GroupAccuracy:
    """The test windows of one group."""

    name: str
    windows: int
    accuracy: float
    """0…1."""


@dataclass(frozen=True, slots=True)
class GroupInterval:
    """95 % of the accuracy when whole groups are drawn again, 0…1; NaN with one group."""

    low: float
    high: float
    groups: int


@dataclass(frozen=True, slots=True)
class ReliabilityBin:
    """Test windows predicted with about the same confidence."""

    confidence: float
    """Mean of the largest probability, 0…1."""
    accuracy: float
    """Share predicted correctly, 0…1."""
    windows: int


@dataclass(frozen=True, slots=True, kw_only=True)
class RunScores:
    """Scores of a run's test predictions."""

    scores: Scores
    group: str
    """The coarsest group, by which `by_group` is cut."""
    intervals: dict[str, GroupInterval]
    """Group → interval, the coarsest first."""
    lone: str | None
    """The group of which one value only was tested, such as the session; None where there is no
    such group."""
    by_group: tuple[GroupAccuracy, ...]
    trial_accuracy: float
    """Share of trials predicted correctly when their windows are joined, 0…1."""
    fold_accuracies: tuple[float, ...]
    reliability: tuple[ReliabilityBin, ...]
    calibration_error: float
    """Expected calibration error: mean distance of confidence and accuracy, 0…1."""


def judge(predictions: Predictions) -> RunScores:
    """Return accuracy, intervals, reliability and group scores of a run's test predictions."""
    y, probabilities, correct = predictions.y, predictions.probabilities, predictions.correct
    main = coarsest_of(predictions)
    owner = predictions.group(main)
    names, index = np.unique(owner, return_inverse=True)
    shares = np.bincount(index, weights=correct) / np.bincount(index)
    _, trial_y, joined = by_trial(predictions.trial, y, probabilities)
    bins = reliability(probabilities, correct)
    return RunScores(
        scores=score(y, probabilities),
        group=main,
        intervals={
            key: _interval(correct, predictions.group(key))
            for key in dict.fromkeys((main, *split_groups(predictions), "trial"))
        },
        lone=lone_group(tested_of(predictions), predictions.split),
        by_group=tuple(
            GroupAccuracy(str(name), int(count), float(share))
            for name, count, share in zip(names, np.bincount(index), shares, strict=True)
        ),
        trial_accuracy=float((joined.argmax(axis=1) == trial_y).mean()),
        fold_accuracies=tuple(
            float(correct[predictions.fold == fold].mean())
            for fold in range(len(predictions.folds))
            if (predictions.fold == fold).any()
        ),
        reliability=bins,
        calibration_error=sum(b.windows * abs(b.confidence - b.accuracy) for b in bins) / len(y),
    )


def reliability(
    probabilities: NDArray[np.float64], correct: NDArray[np.bool_]
) -> tuple[ReliabilityBin, ...]:
    """Return accuracy against confidence, bins of equal width, empty ones left out.

    Args:
        probabilities: Shape (n, classes).
        correct: Shape (n,).
    """
    confidence = probabilities.max(axis=1)
    place = np.minimum((confidence * BINS).astype(int), BINS - 1)
    return tuple(
        ReliabilityBin(
            float(confidence[place == bin_].mean()),
            float(correct[place == bin_].mean()),
            int((place == bin_).sum()),
        )
        for bin_ in np.unique(place)
    )


Standing = Literal["behind", "near", "few", "clear"]
"""Of an accuracy beside the best trivial baseline: no better, within its interval, above it with
fewer groups than `compare_runs` could claim anything of, or above."""


def least_of_all_right(trials: int) -> float:
    """Return the accuracy, 0…1, that is plausible at least (95 %) where all of so many are right.

    Source: Clopper and Pearson, Biometrika 26 (1934) 404.
    """
    return float(binomtest(trials, trials).proportion_ci().low)


def beside_baselines(
    name: str,
    accuracy: float,
    interval: GroupInterval,
    group: str,
    trivial: Mapping[str, float],
) -> tuple[Standing, str]:
    """Return whether an accuracy stands clear of the best trivial baseline, and that in words.

    Args:
        name: Whose accuracy it is.
        accuracy: 0…1.
        interval: Its own.
        group: What was resampled for that.
        trivial: Baseline → accuracy, 0…1; at least one.
    """
    best = max(trivial, key=lambda what: trivial[what])
    beside = f"the baseline “{best}” ({100 * trivial[best]:.1f} %)"
    if accuracy <= trivial[best]:
        return "behind", f"{name} is no better than {beside}"
    if math.isfinite(interval.low) and interval.low <= trivial[best]:
        return "near", f"{name} is above {beside}, but its interval is not"
    if smallest_p(interval.groups) >= LEVEL:
        return "few", (
            f"{name} is above {beside}, but with {number_of(interval.groups, group)} no difference "
            f"can be claimed (smallest possible p {smallest_p(interval.groups):.2g})"
        )
    return "clear", f"{name} stands clear of every baseline, the best being “{best}”"


def baseline_warning(
    name: str,
    scores: Scores,
    interval: GroupInterval,
    group: str,
    trivial: Mapping[str, float],
) -> str | None:
    """Return a warning where an accuracy does not stand clear of trivial baselines.

    Args:
        name: Whose scores they are.
        scores: Its own.
        interval: Of its accuracy.
        group: What was resampled for that.
        trivial: Baseline → accuracy, 0…1; at least one.
    """
    shown = f"{name} ({scores.accuracy:.1%})".replace("%", " %")
    standing, comparison = beside_baselines(shown, scores.accuracy, interval, group, trivial)
    more = f"record more {several(group)}"
    mend = {
        "behind": f"{_meaning(scores, group, trivial)}train longer, or {more}",
        "near": f"the difference may be chance; {more}",
        "few": "record more of them",
    }
    return f"{comparison}: {mend[standing]}" if standing in mend else None


def _meaning(scores: Scores, group: str, trivial: Mapping[str, float]) -> str:
    """Return what is known of an accuracy that is no better than the best trivial baseline.

    Below the majority class it is no sign of a leak, and nothing was learned if the balanced
    accuracy is near chance too. Only where a baseline that hardly sees touch is as good may
    something give the label away, which the audit finds out.

    Args:
        scores: Whose accuracy it is.
        group: What was resampled for its interval.
        trivial: Baseline → accuracy, 0…1; at least one.
    """
    from taxel.evaluation.baselines import MAJORITY, SEES_TOUCH  # loads scikit-learn

    best, majority = max(trivial, key=lambda what: trivial[what]), trivial.get(MAJORITY, -1.0)
    if scores.accuracy <= majority:
        share = "" if best == MAJORITY else f" ({100 * majority:.1f} %)"
        return (
            f"not better than always naming the commonest class{share}"
            f"{learned_note(scores.balanced, scores.tested, group)}; "
        )
    if best in SEES_TOUCH:
        return "do not claim this accuracy for more than the channels' means; "
    return (
        "do not claim this accuracy; run taxel audit to see whether something gives the label "
        "away, "
    )


def learned_note(balanced: float, classes: int, group: str) -> str:
    """Return what balanced accuracy shows of a model that is no better than the commonest class.

    Args:
        balanced: Mean of the classes' recalls, 0…1.
        classes: How many; of a single one nothing is shown.
        group: What was held out, such as "session".
    """
    if classes < 2:
        return ""
    figures = f", with a balanced accuracy of {100 * balanced:.1f} % (chance {100 / classes:.1f} %)"
    if near_chance(balanced, classes):
        return f"{figures}: nothing was learned that holds on the tested {several(group)}"
    return figures


def unnamed_line(predictions: Predictions) -> str | None:
    """Return how many test windows live would answer UNKNOWN to; None below one in a hundred.

    Args:
        predictions: For each test window.
    """
    least = RecogniseConfig().least_confidence
    sure = predictions.probabilities.max(axis=1) >= least
    limit = np.zeros(len(sure), bool) if predictions.at_limit is None else predictions.at_limit
    named = sure & ~limit
    share = float(named.mean())
    if share > 1.0 - LEAST_UNNAMED:
        return None
    reasons = []
    if (~sure & ~limit).any():
        reasons.append(f"its confidence is below {least:g} (taxel live --least-confidence)")
    if limit.any():
        rows_of = "them" if limit.all() else number_of(int(limit.sum()), "window")
        reasons.append(f"a channel stands at the converter's limit in all rows of {rows_of}")
    if limit.mean() >= LEAST_UNNAMED:
        reasons[-1] += "; if that is a dead channel, import again without it"
    asked = f"as {', or '.join(reasons)}"
    if not share:
        return f"warning: live would answer UNKNOWN to all of these test windows, {asked}"
    right = f"{100 * predictions.correct[named].mean():.1f} % of them rightly"
    sentence = (
        f"live would name {100 * share:.1f} % of these test windows, {right}; it answers UNKNOWN "
        f"to the others, {asked}"
    )
    if share >= FEW_NAMED:
        return sentence
    more = "; record more" if sure.mean() < FEW_NAMED else ""
    return f"warning: {sentence}{more}"


def blind_baselines(predictions: Predictions) -> tuple[str, ...]:
    """Return the trivial baselines that see the same of each window here, or nothing they know.

    Args:
        predictions: The test windows, and which trials each fold learned from.
    """
    trials, own = predictions.trials, predictions.trial
    counts = np.bincount(own, minlength=len(trials))[np.unique(own)]
    lasts_s = np.array([trials[i].duration_s for i in np.unique(own)])
    single = bool((counts == 1).all())
    since_s = predictions.start_s - np.array([trial.start_s for trial in trials])[own]
    found = []
    if single and np.ptp(since_s) < _SAME_S:
        found.append("place in the trial")
    if single and np.ptp(lasts_s) < _SAME_S:
        found.append("length of the trial")
    key = "session" if all("session" in trial.groups for trial in trials) else "recording"
    names = np.array([trial.groups[key] for trial in trials])
    if not any(
        np.isin(names[own[predictions.fold == fold]], names[trained > 0]).any()
        for fold, trained in enumerate(predictions.trained)
    ):
        found.append("session")
    return tuple(found)


def few_groups(group: str, groups: int) -> str | None:
    """Return a warning on an interval of so few groups that it is too narrow."""
    if smallest_p(groups) < LEVEL:
        return None
    width_note = "no interval" if groups < 2 else "the interval is about their lowest and highest"
    return f"{number_of(groups, group)}: {width_note}; record more"


def only_one(lone: str | None, group: str) -> str | None:
    """Return a warning on an interval within one session, or what else is tested once.

    Args:
        lone: The group of which one value only was tested, if any.
        group: What was resampled for the interval; of one such group there is none.
    """
    if lone is None or lone == group:
        return None
    return (
        f"only one {noun_of(lone)} was tested: the interval says nothing about other "
        f"{several(lone)}"
    )


def split_groups(predictions: Predictions) -> list[str]:
    """Return the groups that a reader of the split wants to see: few values, no numbers,
    neither the coarsest group again nor the trial by another name.

    The coarsest group always stands first, whatever its values look like.
    """
    first = coarsest_of(predictions)
    found = [first]
    for key in predictions.groups():
        values = sorted({trial.groups[key] for trial in predictions.trials})
        if key not in (first, "trial", "recording") and 2 <= len(values) <= _MOST_GROUPS:
            own = _partition(predictions, key)
            same = own in (_partition(predictions, first), _partition(predictions, "trial"))
            if not same and not all(map(is_number, values)):
                found.append(key)
    return found


def is_number(text: str) -> bool:
    """Return whether a group's value is a measured figure, such as a temperature."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def _interval(correct: NDArray[np.bool_], groups: NDArray[np.str_]) -> GroupInterval:
    return GroupInterval(*accuracy_interval(correct, groups), len(np.unique(groups)))


def _partition(predictions: Predictions, key: str) -> list[int]:
    """Return each trial's group as a number of its own, in order of appearance."""
    seen: dict[str, int] = {}
    return [seen.setdefault(trial.groups[key], len(seen)) for trial in predictions.trials]
