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


def check_gradient(length: float, step: int, mend: str) -> None:
    """End a training whose gradient is no longer a number, before its weights are changed by it.

    Args:
        length: Of this step's gradient, over all weights; of several processes' mean.
        step: 1 for the first.
        mend: What may help, after "try".

    Raises:
        BadInput: It is not finite.
    """
    if not math.isfinite(length):
        raise BadInput(
            "a loss and a gradient that are numbers", f"{length} in step {step}",
            f"try {mend}, without --resume",
        )  # fmt: skip
