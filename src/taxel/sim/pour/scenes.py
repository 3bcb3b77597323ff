"""What surrounds a grasp that is not just held: the arm's way, a table, a person, an obstacle.

Plain values, drawn in `scene_draws` and put into forces in `surroundings`. Knows nothing about
cups, gels or random numbers.

Background of our choices: docs/decisions/0045.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from taxel.sim.pour.gripper_path import GripperPath


@dataclass(frozen=True, slots=True, kw_only=True)
class Approach:
    """Open jaws that close on a handle: approach, contact, settled."""

    contact_s: float
    """When the first gel touches the handle."""
    lag_s: float
    """How much later the other one does: the handle is never quite in the middle, so it is first
    pushed over the table."""
    first: Literal[0, 1]
    """Which gel touches first: 0 left, 1 right."""
    push_n: float
    """Force with which the first gel pushes the cup meanwhile: friction of the table."""
    close_mm_s: float
    """Speed of each pad."""
    settled_s: float
    """When both gels are pressed as commanded: the grasp begins."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Person:
    """Somebody who hands the cup over, or takes it."""

    start_s: float
    duration_s: float
    """In which the share that they bear changes, with minimum jerk."""
    bears_from: float
    """Share of the weight and its moment, 0…1, until `start_s`."""
    bears_to: float
    """The same in the end."""
    pull_n: tuple[float, float] = (0.0, 0.0)
    """What they pull with afterwards (x, down), newtons, at the cup's centre of mass."""
    pull_s: float = 0.0
    """When that begins."""
    pull_rise_s: float = 1.0
    """How long it takes to rise."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Hit:
    """The cup meets an obstacle."""

    at_s: float
    force_n: float
    """Peak, along x: a half sine."""
    duration_s: float
    below_mm: float
    """Where on the cup, below the pads' middle."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """All that happens around one grasp."""

    path: GripperPath = field(default_factory=GripperPath)
    approach: Approach | None = None
    """None: the grasp is made at time zero."""
    on_table: bool = False
    """The cup stands on a table until it is lifted off."""
    person: Person | None = None
    hit: Hit | None = None
    contents_g: float = 0.0
    """In the cup from the beginning; it moves with the cup, as under a lid."""
    below_mm: float = 0.0
    """Height of the pads' middle over the centre of mass."""
