"""How sure a contact's windows are together.

Windows of one contact err together, so that their likelihoods must not be multiplied as if they
were independent, nor averaged as if a second window said nothing. The mean of their logarithms
is raised by windows^power × strength. Which class leads stays the same; how sure it is does not.
Knows nothing about models, nor how the two numbers are found.

Source: docs/decisions/0039.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Joining:
    """How a contact's windows are joined; unless found, by the plain mean of logarithms."""

    power: float = 0.0
    """0: windows say the same; 1: they are independent."""
    strength: float = 1.0

    def of_means(
        self, mean: NDArray[np.float64], count: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return joined probabilities, shape (m, classes).

        Args:
            mean: Mean logarithm of each contact's windows, shape (m, classes).
            count: Each contact's windows, shape (m,).
        """
        logits = self.strength * count[:, None] ** self.power * mean
        weights = np.exp(logits - logits.max(axis=1, keepdims=True))
        return np.asarray(weights / weights.sum(axis=1, keepdims=True))


MEAN = Joining()
"""The plain mean."""
