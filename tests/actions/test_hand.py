"""The hand's controller on a pseudo-terminal: it arms, closes until contact, and always stops."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from hand_rig import HandEmulator, emulated_hand
from waiting import until

from taxel.actions.actuators import HandActuator, hear_all
from taxel.actions.bus_worker import Command
from taxel.actions.hand import HandController
from taxel.actions.hand_link import Grip, HandConfig, HandLink
from taxel.actions.interlock import Interlock, InterlockConfig, InterlockState
from taxel.clock import ManualClock, SystemClock
from taxel.decisions.stability import Stability, StabilityDecision
from taxel.errors import BadInput
from taxel.wire.messages import Ability, Order, State

STABLE = StabilityDecision(Stability.STABLE, "", 0.0, 0.1)


class Driven:
    """A controller whose owner lives: `until` keeps refreshing it."""

    def __init__(self, board: HandEmulator, hand: HandController) -> None:
        self.board = board
        self.hand = hand

    def until(self, true: Callable[[], bool]) -> float:
        def so() -> bool:
            self.hand.refresh()
            return true()

        return until(so, state=self.hand.status)

    def beats(self, count: int) -> None:
        """Wait until the board has heard so many more heartbeats, one each 25 ms at the most."""
        enough = self.board.beats + count
        self.until(lambda: self.board.beats >= enough)

    def armed(self) -> HandController:
        self.hand.refresh()
        self.hand.arm()
        self.until(lambda: self.hand.status().armed)
        return self.hand


@contextmanager
def rigged(**options: Any) -> Iterator[tuple[HandEmulator, Driven]]:
    """The emulated board shares the machine: while that stands still, writes take longer."""
    with emulated_hand() as board:
        config = HandConfig(port=board.port, **{"write_s": 5.0, **options})
        hand = HandController(config, SystemClock())
        try:
            hand.connect()
            yield board, Driven(board, hand)
        finally:
            hand.close()


def test_it_arms_and_closes_until_the_board_feels_contact() -> None:
    with rigged() as (board, driven):
        hand = driven.armed()
        hand.grip(0b0001, 1000, 300, lasts_s=2.0)
        driven.until(lambda: board.closed == 600.0 and board.state is State.ARMED)

        assert hand.status().ok
        assert hand.status().boot_id == 7
        assert 0 < hand.latency.p50_s < 0.5


def test_a_grip_that_is_not_refreshed_runs_out() -> None:
    with rigged() as (board, driven):
        driven.armed().grip(0b0001, 1000, 2000, lasts_s=0.05)
        driven.until(lambda: board.state is State.MOVING)
        driven.until(lambda: board.state is State.ARMED)

        assert 0 < board.closed < 600


def test_a_request_to_arm_does_not_outlive_an_owner_that_stood_still() -> None:
    """Asked for while the owner was silent: not sent, not even once the owner is back."""
    with rigged(owner_s=0.05) as (board, driven):
        driven.hand.refresh()
        silent_s = time.monotonic()
        until(lambda: time.monotonic() > silent_s + 0.06)
        driven.hand.arm()
        beats = board.beats
        until(lambda: not driven.hand._link.arm_wanted)
        driven.beats(4)

        assert board.beats > beats
        assert not driven.hand.status().armed
        assert board.state is not State.ARMED


def test_a_grip_that_waited_is_sent_with_what_is_left_of_its_life() -> None:
    """The board counts from the arrival, so that a late one would live twice as long."""
    clock = ManualClock(10.0)
    link = HandLink(HandConfig(port="none"), clock)
    sent: list[Any] = []
    link._send = sent.append  # type: ignore[method-assign]
    link.grip = Grip(1, 1000, 300, 200)
    link.do(Command("grip", expires_s=10.2))
    clock.advance(0.15)
    link.do(Command("grip", expires_s=10.2))
    clock.advance(0.05)
    link.do(Command("grip", expires_s=10.2))

    assert [message.expires_ms for message in sent] == pytest.approx([200, 50], abs=1)


def test_a_silent_owner_stops_the_hand_though_the_thread_lives() -> None:
    """Without refresh no heartbeat leaves, and the board's watchdog ends the motion."""
    with rigged() as (board, driven):
        hand = driven.armed()
        hand.grip(0b0001, 1000, 2000, lasts_s=5.0)
        driven.until(lambda: board.state is State.MOVING)
        silent_s = time.monotonic()
        until(lambda: board.state is State.STOPPED, 1.0)

        assert board.stopped_s - board.heard_beat_s >= 0.2
        assert board.stopped_s - silent_s < 0.5  # 0.1 s of the owner, 0.2 s of the board
        driven.until(lambda: hand.status().fault == "the hand has stopped by itself")


def test_a_stop_that_gets_lost_is_sent_again_until_it_is_acknowledged() -> None:
    with rigged() as (board, driven):
        hand = driven.armed()
        board.ignored[Order.STOP] = 3
        hand.stop()
        took = driven.until(lambda: board.state is State.STOPPED)

        assert took < 0.3
        driven.until(lambda: hand.status().state is State.STOPPED)
        assert board.orders.count(Order.STOP) == 1
        hand.stop()
        driven.beats(3)
        assert board.orders.count(Order.STOP) == 1  # acknowledged: nothing more to say


def test_a_stop_that_is_never_acknowledged_is_a_fault() -> None:
    with rigged() as (board, driven):
        hand = driven.armed()
        board.ignored[Order.STOP] = 10_000
        hand.stop()
        driven.until(lambda: hand.status().fault == "the hand does not acknowledge the stop")
        board.ignored.clear()
        driven.until(lambda: hand.status().ok)


def test_neither_a_grip_nor_an_arm_under_way_outlives_a_stop() -> None:
    with rigged() as (board, driven):
        board.ignored[Order.ARM] = 4
        driven.hand.refresh()
        driven.hand.arm()
        driven.until(lambda: board.ignored[Order.ARM] < 4)
        driven.hand.stop()
        driven.hand.grip(0b0001, 1000, 300)
        driven.until(lambda: board.state is State.STOPPED)
        driven.beats(4)

        assert Order.ARM not in board.orders
        assert Order.GRIP not in board.orders
        assert not driven.hand.status().armed


def test_a_reboot_while_armed_is_a_fault_until_a_person_arms_again() -> None:
    with rigged() as (board, driven):
        hand = driven.armed()
        board.reboot()
        driven.until(lambda: not hand.status().ok)
        assert hand.status().fault in ("the hand has rebooted", "the hand has stopped by itself")
        driven.armed()
        driven.until(lambda: hand.status().ok)


def test_a_board_that_falls_silent_or_is_unplugged_is_reported() -> None:
    with rigged() as (board, driven):
        board.mute = True
        assert driven.until(lambda: not driven.hand.status().ok) < 0.5
        board.mute = False
        driven.until(lambda: driven.hand.status().ok)
        board.close()
        assert driven.until(lambda: not driven.hand.status().ok) < 0.5
        driven.hand.stop()  # neither waits nor raises


def test_noise_between_frames_costs_nothing() -> None:
    with rigged() as (board, driven):
        board.noise = b"\xffgarbage\x00\x03\x01"
        hand = driven.armed()
        hand.grip(0b0001, 1000, 300, lasts_s=2.0)
        driven.until(lambda: board.closed == 600.0)


def test_a_board_without_motors_and_a_port_without_a_board_are_one_plain_line() -> None:
    with emulated_hand() as board:
        board.abilities = Ability.SENSORS
        hand = HandController(HandConfig(port=board.port), SystemClock())
        with pytest.raises(BadInput, match="the board h has no motors"):
            hand.connect()
        board.mute = True
        hand = HandController(HandConfig(port=board.port, hello_s=0.1), SystemClock())
        with pytest.raises(BadInput, match=r"no hello within 0\.1 s"):
            hand.connect()


@pytest.mark.parametrize(
    "bad", [(0, 500, 300, 0.2), (1, 1001, 300, 0.2), (1, 500, 0, 0.2), (1, 500, 300, 1e9)]
)
def test_grips_that_do_not_fit_the_wire_are_refused(bad: tuple[int, int, int, float]) -> None:
    hand = HandController(HandConfig(port="/dev/null"), SystemClock())
    with pytest.raises(BadInput):
        hand.grip(*bad)


def test_contact_that_the_board_does_not_stop_at_trips_the_interlock_and_stops_the_hand() -> None:
    """The grip names a limit that contact never reaches; the host's threshold does."""
    limits = InterlockConfig(
        min_n=0.0, max_n=1.0, contact_ma=300.0, contact_s=0.03, stall_s=1.0, current_s=1.0
    )
    lock = Interlock(limits)
    with rigged() as (board, driven):
        hand = driven.armed()
        actuator = HandActuator("hand", hand)

        def tick() -> bool:
            now = time.monotonic()
            lock.beat(now)
            lock.decision("STABLE", now)
            assert hear_all(lock, [actuator], now) == {}
            actuator.apply(STABLE, lock.tick(now), now)
            return lock.state is InterlockState.STOPPED

        driven.until(lambda: not tick() and lock.arm(time.monotonic()) == ())
        hand.grip(0b0001, 1000, 2000, lasts_s=5.0)
        driven.until(tick)
        assert lock.reason == "contact: 400 mA for 0.03 s"
        driven.until(lambda: tick() and board.state is State.STOPPED)
        driven.until(lambda: tick() and lock.arm(time.monotonic()) == ())
