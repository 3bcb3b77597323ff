"""What a training looked like: loss and accuracy after each epoch, learned from and held out.

Knows nothing about networks, folds or pages.

Background of our choices: docs/decisions/0046.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.foreign.records import record_of

WATCHED = 256
"""Windows of each side that are looked at after each epoch, drawn evenly. Source: our choice,
docs/decisions/0046: about a tenth of the time that the epoch takes."""


@dataclass(frozen=True, slots=True)
class Epoch:
    """What one epoch gave."""

    number: int
    """1 for the first."""
    loss: float
    """Mean cross-entropy over the training windows while they were learned from, nats: with
    augmentation, dropout and weights that still move."""
    validation_loss: float | None = None
    """Mean cross-entropy over held-out windows after the epoch, nats; None where there are none."""
    validation_accuracy: float | None = None
    """0…1."""
    training_loss: float | None = None
    """The same over training windows after the epoch, as the held-out ones are looked at."""
    training_accuracy: float | None = None
    """0…1."""


@dataclass(frozen=True, slots=True)
class Curve:
    """One training."""

    name: str
    """Such as a fold's name."""
    epochs: tuple[Epoch, ...]

    @property
    def gap(self) -> tuple[float, float]:
        """Held out less training after the last epoch: loss in nats, accuracy 0…1 the other way.

        Both are above 0 where the network does better on what it learned from; NaN where
        nothing was held out.
        """
        last = self.epochs[-1] if self.epochs else Epoch(0, math.nan)
        sides = (last.validation_loss, last.training_loss, last.training_accuracy,
                 last.validation_accuracy)  # fmt: skip
        held, own, right, held_right = (math.nan if v is None else v for v in sides)
        return held - own, right - held_right


def thinned(count: int, most: int = WATCHED) -> NDArray[np.intp]:
    """Return at most so many of `count` indices, evenly drawn, shape (n,)."""
    if count <= most:
        return np.arange(count)
    return np.unique(np.linspace(0, count - 1, most).astype(np.intp))


def curves_to_json(curves: Sequence[Curve]) -> list[dict[str, Any]]:
    """Return curves as plain values."""
    return [asdict(curve) for curve in curves]


def curves_from_json(raw: object) -> tuple[Curve, ...]:
    """Return what `curves_to_json` gave.

    Raises:
        ValueError: It is something else.
    """
    if not isinstance(raw, list):
        raise ValueError("curves are no list")
    return tuple(_curve(entry) for entry in raw)


def _curve(raw: object) -> Curve:
    if not isinstance(raw, Mapping) or set(raw) != {"name", "epochs"}:
        raise ValueError("a curve without name and epochs")
    if not isinstance(raw["name"], str) or not isinstance(raw["epochs"], list | tuple):
        raise ValueError("a curve whose name or epochs are of another kind")
    return Curve(
        raw["name"], tuple(record_of(Epoch, epoch, finite=False) for epoch in raw["epochs"])
    )
