"""Any robot can listen: datagrams as documented, functions whose errors stop nothing."""

import json
import math
import socket

import pytest
from hypothesis import given
from hypothesis import strategies as st

from taxel.actions.interlock import Order, OrderKind
from taxel.actions.plain_output import Action, CallbackOutput, UdpOutput, action_of, open_udp
from taxel.decisions.stability import Stability, StabilityDecision
from taxel.errors import BadInput

WARNING = StabilityDecision(Stability.WARNING, "", 9.5, 0.75)
GRIP = Order(OrderKind.GRIP, 21.5, "the grasp is WARNING", 10.1)


def test_a_datagram_says_all_that_is_documented() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as robot:
        robot.bind(("127.0.0.1", 0))
        robot.settimeout(5)
        with UdpOutput("127.0.0.1", robot.getsockname()[1]) as output:
            output.tell(WARNING, GRIP, 10.0)
            output.tell(WARNING, GRIP, 10.0)
            first, second = (json.loads(robot.recv(4096)) for _ in range(2))

    assert first.pop("expires_in_s") == pytest.approx(0.1)
    assert first == {
        "schema": "taxel-action-1",
        "sequence": 1,
        "time_s": 10.0,
        "state": "WARNING",
        "reason": "",
        "probability": 0.75,
        "since_s": 9.5,
        "order": "grip",
        "order_reason": "the grasp is WARNING",
        "force_n": 21.5,
    }
    assert second["sequence"] == 2


def test_nobody_listening_or_a_closed_socket_stops_nothing() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as robot:
        robot.bind(("127.0.0.1", 0))
        port = robot.getsockname()[1]
    output = UdpOutput("127.0.0.1", port)
    for _ in range(5):  # a port that refuses makes every second call fail on Linux
        output.tell(WARNING, GRIP, 10.0)
    assert output.sent + output.dropped == 5
    output.close()
    output.tell(WARNING, GRIP, 10.0)
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

    output = CallbackOutput(robot)
    for _ in range(3):
        output.tell(WARNING, GRIP, 10.0)

    assert (output.sent, output.failed) == (2, 1)
    assert output.last_error == "RuntimeError: the robot's own program is broken"
    assert [action.sequence for action in heard] == [2, 3]


def test_a_stop_never_expires_and_no_order_has_no_force() -> None:
    stop = action_of(WARNING, Order(OrderKind.STOP, 20.0, "a fault", math.inf), 1, 10.0)
    none = action_of(WARNING, Order(OrderKind.NONE, math.nan, "not armed", 10.1), 1, 10.0)

    assert (stop.order, stop.expires_in_s, stop.force_n) == ("stop", None, 20.0)
    assert (none.order, none.force_n) == ("none", None)


NUMBERS = st.floats(allow_nan=True, allow_infinity=True)


@given(st.sampled_from(Stability), NUMBERS, NUMBERS, st.sampled_from(OrderKind), NUMBERS, NUMBERS)
def test_whatever_the_numbers_it_is_json(
    state: Stability, since: float, p: float, kind: OrderKind, force: float, expires: float
) -> None:
    action = action_of(
        StabilityDecision(state, "", since, p), Order(kind, force, "", expires), 1, since
    )

    told = json.loads(action.as_json())
    assert told["state"] == state.name
    assert told["probability"] == (p if math.isfinite(p) else None)
