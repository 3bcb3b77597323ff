"""What a process that decides from one source's ring is given. Knows nothing about models.

Background of our choices: docs/decisions/0019.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from taxel.bundles.signing import Trust
from taxel.live.station.worker import Place, Rank
from taxel.models.devices import CPU
from taxel.signals import CameraInfo, SensorInfo

AGAIN_S = 0.1
"""How often a state that no new frames give is sent again, seconds: its reason says how long, and
a decision lives for 0.3 s. Source: our choice, docs/decisions/0030."""
LOOK_S = 10.0
"""What a look at a crop of a camera trial may take, seconds: 2 cameras × 48 frames take 1 to 2 on a
slow core. Source: our choice, docs/decisions/0041."""
Note = dict[str, Any]
"""What a process sends another, as JSON."""
Came = dict[str, float]
"""When the newest message was put into the ring, and when it was taken out, monotonic seconds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Inference:
    """Bundles, one source's ring, and where the decisions go."""

    place: Place
    bundles: tuple[Path, ...]
    checksums: tuple[str, ...] = ()
    """Of the bundles as the station began with them; any others are refused. Empty: not known."""
    sensor: SensorInfo
    cameras: tuple[CameraInfo, ...]
    ring: str
    """The source's."""
    source_row: int
    """The source's beats."""
    decisions: str
    """Ring of notes."""
    last_step_s: float = 0.0
    """How long the step may take with which it answers at the end, seconds: it is waited for."""
    rank: Rank = Rank.MODEL
    """Whom it runs before."""
    least_confidence: float = 0.5
    orders: str = ""
    """Ring of notes from the supervisor, such as {"do": "new grasp"}."""
    drill: bool = False
    """Obey orders to go wrong on purpose, as `taxel bench faults` gives them."""
    trust: Trust | None = None
    """Keys of which one must have signed each bundle; any bundle unless given."""
    device: str = CPU
    """On which ONNX Runtime runs the bundles."""
    levels: dict[str, dict[str, Any]] = field(default_factory=dict)
    """Recogniser → where its session's level stood when its process died."""


def number_or_none(value: float) -> float | None:
    """Return a number as JSON has it: None in place of NaN."""
    return None if math.isnan(value) else value
