"""Open pads and motors that belong together: a real hand's two addresses, or a simulated one.

    serial:///dev/teng-a,/dev/teng-b,/dev/teng-c     hand:///dev/teng-hand
    sim://teng?seed=3                                sim://hand?stroke_s=1.5&speed=max

Of a simulated pair the pads feel what the fingers do; the plan says what lies between them.
Nothing moves by opening. Knows nothing about grasps or files.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from taxel.actions.actuators import HandActuator
from taxel.actions.opening import open_actuator
from taxel.clock import Clock, ManualClock, SystemClock
from taxel.errors import BadInput
from taxel.recordings.trial_plan import PlannedTrial
from taxel.sources.contract import Source
from taxel.sources.opening import open_source

SIMULATED = "sim://hand"
_PADS = "sim://teng"
_AT_ONCE = "speed=max"
LIVE_SESSION = "live"


@dataclass(frozen=True, slots=True)
class Grasping:
    """Pads and motors, open."""

    source: Source
    actuator: HandActuator
    clock: Clock
    place: Callable[[PlannedTrial], None] | None
    """Puts a trial's object into the simulated hand; None where a person does so."""


def open_hand(url: str) -> tuple[HandActuator, Clock]:
    """Return a hand by its address, not connected yet, and the clock that it lives on.

    Raises:
        BadInput: The address is wrong, or is that of something else.
        MissingExtra: It needs a package that is not installed.
    """
    at_once = url.startswith(SIMULATED) and _AT_ONCE in url
    clock: Clock = ManualClock() if at_once else SystemClock()
    actuator = open_actuator(url, clock)
    if not isinstance(actuator, HandActuator):
        raise BadInput("a hand with motors, hand://PORT or sim://hand", repr(url), "name one")
    return actuator, clock


def open_grasping(source_url: str, hand_url: str) -> Grasping:
    """Return pads and motors; the hand is not connected yet.

    Args:
        source_url: The pads.
        hand_url: The motors.

    Raises:
        BadInput: An address is wrong, or only one of the two is simulated.
        MissingExtra: One of them needs a package that is not installed.
    """
    actuator, clock = open_hand(hand_url)
    simulated = hand_url.startswith(SIMULATED)
    if source_url.startswith("sim://") != simulated or (
        simulated and source_url.partition("?")[0] != _PADS
    ):
        raise BadInput(
            f"pads and motors of one hand: {_PADS} with {SIMULATED}, or both real",
            f"{source_url} with {hand_url}",
            "name the other one too",
        )
    if simulated:
        return _simulated(source_url, actuator, clock)
    return Grasping(open_source(source_url, clock), actuator, clock, None)


def _simulated(url: str, actuator: HandActuator, clock: Clock) -> Grasping:
    """Return a simulated pair; only here is the simulator imported, which a real hand can lack."""
    from taxel.actions.sim_hand import SimHand
    from taxel.sim.teng.constants import MATERIALS, SHAPES
    from taxel.sim.teng.grasped_hand import GraspedHand
    from taxel.sources.simulated.grasped_teng import GraspedTeng
    from taxel.sources.simulated.teng_options import parse_options

    hand = actuator.hand
    assert isinstance(hand, SimHand)
    words = [part.partition("=") for part in url.partition("?")[2].split("&") if part]
    config, _ = parse_options({key: value for key, _, value in words})
    plant = hand.plant = GraspedHand(config, hand.plant.motors)
    source = GraspedTeng(plant, clock, hand.advance)
    hand.on_charge = source.take

    def place(trial: PlannedTrial) -> None:
        """Put a trial's object between the open fingers."""
        shape, material = (trial.labels.get(name, "") for name in ("shape", "material"))
        if shape not in SHAPES or material not in MATERIALS:
            raise BadInput(
                f"label:shape of {', '.join(SHAPES)} and label:material of {', '.join(MATERIALS)}",
                f"{shape or 'none'} and {material or 'none'} for the simulated hand",
                "mend the plan",
            )
        plant.begin_session(trial.groups.get("session", LIVE_SESSION))
        plant.present(shape, material, trial.number)

    return Grasping(source, actuator, clock, place)
