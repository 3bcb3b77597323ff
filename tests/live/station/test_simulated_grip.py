"""A simulated cup's gripper: what is sent to its process, and which orders that process obeys."""

from __future__ import annotations

import math
from typing import Any

import pytest
from station_rig import Idle

from taxel.actions.actuators import OutputActuator
from taxel.actions.gripper import ForceRange
from taxel.actions.interlock import Interlock, InterlockConfig, InterlockState, Order, OrderKind
from taxel.actions.plain_output import CallbackOutput
from taxel.clock import ManualClock
from taxel.decisions.stability import Stability, StabilityDecision
from taxel.live.station import acquisition
from taxel.live.station.acting import SimulatedGrip
from taxel.live.station.driving import Driving
from taxel.live.station.guard import Guard
from taxel.live.station.packets import pack
from taxel.live.station.ring import Ring, RingReader, RingWriter

FORCE = ForceRange(max_n=50.0)
STABLE = StabilityDecision(Stability.STABLE, "", 0.0, 0.1)


def order(force_n: float, expires_s: float, kind: OrderKind = OrderKind.GRIP) -> Order:
    return Order(kind, force_n, "", expires_s)


class Rig:
    """A simulated gripper whose sent forces are kept."""

    def __init__(self) -> None:
        self.clock = ManualClock()
        self.sent: list[tuple[float, float]] = []
        self.grip = SimulatedGrip(lambda n, s: self.sent.append((n, s)), FORCE, self.clock)

    def apply(self, snapshot: Order, now_s: float = 0.0) -> None:
        self.grip.apply(STABLE, snapshot, now_s)


def test_a_higher_force_is_sent_at_once_and_a_lower_one_never():
    rig = Rig()
    for force_n in (20.0, 30.0, 25.0, 15.0):
        rig.apply(order(force_n, expires_s=0.1))
    assert rig.sent == [(20.0, 0.1), (30.0, 0.1)]
    assert rig.grip.snapshot() == {"motion": "simulated", "force_n": 30.0}


def test_the_same_force_is_sent_again_only_before_the_last_order_expires():
    rig = Rig()
    for ms in range(0, 121, 10):
        rig.apply(order(20.0, expires_s=ms / 1000 + 0.1), ms / 1000)
    assert rig.sent == [(20.0, 0.1), (20.0, pytest.approx(0.15)), (20.0, pytest.approx(0.2))]


@pytest.mark.parametrize("kind", [OrderKind.NONE, OrderKind.HOLD, OrderKind.STOP])
def test_an_order_that_is_no_raise_sends_nothing(kind: OrderKind):
    rig = Rig()
    rig.apply(order(30.0, expires_s=1.0, kind=kind))
    assert rig.sent == []
    assert rig.grip.snapshot() == {"motion": "simulated", "force_n": None}


def test_an_order_that_expired_between_its_tick_and_now_is_not_sent():
    rig = Rig()
    rig.clock.advance(0.2)
    rig.apply(order(30.0, expires_s=0.1), now_s=0.0)
    assert rig.sent == []


def test_at_a_new_grasp_a_force_below_the_last_grasps_is_sent():
    rig = Rig()
    rig.apply(order(40.0, expires_s=0.1))
    rig.grip.new_grasp()
    assert rig.grip.snapshot()["force_n"] is None
    rig.apply(order(20.0, expires_s=0.1))
    assert [n for n, _ in rig.sent] == [40.0, 20.0]


def test_the_simulated_gripper_is_always_well():
    rig = Rig()
    health = rig.grip.hear(Interlock(InterlockConfig(min_n=15.0, max_n=50.0)), 3.0)
    assert (health.fault, health.read_s) == ("", 3.0)


class Cup:
    """A source whose gripper can be told what to do."""

    def __init__(self) -> None:
        self.forces_n: list[float] = []

    def grip(self, force_n: float) -> None:
        self.forces_n.append(force_n)


class Array:
    """A source without a gripper."""


def obeyed(source: object, *orders: dict[str, Any], now_s: float) -> None:
    with Ring(4096) as ring, RingReader(ring.name) as reader, RingWriter(ring.name) as writer:
        for snapshot in orders:
            writer.put(pack(snapshot))
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(acquisition, "monotonic", lambda: now_s)
            acquisition._obey(source, reader)  # type: ignore[arg-type]  # what it uses of one


def test_the_source_obeys_the_newest_order_and_none_that_has_expired():
    cup = Cup()
    first, newest = {"grip_n": 20.0, "expires_s": 9.0}, {"grip_n": 30.0, "expires_s": 5.0}
    obeyed(cup, first, newest, now_s=4.9)
    obeyed(cup, newest, now_s=5.0)
    assert cup.forces_n == [30.0]


def test_a_source_obeys_no_note_without_a_force_and_needs_a_gripper():
    cup = Cup()
    obeyed(cup, {"do": "new grasp"}, now_s=0.0)
    obeyed(cup, now_s=0.0)
    obeyed(Array(), {"grip_n": 20.0, "expires_s": 9.0}, now_s=0.0)
    assert cup.forces_n == []


class Grasping:
    """A guard over one monitor, and the simulated gripper; a millisecond a turn."""

    def __init__(self) -> None:
        self.clock = ManualClock()
        self.guard = Guard(Interlock(InterlockConfig(min_n=15.0, max_n=50.0)))
        self.driving = Driving(self.guard, 15.0)
        self.sent_n: list[float] = []
        send = lambda n, _: self.sent_n.append(n)  # noqa: E731  # one line, used once
        self.driving.add(SimulatedGrip(send, FORCE, self.clock, {"monitor"}))
        self.guard.expect("monitor", self.clock.now_s())

    def run(self, state: str, seconds: float) -> None:
        for _ in range(round(seconds * 1000)):
            self.clock.advance(0.001)
            now_s = self.clock.now_s()
            self.guard.beat("monitor", now_s)
            self.guard.decide("monitor", {"state": state, "p": 0.1, "decided_s": now_s})
            self.guard.wake(now_s)
            self.driving.tick(now_s)

    def begin(self) -> None:
        self.run("STABLE", 0.2)
        assert self.guard.interlock.arm(self.clock.now_s()) == ()
        self.run("WARNING", 0.2)


def test_a_calm_new_grasp_begins_with_the_least_force_and_only_once():
    rig = Grasping()
    rig.begin()
    assert rig.guard.interlock.force_n == 50.0
    rig.driving.new_grasp()
    rig.run("STABLE", 1.0)
    assert rig.guard.interlock.force_n == 15.0
    rig.run("WARNING", 0.05)
    assert rig.guard.interlock.force_n > 15.0
    rig.run("STABLE", 1.0)
    assert rig.guard.interlock.force_n > 15.0


def test_a_new_grasp_of_another_cup_lowers_nothing_of_this_one():
    """The gripper holds the first cup only: it was sent 17 N after 50, and loosened it."""
    rig = Grasping()
    rig.begin()
    rig.driving.new_grasp("monitor of another cup")
    rig.run("STABLE", 1.0)
    rig.run("WARNING", 0.1)
    assert rig.guard.interlock.force_n == 50.0
    assert sorted(rig.sent_n) == rig.sent_n
    rig.driving.new_grasp("monitor")
    rig.run("STABLE", 1.0)
    assert rig.guard.interlock.force_n == 15.0


def test_a_new_grasp_that_slips_at_once_keeps_the_force():
    """A raise in it ends the release that was asked for: it never loosens what just slipped."""
    rig = Grasping()
    rig.begin()
    rig.driving.new_grasp()
    rig.run("WARNING", 0.1)
    rig.run("STABLE", 1.0)
    assert rig.guard.interlock.force_n == 50.0


class Robot(Idle):
    """Another robot's program, which wants to know what is in the hand."""

    def __init__(self) -> None:
        super().__init__()
        self.heard: list[dict[str, Any]] = []

    def recognised(self, answer: dict[str, Any]) -> None:
        self.heard.append(answer)


def test_an_answer_reaches_each_actuator_that_takes_answers_and_no_other():
    guard = Guard(Interlock(InterlockConfig(min_n=15.0, max_n=50.0)))
    driving, robots = Driving(guard, 15.0), (Robot(), Robot())
    for actuator in (robots[0], Idle(), robots[1]):
        driving.add(actuator)
    driving.recognised({"grasp": "ball"})
    assert [robot.heard for robot in robots] == [[{"grasp": "ball"}]] * 2


def test_at_a_new_grasp_a_gripper_that_is_not_simulated_keeps_its_force():
    """Only of the simulated cup is it known that nobody holds anything then."""
    rig = Grasping()
    rig.driving = Driving(rig.guard, 15.0)
    rig.driving.add(Idle())
    rig.begin()
    rig.driving.new_grasp()
    rig.run("STABLE", 1.0)
    assert rig.guard.interlock.force_n == 50.0


def test_what_an_actuator_reports_is_alarmed_once_and_over_when_it_is_well_again():
    class Faulty(SimulatedGrip):
        fault = ""

        def hear(self, interlock: Interlock, now_s: float) -> Any:
            health = super().hear(interlock, now_s)
            return type(health)(self.fault, now_s)

    rig = Grasping()
    grip = Faulty(lambda *_: None, FORCE, rig.clock)
    reported: list[str] = []
    rig.driving = Driving(rig.guard, 15.0, lambda _, text: reported.append(text))
    rig.driving.add(grip)
    rig.run("STABLE", 0.1)
    assert rig.guard.alarms.alarms == ()
    grip.fault = "its cable is out"
    rig.run("STABLE", 0.1)
    (alarm,) = [a for a in rig.guard.alarms.alarms if a.kind == grip.name]
    assert (alarm.on, alarm.text) == (True, f"{grip.name}: its cable is out")
    snapshot = rig.driving.snapshot()
    assert snapshot is not None
    assert snapshot["note"] == "its cable is out"
    grip.fault = "its cable has been out for 0.2 s"
    rig.run("STABLE", 0.1)
    assert reported == [f"{grip.name}: its cable is out"]  # a terminal shows no alarms by itself
    grip.fault = ""
    rig.run("STABLE", 0.1)
    (alarm,) = [a for a in rig.guard.alarms.alarms if a.kind == grip.name]
    assert not alarm.on
    assert rig.guard.interlock.state is not InterlockState.HOLDING


def test_without_an_actuator_the_page_shows_no_gripper():
    guard = Guard(Interlock(InterlockConfig(min_n=15.0, max_n=50.0)))
    assert Driving(guard, 15.0).snapshot() is None
    assert math.isnan(guard.probability)


def test_lost_messages_of_an_output_are_reported_once_and_counted() -> None:
    """A robot's program that was not there got nothing, and nobody heard of it."""
    reported: list[tuple[float, str]] = []
    guard = Guard(Interlock(InterlockConfig(min_n=15.0, max_n=50.0)))
    driving = Driving(guard, 15.0, lambda *words: reported.append(words))
    answers = iter([None, OSError("away"), OSError("away")])

    def call(_: object) -> None:
        if (error := next(answers)) is not None:
            raise error

    driving.add(OutputActuator("robot", CallbackOutput(call, ManualClock())))
    for number in range(3):
        driving.tick(number / 100)
    text = "robot: a message was lost; the summary at the end counts them"
    assert reported == [(0.01, text)]
    assert driving.counts() == {"robot": {"sent": 1, "lost": 2}}
