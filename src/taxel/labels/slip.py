"""Labels from the physics truth that a simulator records beside its images.

Knows nothing about images, files or models.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadInput
from taxel.labels.rules import RULES, rule_named
from taxel.sim.pour.state import TRUTH_CHANNELS


def label_truth(truth: NDArray[np.floating], rule: str) -> NDArray[np.int8]:
    """Return 1 for each moment that a physics rule calls unstable, shape (n,).

    Args:
        truth: Shape (n, 8), columns in the order of `TRUTH_CHANNELS`, oldest first.
        rule: Name of a rule that needs truth: micro-slip, slip, gross-slip or drop.

    Raises:
        BadInput: There is no such rule, it needs images, or the truth is of
            another shape or holds NaN where the rule looks.
    """
    label_rule = rule_named(rule)
    if label_rule.needs != "truth":
        physics = ", ".join(name for name, rule in RULES.items() if rule.needs == "truth")
        raise BadInput(f"a rule on physics truth ({physics})", repr(rule), "choose one of them")
    if truth.ndim != 2 or truth.shape[1] != len(TRUTH_CHANNELS):
        raise BadInput(
            f"truth of shape (n, {len(TRUTH_CHANNELS)})",
            f"shape {truth.shape}",
            f"give the columns {', '.join(TRUTH_CHANNELS)}",
        )
    values = truth[:, TRUTH_CHANNELS.index(label_rule.channel)]
    if np.isnan(values).any():
        raise BadInput(
            f"a finite {label_rule.channel} at every moment",
            f"NaN at row {int(np.isnan(values).argmax())}",
            "record the truth again or leave the recording out",
        )
    return (values > label_rule.above).astype(np.int8)
