"""How large a training step is: rising first, then falling to zero along half a cosine."""

from __future__ import annotations

import math

_WARM_UP = 0.1
"""Share of all steps in which the step size rises. Source: our choice, docs/decisions/0057."""


def pace(step: int, of: int) -> float:
    """Return the share of the largest step size at a step, 0 for the first."""
    warm = max(1.0, _WARM_UP * of)
    if step < warm:
        return (step + 1) / (warm + 1)
    return 0.5 * (1 + math.cos(math.pi * (step - warm) / max(1.0, of - warm)))
