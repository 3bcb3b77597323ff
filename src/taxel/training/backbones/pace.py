"""How large a training step is, and when steps were too large.

The size rises first, then falls to zero along half a cosine.
"""

from __future__ import annotations

import math

from taxel.errors import BadInput

_WARM_UP = 0.1
"""Share of all steps in which the step size rises. Source: our choice, docs/decisions/0057."""


def pace(step: int, of: int) -> float:
    """Return the share of the largest step size at a step, 0 for the first."""
    warm = max(1.0, _WARM_UP * of)
    if step < warm:
        return (step + 1) / (warm + 1)
    return 0.5 * (1 + math.cos(math.pi * (step - warm) / max(1.0, of - warm)))


def check_loss(loss: float, step: int, mend: str) -> None:
    """End a training whose loss is no longer a number: nothing can be learned any more.

    Args:
        loss: Of this step.
        step: 1 for the first.
        mend: What may help, after "try".

    Raises:
        BadInput: It is not finite.
    """
    if not math.isfinite(loss):
        raise BadInput("a loss that is a number", f"{loss} in step {step}", f"try {mend}")
