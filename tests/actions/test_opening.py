"""Each kind of actuator opens by its address, and a wrong address is one plain line."""

import builtins
import math
import os
import pty
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import modbus_rig
import pytest
import serial
from hand_rig import emulated_hand
from jaka_rig import emulated_jaka

from taxel.actions.actuators import ArmActuator, GripperActuator, Health, hear_all
from taxel.actions.arm import ArmLimits, SimArm
from taxel.actions.interlock import Interlock, InterlockConfig, InterlockState, Order, OrderKind
from taxel.actions.opening import open_actuator
from taxel.actions.plain_output import CallbackOutput
from taxel.actions.sim_gripper import SimGripper
from taxel.clock import ManualClock, SystemClock
from taxel.decisions.stability import Stability, StabilityDecision
from taxel.errors import BadInput, MissingExtra


def decided(state: Stability) -> StabilityDecision:
    return StabilityDecision(state, "", 0.0, 0.5)


@pytest.mark.parametrize("address", ["pge://{port}?max_force_n=50", "hand://{port}"])
def test_a_port_is_one_programs_and_why_it_cannot_be_opened_is_in_plain_words(
    address: str, tmp_path: Path
) -> None:
    """Two programs never drive the same fingers, and nobody looks for a cable in vain."""
    inner, outer = pty.openpty()
    free = os.ttyname(outer)
    try:
        with serial.Serial(free, exclusive=True):
            _refused(address.format(port=free), "another program holds it")
    finally:
        os.close(inner)
        os.close(outer)
    _refused(address.format(port=tmp_path / "none"), "no such device")


def _refused(address: str, why: str) -> None:
    device = open_actuator(address)
    with pytest.raises(BadInput, match=rf"got a port that cannot be opened: {why}; check power"):
        device.connect()
    device.close()


def test_real_devices_open_by_address_and_are_well() -> None:
    lock = Interlock(InterlockConfig(min_n=15.0, max_n=50.0))
    clock = SystemClock()
    with (
        modbus_rig.pge_on_a_cable(device_id=3) as (cable, _),
        emulated_hand() as hand,
        emulated_jaka() as jaka,
    ):
        opened = [
            open_actuator(url, clock)
            for url in (
                f"pge://{cable.near}?id=3&max_force_n=50&force_table=20:9,50:26,100:50",
                f"hand://{hand.port}",
                f"jaka://127.0.0.1?port={jaka.port}&timeout_s=1",
                "udp://127.0.0.1:5005?max_force_n=20",
                "sim://gripper?width_mm=12&max_force_n=80",
                "sim://arm",
            )
        ]
        try:
            for device in opened:
                device.connect()
            assert hear_all(lock, opened, clock.now_s()) == {}
            assert [device.force.max_n if device.force else None for device in opened] == [
                50.0, None, None, 20.0, 80.0, None,
            ]  # fmt: skip
            assert all(isinstance(device.snapshot()["motion"], str) for device in opened)
        finally:
            for device in opened:
                device.close()


@pytest.mark.parametrize(
    ("url", "words"),
    [
        ("gripper", "starts with one of pge://, hand://, jaka://, udp://, sim://"),
        ("ftp://x", "starts with one of"),
        ("pge://", "starts with one of"),
        ("pge:///dev/ttyUSB0", "max_force_n"),
        ("pge:///dev/ttyUSB0?max_force_n=much", "max_force_n of pge:// as a number"),
        ("pge:///dev/ttyUSB0?max_force_n=50&id=300", "a Modbus id of 1 to 247"),
        ("pge:///dev/ttyUSB0?max_force_n=50&force_table=20:9,100", "percent:newtons pairs"),
        ("udp://127.0.0.1:5005?force_table=20:9,100:50", "max_force_n"),
        ("hand:///dev/ttyUSB0?contact_ma=500", "contact_ma alone"),
        ("sim://hand?contact_ma=500", "contact_ma alone"),
        ("pge:///dev/ttyUSB0?max_force_n=50&force_table=20:9,100:60", "the largest force"),
        ("pge:///dev/ttyUSB0?max_force_n=50&initialise=maybe", "as yes or no"),
        ("sim://gripper?colour=red", "options of sim://gripper among"),
        ("sim://gripper?width_mm=1&width_mm=2", "each option once"),
        ("sim://gripper?width_mm", "key=value"),
        ("sim://gripper?width_mm=nan", "a width of"),
        ("sim://foot", "sim://gripper or sim://arm or sim://hand"),
        ("sim://arm?lower_mm=500", "lower_mm of 0 to lowest_mm"),
        ("jaka://10.0.0.1?speed_mm_s=1000", "a speed of up to 250 mm/s"),
        ("jaka://10.0.0.1?speed_mm_s=20", "lower_mm, the way down, beside speed_mm_s"),
        ("sim://arm?lower_mm=0&lowest_mm=100", "lower_mm, the way down, beside lowest_mm"),
        ("udp://127.0.0.1", "udp://HOST:PORT"),
        ("udp://10.0.0.1:5005", "allow other hosts"),
        ("hand:///dev/ttyACM0?board=999", "a board of 0 to 255"),
    ],
)
def test_wrong_addresses_are_one_plain_line(url: str, words: str) -> None:
    with pytest.raises(BadInput) as error:
        open_actuator(url, ManualClock())

    assert words in str(error.value)
    assert "\n" not in str(error.value)


def test_a_missing_package_names_its_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    real = builtins.__import__

    def without(name: str, *rest: Any) -> Any:
        if name == "taxel.actions.pge_gripper":
            raise ModuleNotFoundError("No module named 'pymodbus'", name="pymodbus")
        return real(name, *rest)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(MissingExtra, match=r"taxel\[gripper\]"):
        open_actuator("pge:///dev/ttyUSB0?max_force_n=50")


class Sick:
    """An actuator in a given health that hears nothing."""

    force = None

    def __init__(self, name: str, fault: str, read_s: float) -> None:
        self.name = name
        self._health = Health(fault, read_s)

    def connect(self) -> None: ...

    def close(self) -> None: ...

    def decided(self) -> dict[str, Any]:
        return {}

    def apply(self, decision: StabilityDecision, order: Order, now_s: float) -> None: ...

    def hear(self, interlock: Interlock, now_s: float) -> Health:
        return self._health


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_one_sick_actuator_beside_a_well_one_forbids_arming(order: Sequence[int]) -> None:
    """Whichever is asked last."""
    both = [Sick("gripper", "no answer", 10.0), Sick("udp", "", math.inf)]
    lock = Interlock(InterlockConfig(min_n=0.0, max_n=1.0))
    lock.beat(10.0)

    assert hear_all(lock, [both[i] for i in order], 10.0) == {"gripper": "no answer"}
    assert lock.arm(10.0) == ("the actuator is not well",)


def test_the_oldest_reading_counts() -> None:
    lock = Interlock(InterlockConfig(min_n=0.0, max_n=1.0, device_s=0.5))
    lock.beat(10.0)
    hear_all(lock, [Sick("gripper", "", 9.4), Sick("udp", "", math.inf)], 10.0)

    assert lock.arm(10.0) == ("nothing from the actuator for 0.5 s",)


def test_the_whole_path_with_simulated_devices_raises_lowers_and_stops() -> None:
    clock = ManualClock(10.0)
    gripper = open_actuator("sim://gripper?slew_n_s=1000", clock)
    arm = ArmActuator("arm", SimArm(ArmLimits(), clock), lower_mm=20.0)
    heard: list[Any] = []
    both = [gripper, arm]
    assert isinstance(gripper, GripperActuator)
    assert isinstance(gripper.gripper, SimGripper)
    output = CallbackOutput(heard.append, clock)
    for device in both:
        device.connect()
    gripper.gripper.grip(20.0)
    clock.advance(1.0)
    lock = Interlock(InterlockConfig(min_n=10.0, max_n=40.0))

    def tick(state: Stability, n: int = 1, beat: bool = True) -> None:
        for _ in range(n):
            clock.advance(0.01)
            now = clock.now_s()
            if beat:
                lock.beat(now)
            lock.decision(state.name, now)
            hear_all(lock, both, now)
            order = lock.tick(now)
            for device in both:
                device.apply(decided(state), order, now)
            output.send(decided(state), order, now)

    tick(Stability.STABLE)
    assert lock.arm(clock.now_s()) == ()
    tick(Stability.STABLE, 5)
    assert gripper.gripper.fingers.force_n == pytest.approx(10.0, abs=0.01)
    tick(Stability.WARNING, 60)
    assert gripper.gripper.fingers.force_n == pytest.approx(40.0, abs=0.5)
    assert arm.snapshot() == {"motion": "still", "height_mm": 400.0}
    tick(Stability.UNSTABLE, 200)
    assert arm.snapshot()["height_mm"] == pytest.approx(380.0)  # once, not once a tick
    tick(Stability.STABLE, 10)
    tick(Stability.UNSTABLE, 10)
    tick(Stability.UNSTABLE, 20, beat=False)
    assert lock.state is InterlockState.STOPPED
    stopped_mm = arm.snapshot()["height_mm"]
    tick(Stability.UNSTABLE, 200, beat=False)
    assert arm.snapshot()["motion"] == "still"
    assert 360.0 < arm.snapshot()["height_mm"] <= stopped_mm
    assert gripper.gripper.fingers.force_n == pytest.approx(40.0, abs=0.5)
    assert {action.order for action in heard} == {"none", "hold", "grip", "stop"}


def test_a_stop_is_sent_to_an_arm_once_and_again_only_while_it_moves() -> None:
    clock = ManualClock()
    arm = SimArm(ArmLimits(), clock)
    stops = []
    actuator = ArmActuator("arm", arm)
    actuator.connect()
    arm.lower(100.0)
    clock.advance(0.5)
    arm.stop = lambda: stops.append(clock.now_s())  # type: ignore[method-assign]
    for _ in range(3):  # a controller that does not listen yet
        clock.advance(0.01)
        actuator.apply(decided(Stability.UNKNOWN), Order(OrderKind.STOP, 1.0, "", math.inf), 0.0)
    del arm.stop
    for _ in range(100):
        clock.advance(0.01)
        actuator.apply(decided(Stability.UNKNOWN), Order(OrderKind.STOP, 1.0, "", math.inf), 0.0)
    assert len(stops) == 3
    assert arm.status().height_mm > 370
    arm.stop = lambda: stops.append(clock.now_s())  # type: ignore[method-assign]
    actuator.apply(decided(Stability.UNKNOWN), Order(OrderKind.STOP, 1.0, "", math.inf), 0.0)
    assert len(stops) == 3


def test_an_expired_order_moves_no_arm() -> None:
    clock = ManualClock()
    arm = ArmActuator("arm", SimArm(ArmLimits(), clock), lower_mm=20.0)
    arm.connect()
    arm.apply(decided(Stability.UNSTABLE), Order(OrderKind.GRIP, 1.0, "", 0.0), 0.0)
    clock.advance(2.0)

    assert arm.snapshot()["height_mm"] == 400.0


def test_an_arm_lowers_again_where_the_next_grasp_is_unstable_from_its_beginning() -> None:
    """It had lowered the object before, and was never stable since: the next one hung in the air.

    The last words about the grasp before, which may still come, lower nothing.
    """
    clock = ManualClock(10.0)
    arm = ArmActuator("arm", SimArm(ArmLimits(), clock), lower_mm=20.0)
    arm.connect()

    def tick(state: Stability, kind: OrderKind) -> None:
        for _ in range(200):
            clock.advance(0.01)
            order = Order(kind, 40.0, "", clock.now_s() + 0.1)
            arm.apply(decided(state), order, clock.now_s())

    tick(Stability.UNSTABLE, OrderKind.GRIP)
    assert arm.snapshot()["height_mm"] == pytest.approx(380.0)
    arm.new_grasp()
    tick(Stability.UNSTABLE, OrderKind.GRIP)
    assert arm.snapshot()["height_mm"] == pytest.approx(380.0)
    tick(Stability.UNKNOWN, OrderKind.HOLD)
    tick(Stability.UNSTABLE, OrderKind.GRIP)
    assert arm.snapshot()["height_mm"] == pytest.approx(360.0)
    tick(Stability.UNKNOWN, OrderKind.HOLD)  # an image that could not be read, in the same grasp
    tick(Stability.UNSTABLE, OrderKind.GRIP)
    assert arm.snapshot()["height_mm"] == pytest.approx(360.0)
