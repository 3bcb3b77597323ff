"""What is recognised, for another program: the class, its confidence, and the action for it.

One datagram a window, or a verdict on a camera trial, UTF-8, one JSON object:

    schema             "taxel-answer-1"
    sequence           counts datagrams from 1, those of other schemas too; a hole is a lost one
    time_s             sender's monotonic clock, seconds
    taken_s            the window's last row, on the same clock
    target             what is recognised, such as "material"
    label              the class by the windows of this contact so far (without a contact gate:
                       by the latest ones), or UNKNOWN
    confidence         its probability, 0…1; null with UNKNOWN
    action             what the rule table says is to be done; empty where it says nothing
    window_label       the class by this window alone, or UNKNOWN
    window_confidence  its probability, 0…1; null where the window cannot be used
    reason             why the window is UNKNOWN; empty otherwise
    whole_trial        true for the verdict on a camera trial that is over, false for one that may
                       still change; null for windows of an array

Knows nothing about sockets, models or rules.

Background of our choices: docs/decisions/0046.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

SCHEMA = "taxel-answer-1"


@dataclass(frozen=True, slots=True, kw_only=True)
class Recognised:
    """What is sent of a window; fields as above."""

    sequence: int
    time_s: float
    taken_s: float | None
    target: str
    label: str
    confidence: float | None
    action: str
    window_label: str
    window_confidence: float | None
    reason: str
    whole_trial: bool | None = None
    schema: str = SCHEMA

    def as_json(self) -> bytes:
        """Return it as the bytes of a datagram."""
        return json.dumps(asdict(self), allow_nan=False).encode()


def recognised_of(answer: Mapping[str, Any], sequence: int, now_s: float) -> Recognised:
    """Return what to send; a number that is not finite becomes None.

    Args:
        answer: A recogniser's note, with its action.
        sequence: Number of the datagram.
        now_s: The moment of sending, monotonic seconds.
    """
    return Recognised(
        sequence=sequence,
        time_s=now_s,
        taken_s=finite_number(answer.get("time_s")),
        target=str(answer["target"]),
        label=str(answer["grasp"]),
        confidence=finite_number(answer.get("grasp_confidence")),
        action=str(answer.get("action", "")),
        window_label=str(answer["label"]),
        window_confidence=finite_number(answer.get("confidence")),
        reason=str(answer.get("reason", "")),
        whole_trial=bool(answer["last"]) if "last" in answer else None,
    )


def finite_number(value: object) -> float | None:
    """Return a number as JSON has it: None where it is no number, NaN or infinite."""
    return float(value) if isinstance(value, int | float) and math.isfinite(value) else None
