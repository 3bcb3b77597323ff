"""Any robot can listen: datagrams as documented, functions whose errors stop nothing."""

import json
import math
import socket
from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st
from waiting import until

from taxel.actions.actuators import OutputActuator, hear_all
from taxel.actions.answer_output import recognised_of
from taxel.actions.interlock import (
    Interlock,
    InterlockConfig,
    InterlockState,
    Order,
    OrderKind,
)
from taxel.actions.opening import open_actuator
from taxel.actions.plain_output import Action, CallbackOutput, UdpOutput, action_of, open_udp
from taxel.clock import ManualClock
from taxel.decisions.stability import Stability, StabilityDecision
from taxel.errors import BadInput
from taxel.gel.slip_signal import Slip

WARNING = StabilityDecision(Stability.WARNING, "", 9.5, 0.75)
GRIP = Order(OrderKind.GRIP, 21.5, "the grasp is WARNING", 10.1)


def test_a_datagram_says_all_that_is_documented() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as robot:
        robot.bind(("127.0.0.1", 0))
        robot.settimeout(5)
        with UdpOutput("127.0.0.1", robot.getsockname()[1], clock=ManualClock(10.0)) as output:
            output.send(WARNING, GRIP, 10.0)
            output.send(WARNING, GRIP, 10.0)
            first, second = (json.loads(robot.recv(4096)) for _ in range(2))

    assert first.pop("expires_in_s") == pytest.approx(0.1)
    assert first == {
        "schema": "taxel-action-1",
        "sequence": 1,
        "time_s": 10.0,
        "state": "WARNING",
        "reason": "",
        "probability": 0.75,
        "score": None,
        "slip": None,
        "since_s": 9.5,
        "order": "grip",
        "order_reason": "the grasp is WARNING",
        "force_n": 21.5,
        "grasp": 1,
    }
    assert second["sequence"] == 2


def test_a_warnings_score_is_not_sent_as_a_probability() -> None:
    action = action_of(replace(WARNING, is_score=True), GRIP, 1, 10.0)

    assert (action.probability, action.score) == (None, 0.75)


ANSWER = {"target": "material", "grasp": "glass", "grasp_confidence": 0.93, "action": "glass bin",
          "label": "UNKNOWN", "confidence": math.nan, "reason": "the model gave NaN",
          "time_s": 9.9, "who": "monitor/0"}  # fmt: skip


def test_what_is_recognised_goes_out_with_its_confidence_and_its_action() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as robot:
        robot.bind(("127.0.0.1", 0))
        robot.settimeout(5)
        with UdpOutput("127.0.0.1", robot.getsockname()[1], clock=ManualClock(10.0)) as output:
            OutputActuator("udp", output).recognised(ANSWER)
            output.send(WARNING, GRIP, 10.0)
            first, second = (json.loads(robot.recv(4096)) for _ in range(2))

    assert first == {
        "schema": "taxel-answer-1",
        "sequence": 1,
        "time_s": 10.0,
        "taken_s": 9.9,
        "target": "material",
        "label": "glass",
        "confidence": 0.93,
        "action": "glass bin",
        "window_label": "UNKNOWN",
        "window_confidence": None,
        "reason": "the model gave NaN",
        "whole_trial": None,
    }
    assert (second["schema"], second["sequence"]) == ("taxel-action-1", 2)


@pytest.mark.parametrize("last", [True, False])
def test_a_verdict_on_a_camera_trial_says_whether_the_trial_is_over(last: bool) -> None:
    sent = recognised_of(ANSWER | {"last": last}, sequence=1, now_s=10.0)

    assert json.loads(sent.as_json())["whole_trial"] is last


def test_a_function_that_fails_on_an_answer_is_counted_and_stops_nothing() -> None:
    def fail(_: object) -> None:
        raise RuntimeError("no arm")

    output = CallbackOutput(fail, ManualClock(1.0))
    output.recognised(ANSWER)

    assert (output.sent, output.failed, output.last_error) == (0, 1, "RuntimeError: no arm")


def test_a_datagram_reports_the_slip_where_a_monitor_follows_it() -> None:
    slip = Slip(0.12, 0.3, 0.5, 0.01, math.inf, 0.1, True)
    action = action_of(replace(WARNING, slip=slip), GRIP, 1, 10.0)

    sent = json.loads(action.as_json())["slip"]

    assert sent["slip_mm"] == 0.12
    assert sent["slip_rate_mm_s"] == 0.3
    assert sent["slip_rate_sd_mm_s"] is None
    assert sent["slip_seen"] is True


def test_nobody_listening_or_a_closed_socket_stops_nothing() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as robot:
        robot.bind(("127.0.0.1", 0))
        port = robot.getsockname()[1]
    output = UdpOutput("127.0.0.1", port)
    for _ in range(5):  # a port that refuses makes every second call fail on Linux
        output.send(WARNING, GRIP, 10.0)
    assert output.sent + output.dropped == 5
    output.close()
    output.send(WARNING, GRIP, 10.0)
    assert output.dropped >= 1


def test_other_hosts_only_when_allowed() -> None:
    with pytest.raises(BadInput, match="allow other hosts"):
        UdpOutput("192.168.1.20", 5005)
    UdpOutput("192.168.1.20", 5005, allow_other_hosts=True).close()
    UdpOutput("::1", 5005).close()


@pytest.mark.parametrize("name", ["robot:5005", "127.0.0.1", "127.0.0.1:0", "127.0.0.1:70000", ":"])
def test_addresses_that_are_none_are_refused(name: str) -> None:
    with pytest.raises(BadInput):
        open_udp(name, False)


def test_a_function_that_raises_is_counted_and_called_again() -> None:
    heard: list[Action] = []

    def robot(action: Action) -> None:
        if len(heard) == 0 and action.sequence == 1:
            raise RuntimeError("the robot's own program is broken")
        heard.append(action)

    output = CallbackOutput(robot, ManualClock(10.0))
    for _ in range(3):
        output.send(WARNING, GRIP, 10.0)

    assert (output.sent, output.failed) == (2, 1)
    assert output.last_error == "RuntimeError: the robot's own program is broken"
    assert [action.sequence for action in heard] == [2, 3]


def test_a_stop_never_expires_and_no_order_has_no_force() -> None:
    stop = action_of(WARNING, Order(OrderKind.STOP, 20.0, "a fault", math.inf), 1, 10.0)
    none = action_of(WARNING, Order(OrderKind.NONE, math.nan, "not armed", 10.1), 1, 10.0)

    assert (stop.order, stop.expires_in_s, stop.force_n) == ("stop", None, 20.0)
    assert (none.order, none.force_n) == ("none", None)


def hold(force_n: float, now_s: float) -> Order:
    return Order(OrderKind.HOLD, force_n, "", now_s + 0.1)


def test_the_force_sent_never_falls_and_a_new_grasp_is_a_field_of_its_own() -> None:
    """What a person's new grasp did: 43.8 N, then 15 N to a hand that still held the cup."""
    heard: list[Action] = []
    clock = ManualClock(10.0)
    actuator = OutputActuator("robot", CallbackOutput(heard.append, clock))
    for force_n in (15.0, 43.8):
        actuator.apply(WARNING, hold(force_n, 10.0), 10.0)
    actuator.new_grasp()
    for force_n in (15.0, 20.0, 50.0):
        actuator.apply(WARNING, hold(force_n, 10.0), 10.0)

    assert [action.force_n for action in heard] == [15.0, 43.8, 43.8, 43.8, 50.0]
    assert [action.grasp for action in heard] == [1, 1, 2, 2, 2]


def test_an_order_that_expired_before_it_could_be_sent_is_not_sent_but_a_stop_is() -> None:
    """The process stood still between the tick and the sending: the tick's time is long ago."""
    heard: list[Action] = []
    clock = ManualClock(10.0)
    output = CallbackOutput(heard.append, clock)
    clock.advance(0.06)
    output.send(WARNING, GRIP, 10.0)
    clock.advance(1.0)
    output.send(WARNING, GRIP, 10.0)
    output.send(WARNING, Order(OrderKind.STOP, 20.0, "", math.inf), 10.0)

    assert [action.order for action in heard] == ["grip", "stop"]
    assert heard[0].expires_in_s == pytest.approx(0.04)
    assert (output.sent, output.lost) == (2, 1)


def armed() -> Interlock:
    interlock = Interlock(InterlockConfig(min_n=10.0, max_n=50.0))
    interlock.beat(10.0)
    interlock.decision("STABLE", 10.0)
    interlock.device(True, 10.0)
    assert interlock.arm(10.0) == ()
    return interlock


def test_the_robot_s_program_disarms_by_an_answer_and_nobody_else_does() -> None:
    interlock = armed()
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as robot,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other,
    ):
        robot.bind(("127.0.0.1", 0))
        robot.settimeout(5)
        output = UdpOutput("127.0.0.1", robot.getsockname()[1], clock=ManualClock(10.0))
        actuator = OutputActuator("robot", output)
        actuator.apply(WARNING, GRIP, 10.0)
        _, taxel = robot.recvfrom(4096)
        word = json.dumps({"schema": "taxel-action-1", "do": "disarm"}).encode()
        other.sendto(word, taxel)
        for nonsense in (b"", b"\xff", b"[]", b"{}", b'{"do":"disarm"}', b"[" * 500, b"x" * 9000):
            robot.sendto(nonsense, taxel)
        robot.sendto(json.dumps({"schema": "taxel-action-1", "do": "arm"}).encode(), taxel)
        until(lambda: bool(actuator.hear(interlock, 10.0)) and output.refused == 8)
        assert interlock.armed
        robot.sendto(word, taxel)
        until(lambda: bool(actuator.hear(interlock, 10.0)) and not interlock.armed)
        output.close()
        assert output.heard() == []

    assert interlock.state is InterlockState.DISARMED
    assert interlock.reason == "disarmed by the robot's program (robot)"


def test_raises_begin_anew_where_the_robot_says_how_hard_it_grips_but_not_in_doubt() -> None:
    heard: list[Action] = []
    answers: list[object] = []

    def robot(action: Action) -> object:
        heard.append(action)
        return answers.pop(0) if answers else None

    interlock = armed()
    assert interlock.release(40.0)
    actuator = OutputActuator("robot", CallbackOutput(robot, ManualClock(10.0)))
    for word, answer in (
        ("WARNING", {"do": "gripping", "force_n": 15.0}),
        ("STABLE", {"do": "gripping", "force_n": True}),
        ("STABLE", {"do": "gripping", "force_n": 15.0}),
        ("STABLE", None),
    ):
        interlock.decision(word, 10.0, 40.0)
        actuator.hear(interlock, 10.0)
        answers.append(answer)
        actuator.apply(WARNING, interlock.tick(10.0), 10.0)

    assert [action.force_n for action in heard] == [40.0, 40.0, 40.0, 15.0]


def test_a_robot_that_grips_harder_than_the_largest_force_is_not_ordered_to_loosen() -> None:
    """It was sent "grip" with the largest force while the object slipped: 40 N in place of 80."""
    heard: list[Action] = []
    answers: list[object] = [{"do": "gripping", "force_n": 80.0}]

    def robot(action: Action) -> object:
        heard.append(action)
        return answers.pop(0) if answers else None

    interlock = armed()
    actuator = OutputActuator("robot", CallbackOutput(robot, ManualClock(10.0)))
    calm, slips = "STABLE", "WARNING"
    for number, word in enumerate((calm, calm, slips, "UNSTABLE", calm, calm, slips)):
        if number == 4:
            answers.append({"do": "gripping", "force_n": 20.0})
        interlock.decision(word, 10.0, 40.0)
        actuator.hear(interlock, 10.0)
        actuator.apply(WARNING, interlock.tick(10.0), 10.0)

    assert [(action.order, action.force_n) for action in heard[1:]] == [
        ("hold", 80.0), ("hold", 80.0), ("hold", 80.0), ("hold", 80.0), ("hold", 20.0),
        ("grip", 20.0),
    ]  # fmt: skip
    assert heard[2].order_reason == "the robot grips with 80 N, and no more is ordered"


def test_what_a_robot_says_of_its_own_grip_makes_no_step_of_a_gripper_driven_here() -> None:
    """200 N/s: a tick of 10 ms raises by 2 N, whatever comes over the wire; it may still disarm."""
    clock = ManualClock(10.0)
    gripper = open_actuator("sim://gripper?max_force_n=50", clock)
    gripper.connect()
    replies: list[object] = [{"do": "gripping", "force_n": 50.0}] * 20 + ["disarm"]
    robot = OutputActuator("robot", CallbackOutput(lambda _: replies.pop(0), clock))
    every = (gripper, robot)
    interlock = Interlock(InterlockConfig(min_n=10.0, max_n=50.0))
    interlock.beat(10.0)
    hear_all(interlock, every, 10.0)
    assert interlock.arm(10.0) == ()
    forces = [interlock.force_n]
    for word in ["STABLE"] * 5 + ["UNSTABLE"] * 10:
        clock.advance(0.01)
        now_s = clock.now_s()
        interlock.beat(now_s)
        interlock.decision(word, now_s)
        hear_all(interlock, every, now_s)
        order = interlock.tick(now_s)
        forces.append(order.force_n)
        for actuator in every:
            actuator.apply(WARNING, order, now_s)
    assert max(after - before for before, after in pairwise(forces)) <= 2.0 + 1e-9
    assert forces[-1] > forces[0]


def test_a_function_disarms_by_what_it_returns() -> None:
    interlock = armed()
    actuator = OutputActuator("robot", CallbackOutput(lambda _: "disarm", ManualClock(10.0)))
    actuator.apply(WARNING, GRIP, 10.0)
    actuator.hear(interlock, 10.0)
    assert not interlock.armed


NUMBERS = st.floats(allow_nan=True, allow_infinity=True)


@given(st.sampled_from(Stability), NUMBERS, NUMBERS, st.sampled_from(OrderKind), NUMBERS, NUMBERS)
def test_whatever_the_numbers_it_is_json(
    state: Stability, since: float, p: float, kind: OrderKind, force: float, expires: float
) -> None:
    action = action_of(
        StabilityDecision(state, "", since, p), Order(kind, force, "", expires), 1, since
    )

    sent = json.loads(action.as_json())
    assert sent["state"] == ("UNKNOWN" if state is Stability.NO_GRASP else state.name)
    assert sent["probability"] == (p if math.isfinite(p) else None)
