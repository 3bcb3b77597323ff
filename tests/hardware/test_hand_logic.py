"""When the hand's motors may run: the board's half of the interlock, in plain C on the host."""

from __future__ import annotations

import random
from dataclasses import dataclass
from typing import Any

import pytest

from taxel.actions.interlock import Interlock, InterlockConfig
from taxel.wire.messages import Order, Result, State

LIMIT_MA = 700


@dataclass
class Hand:
    """The logic with a time of its own: every millisecond all sensors are read, then a tick."""

    program: Any
    motors: int = 4
    sensors: int = 4
    now_ms: int = 0
    seq: int = 0
    beating: bool = True

    def __post_init__(self) -> None:
        self.ma = [0] * self.sensors
        self.good = [True] * self.sensors
        self.on: list[int] = []
        self.at_ms: list[int] = []
        self.state = State.IDLE
        self.ran_out = 0
        self.program.ask(f"start {self.motors} {self.sensors}")

    def _take(self, answer: str) -> int:
        result, state, *motors = map(int, answer.split())
        self.state, self.on, self.at_ms = State(state), motors[0::2], motors[1::2]
        return result

    def run(self, ms: int) -> None:
        for _ in range(ms):
            self.now_ms += 1
            if self.beating and self.now_ms % 40 == 0:
                self.beat()
            readings = " ".join(
                f"{int(good)} {ma}" for good, ma in zip(self.good, self.ma, strict=True)
            )
            self.ran_out += self._take(self.program.ask(f"ms {self.wrapped} {readings}"))

    @property
    def wrapped(self) -> int:
        return self.now_ms % 2**32

    def beat(self) -> None:
        self._take(self.program.ask(f"beat {self.wrapped}"))

    def do(self, order: int, expires_ms: int = 0, a: int = 0, b: int = 0, c: int = 0) -> Result:
        self.seq += 1
        line = f"do {self.wrapped} {self.seq} {order} {expires_ms} {a} {b} {c}"
        return Result(self._take(self.program.ask(line)))

    def grip(self, fingers: int = 15, closed: int = 1000, lasts_ms: int = 5000) -> Result:
        return self.do(Order.GRIP, lasts_ms, fingers, closed, LIMIT_MA)

    def ready(self) -> Hand:
        self.beat()
        self.run(50)
        assert self.do(Order.ARM) == Result.DONE
        return self

    def closing(self, ms: int = 100) -> Hand:
        self.ready()
        assert self.grip() == Result.DONE
        self.run(ms)
        assert self.on == [1] * self.motors
        return self


def test_nothing_moves_before_a_person_armed_the_hand(hand: Any):
    it = Hand(hand)
    it.run(50)
    assert it.grip() == Result.NOT_ARMED
    it.run(10)
    assert (it.state, it.on) == (State.IDLE, [0, 0, 0, 0])


def test_arming_needs_a_host_that_was_heard_and_sensors_that_were_read(hand: Any):
    it = Hand(hand, beating=False)
    it.run(50)
    assert it.do(Order.ARM) == Result.NOT_ARMED  # no heartbeat yet
    it = Hand(hand)
    it.good[2] = False
    it.beat()
    it.run(50)
    assert it.do(Order.ARM) == Result.NOT_ARMED
    it.good[2] = True
    it.run(11)
    assert it.do(Order.ARM) == Result.DONE
    assert it.do(Order.ARM) == Result.DONE  # again: nothing changes


def test_a_grip_closes_the_fingers_it_names_as_far_as_it_says(hand: Any):
    it = Hand(hand).ready()
    it.grip(0b0101, closed=200)
    it.run(100)
    assert (it.state, it.on) == (State.MOVING, [1, 0, 1, 0])
    it.run(200)
    assert (it.state, it.on, it.at_ms) == (State.ARMED, [0, 0, 0, 0], [200, 0, 200, 0])


@pytest.mark.parametrize(
    ("expires_ms", "a", "b", "c"),
    [(0, 1, 500, 700), (100, 0, 500, 700), (100, 16, 500, 700), (100, 1, 1001, 700),
     (100, 1, 500, 0), (100, 1, 500, 32768)],
)  # fmt: skip
def test_a_grip_with_an_argument_out_of_its_limits_is_refused(
    hand: Any, expires_ms: int, a: int, b: int, c: int
):
    it = Hand(hand).ready()
    assert it.do(Order.GRIP, expires_ms, a, b, c) == Result.BAD_ARGUMENT
    it.run(5)
    assert it.on == [0, 0, 0, 0]


def test_contact_stops_that_finger_after_three_readings_and_no_other(hand: Any):
    it = Hand(hand).closing()
    it.ma[1] = LIMIT_MA
    it.run(2)
    assert it.on == [1, 1, 1, 1]
    it.run(1)
    assert (it.state, it.on) == (State.MOVING, [1, 0, 1, 1])


def test_two_readings_of_noise_are_no_contact(hand: Any):
    it = Hand(hand).closing()
    for _ in range(20):
        it.ma[1] = LIMIT_MA + 500
        it.run(2)
        it.ma[1] = LIMIT_MA - 1
        it.run(1)
    assert it.on == [1, 1, 1, 1]


def test_a_finger_in_contact_closes_no_further_when_the_same_grip_is_refreshed(hand: Any):
    it = Hand(hand).closing()
    it.ma[0] = LIMIT_MA
    it.run(3)
    it.ma[0] = 0
    for _ in range(10):
        it.grip()
        it.run(20)
        assert it.on[0] == 0
    assert it.do(Order.GRIP, 500, 1, 1000, LIMIT_MA + 100) == Result.DONE  # harder
    it.run(2)
    assert it.on[0] == 1


def test_a_finger_in_contact_may_open(hand: Any):
    it = Hand(hand).closing(400)
    it.ma[0] = LIMIT_MA
    it.run(3)
    it.ma[0] = 0
    it.run(60)
    it.grip(closed=100)
    it.run(60)
    assert it.on[0] == -1


def test_a_motors_start_up_peak_is_no_contact_and_its_over_current_is(hand: Any):
    it = Hand(hand).ready()
    it.grip()
    it.ma = [2000] * 4
    it.run(70)
    assert it.on == [1] * 4
    it.ma[3] = 2500
    it.run(2)
    assert (it.state, it.on) == (State.FAULT, [0] * 4)


def test_one_sensor_for_all_motors_stops_all_that_move(hand: Any):
    it = Hand(hand, sensors=1).closing()
    it.ma[0] = LIMIT_MA
    it.run(3)
    assert it.on == [0] * 4


def test_a_silent_host_stops_the_hand_within_a_tenth_of_a_second_until_it_is_armed_again(hand: Any):
    it = Hand(hand).closing()
    it.beat()
    it.beating = False
    it.run(95)
    assert it.on == [1] * 4
    it.run(2)
    assert (it.state, it.on) == (State.STOPPED, [0] * 4)
    it.beating = True
    it.run(200)
    assert it.state == State.STOPPED
    assert it.grip() == Result.NOT_ARMED
    assert it.do(Order.ARM) == Result.DONE


def test_a_sensor_that_fails_twice_stops_the_hand_and_forbids_arming_while_it_fails(hand: Any):
    it = Hand(hand).closing()
    it.good[2] = False
    it.run(1)
    assert it.on == [1] * 4  # one error may be noise
    it.run(1)
    assert (it.state, it.on) == (State.FAULT, [0] * 4)
    assert it.do(Order.ARM) == Result.NOT_ARMED
    assert it.do(Order.STOP) == Result.DONE
    assert it.state == State.FAULT  # a stop does not mend it
    it.good[2] = True
    it.run(9)
    assert it.do(Order.ARM) == Result.NOT_ARMED
    it.run(1)
    assert it.state == State.FAULT  # stays until a person acts
    assert it.do(Order.ARM) == Result.DONE


def test_a_grip_runs_out_and_is_acknowledged_once_more_and_the_hand_stays_armed(hand: Any):
    it = Hand(hand).ready()
    it.grip(lasts_ms=100)
    it.run(99)
    assert (it.ran_out, it.on) == (0, [1] * 4)
    it.run(1)
    assert (it.ran_out, it.state, it.on) == (1, State.ARMED, [0] * 4)
    it.run(100)
    assert it.ran_out == 1


def test_a_grip_that_is_refreshed_does_not_run_out(hand: Any):
    it = Hand(hand).ready()
    for _ in range(8):
        it.grip(lasts_ms=100)
        it.run(90)
    assert (it.ran_out, it.on) == (0, [1] * 4)


def test_stop_stops_at_once_and_is_never_old(hand: Any):
    it = Hand(hand).closing()
    it.seq = 0  # a host that was started again
    assert it.do(Order.STOP) == Result.DONE
    assert (it.state, it.on) == (State.STOPPED, [0] * 4)
    assert it.do(Order.ARM) == Result.OLD
    assert it.do(Order.IDENTIFY) == Result.DONE
    assert it.do(Order.ARM) == Result.DONE


def test_a_motor_rests_between_two_directions(hand: Any):
    it = Hand(hand).closing(300)
    it.grip(closed=100)
    seen = []
    for _ in range(80):
        it.run(1)
        seen.append(it.on[0])
    assert seen.count(0) >= 50
    assert seen[-1] == -1
    assert seen == sorted(seen, reverse=True)  # never straight from closing to opening


def test_the_first_opening_after_boot_takes_the_whole_way(hand: Any):
    """Nobody knows where the fingers stood."""
    it = Hand(hand).ready()
    it.grip(closed=0, lasts_ms=5000)
    it.run(1100)
    assert it.on == [-1] * 4
    it.run(200)
    assert (it.on, it.at_ms) == ([0] * 4, [0] * 4)
    it.grip(closed=0)
    it.run(60)
    assert it.on == [0] * 4  # and only the first


def test_times_may_wrap(hand: Any):
    it = Hand(hand)
    it.now_ms = 2**32 - 400
    it.ready()
    it.grip()
    it.run(500)
    assert (it.wrapped < 200, it.on) == (True, [1] * 4)
    it.beat()
    it.beating = False
    it.run(97)
    assert (it.state, it.on) == (State.STOPPED, [0] * 4)


@pytest.mark.parametrize("seed", range(4))
def test_board_and_interlock_agree_about_what_stops_and_when_arming_is_allowed(
    hand: Any, seed: int
):
    """The same troubles to both: what stops the host's interlock has the motors off 3 ms later."""
    chance = random.Random(seed)
    limits = InterlockConfig(min_n=1.0, max_n=2.0, watchdog_s=0.095, over_ma=2500.0)
    interlock, it = Interlock(limits), Hand(hand)
    stopped_ms = moving_ms = refused = 0
    for trouble in chance.choices(("none", "none", "silent", "over", "lost"), k=14):
        who = chance.randrange(4)
        it.beating = trouble != "silent"
        it.ma = [3000 if trouble == "over" and s == who else 300 for s in range(4)]
        it.good = [not (trouble == "lost" and s == who) for s in range(4)]
        for _ in range(chance.randrange(120, 200)):
            it.run(1)
            now_s = it.now_ms / 1000.0
            if it.beating and it.now_ms % 40 == 0:
                interlock.beat(now_s)
            interlock.device(True, now_s)
            interlock.contact_current(float(max(it.ma)), now_s)
            interlock.fault_gone("i2c") if all(it.good) else interlock.fault("i2c", now_s)
            interlock.tick(now_s)
            stopped_ms = 0 if interlock.armed else stopped_ms + 1
            moving_ms += any(it.on)
            assert stopped_ms <= 3 or not any(it.on), interlock.reason
            assert not any(it.on) or it.state == State.MOVING
        causes, result = interlock.arm(it.now_ms / 1000.0), it.do(Order.ARM)
        refused += bool(causes)
        assert (result == Result.DONE) == (not causes)
        assert (it.state in (State.ARMED, State.MOVING)) == interlock.armed
        if not causes:
            stopped_ms = 0
            assert it.grip(closed=chance.choice((0, 1000))) == Result.DONE
    assert moving_ms > 100
    assert refused
