"""A trial's grip: reported only once the gripper holds something with the force that was asked."""

import math
from dataclasses import replace

import pytest

from taxel.actions.actuators import GripperActuator
from taxel.actions.gripper import ForceRange, GripperStatus, Motion
from taxel.actions.guided_trials import NotHeld, set_grip
from taxel.actions.sim_gripper import FingersConfig, SimGripper
from taxel.clock import ManualClock
from taxel.errors import BadInput
from taxel.recordings.trial_plan import PlannedTrial


def trial(force: str) -> PlannedTrial:
    return PlannedTrial(number=1, labels={}, groups={"force_n": force})


class Rig:
    """A simulated gripper on a manual clock."""

    def __init__(self, **fingers: float) -> None:
        self.clock = ManualClock(5.0)
        self.gripper = SimGripper(FingersConfig(**fingers), self.clock)
        self.actuator = GripperActuator("gripper", self.gripper, ForceRange(max_n=50.0))
        self.actuator.connect()

    def grip(self, force: str) -> float:
        return set_grip(self.actuator, trial(force), self.clock)


class Bus(SimGripper):
    """A gripper whose status is what was read last, as over a bus; its cable may be cut."""

    def __init__(self, clock: ManualClock, set_pct: float = math.nan) -> None:
        super().__init__(FingersConfig(), clock)
        self.cut = self.deaf = False
        self._read = replace(super().status(), initialised=True, force_pct=set_pct)

    def grip(self, force_pct: float, expires_s: float = math.inf) -> None:
        if not (self.cut or self.deaf):
            super().grip(math.floor(force_pct + 1e-9), expires_s)

    def status(self) -> GripperStatus:
        before = self._read
        if not self.cut:
            self._read = super().status()
        return before


def connected() -> tuple[ManualClock, Bus, GripperActuator]:
    """A gripper of 50 N at most that answers."""
    clock = ManualClock(5.0)
    bus = Bus(clock)
    actuator = GripperActuator("gripper", bus, ForceRange(max_n=50.0))
    bus.connect()
    return clock, bus, actuator


@pytest.mark.parametrize("closing_s", [0.05, 0.5, 2.0])
def test_each_force_is_there_when_it_is_reported(closing_s: float):
    rig = Rig(closing_s=closing_s)
    for force in ("15", "50", "15", "40.3"):
        assert rig.grip(force) == float(force)
        assert rig.gripper.status().motion is Motion.CAUGHT
        assert rig.gripper.fingers.force_n == pytest.approx(float(force), rel=0.02)


def test_closing_on_nothing_is_refused_also_when_asked_again():
    rig = Rig(width_mm=0.0)
    for force in ("15", "15", "50"):
        with pytest.raises(NotHeld, match=r"got a gripper that closed on nothing; open the"):
            rig.grip(force)


def test_an_object_that_drops_is_refused():
    rig = Rig()
    rig.gripper.fingers.load_n = 40.0
    with pytest.raises(NotHeld, match="got a gripper that dropped it"):
        rig.grip("15")


def test_a_status_from_before_the_order_does_not_count():
    """The newest status says: open, at its place, with the very force that is asked for."""
    clock = ManualClock(5.0)
    bus = Bus(clock, set_pct=30.0)
    actuator = GripperActuator("gripper", bus, ForceRange(max_n=50.0))
    bus.connect()

    assert set_grip(actuator, trial("15.3"), clock) == 15.3
    assert bus.fingers.force_n == pytest.approx(15.0, rel=0.02)


def test_a_cable_without_answers_ends_in_one_line_after_five_seconds():
    clock, bus, actuator = connected()
    set_grip(actuator, trial("50"), clock)
    bus.cut, began_s = True, clock.now_s()

    with pytest.raises(BadInput, match=r"holds with 15 N within 5 s; got a force set to 50 N"):
        set_grip(actuator, trial("15"), clock)
    assert clock.now_s() - began_s == pytest.approx(5.0, abs=0.03)


def test_a_gripper_that_keeps_its_old_force_is_refused():
    clock, bus, actuator = connected()
    set_grip(actuator, trial("25"), clock)
    bus.deaf = True

    with pytest.raises(BadInput, match=r"holds with 50 N within 5 s; got a force set to 25 N"):
        set_grip(actuator, trial("50"), clock)
