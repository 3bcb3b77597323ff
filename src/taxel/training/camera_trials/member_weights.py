"""What each member of a blend of camera trials counts, and how sharp their mean is made.

From what members say of trials that they were not fitted on. Knows nothing about models, views or
folds.

Source: docs/decisions/0041.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

PRIOR: Final = 2.0
"""Weight of the members' priors beside the trials, as a multiple of their number: few trials part
members of a kind badly. Source: our choice, decision 41."""
TRUST: Final = 1.0
"""Observations that a held-out group is worth where its trials part the kinds of members. Source:
our choice, decision 41."""
WITHIN: Final = 0.1
"""The same where they part the members of a kind. Source: our choice, decision 41."""
MOST_GROUPS: Final = 30
"""Groups that count where kinds are parted: however many trials there are, those to come may be of
another session. Source: our choice, decision 41."""
EQUAL_GROUPS, LEAST_EQUAL = 2.0, 0.25
"""How much equal weights of a trial's crops count beside the trials, as a multiple of their number:
so many, divided by the number of groups, and at least so much. Source: our choice, decision 41."""
DOUBT: Final = 2.0
"""What a squared logarithm of a power adds to the summed log-loss under which it is found, nats:
few trials leave it near 1. Source: our choice, decision 41."""
_ROUNDS: Final = 200
_BLUNTEST, _SHARPEST, _POWERS = 0.2, 6.0, 41
LEAST: Final = 1e-6
"""Least probability that is raised to a power, or whose logarithm is taken."""


def weigh(
    held: NDArray[np.float64],
    y: NDArray[np.intp],
    prior: NDArray[np.float64],
    strength: float = PRIOR,
) -> NDArray[np.float64]:
    """Return weights under which the members' mean is likeliest, drawn towards their priors.

    Expectation maximisation of a mixture's weights with a Dirichlet prior.

    Args:
        held: Shape (trials, members, classes).
        y: Shape (trials,).
        prior: Shape (members,).
        strength: Of the prior beside the trials, as a multiple of their number.
    """
    right = np.maximum(held[np.arange(len(y)), :, y], LEAST)
    count, members = right.shape
    drawn = strength * count * prior / prior.sum() if prior.any() else np.zeros(members)
    weights = np.full(members, 1 / members)
    for _ in range(_ROUNDS):
        share = right * weights
        share /= share.sum(axis=1, keepdims=True)
        weights = share.sum(axis=0) + drawn
        weights /= weights.sum()
    return weights


def weigh_places(
    held: NDArray[np.float64], y: NDArray[np.intp], groups: int
) -> NDArray[np.float64]:
    """Return what each of a trial's crops counts in its mean, shape (places,), summing to 1.

    Drawn towards equal weights, the more so the fewer groups there are.

    Args:
        held: Shape (trials, places, classes).
        y: Shape (trials,).
        groups: How many the trials are of.
    """
    strength = max(LEAST_EQUAL, EQUAL_GROUPS / groups)
    return weigh(held, y, np.ones(held.shape[1]), strength)


def trusted(
    held: NDArray[np.float64],
    y: NDArray[np.intp],
    groups: int,
    prior: NDArray[np.float64],
    kinds: NDArray[Any],
    parts: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Return priors of which each kind of members has the share that its predictions deserve.

    The kinds' means are compared as models are by their likelihoods on trials held out. Trials
    of a group are alike: each group counts as `TRUST` observations, whatever its trials' number, up
    to `MOST_GROUPS` groups. A mean's log-loss is taken at its own best sharpness. Within a kind,
    members are compared in the same way, a group for `WITHIN` observations.

    Args:
        held: Shape (trials, members, classes).
        y: Shape (trials,).
        groups: How many the trials are of.
        prior: Shape (members,): shares within a kind.
        kinds: Shape (members,): what each member sees, in one word.
        parts: Shape (members,): what the kind of each counts before any trial is seen, above 0;
            1 unless given.

    Source:
        Pseudo-Bayesian model averaging, Yao et al., Bayesian Analysis 13(3), 2018, with groups in
        place of trials; docs/decisions/0041.
    """
    own = np.array([log_loss(held[:, member], y) for member in range(held.shape[1])])
    least = np.array([own[kinds == kind].min() for kind in kinds])
    inside = prior * np.exp(-WITHIN * groups * (own - least))
    shares = [np.where(kinds == kind, inside, 0.0) for kind in np.unique(kinds)]
    shares = [share / share.sum() for share in shares if share.any()]
    if not shares:
        return prior
    before = (
        np.ones(len(shares)) if parts is None else np.array([share @ parts for share in shares])
    )
    losses = []
    for share in shares:
        mean = np.asarray(np.einsum("tmc,m->tc", held, share), np.float64)
        losses.append(log_loss(sharpened(mean, sharpen(mean, y)), y))
    behind = np.array(losses) - min(losses)
    return np.asarray(
        before * np.exp(-TRUST * min(groups, MOST_GROUPS) * behind) @ np.stack(shares), np.float64
    )


def sharpen(probabilities: NDArray[np.float64], y: NDArray[np.intp]) -> float:
    """Return the power that makes probabilities likeliest, shape (trials, classes), near 1."""

    def cost(power: float) -> float:
        loss = log_loss(sharpened(probabilities, power), y)
        return len(y) * loss + DOUBT * float(np.log(power)) ** 2

    return float(min(np.geomspace(_BLUNTEST, _SHARPEST, _POWERS), key=cost))


def sharpened(probabilities: NDArray[np.float64], power: float) -> NDArray[np.float64]:
    """Return probabilities, shape (…, classes), raised to a power and made to sum to 1."""
    raised = np.maximum(probabilities, LEAST) ** power
    return np.asarray(raised / raised.sum(axis=-1, keepdims=True), np.float64)


def log_loss(probabilities: NDArray[np.float64], y: NDArray[np.intp]) -> float:
    """Return the mean negative logarithm of the true class's probability, nats.

    Args:
        probabilities: Shape (n, classes); below `LEAST` they count as that.
        y: True class numbers, shape (n,).
    """
    found = float(np.log(np.maximum(probabilities[np.arange(len(y)), y], LEAST)).mean())
    return 0.0 - found  # not -0.0 where all are certain and correct
