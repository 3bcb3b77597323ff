"""What the TENG thesis says of real-world trials, to stand beside ours.

Source: TENG thesis, sections 4.3 and 4.4; its text has no table of them, and no number a
condition; Table 4.1 has one for noisy data, which it does not define. Knows nothing about how
ours were measured.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ClaimedCondition:
    """A claim of the thesis about one condition, as it was published."""

    what: str
    section: str
    published: str
    conditions: tuple[str, ...]
    """Conditions of ours that stand beside it; empty where nothing of ours can."""


CLAIMS: tuple[ClaimedCondition, ...] = (
    ClaimedCondition(
        "shape and material, 20 to 35 °C, changing light, now and then dust or moisture", "4.4",
        "above 95 %", ("temperature", "dust", "moisture"),
    ),
    ClaimedCondition(
        "misclassified, for altered surfaces or extreme temperatures", "4.4",
        "below 3 % of trials", ("temperature", "dust", "moisture"),
    ),
    ClaimedCondition(
        "moving objects (conveyor belt)", "4.3", "“remains robust”, no number", ("moving",)
    ),
    ClaimedCondition(
        "noisy data, 2D against 1D", "4.3, Table 4.1", "0.9960 against 0.9704", ("noise",)
    ),
    ClaimedCondition("changing light", "4.4", "within the first line", ()),
)  # fmt: skip
"""In the thesis's order of weight. Light does not reach a triboelectric pad: no row of ours."""
LEAST = 0.95
"""Accuracy that section 4.4 claims, 0…1."""
