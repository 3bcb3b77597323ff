"""Every rule that calls a frame stable or unstable, by name.

Knows nothing about files, models or how a rule is carried out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

from taxel.errors import BadInput

Needs = Literal["images", "truth"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Rule:
    """What calls a frame unstable."""

    needs: Needs
    """What it is computed from: the images, or the simulator's physics truth."""
    summary: str
    """What it means, in one line."""
    source: str
    """Where it comes from."""
    channel: str = ""
    """The truth channel that it looks at; empty for a rule on images."""
    above: float = float("nan")
    """A frame is unstable above this value, in the channel's unit; NaN for images."""


RULES: Mapping[str, Rule] = MappingProxyType(
    {
        "change": Rule(
            needs="images",
            summary="the image differs from the settled first frames by more than noise",
            source="Sensors 2024, 24, 5080, section 3.2; threshold docs/decisions/0013",
        ),
        "micro-slip": Rule(
            needs="truth",
            summary="the handle has slipped more than 20 µm since the grasp",
            source="our choice, docs/decisions/0013",
            channel="slip",
            above=20.0,
        ),
        "slip": Rule(
            needs="truth",
            summary="the handle has slipped more than 100 µm since the grasp",
            source="our choice, docs/decisions/0013",
            channel="slip",
            above=100.0,
        ),
        "gross-slip": Rule(
            needs="truth",
            summary="the handle has slipped more than 300 µm since the grasp",
            source="our choice, docs/decisions/0013",
            channel="slip",
            above=300.0,
        ),
        "drop": Rule(
            needs="truth",
            summary="the cup has left the gripper",
            source="the simulator's own event",
            channel="dropped",
            above=0.5,
        ),
    }
)


def rule_named(name: str) -> Rule:
    """Return the rule of that name.

    Raises:
        BadInput: There is no such rule.
    """
    if name not in RULES:
        raise BadInput(f"a label rule among {', '.join(RULES)}", repr(name), "choose one of them")
    return RULES[name]
