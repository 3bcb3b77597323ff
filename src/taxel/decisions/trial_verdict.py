"""From the crops of a camera trial seen so far to a verdict, or to UNKNOWN with its reason.

Knows nothing about images, models or screens.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.decisions.recognition import UNKNOWN

NOVEL = "novel touch"
"""Begins the reason where a trial is unlike what was learned."""
_LEAST = 1e-6
"""Probability that each class has at the least before it is sharpened: the sum stays above 0."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VerdictConfig:
    """When a verdict may be given."""

    sharpness: float = 1.0
    """Power to which a trial's mean probabilities are raised."""
    places: tuple[float, ...] = ()
    """What each crop of a whole trial counts in the mean, summing to 1; empty where all count
    alike."""
    threshold: float | None = None
    """Above this mean novelty a trial is UNKNOWN; None tests nothing."""
    least_confidence: float = 0.5
    """Below this probability the verdict is UNKNOWN, 0…1."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """What is said of a trial so far."""

    label: str
    """A class, or UNKNOWN."""
    confidence: float
    """Probability of the likeliest class, 0…1; NaN where nothing was seen yet."""
    probabilities: NDArray[np.float64]
    """Shape (classes,)."""
    novelty: float
    """Mean distance to what was learned; NaN where nothing was seen yet."""
    reason: str
    """Why the verdict is UNKNOWN; empty otherwise."""
    crops: int
    """How many crops it rests on."""


def no_verdict(classes: tuple[str, ...], reason: str) -> Verdict:
    """Return UNKNOWN for a trial of which no crop could be seen."""
    nothing = np.full(len(classes), np.nan)
    return Verdict(UNKNOWN, float("nan"), nothing, float("nan"), reason, 0)


def join_crops(
    probabilities: NDArray[np.float64],
    novelty: NDArray[np.float64],
    classes: tuple[str, ...],
    config: VerdictConfig,
) -> Verdict:
    """Return the verdict of a trial's crops: their mean, weighed and sharpened as inner folds said.

    While a trial runs, its crops lie elsewhere and have one mean already: they count alike.

    Args:
        probabilities: Shape (crops, classes).
        novelty: Shape (crops,).
        classes: Their names.
        config: When a verdict may be given.
    """
    places = config.places if len(config.places) == len(probabilities) else None
    mean = np.average(probabilities, axis=0, weights=places)
    mean = np.maximum(mean, _LEAST) ** config.sharpness
    mean = mean / mean.sum()
    score = float(novelty.mean())
    best = int(mean.argmax())
    confidence = float(mean[best])
    reason = ""
    if not np.isfinite(mean).all() or not np.isfinite(score):
        reason = "the model gave NaN"
    elif config.threshold is not None and score > config.threshold:
        reason = f"{NOVEL} (novelty score {score:.1f}, limit {config.threshold:.1f})"
    elif confidence < config.least_confidence:
        reason = f"confidence {confidence:.2f} is below {config.least_confidence:.2f}"
    label = UNKNOWN if reason else classes[best]
    return Verdict(label, confidence, mean, score, reason, len(novelty))
