"""A robot's answer is heard whoever else sends, and a receiver that is away holds nothing up."""

import errno
import ipaddress
import json
import socket

import pytest

from taxel.actions.plain_output import Disarm, UdpOutput
from taxel.actions.udp_line import UdpLine

LOOPBACK = ipaddress.ip_address("127.0.0.1")
DISARM = json.dumps({"schema": "taxel-action-1", "do": "disarm"}).encode()


def udp() -> socket.socket:
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.bind(("127.0.0.1", 0))
    made.settimeout(5)
    return made


def place(line: UdpLine) -> tuple[str, int]:
    return line._socket.getsockname()


def test_a_robots_disarm_is_heard_whatever_others_send_to_the_same_port() -> None:
    """20,000 datagrams are more than a socket keeps: before, the robot's own had no room."""
    with udp() as robot, udp() as other:
        output = UdpOutput("127.0.0.1", robot.getsockname()[1])
        for _ in range(20_000):
            other.sendto(b"x", place(output._line))
        robot.sendto(DISARM, place(output._line))

        assert output.heard() == [Disarm()]
        assert output.refused == 0
        output.close()


def test_nobody_on_another_machine_reaches_a_line_to_a_robot_on_this_one() -> None:
    for address, own in (("127.0.0.1", "127.0.0.1"), ("::1", "::1"), ("::ffff:127.0.0.1", "")):
        line = UdpLine(ipaddress.ip_address(address), 5005)
        assert place(line)[0] == (own or "127.0.0.1")
        line.close()


def test_a_robot_that_starts_late_gets_the_next_datagram_and_is_heard_at_once() -> None:
    with udp() as robot:
        port = robot.getsockname()[1]
    line = UdpLine(LOOPBACK, port)
    assert [line.send(b"nobody is there") for _ in range(5)] == [True] * 5
    assert line.returned >= 1
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as robot:
        robot.bind(("127.0.0.1", port))
        robot.settimeout(5)
        robot.sendto(b"disarm", place(line))
        assert line.take(100, 8) == [b"disarm"]
        assert line.send(b"here")
        assert robot.recv(100) == b"here"
    line.close()


def test_a_network_that_is_away_drops_and_comes_back_on_the_same_port(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def away(*_: object) -> None:
        raise OSError(errno.ENETUNREACH, "Network is unreachable")

    with udp() as robot:
        with monkeypatch.context() as patched:
            patched.setattr(socket.socket, "connect", away)
            line = UdpLine(LOOPBACK, robot.getsockname()[1])
            port = place(line)[1]
            assert [line.send(b"x") for _ in range(3)] == [False] * 3
            assert line.take(100, 8) == []
        assert line.send(b"back")
        content, sender = robot.recvfrom(100)
        assert (content, sender) == (b"back", ("127.0.0.1", port))
    line.close()
    assert not line.send(b"closed")


def test_what_others_sent_before_the_line_was_connected_is_left_out() -> None:
    with udp() as robot, udp() as other:
        line = UdpLine(LOOPBACK, robot.getsockname()[1])
        line._socket.close()
        line._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        line._socket.bind(("127.0.0.1", 0))
        line._socket.setblocking(False)
        other.sendto(DISARM, place(line))
        line._socket.connect(robot.getsockname())
        robot.sendto(b"mine", place(line))
        assert line.take(100, 8) == [b"mine"]
        line.close()
