"""95 % intervals by drawing whole clusters again: sessions, cups, or whatever a split holds out.

Windows of one cluster are alike, so that drawing windows would promise too much. One rule
everywhere: fewer than two clusters give no interval, (NaN, NaN), and a draw that gives no finite
number is left out. Knows nothing about what is measured.

Background of our choices: docs/decisions/0008 and docs/decisions/0048.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

RESAMPLES = 2000
"""Draws, unless a study says how many. Source: our choice."""
Interval = tuple[float, float]
"""Lower and upper bound; NaN where there is none."""
ALIKE = "all alike"
"""What a reader finds in the place of an interval without width."""
_ROUNDING = 1e-9
"""Width that sums in another order have, as a share."""
NO_INTERVAL: Interval = (float("nan"), float("nan"))


def draw_clusters(clusters: int, seed: int = 0, resamples: int = RESAMPLES) -> NDArray[np.intp]:
    """Return cluster numbers drawn with replacement, shape (resamples, clusters).

    Fewer than two clusters give no draw, shape (0, clusters).
    """
    if clusters < 2:
        return np.zeros((0, clusters), np.intp)
    return np.random.default_rng(seed).integers(0, clusters, (resamples, clusters))


def draw_rows(
    groups: NDArray[np.generic] | Sequence[str], seed: int = 0, resamples: int = RESAMPLES
) -> list[NDArray[np.intp]]:
    """Return the rows of each draw of whole clusters; no draw with fewer than two of them.

    Args:
        groups: Each row's cluster, shape (n,).
        seed: Seed of the drawing.
        resamples: How many draws.
    """
    names, index = np.unique(groups, return_inverse=True)
    members = [np.flatnonzero(index == number) for number in range(len(names))]
    draws = draw_clusters(len(names), seed, resamples)
    return [np.concatenate([members[number] for number in draw]) for draw in draws]


def percentile_interval(values: NDArray[np.float64] | Sequence[float]) -> Interval:
    """Return the middle 95 % of what the draws gave, shape (resamples,); NaN left out."""
    known = np.asarray(values, np.float64)
    known = known[np.isfinite(known)]
    if not len(known):
        return NO_INTERVAL
    low, high = np.percentile(known, [2.5, 97.5])
    return float(low), float(high)


def all_alike(interval: Interval) -> bool:
    """Return whether every draw gave the same number: no width, which is no certainty.

    All clusters are alike then, as where each session is wholly correct, and nothing shows how far
    another one may differ.
    """
    low, high = interval
    return high - low <= _ROUNDING * max(1.0, abs(high))


def ratio_interval(
    part: NDArray[np.generic], whole: NDArray[np.generic], seed: int = 0
) -> Interval:
    """Return the interval of Σ part / Σ whole, such as an accuracy from right and tested windows.

    Args:
        part: Of each cluster, shape (clusters,), as `whole`.
        whole: Of each cluster, shape (clusters,); a draw in which all are 0 is left out.
        seed: Seed of the drawing.
    """
    drawn = draw_clusters(len(part), seed)
    sums, totals = part[drawn].sum(axis=1), whole[drawn].sum(axis=1)
    return percentile_interval(sums[totals != 0] / totals[totals != 0])


def at_least_exact(interval: Interval, hits: int, total: int) -> Interval:
    """Return a share's 95 % interval, at least as wide as the exact binomial one.

    Where all or none succeed, resampling says nothing; runs beside each other are not independent,
    so that the binomial alone would say too much.

    Args:
        interval: By resampling whole clusters; NaN where there is none.
        hits: Successes.
        total: Of so many, above 0.

    Source: Clopper and Pearson, Biometrika 26 (1934) 404.
    """
    from scipy.stats import beta

    low = float(beta.ppf(0.025, hits, total - hits + 1)) if hits else 0.0
    high = float(beta.ppf(0.975, hits + 1, total - hits)) if hits < total else 1.0
    return float(np.fmin(interval[0], low)), float(np.fmax(interval[1], high))
