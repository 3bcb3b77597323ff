"""Statistics of each feature, an episode and over all, by which LeRobot scales what it learns.

Values that are not finite are left out: what is missing must not scale what is there. Over all
episodes the quantiles are the mean of the episodes', weighted by the values there, nearly as
LeRobot does it: theirs are weighted by frames, and an episode without a value would count as zero.
Knows nothing about recordings or Parquet.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
"""Source: their DEFAULT_QUANTILES."""
KNOWN = "known"
"""How many values each statistic is made of; LeRobot's files have no place for it."""
Stats = dict[str, NDArray[np.float64]]
"""min, max, mean, std, quantiles and KNOWN of a feature, each of the feature's shape, and count:
its frames. Where nothing is known, all are zero."""


def stats_of(values: NDArray[Any]) -> Stats:
    """Return the statistics of a feature in an episode.

    Args:
        values: Shape (frames, …); the statistics have the shape behind.
    """
    found = np.asarray(values, np.float64)
    found = found[:, None] if found.ndim == 1 else found
    known = np.isfinite(found)
    empty = ~known.any(axis=0)
    count = np.maximum(known.sum(axis=0), 1)
    mean = np.where(known, found, 0.0).sum(axis=0) / count
    spread = np.where(known, found - mean, 0.0)
    masked = np.where(empty, 0.0, np.where(known, found, np.nan))
    stats = {
        "min": np.nanmin(masked, axis=0),
        "max": np.nanmax(masked, axis=0),
        "mean": mean,
        "std": np.sqrt((spread**2).sum(axis=0) / count),
        "count": np.array([len(found)], np.float64),
        KNOWN: known.sum(axis=0).astype(np.float64),
    }
    quantiles = np.nanquantile(masked, list(QUANTILES.values()), axis=0)
    return stats | dict(zip(QUANTILES, quantiles, strict=True))


def image_stats(images: Sequence[NDArray[np.uint8]]) -> Stats:
    """Return the statistics of colours, 0…1, each of shape (3, 1, 1).

    Args:
        images: Some of an episode's, each of shape (height, width, 3).
    """
    pixels = np.concatenate([image.reshape(-1, 3) for image in images]) / 255.0
    stats = {name: value.reshape(3, 1, 1) for name, value in stats_of(pixels).items()
             if name != "count"}  # fmt: skip
    count = np.array([len(images)], np.float64)
    return stats | {"count": count, KNOWN: np.full((3, 1, 1), count)}


def together(parts: Sequence[Stats]) -> Stats:
    """Return the statistics over several episodes; one without a value weighs nothing."""
    weights = [part[KNOWN] for part in parts]
    known = np.sum(weights, axis=0)
    total = np.maximum(known, 1.0)

    def of_known(name: str, empty: float) -> list[NDArray[np.float64]]:
        return [np.where((part[KNOWN] > 0) | (known == 0), part[name], empty) for part in parts]

    def mean_of(values: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
        weighted = [value * weight for value, weight in zip(values, weights, strict=True)]
        return np.asarray(np.sum(weighted, axis=0) / total)

    mean = mean_of([part["mean"] for part in parts])
    spread = mean_of([part["std"] ** 2 + (part["mean"] - mean) ** 2 for part in parts])
    return {
        "min": np.min(of_known("min", np.inf), axis=0),
        "max": np.max(of_known("max", -np.inf), axis=0),
        "mean": mean,
        "std": np.sqrt(spread),
        "count": np.sum([part["count"] for part in parts], axis=0),
        KNOWN: known,
    } | {name: mean_of([part[name] for part in parts]) for name in QUANTILES}


def as_lists(stats: Stats) -> dict[str, Any]:
    """Return statistics as plain values; counts are whole numbers."""
    return {
        name: value.astype(np.int64).tolist() if name == "count" else value.tolist()
        for name, value in stats.items()
        if name != KNOWN
    }
