"""Join candidates: one temperature each, then the mean of the kinds' best, with what beats it.

A candidate's inner score says how it does on groups like those that were held out. Groups to
come may be further away, where one kind of model fails and another does not; so the kinds' bests
are averaged. What is better than that by more than chance gets half of the weight: the log-loss of
two probabilities' mean is never above the mean of their log-losses. Knows nothing about features
or files.

Source: Caruana et al., "Ensemble selection from libraries of models", ICML 2004; the rule of one
standard error after Breiman et al., "Classification and regression trees", 1984;
docs/decisions/0039.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from taxel.models.blend import DOUBT

LEAST = 1e-6
"""Probabilities are cut here before the logarithm. Source: our choice, 0039."""
SHARPNESS = np.geomspace(0.05, 200.0, 100)
"""What logits may be multiplied by: a discriminant's, of unit spread where it learned, by much."""
FEW_SHARPNESS = 0.5
"""What a blend's logarithms are multiplied by where new sessions come and too few were learned from
to hold one out. Source: our choice, 0039."""
ROUNDS = 8
"""Members that are added one by one in the greedy blend. Source: our choice, 0039."""
LEAST_GAIN, CHANCE = 0.1, 0.025
"""Share of that mean's loss by which anything must beat it, and how likely so much is by chance,
by Student's t over the groups held out. Source: our choice, 0039: weights fitted to held-out groups
favour what fits groups like those."""
LEAST_NATS = 0.03
"""And so much more. Source: as above."""
STEADY, LIKE_IT = "discriminant", "sums"
"""A camp that goes on better than others beyond what was learned, and one that is as linear but
keeps less to what is known of a class: members of the latter stay only where they are better by
`LEAST_NATS`. Source: our choice, 0039, from seven sets' outer folds."""
STEADY_WEIGHT = 2.0
"""Of the former camp, any other's being 1. Source: as above."""
BEHIND, SLACK = 1.3, 0.05
"""A kind's best is in the mean where its loss is at most so many times the least, and so much
more. Source: our choice, 0039."""
STEADY_BEHIND, STEADY_SLACK = 2.0, 0.1
"""The same for the steady camp. Source: as above."""


_MEAN = (
    "a blend, the mean of the best model of each kind; kinds that are much worse are left out, and "
    "logistic regression and perceptrons unless clearly better than discriminants. No single "
    "model is better by more than chance, and the mean is safer for new groups"
)
_ALONE = "one model alone, because all other kinds are far behind"
_STEADY_ALONE = (
    "a discriminant alone: logistic regression and perceptrons are left out unless clearly better "
    "than discriminants, and any other kind that was tried is far behind"
)
_ONLY = "one model alone, because no other kind was tried"


@dataclass(frozen=True, slots=True)
class Mix:
    """Members with their weights."""

    members: tuple[int, ...]
    weights: tuple[float, ...]
    why: str


def softmax(logits: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return probabilities, shape (n, classes)."""
    found = np.exp(logits - logits.max(axis=1, keepdims=True))
    return np.asarray(found / found.sum(axis=1, keepdims=True))


def doubted(probabilities: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a blend's probabilities, shape (n, classes), with the doubt that always stays."""
    return np.asarray((1.0 - DOUBT) * probabilities + DOUBT / probabilities.shape[1])


def losses(probabilities: NDArray[np.float64], y: NDArray[np.intp]) -> NDArray[np.float64]:
    """Return each window's cross-entropy, nats, shape (n,)."""
    return np.asarray(-np.log(np.maximum(probabilities[np.arange(len(y)), y], LEAST)))


def fit_sharpness(
    logits: NDArray[np.float64], y: NDArray[np.intp], trials: int | None = None
) -> float:
    """Return what logits are multiplied by for the least loss: one over the temperature.

    Where no window is wrong, any sharpness would do; so few trials cannot show more certainty
    than that one more might be wrong, which is what the truth is smoothed by.

    Args:
        logits: Out of fold, shape (n, classes).
        y: Shape (n,).
        trials: How many trials they come from; n unless given.

    Source:
        Guo et al., "On calibration of modern neural networks", ICML 2017.
    """
    return _least_loss(logits, y, 1.0 / ((len(y) if trials is None else trials) + 2.0))


def _least_loss(logits: NDArray[np.float64], y: NDArray[np.intp], doubt: float) -> float:
    """Return the factor of least loss where a share of the truth is spread over all classes."""
    each = []
    for factor in SHARPNESS:
        scaled = factor * logits
        scaled = scaled - scaled.max(axis=1, keepdims=True)
        log = scaled - np.log(np.exp(scaled).sum(axis=1, keepdims=True))
        likely = (1.0 - doubt) * log[np.arange(len(y)), y] + doubt * log.mean(axis=1)
        each.append(-likely.mean())
    return float(SHARPNESS[int(np.argmin(each))])


def fit_last(
    logits: NDArray[np.float64], y: NDArray[np.intp], trials: int, *, later: bool
) -> float:
    """Return what a blend's logarithms are multiplied by.

    Members' errors are on other windows, so that their mean is less sure than it is right. Errors
    that were made take the place of the doubt that a flawless fit needs. And where groups to come
    are held out, the blend is at least as sure in the mean as it is right on inner folds: these
    learn from fewer groups than what is trained in the end. Later trials may be unlike all before.

    Args:
        logits: Logarithms of the blend's probabilities out of fold, shape (n, classes).
        y: Shape (n,).
        trials: How many trials they come from.
        later: Whether later trials are held out.

    Source:
        Ranjan and Gneiting, "Combining probability forecasts", JRSS B 72(1), 2010; decision 0039.
    """
    right = float((logits.argmax(axis=1) == y).mean())
    doubt = 1.0 / (trials + 2.0)
    left = max(doubt - (1.0 - right), 0.0)
    sharpness = _least_loss(logits, y, left)
    if later:
        return sharpness
    sure = [softmax(factor * logits).max(axis=1).mean() for factor in SHARPNESS]
    enough = int(np.argmin(np.abs(np.array(sure) - right * (1.0 - doubt))))
    return max(sharpness, float(SHARPNESS[enough]))


def mix(
    probabilities: list[NDArray[np.float64]],
    kinds: list[str],
    camps: list[str],
    freedom: list[tuple[float, ...]],
    y: NDArray[np.intp],
    groups: NDArray[np.intp],
) -> Mix:
    """Return which candidates to join, and how.

    Args:
        probabilities: Each candidate's, out of fold and calibrated, shape (n, classes).
        kinds: Each candidate's kind: candidates of one kind make the same mistakes.
        camps: Each candidate's camp: kinds of one camp fail together far from what was learned, and
            share its weight; discriminants have twice that of others.
        freedom: How much each may fit; of those of a kind that are as good as its best within one
            standard error, the least free is taken.
        y: Shape (n,).
        groups: What must be taken as a whole when a difference is judged, shape (n,).
    """
    by_window = np.stack([losses(found, y) for found in probabilities])
    each = by_window.mean(axis=1)
    best = int(each.argmin())
    near = _champions(by_window, kinds, camps, freedom, groups)
    champions = _without_likes(near, camps, each)
    equal = Mix(champions, _shared(champions, camps), _why_mean(champions, near, kinds))
    others = [
        Mix((best,), (1.0,), "the best model"),
        _greedy(probabilities, y, best),
    ]
    base = losses(joined(probabilities, equal), y)
    chosen, most = equal, LEAST_GAIN * base.mean() + LEAST_NATS
    for other in others:
        gain = base - losses(joined(probabilities, other), y)
        if gain.mean() > most and gain.mean() > by_chance(gain, groups):
            chosen, most = other, gain.mean()
    return equal if chosen is equal else _halved(chosen, equal)


def _halved(better: Mix, mean: Mix) -> Mix:
    """Return a mix of which half the weight is on what beats the mean, half on the mean."""
    weights: dict[int, float] = {}
    for part in (better, mean):
        for member, weight in zip(part.members, part.weights, strict=True):
            weights[member] = weights.get(member, 0.0) + 0.5 * weight
    rest = "the mean of the best model of each kind" if len(mean.members) > 1 else "one model alone"
    why = (
        f"half {better.why}, half {rest}: the former is clearly better on inner folds, the latter "
        "is safer for new groups"
    )
    return Mix(tuple(weights), tuple(weights.values()), why)


def _why_mean(champions: tuple[int, ...], near: tuple[int, ...], kinds: list[str]) -> str:
    """Return why these candidates are joined.

    Args:
        champions: Of each kind in the mean the candidate.
        near: The same before some were left out for a steadier camp.
        kinds: Each candidate's kind.
    """
    if len(champions) > 1:
        return _MEAN
    if len(near) > 1:
        return _STEADY_ALONE
    return _ALONE if len(set(kinds)) > 1 else _ONLY


def _without_likes(
    members: tuple[int, ...], camps: list[str], each: NDArray[np.float64]
) -> tuple[int, ...]:
    """Return members without those of a camp that a steadier one is as good as.

    Args:
        members: Places of candidates.
        camps: Each candidate's.
        each: Each candidate's loss, nats, shape (candidates,).
    """
    steady = [each[member] for member in members if camps[member] == STEADY]
    if not steady:
        return members
    enough = min(steady) - LEAST_NATS
    return tuple(m for m in members if camps[m] != LIKE_IT or each[m] < enough)


def _shared(members: tuple[int, ...], camps: list[str]) -> tuple[float, ...]:
    """Return weights: the steady camp's twice any other's, equal within each."""
    own = [camps[member] for member in members]
    share = {camp: STEADY_WEIGHT if camp == STEADY else 1.0 for camp in own}
    whole = sum(share.values())
    return tuple(share[camp] / (whole * own.count(camp)) for camp in own)


def joined(probabilities: list[NDArray[np.float64]], found: Mix) -> NDArray[np.float64]:
    """Return a mix's probabilities, shape (n, classes)."""
    parts = [w * probabilities[i] for i, w in zip(found.members, found.weights, strict=True)]
    return np.asarray(np.sum(parts, axis=0))


def standard_error(gain: NDArray[np.float64], groups: NDArray[np.intp]) -> float:
    """Return the standard error of a mean over windows of which whole groups are alike."""
    _, index, count = np.unique(groups, return_inverse=True, return_counts=True)
    if len(count) < 2:
        return float("inf")
    apart = np.bincount(index, weights=gain - gain.mean())
    return float(np.sqrt((apart**2).sum() * len(count) / (len(count) - 1)) / len(gain))


def by_chance(gain: NDArray[np.float64], groups: NDArray[np.intp]) -> float:
    """Return what a mean over windows exceeds by chance, so likely as `CHANCE` says.

    Args:
        gain: Of each window, shape (n,).
        groups: What must be taken as a whole, shape (n,).
    """
    many = len(np.unique(groups))
    if many < 2:
        return float("inf")
    return float(stdtrit(many - 1, 1.0 - CHANCE)) * standard_error(gain, groups)


def _champions(
    by_window: NDArray[np.float64],
    kinds: list[str],
    camps: list[str],
    freedom: list[tuple[float, ...]],
    groups: NDArray[np.intp],
) -> tuple[int, ...]:
    """Return each kind's candidate, where it is not far behind the best of all."""
    each = by_window.mean(axis=1)
    found = []
    for kind in dict.fromkeys(kinds):
        own = [i for i, name in enumerate(kinds) if name == kind]
        best = min(own, key=lambda i: each[i])
        as_good = [i for i in own if i == best or each[i] - each[best]
                   <= standard_error(by_window[i] - by_window[best], groups)]  # fmt: skip
        chosen = min(as_good, key=lambda i: freedom[i])
        steady = camps[best] == STEADY
        behind, slack = (STEADY_BEHIND, STEADY_SLACK) if steady else (BEHIND, SLACK)
        if each[best] <= behind * each.min() + slack:
            found.append(chosen)
    return tuple(found)


def _greedy(probabilities: list[NDArray[np.float64]], y: NDArray[np.intp], first: int) -> Mix:
    """Add the member that helps most, again and again, with replacement."""
    chosen = [first]
    total = probabilities[first].copy()
    loss = losses(total, y).mean()
    for size in range(2, ROUNDS + 1):
        tried = [losses((total + own) / size, y).mean() for own in probabilities]
        best = int(np.argmin(tried))
        if tried[best] >= loss:
            break
        chosen.append(best)
        total, loss = total + probabilities[best], tried[best]
    members, counts = np.unique(chosen, return_counts=True)
    weights = counts / counts.sum()
    return Mix(tuple(map(int, members)), tuple(map(float, weights)), "a greedy blend")
