"""The simulated hand grasps, labels and records by itself; what it records can be learned from."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from taxel.actions.actuators import HandActuator, hear_all
from taxel.actions.collecting import CURRENTS, collect_grasp
from taxel.actions.grasp_cycle import CycleConfig
from taxel.actions.hand_contract import HandStatus
from taxel.actions.hand_driver import HandDriver, HandStopped, hand_limits
from taxel.actions.hand_raise import CurrentRaise, Raising
from taxel.actions.interlock import Interlock, InterlockConfig, InterlockState
from taxel.actions.sim_hand import SimHand
from taxel.clock import ManualClock
from taxel.decisions.stability import Stability, StabilityDecision
from taxel.errors import BadInput, BadSource, RecordingFailed
from taxel.recordings.reader import read_recording
from taxel.recordings.trial_plan import PlannedTrial
from taxel.sim.teng.grasped_hand import GraspedHand, Motors
from taxel.sources.simulated.grasped_teng import GraspedTeng
from taxel.wire.messages import State

QUICK = CycleConfig(stroke_s=1.0, hold_s=0.15, presses=2, pause_s=0.1, lift_s=0.1)
BALL = PlannedTrial(number=1, labels={"shape": "sphere"}, groups={"session": "a", "object": "ball"})


class Rig:
    """A simulated hand on a manual clock, and whoever moves it."""

    def __init__(self) -> None:
        self.clock = ManualClock(5.0)
        self.plant = GraspedHand(motors=Motors(stroke_s=1.0))
        self.hand = SimHand(self.plant, self.clock)
        self.source = GraspedTeng(self.plant, self.clock, self.hand.advance)
        self.hand.on_charge = self.source.take
        actuator = HandActuator("hand", self.hand)
        self.driver = HandDriver(actuator, self.clock, hand_limits(QUICK.contact_ma))
        self.driver.arm()


def test_a_grasp_is_recorded_with_its_labels_its_touch_and_its_currents(tmp_path: Path):
    rig = Rig()
    rig.plant.present("sphere", "glass", 1)
    found = collect_grasp(rig.source, rig.driver, BALL, tmp_path, QUICK)

    recording = read_recording(tmp_path / "trial-001.mcap")
    (mark,) = recording.marks
    time_s, touched = recording.samples.fitted_s, recording.samples.values.max(axis=1) > 1.55
    assert found.touched == (1, 2, 3, 4)
    assert recording.manifest.labels == {"shape": "sphere"}
    assert recording.manifest.groups == {"session": "a", "object": "ball"}
    assert touched.sum() > 50
    assert touched[(time_s < mark.start_s) | (time_s > mark.end_s)].sum() == 0
    motors = read_recording(tmp_path / CURRENTS / "trial-001.mcap")
    assert motors.manifest.sensor.units == ("mA",) * 4
    assert 700 <= motors.samples.values.max() == found.largest_ma
    assert motors.manifest.wall_anchor_ns == recording.manifest.wall_anchor_ns


def test_a_grasp_that_goes_on_names_the_options_that_can_end_it(tmp_path: Path):
    """Here the hand would rest open for as long as a grasp may take."""
    rig = Rig()
    rig.plant.present("sphere", "glass", 1)
    with pytest.raises(BadSource, match=r"less than 60 s; got one that goes on; .*--pause-s"):
        collect_grasp(rig.source, rig.driver, BALL, tmp_path, replace(QUICK, pause_s=60.0))


def test_the_motor_is_off_within_ten_milliseconds_of_each_contact(tmp_path: Path):
    rig = Rig()
    rig.plant.present("rectangle", "plastic", 4)
    collect_grasp(rig.source, rig.driver, BALL, tmp_path, QUICK)

    assert len(rig.hand.contact_to_off_s) == 4 * QUICK.presses
    assert 0.0 < max(rig.hand.contact_to_off_s) <= 0.010


def test_a_hand_that_closes_on_nothing_records_nothing(tmp_path: Path):
    rig = Rig()
    found = collect_grasp(rig.source, rig.driver, BALL, tmp_path, QUICK)

    assert found.touched == ()
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == []


def test_a_grasp_whose_currents_cannot_be_written_is_not_recorded(tmp_path: Path):
    rig = Rig()
    rig.plant.present("sphere", "glass", 1)
    (tmp_path / CURRENTS).touch()
    with pytest.raises(RecordingFailed, match="currents for recordings; got a file where"):
        collect_grasp(rig.source, rig.driver, BALL, tmp_path, QUICK)
    assert [path.name for path in tmp_path.iterdir()] == [CURRENTS]

    (tmp_path / CURRENTS).unlink()
    collect_grasp(rig.source, rig.driver, BALL, tmp_path, QUICK)
    assert (tmp_path / "trial-001.mcap").is_file()
    assert (tmp_path / CURRENTS / "trial-001.mcap").is_file()


def test_a_stop_in_the_middle_keeps_nothing_and_moves_nothing_more(tmp_path: Path):
    """The board's stop, as of an emergency: the driver says so, and half a grasp is not kept."""
    rig = Rig()
    rig.plant.present("sphere", "glass", 1)
    calls = 0

    def stop_it() -> bool:
        nonlocal calls
        calls += 1
        if calls == 60:
            rig.hand.stop()
        return False

    with pytest.raises(HandStopped, match="a stop"):
        collect_grasp(rig.source, rig.driver, BALL, tmp_path, QUICK, stopped=stop_it)
    position = rig.plant.position.copy()
    rig.clock.advance(0.5)
    rig.hand.advance()

    assert [path for path in tmp_path.rglob("*") if path.is_file()] == []
    assert np.array_equal(position, rig.plant.position)


def test_whoever_stands_still_stops_the_fingers(tmp_path: Path):
    """The board's watchdog: 95 ms after the last word of the owner nothing moves."""
    rig = Rig()
    rig.hand.grip(0b1111, 1000, 700, 5.0)
    rig.clock.advance(0.5)

    assert rig.hand.status().state is State.STOPPED
    assert rig.plant.position.max() < 120.0


def test_the_same_session_has_the_same_gains_after_a_restart():
    first, second = GraspedHand(), GraspedHand()
    first.begin_session("monday")
    second.begin_session("tuesday")
    second.begin_session("monday")

    assert np.array_equal(first.session.gain, second.session.gain)


@pytest.mark.parametrize(
    "wrong", [{"fingers": 0}, {"presses": 0}, {"contact_ma": 0}, {"stroke_s": 0.0}, {"hold_s": 1e9}]
)
def test_a_grasp_that_makes_no_sense_is_refused(wrong: dict[str, int]):
    with pytest.raises(BadInput):
        CycleConfig(**wrong)  # type: ignore[arg-type]


def test_a_time_out_of_its_limits_is_named_with_its_value():
    with pytest.raises(BadInput, match=r"hold_s of a grasp above 0 and up to 60 s; got -1;"):
        CycleConfig(hold_s=-1.0)


class Heard:
    """A hand that writes down the contact current of each grip."""

    def __init__(self) -> None:
        self.limits: list[int] = []
        self.state = State.IDLE

    def status(self) -> HandStatus:
        return HandStatus(state=self.state)

    def arm(self) -> None:
        self.state = State.ARMED

    def grip(self, fingers: int, closed: int, contact_ma: int, lasts_s: float = 0.2) -> None:
        self.limits.append(contact_ma)


def raised(seconds: Sequence[float]) -> list[int]:
    hand = Heard()
    raising = Raising(CurrentRaise(step_ma=150, most_ma=1000, contact_ma=700))
    for now_s in seconds:
        raising.obey(hand, now_s)  # type: ignore[arg-type]
    return hand.limits


def test_a_raise_first_arms_the_board():
    """A person has armed the interlock, or no GRIP order would come."""
    assert raised([0.0]) == []
    assert raised([0.0, 0.01]) == [850]


def test_a_raise_goes_up_in_steps_and_never_beyond_its_bound():
    assert raised([-0.1, 0.0, 0.1, 0.2, 0.3, 0.45, 0.7, 60.0]) == [
        850,
        850,
        1000,
        1000,
        1000,
        1000,
        1000,
    ]


def test_a_grip_order_presses_the_hand_again_with_more_current_and_no_more_than_its_bound():
    """Through the interlock, on the simulated hand: 700 mA stop a finger, then 900, then 1,000."""
    rig = Rig()
    rig.plant.present("sphere", "glass", 1)
    raises = CurrentRaise(step_ma=200, most_ma=1000, contact_ma=700, every_s=0.3)
    actuator = HandActuator("hand", rig.hand, raises)
    lock = Interlock(InterlockConfig(min_n=0.0, max_n=1.0, over_ma=2600.0))
    limits: list[float] = []

    def ticks(word: str, count: int) -> None:
        for _ in range(count):
            now_s = rig.clock.now_s()
            lock.beat(now_s)
            lock.decision(word, now_s)
            hear_all(lock, [actuator], now_s)
            decision = StabilityDecision(Stability[word], "", now_s, 0.9)
            actuator.apply(decision, lock.tick(now_s), now_s)
            limits.append(max(map(abs, rig.hand.status().currents_ma)))
            rig.clock.advance(0.01)

    ticks("STABLE", 3)
    assert lock.arm(rig.clock.now_s()) == ()
    rig.hand.grip(0b1111, 1000, 700, 2.0)
    ticks("STABLE", 100)
    before = len(rig.hand.contact_to_off_s)
    ticks("WARNING", 100)
    after = len(rig.hand.contact_to_off_s)
    ticks("WARNING", 100)

    assert before == 4
    assert after == before + 8, "two steps, four fingers each"
    assert len(rig.hand.contact_to_off_s) == after, "at its bound it presses no more"
    assert lock.state is InterlockState.RAISED
