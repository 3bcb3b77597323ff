"""An arm lowers within its limits and stops; JAKA's controller is spoken to as documented."""

import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from jaka_rig import JakaEmulator, emulated_jaka
from waiting import until

from taxel.actions.arm import ArmLimits, SimArm
from taxel.actions.jaka_arm import JakaArm, JakaConfig, JsonReplies
from taxel.clock import ManualClock, SystemClock
from taxel.errors import BadInput


def test_the_simulated_arm_lowers_by_the_way_and_never_faster_than_allowed() -> None:
    """50 mm at 50 mm/s and 200 mm/s²: a trapezoid of 1.25 s."""
    clock = ManualClock()
    arm = SimArm(ArmLimits(), clock)
    arm.connect()
    arm.lower(50.0)
    heights = [arm.status().height_mm]
    for _ in range(125):
        clock.advance(0.01)
        heights.append(arm.status().height_mm)
    assert max(a - b for a, b in pairwise(heights)) <= 0.5 + 1e-6
    assert heights[-1] == pytest.approx(350.0, abs=0.5)
    clock.advance(1.0)
    assert arm.status().height_mm == pytest.approx(350.0, abs=1e-3)
    assert not arm.status().moving


def test_a_stop_brakes_within_the_way_that_physics_asks() -> None:
    """50 mm/s against 200 mm/s²: 6.25 mm."""
    clock = ManualClock()
    arm = SimArm(ArmLimits(), clock)
    arm.connect()
    arm.lower(100.0)
    clock.advance(0.5)
    there = arm.status().height_mm
    arm.stop()
    clock.advance(1.0)

    assert there - arm.status().height_mm == pytest.approx(6.25, abs=0.2)
    assert not arm.status().moving


def test_ways_and_speeds_are_kept_within_the_limits_and_only_down() -> None:
    limits = ArmLimits(lowest_mm=30.0, speed_mm_s=20.0)
    assert limits.lowering(500.0, 1000.0) == (30.0, 20.0)
    for way, speed in ((-1.0, None), (0.0, None), (float("nan"), None), (10.0, 0.0), (10.0, -5.0)):
        with pytest.raises(BadInput, match="only lowers"):
            limits.lowering(way, speed)


@pytest.mark.parametrize("bad", [{"speed_mm_s": 251.0}, {"lowest_mm": 0.0}, {"accel_mm_s2": -1.0}])
def test_limits_beyond_a_careful_arm_are_refused(bad: dict[str, float]) -> None:
    with pytest.raises(BadInput):
        ArmLimits(**bad)


@contextmanager
def jaka(**options: Any) -> Iterator[tuple[JakaEmulator, JakaArm]]:
    options = {"look_s": 0.01, "again_s": 0.03, **options}
    with emulated_jaka() as server:
        arm = JakaArm(JakaConfig(host="127.0.0.1", port=server.port, **options), SystemClock())
        try:
            arm.connect()
            yield server, arm
        finally:
            arm.close()


def test_lowering_is_one_relative_straight_line_and_moves_the_tool() -> None:
    with jaka(limits=ArmLimits(lowest_mm=20.0, speed_mm_s=200.0)) as (server, arm):
        arm.lower(500.0)
        until(lambda: arm.status().moving)
        until(lambda: arm.status().height_mm < 380.01 and not arm.status().moving)

        (sent,) = [command for command in server.heard if command["cmdName"] == "moveL"]
        assert sent == {
            "cmdName": "moveL",
            "relFlag": 1,
            "cartPosition": [0, 0, -20.0, 0, 0, 0],
            "speed": 200.0,
            "accel": 200.0,
        }
        assert arm.status().ok


def test_an_order_to_lower_is_void_when_it_has_expired_and_sent_once_an_alarm() -> None:
    """Asked each tick, since each order lives for 0.1 s."""
    with jaka() as (server, arm):
        arm.lower(20.0, expires_s=time.monotonic() - 0.001, number=1)
        read_s = arm.status().read_s
        until(lambda: arm.status().read_s > read_s + 0.05)
        assert [c["cmdName"] for c in server.heard].count("moveL") == 0

        def lowered() -> bool:
            arm.lower(20.0, expires_s=time.monotonic() + 0.1, number=1)
            return arm.status().height_mm < 381 and not arm.status().moving

        until(lowered)
        assert [c["cmdName"] for c in server.heard].count("moveL") == 1
        arm.lower(20.0, expires_s=time.monotonic() + 0.1, number=2)
        until(lambda: [c["cmdName"] for c in server.heard].count("moveL") == 2)


def test_a_lowering_whose_answer_was_lost_is_not_sent_again() -> None:
    with jaka(timeout_s=0.05) as (server, arm):
        until(lambda: arm.status().ok)
        server.mute = True
        until_s = time.monotonic() + 60.0
        arm.lower(20.0, expires_s=until_s, number=1)
        until(lambda: not arm.status().ok)
        server.mute = False
        until(lambda: arm.status().ok)
        arm.lower(20.0, expires_s=until_s, number=1)
        read_s = arm.status().read_s
        until(lambda: arm.status().read_s > read_s + 0.05)

        assert [c["cmdName"] for c in server.heard].count("moveL") <= 1


def test_the_simulated_arm_obeys_no_expired_order_and_lowers_once_an_alarm() -> None:
    clock = ManualClock(10.0)
    arm = SimArm(ArmLimits(), clock)
    arm.connect()
    arm.lower(20.0, expires_s=10.0, number=1)
    clock.advance(2.0)
    assert arm.status().height_mm == 400.0
    for _ in range(100):
        arm.lower(20.0, expires_s=clock.now_s() + 0.1, number=1)
        clock.advance(0.05)
    assert arm.status().height_mm == pytest.approx(380.0, abs=1e-3)


def test_stop_ends_a_lowering_and_hold_ends_only_its_own() -> None:
    with jaka() as (server, arm):
        arm.hold()
        arm.lower(100.0)
        until(lambda: arm.status().height_mm < 399)
        arm.hold()
        until(lambda: server.heard[-1]["cmdName"] != "moveL" and not arm.status().moving)
        arm.stop()
        until(lambda: [c["cmdName"] for c in server.heard].count("stop_program") == 2)

        assert 300 < arm.status().height_mm < 399


def test_replies_in_pieces_and_garbage_between_them_change_nothing() -> None:
    with jaka(timeout_s=1.0) as (server, arm):
        server.piece = 3
        server.before = b'\xff}{"half": [}\r\n'
        read_s = arm.status().read_s
        until(lambda: arm.status().read_s > read_s + 0.2)
        assert arm.status().ok
        assert arm.status().height_mm == 400.0


def test_an_error_reply_is_reported_in_its_words() -> None:
    with jaka() as (server, arm):
        server.refuse["moveL"] = ("2", "call moveL failed\nsecond line")
        arm.lower(10.0)
        until(lambda: not arm.status().ok)

        assert arm.status().fault == "the arm refuses moveL: error 2 call moveL failed second line"


def test_a_refused_stop_is_sent_again_until_it_is_taken() -> None:
    with jaka() as (server, arm):
        server.refuse["stop_program"] = ("1", "busy")
        arm.stop()
        until(lambda: "the arm refuses stop_program" in arm.status().fault)
        del server.refuse["stop_program"]
        until(lambda: any(c["cmdName"] == "stop_program" for c in server.heard))
        until(lambda: arm.status().ok)


def test_silence_and_a_pushed_out_client_are_faults_that_end() -> None:
    with jaka(timeout_s=0.05) as (server, arm):
        server.mute = True
        took = until(lambda: arm.status().fault.startswith("no reply to get_"))
        assert took < 0.5
        server.mute = False
        until(lambda: arm.status().ok)
        server.hang_up()
        until(lambda: not arm.status().ok)
        until(lambda: arm.status().ok)


@pytest.mark.parametrize(
    "positions", ["none", [1, 2], [1, 2, "x", 4, 5, 6], [1, 2, 1e300, 4, 5, 6], [True] * 6]
)
def test_a_position_that_is_none_is_a_fault(positions: object) -> None:
    with jaka() as (server, arm):
        server.positions = positions
        until(lambda: arm.status().fault == "the arm's position is no list of six numbers")


def test_an_arm_that_is_not_enabled_is_neither_moved_nor_enabled() -> None:
    with jaka() as (server, arm):
        server.enabled = False
        until(lambda: not arm.status().ok)
        arm.lower(10.0)
        until(lambda: "not lowered" in arm.status().fault)

        assert {c["cmdName"] for c in server.heard} == {"get_robot_state", "get_tcp_pos"}


def test_nobody_at_the_address_is_one_plain_line() -> None:
    with emulated_jaka() as server:
        port = server.port
    arm = JakaArm(JakaConfig(host="127.0.0.1", port=port), SystemClock())
    with pytest.raises(BadInput, match="a JAKA controller at 127") as error:
        arm.connect()
    assert "\n" not in str(error.value)


OBJECTS = st.lists(
    st.dictionaries(st.text(max_size=5), st.one_of(st.integers(), st.text(max_size=8)), max_size=3),
    max_size=6,
)


@given(OBJECTS, st.integers(1, 40))
def test_objects_survive_any_cut(objects: list[dict[str, Any]], size: int) -> None:
    data = b"".join(json.dumps(message).encode() for message in objects)
    replies = JsonReplies()
    found = [r for i in range(0, len(data), size) for r in replies.feed(data[i : i + size])]

    assert found == objects
    assert replies.bad == 0


@given(st.lists(st.binary(max_size=60), max_size=20))
def test_garbage_never_raises_and_is_not_kept_for_ever(pieces: list[bytes]) -> None:
    replies = JsonReplies()
    for piece in pieces:
        for reply in replies.feed(piece):
            assert isinstance(reply, dict)
    for _ in range(3):
        replies.feed(b'{"' * 4096)
    assert len(replies._kept) <= 16_384
