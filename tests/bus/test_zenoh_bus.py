"""A station's rings over Zenoh: what a subscriber gets, what is counted, who may listen."""

import importlib.util
import json
import os
import signal
import socket
import subprocess
import sys
import time

import numpy as np
import pytest

from taxel.errors import BadInput
from taxel.signals import Frame, Samples

if importlib.util.find_spec("zenoh") is None:
    pytest.skip("needs eclipse-zenoh: pip install 'taxel[bus]'", allow_module_level=True)

from taxel.bench.real_mosquitto import free_port
from taxel.bus.addresses import parse_zenoh
from taxel.bus.batches import Head
from taxel.bus.zenoh_publisher import Bus
from taxel.bus.zenoh_reader import BusReader


def scans(first: int, count: int) -> Samples:
    values = np.arange(first, first + count, dtype=np.float64)[:, None] * np.ones((1, 12))
    return Samples.from_values(values, np.arange(first, first + count) / 1000.0)


def joined(reader: BusReader, bus: Bus) -> None:
    """Wait until the two know each other."""
    until_s = time.monotonic() + 5.0
    while not reader.take(wait_s=0.05):
        assert time.monotonic() < until_s
        bus.put("/hello", {})


@pytest.fixture
def pair():
    url = f"zenoh://127.0.0.1:{free_port()}/bench"
    with Bus(parse_zenoh(url)) as bus, BusReader(url) as reader:
        joined(reader, bus)
        yield bus, reader


def received(reader: BusReader, count: int, topic: str) -> list:
    found: list = []
    until_s = time.monotonic() + 5.0
    while len(found) < count and time.monotonic() < until_s:
        found += [m for m in reader.take(wait_s=0.1) if m.topic == topic]
    return found


def test_scans_frames_and_notes_come_as_they_were_sent(pair) -> None:
    bus, reader = pair
    sent = scans(5, 10)
    frame = Frame(camera=1, jpeg=b"\xff\xd8 image \xff\xd9", counter=7, device_s=0.5,
                  arrival_s=1.5, fitted_s=1.25)  # fmt: skip
    bus.put("/touch/teng", sent)
    bus.put("/camera/left", frame)
    bus.put("/state", {"state": "STABLE", "probability": float("nan")})

    (touch,) = received(reader, 1, "touch/teng")
    assert np.array_equal(touch.value.values, sent.values)
    assert np.array_equal(touch.value.fitted_s, sent.fitted_s)
    bus.put("/camera/left", frame)
    camera, *_ = received(reader, 1, "camera/left")
    assert camera.value == frame
    bus.put("/state", {"state": "STABLE", "probability": float("nan")})
    state, *_ = received(reader, 1, "state")
    assert state.value == {"state": "STABLE", "probability": None}
    assert reader.bad == 0


def test_every_scan_comes_once_and_in_order(pair) -> None:
    """The scan's number is its value, so that a lost or repeated scan would show."""
    bus, reader = pair
    for batch in range(100):
        bus.put("/touch/teng", scans(10 * batch, 10))
        time.sleep(0.001)

    values = np.concatenate([m.value.values[:, 0] for m in received(reader, 100, "touch/teng")])
    assert values.tolist() == list(range(1000))
    assert reader.lost == 0


def test_what_the_publisher_lost_before_is_reported(pair) -> None:
    bus, reader = pair
    bus.put("/touch/teng", scans(0, 1), lost=12)
    received(reader, 1, "touch/teng")
    assert reader.lost_before == 12


def test_a_gap_in_the_numbers_is_counted_and_a_new_start_is_none(pair) -> None:
    bus, reader = pair
    bus.put("/touch/teng", scans(0, 1))
    bus._numbers["/touch/teng"] = 5
    bus.put("/touch/teng", scans(1, 1))
    received(reader, 2, "touch/teng")
    assert reader.lost == 4
    bus._numbers["/touch/teng"] = 0
    bus.put("/touch/teng", scans(2, 1))
    received(reader, 1, "touch/teng")
    assert reader.lost == 4


def test_foreign_messages_are_counted_and_let_go(pair) -> None:
    bus, reader = pair
    stranger = bus._session.declare_publisher("taxel/bench/touch/teng")
    for payload, head in ((b"x", None), (b"x", b"short"), (b"S", Head(0, 0, 0.0).pack())):
        stranger.put(payload, attachment=head)
    until_s = time.monotonic() + 5.0
    while reader.bad < 3 and time.monotonic() < until_s:
        time.sleep(0.01)
    assert reader.bad == 3


SUBSCRIBER = """
import sys, time
from taxel.bus.zenoh_reader import BusReader
with BusReader(sys.argv[1]) as reader:
    count = 0
    while True:
        for message in reader.take(wait_s=0.1):
            count += message.topic == "touch/teng"
        print(count, reader.lost, flush=True)
"""


def test_a_stopped_subscriber_holds_nobody_up_and_loses_by_count() -> None:
    """A real process is stopped by SIGSTOP: the publisher's slowest call stays short, another
    subscriber goes on, and the stopped one knows afterwards what it lost.
    """
    url = f"zenoh://127.0.0.1:{free_port()}/bench"
    image = Frame(
        camera=0, jpeg=bytes(60_000), counter=0, device_s=0.0, arrival_s=0.0, fitted_s=0.0
    )
    with Bus(parse_zenoh(url)) as bus:
        other = subprocess.Popen(
            [sys.executable, "-c", SUBSCRIBER, url], stdout=subprocess.PIPE, text=True,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        )  # fmt: skip
        try:
            assert other.stdout is not None
            while not other.stdout.readline().startswith("1 "):
                bus.put("/touch/teng", scans(0, 1))
            with BusReader(url) as reader:
                joined(reader, bus)
                os.kill(other.pid, signal.SIGSTOP)
                slowest_s, sent = 0.0, 0
                taken = 0
                for batch in range(200):  # 12 MB: far more than sockets hold
                    began_s = time.monotonic()
                    bus.put("/touch/teng", scans(10 * batch, 10))
                    bus.put("/camera/left", image)
                    slowest_s = max(slowest_s, time.monotonic() - began_s)
                    sent += 1
                    time.sleep(0.005)
                    taken += sum(m.topic == "touch/teng" for m in reader.take())
                taken += len(received(reader, sent - taken, "touch/teng"))
                assert taken >= 0.9 * sent  # a busy machine may drop some, and says so
                assert taken + reader.lost >= sent
                assert slowest_s < 0.5
                os.kill(other.pid, signal.SIGCONT)
                lost, until_s = 0, time.monotonic() + 10.0
                while not lost and time.monotonic() < until_s:
                    bus.put("/touch/teng", scans(0, 10))
                    bus.put("/camera/left", image)
                    lost = int(other.stdout.readline().split()[1])
                assert lost > 0
        finally:
            other.kill()
            other.wait()
            other.stdout.close()


def test_a_taken_port_is_one_plain_line() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        url = f"zenoh://127.0.0.1:{taken.getsockname()[1]}/bench"
        with pytest.raises(BadInput, match="Address already in use"):
            Bus(parse_zenoh(url))


def test_zenohs_own_file_says_where_and_who(tmp_path) -> None:
    """Its access rules hold: a subscriber whom they deny gets nothing."""
    port = free_port()
    rules = {
        "mode": "peer",
        "listen": {"endpoints": [f"tcp/127.0.0.1:{port}"]},
        "access_control": {
            "enabled": True, "default_permission": "allow",
            "rules": [{"id": "none", "permission": "deny", "flows": ["egress"],
                       "messages": ["put"], "key_exprs": ["taxel/bench/camera/**"]}],
            "subjects": [{"id": "all"}], "policies": [{"rules": ["none"], "subjects": ["all"]}],
        },
    }  # fmt: skip
    file = tmp_path / "zenoh.json5"
    file.write_text(json.dumps(rules))
    with (
        Bus(parse_zenoh(f"zenoh:///bench?config={file}")) as bus,
        BusReader(f"zenoh://127.0.0.1:{port}/bench") as reader,
    ):
        joined(reader, bus)
        bus.put("/camera/left", {"allowed": False})
        bus.put("/touch/teng", scans(0, 1))
        found = []
        until_s = time.monotonic() + 5.0
        while "touch/teng" not in found and time.monotonic() < until_s:
            found += [m.topic for m in reader.take(wait_s=0.1)]
    assert "touch/teng" in found
    assert "camera/left" not in found


def test_a_file_without_addresses_is_refused_instead_of_listening_everywhere(tmp_path) -> None:
    file = tmp_path / "zenoh.json5"
    file.write_text("{mode: 'peer'}")
    with pytest.raises(BadInput, match="listen or connect endpoints"):
        Bus(parse_zenoh(f"zenoh:///bench?config={file}"))
    file.write_text("{mode: ")
    with pytest.raises(BadInput, match="Zenoh configuration"):
        Bus(parse_zenoh(f"zenoh:///bench?config={file}"))
