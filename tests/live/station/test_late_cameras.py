"""The alarm that cameras deliver late, of several monitors."""

import pytest

from taxel.actions.alarm import Alarm
from taxel.actions.interlock import Interlock, InterlockConfig
from taxel.live.station.guard import Guard
from taxel.live.station.late_cameras import LateCameras


class Rig:
    def __init__(self) -> None:
        self.guard = Guard(Interlock(InterlockConfig(min_n=1.0, max_n=10.0)))
        self.events: list[str] = []
        self.late = LateCameras(self.guard, lambda _, text: self.events.append(text))

    def say(self, who: str, now_s: float, **late: float) -> None:
        self.late.hear({"who": who, "time_s": now_s, "late": late}, now_s)

    @property
    def alarm(self) -> Alarm:
        (found,) = self.guard.alarms.alarms
        return found


@pytest.fixture
def rig() -> Rig:
    return Rig()


def test_a_monitor_that_is_given_up_keeps_no_camera_late(rig: Rig):
    """Nobody could end that alarm any more."""
    rig.say("monitor 1/0", 1.0, left=0.25)
    rig.say("monitor 2/0", 1.0, right=0.1)
    rig.late.forget({"monitor 1/0", "monitor 3/0"}, 2.0)
    assert (rig.alarm.on, rig.alarm.text) == (True, "right is 100 ms late")
    rig.late.forget({"monitor 1/0", "monitor 2/0"}, 3.0)
    assert (rig.alarm.on, rig.alarm.gone_s) == (False, 3.0)


def test_a_camera_of_two_monitors_is_named_once_with_its_larger_delay(rig: Rig):
    rig.say("monitor/0", 1.0, left=0.25, right=0.031)
    rig.say("monitor/1", 1.0, left=0.251)
    assert rig.alarm.text == "left is 251 ms late, right is 31 ms late"


def test_a_terminal_hears_when_a_camera_begins_to_be_late_and_not_each_delay(rig: Rig):
    """The alarm was never printed, and the key a acknowledged it all the same."""
    for now_s, late in ((1.0, 0.25), (1.1, 0.26), (1.2, 0.0), (1.3, 0.3)):
        rig.say("monitor/0", now_s, **({"left": late} if late else {}))
    rig.say("monitor/0", 1.4, left=0.3, right=0.2)
    assert rig.events == [
        "left is 250 ms late", "left is 300 ms late", "left is 300 ms late, right is 200 ms late"
    ]  # fmt: skip
