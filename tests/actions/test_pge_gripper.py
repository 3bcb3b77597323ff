"""The PGE adapter on a real Modbus RTU server: it grips, stops, and says when the bus is broken."""

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import groupby
from pathlib import Path

import modbus_rig as rig
import pytest
from waiting import until

from taxel.actions.actuators import GripperActuator, hear_all
from taxel.actions.gripper import ForceRange, Motion
from taxel.actions.interlock import Interlock, InterlockConfig, InterlockState
from taxel.actions.pge_gripper import PgeConfig, PgeGripper
from taxel.clock import SystemClock
from taxel.decisions.stability import Stability, StabilityDecision
from taxel.errors import BadInput


@contextmanager
def gripper(port: str, **options: object) -> Iterator[PgeGripper]:
    made = _connected(PgeConfig(port=port, **options))  # type: ignore[arg-type]
    try:
        yield made
    finally:
        made.close()


def _connected(config: PgeConfig) -> PgeGripper:
    """The emulated gripper shares the machine: while that stands still it cannot answer."""
    for left in (2, 1, 0):
        made = PgeGripper(config, SystemClock())
        try:
            made.connect()
        except BadInput:
            made.close()
            if not left:
                raise
        else:
            break
    return made


def test_it_grips_raises_and_the_registers_say_so() -> None:
    with rig.pge_on_a_cable() as (cable, pge), gripper(cable.near) as hand:
        assert hand.status().ok
        hand.grip(30.0)
        until(lambda: hand.status().motion is Motion.CAUGHT)
        hand.grip(70.9)
        until(lambda: hand.latency.commands == 2)

        # A busy machine answers late, and a request without an answer is repeated.
        written = [write for write, _ in groupby(pge.writes)]
        assert written == [(0x0101, 30), (0x0103, 0), (0x0101, 70), (0x0103, 0)]
        until(lambda: hand.status().force_pct == 70.0)
        assert hand.status().position_permille == 385.0
        until(lambda: pge.fingers.force_n > 30)
        assert 0 < hand.latency.p50_s <= hand.latency.worst_s < 1.0


def test_forces_outside_the_register_are_kept_inside_and_nan_is_not_sent() -> None:
    with rig.pge_on_a_cable() as (cable, pge), gripper(cable.near) as hand:
        hand.grip(math.nan)
        hand.grip(1e6)
        until(lambda: hand.latency.commands == 1)
        hand.grip(-5.0)
        until(lambda: hand.latency.commands == 2)

        assert [value for register, value in pge.writes if register == 0x0101] == [100, 20]


def test_stop_sends_moving_fingers_to_where_they_are() -> None:
    with rig.pge_on_a_cable() as (cable, pge), gripper(cable.near, look_s=0.005) as hand:
        pge.fingers.speed_pct = 5.0
        hand.grip(50.0)
        until(lambda: 700 < hand.status().position_permille < 950)
        hand.stop()
        until(lambda: len(pge.writes) == 3)
        register, there = pge.writes[-1]

        assert register == 0x0103
        assert 650 < there < 950
        until(lambda: hand.status().motion is Motion.REACHED)


def test_stop_writes_nothing_while_an_object_is_held() -> None:
    """Fingers told to stay where they are might press less."""
    with rig.pge_on_a_cable() as (cable, pge), gripper(cable.near) as hand:
        hand.grip(50.0)
        until(lambda: hand.status().motion is Motion.CAUGHT)
        before = len(pge.writes)
        read_s = hand.status().read_s
        hand.stop()
        until(lambda: hand.status().read_s > read_s + 0.05)

        assert len(pge.writes) == before
        assert hand.status().motion is Motion.CAUGHT


def test_a_hundred_commands_at_once_end_in_the_latest_and_wait_for_nothing() -> None:
    with rig.pge_on_a_cable() as (cable, pge), gripper(cable.near) as hand:
        cable.delay_s = 0.02
        for i in range(100):
            hand.grip(20.0 + 0.5 * i)
        until(lambda: pge.writes[-2:] == [(0x0101, 69), (0x0103, 0)])

        assert len(pge.writes) < 20  # each that waited for the bus would be written: 200


def test_an_expired_grip_is_never_sent() -> None:
    with rig.pge_on_a_cable() as (cable, pge), gripper(cable.near) as hand:
        hand.grip(50.0, expires_s=time.monotonic() - 0.001)
        read_s = hand.status().read_s
        until(lambda: hand.status().read_s > read_s + 0.05)

        assert pge.writes == []


def test_a_gripper_that_is_not_initialised_is_neither_moved_nor_called_well() -> None:
    with rig.pge_on_a_cable(initialised=False) as (cable, pge), gripper(cable.near) as hand:
        hand.grip(50.0)
        read_s = hand.status().read_s
        until(lambda: hand.status().read_s > read_s + 0.05)

        assert pge.writes == []
        assert not hand.status().ok
        assert "not initialised" in hand.status().fault


def test_it_is_initialised_only_when_asked_and_only_at_the_first_connect() -> None:
    """A gripper that lost its power while it held something must not open by itself."""
    with (
        rig.pge_on_a_cable(initialised=False) as (cable, pge),
        gripper(cable.near, initialise=True, again_s=0.02) as hand,
    ):
        until(lambda: hand.status().ok)
        assert pge.writes == [(0x0100, 1)]
        cable.mute, pge.initialised = True, False
        until(lambda: bool(hand.status().fault))
        cable.mute = False
        until(lambda: "not initialised" in hand.status().fault)
        assert pge.writes == [(0x0100, 1)]


def test_an_unplugged_bus_is_a_fault_within_a_quarter_second() -> None:
    with rig.pge_on_a_cable() as (cable, pge), gripper(cable.near) as hand:
        pge.close()
        cable.pull()
        took = until(lambda: not hand.status().ok)

        assert took < 0.25
        hand.grip(50.0)  # neither waits nor raises
        hand.stop()


def test_silence_is_a_fault_and_its_end_is_noticed() -> None:
    with rig.pge_on_a_cable() as (cable, _), gripper(cable.near, again_s=0.02) as hand:
        cable.mute = True
        until(lambda: hand.status().fault == "no answer from the gripper")
        cable.mute = False
        until(lambda: hand.status().ok)


def test_exception_replies_are_a_fault_that_names_the_register() -> None:
    with rig.pge_on_a_cable() as (cable, pge), gripper(cable.near, again_s=0.02) as hand:
        pge.busy = True
        until(lambda: hand.status().fault == "the gripper refuses to read register 0x0200")
        pge.busy = False
        until(lambda: hand.status().ok)


def test_replies_later_than_the_timeout_are_never_taken_for_others() -> None:
    """Each comes 30 ms after its request was given up. What is believed afterwards is true."""
    with (
        rig.pge_on_a_cable() as (cable, pge),
        gripper(cable.near, timeout_s=0.02, again_s=0.05) as hand,
    ):
        cable.delay_s = 0.05
        until(lambda: not hand.status().ok)
        hand.grip(60.0)
        cable.delay_s = 0.0
        until(lambda: hand.status().ok and hand.status().force_pct == 60.0)
        # On a busy machine a reply may be late once more, and both are written again.
        until(lambda: pge.writes[-2:] == [(0x0101, 60), (0x0103, 0)])
        until(lambda: hand.status().motion is Motion.CAUGHT)


def test_noise_before_replies_is_survived_or_reported() -> None:
    with rig.pge_on_a_cable() as (cable, pge), gripper(cable.near, again_s=0.02) as hand:
        cable.spoil = b"\x00\xff\x13"
        asked = len(cable.heard)
        until(lambda: len(cable.heard) >= asked + 5)
        cable.spoil = b""
        until(lambda: hand.status().ok)
        hand.grip(40.0)
        until(lambda: pge.writes[-2:] == [(0x0101, 40), (0x0103, 0)])


def test_a_gripper_with_another_id_is_not_found() -> None:
    with (
        rig.pge_on_a_cable(device_id=2) as (cable, _),
        pytest.raises(BadInput, match=r"id 1 on .*no answer from the gripper"),
        gripper(cable.near),
    ):
        pass


def test_a_port_that_does_not_exist_is_one_plain_line(tmp_path: Path) -> None:
    with (
        pytest.raises(BadInput, match="cannot be opened") as error,
        gripper(str(tmp_path / "none")),
    ):
        pass
    assert "\n" not in str(error.value)


def test_a_stop_that_the_bus_could_not_take_is_sent_when_it_is_back() -> None:
    with rig.pge_on_a_cable() as (cable, pge), gripper(cable.near, again_s=0.02) as hand:
        pge.fingers.speed_pct = 10.0
        hand.grip(50.0)
        until(lambda: hand.status().position_permille < 950)
        cable.mute = True
        until(lambda: not hand.status().ok)
        hand.stop()
        hand.grip(100.0)  # must not replace the stop
        cable.mute = False
        until(lambda: len(pge.writes) == 3)

        assert pge.writes[-1][0] == 0x0103
        assert pge.writes[-1][1] > 0


@pytest.mark.parametrize(
    "bad", [{"device_id": 0}, {"timeout_s": 0.0}, {"retries": 9}, {"speed_pct": 0}]
)
def test_settings_that_make_no_sense_are_refused(bad: dict[str, float]) -> None:
    with pytest.raises(BadInput):
        PgeConfig(port="/dev/ttyUSB0", **bad)  # type: ignore[arg-type]


def test_a_raise_is_not_repeated_after_it_has_expired() -> None:
    """The first try is lost, and the quiet line that follows it outlasts the order's 0.1 s."""
    with rig.pge_on_a_cable() as (cable, _), gripper(cable.near, retries=5) as hand:
        hand.grip(30.0)
        until(lambda: hand.latency.commands == 1)
        cable.mute = True
        cable.heard.clear()
        hand.grip(90.0, time.monotonic() + 0.1)
        until(lambda: hand.status().fault != "")
        cable.mute = False
        until(lambda: hand.status().ok)
        raises = [request for request in cable.heard if request[1:6] == bytes([6, 1, 1, 0, 90])]

        assert len(raises) <= 1


def ticking(lock: Interlock, hand: PgeGripper) -> Callable[[str], InterlockState]:
    """Return one tick of a station: a word and the gripper to the interlock, its order back."""
    actuator = GripperActuator("gripper", hand, ForceRange(max_n=50.0))

    def tick(word: str) -> InterlockState:
        now = time.monotonic()
        lock.beat(now)
        lock.decision(word, now)
        hear_all(lock, [actuator], now)
        actuator.apply(StabilityDecision(Stability[word], "", now, 0.5), lock.tick(now), now)
        return lock.state

    return tick


def test_interlock_and_gripper_together_raise_on_a_warning_and_stop_with_the_bus() -> None:
    """The whole path: decision, interlock, order, registers; then the cable is pulled."""
    lock = Interlock(InterlockConfig(min_n=15.0, max_n=40.0, slew_n_s=400.0, stall_s=1.0))
    with rig.pge_on_a_cable() as (cable, pge), gripper(cable.near) as hand:
        tick = ticking(lock, hand)
        tick("STABLE")
        assert lock.arm(time.monotonic()) == ()
        until(lambda: tick("WARNING") is InterlockState.RAISED and hand.status().force_pct == 80)
        assert max(value for register, value in pge.writes if register == 0x0101) == 80
        pge.close()
        cable.pull()
        assert until(lambda: tick("WARNING") is InterlockState.STOPPED) < 0.25
        assert lock.arm(time.monotonic()) != ()


def test_the_papers_four_forces_reach_the_register_as_its_four_settings() -> None:
    """15, 25, 40 and 50 N are written as 30, 50, 80 and 100 % (the grasp paper, section 3.2)."""
    force = ForceRange(max_n=50.0)
    with rig.pge_on_a_cable() as (cable, pge), gripper(cable.near) as hand:
        for force_n in (15.0, 25.0, 40.0, 50.0):
            hand.grip(force.pct(force_n))
            until(lambda: hand.status().force_pct == round(2 * force_n))  # noqa: B023  # waits here

        written = [value for register, value in pge.writes if register == 0x0101]
        assert list(dict.fromkeys(written)) == [30, 50, 80, 100]  # a lost answer is asked for again


def test_a_raise_begins_at_the_force_that_the_gripper_was_set_to_before() -> None:
    """60 % are 30 N: the first raise must not fall back to the least force.

    Nothing may stop here because a busy machine stands still for a second.
    """
    patient = InterlockConfig(min_n=15.0, max_n=50.0, slew_n_s=100.0, stall_s=9.0, device_s=9.0)
    lock = Interlock(patient)
    with (
        rig.pge_on_a_cable(set_pct=60) as (cable, pge),
        gripper(cable.near, timeout_s=2.0, stale_s=9.0) as hand,
    ):
        tick = ticking(lock, hand)
        tick("STABLE")
        assert lock.arm(time.monotonic()) == ()
        until(lambda: tick("WARNING") is InterlockState.RAISED and hand.status().force_pct > 65)

        forces = [value for register, value in pge.writes if register == 0x0101]
        assert min(forces) >= 60
        assert forces == sorted(forces)
