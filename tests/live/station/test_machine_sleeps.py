"""A machine that sleeps with an armed gripper: no tick is missing, and nobody watched (0030)."""

from __future__ import annotations

import time
from types import SimpleNamespace
from typing import Any

import pytest

from taxel import clock
from taxel.actions.interlock import Interlock, InterlockConfig, InterlockState, OrderKind
from taxel.live.station import station as module
from taxel.live.station.guard import STALL, Guard
from taxel.live.station.station import Station
from taxel.live.station.wiring import StationConfig

NIGHT_S = 28_800.0


class Rig:
    """A guard whose one monitor calls the grasp stable, a turn each millisecond."""

    def __init__(self) -> None:
        self.guard = Guard(Interlock(InterlockConfig(min_n=15.0, max_n=50.0)))
        self.now_s, self.asleep_s = 100.0, 5.0
        self.guard.expect("cup", self.now_s)
        self.turn()
        self.guard.interlock.arm(self.now_s)
        assert self.turn().kind is OrderKind.HOLD

    def turn(self) -> Any:
        self.now_s += 0.001
        self.guard.wake(self.now_s)
        self.happened = self.guard.slept(self.asleep_s, self.now_s)
        self.guard.beat("cup", self.now_s)
        note = {"state": "STABLE", "reason": "", "since_s": 0.0, "p": 0.1}
        self.guard.decide("cup", note | {"decided_s": self.now_s})
        self.guard.interlock.device(True, self.now_s)
        return self.guard.tick(self.now_s)


def test_a_night_asleep_stops_and_alarms_until_a_person_arms_again() -> None:
    """Before, the same STABLE was shown as on the evening before, and the grip stayed armed."""
    rig = Rig()
    rig.asleep_s += NIGHT_S
    assert rig.turn().kind is OrderKind.STOP
    assert rig.happened == "the machine slept for 28800.0 s: nobody watched the grasp"
    (alarm,) = rig.guard.alarms.alarms
    assert (alarm.kind, alarm.level, alarm.on) == (STALL, "danger", True)
    assert rig.turn().kind is OrderKind.STOP
    assert rig.happened == ""
    (alarm,) = rig.guard.alarms.alarms
    assert not alarm.on
    assert not alarm.acknowledged
    assert rig.guard.interlock.arm(rig.now_s) == ()
    assert rig.guard.interlock.state is InterlockState.READY


@pytest.mark.parametrize("changes", [(0.01, -0.01), (-3.0, 3.0), (0.0, 0.079)])
def test_looks_at_two_clocks_that_differ_a_little_are_no_sleep(changes: tuple[float, ...]) -> None:
    """Also where the process stood still between them: then less is seen than was, once."""
    rig = Rig()
    for change_s in changes:
        rig.asleep_s += change_s
        assert rig.turn().kind is OrderKind.HOLD
        assert rig.happened == ""


def test_the_supervisor_looks_in_each_turn(monkeypatch: pytest.MonkeyPatch) -> None:
    asleep = [5.0]
    monkeypatch.setattr(module, "asleep_s", lambda: asleep[0])
    station = Station(StationConfig(sources=(), bundles=()))
    try:
        ring = SimpleNamespace(take=list, put=lambda _: None)
        station._requests = station._status_to = ring  # type: ignore[assignment]
        station._watch = SimpleNamespace(look=lambda _: None)  # type: ignore[assignment]
        station.wiring = SimpleNamespace(monitors=[], feeds=[], given_up=())  # type: ignore[assignment]
        station.tick(100.0)
        asleep[0] += 60.0
        station.tick(100.001)
    finally:
        station.close()
    assert [text for _, _, text in station.events] == [
        "the machine slept for 60.0 s: nobody watched the grasp"
    ]


@pytest.mark.parametrize(("whole_s", "awake_s", "asleep_s"), [(90.0, 60.0, 30.0), (60.0, 61.0, 0)])
def test_time_asleep_is_what_the_monotonic_clock_lacks(
    monkeypatch: pytest.MonkeyPatch, whole_s: float, awake_s: float, asleep_s: float
) -> None:
    """The clock that goes on is read first: a pause between both never looks like sleep."""
    looks: list[int] = []
    times = {time.CLOCK_BOOTTIME: whole_s, time.CLOCK_MONOTONIC: awake_s}
    monkeypatch.setattr(clock.time, "clock_gettime", lambda name: looks.append(name) or times[name])
    assert clock.asleep_s() == asleep_s
    assert looks == [time.CLOCK_BOOTTIME, time.CLOCK_MONOTONIC]
