"""Who listens to a station over Zenoh hears it alone: no other program can pass for it."""

import importlib.util
import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace

import pytest

if importlib.util.find_spec("zenoh") is None:
    pytest.skip("needs eclipse-zenoh: pip install 'taxel[bus]'", allow_module_level=True)

import zenoh

from taxel.bench.real_mosquitto import free_port
from taxel.bus.addresses import parse_zenoh
from taxel.bus.batches import JSON, Head
from taxel.bus.zenoh_publisher import Bus
from taxel.bus.zenoh_reader import BusReader

STATE = "taxel/bench/state"


@contextmanager
def stranger(port: int) -> Iterator[zenoh.Session]:
    """A program without taxel that is connected to a station's port."""
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([f"tcp/127.0.0.1:{port}"]))
    config.insert_json5("scouting/multicast/enabled", "false")
    with zenoh.open(config) as session:
        yield session


def states(reader: BusReader, bus: Bus, forger: zenoh.Session) -> list[str]:
    """Return whose states came, after five of each."""
    put_anew(reader, bus)
    for number in range(5):
        forged = Head(10**6 + number, 0, time.monotonic()).pack()
        forger.put(STATE, b'{"state": "forged"}', encoding=zenoh.Encoding(JSON), attachment=forged)
        forger.delete(STATE)
        bus.put("/state", {"state": "true"})
    found: list[str] = []
    until_s = time.monotonic() + 5.0
    while found.count("last") == 0 and time.monotonic() < until_s:
        bus.put("/state", {"state": "last"})
        found += [m.value["state"] for m in reader.take(wait_s=0.1) if m.topic == "state"]
    return [text for text in found if text != "last"]


def put_anew(reader: BusReader, bus: Bus) -> None:
    """Wait until the reader hears the station."""
    until_s = time.monotonic() + 5.0
    while not reader.take(wait_s=0.05):
        assert time.monotonic() < until_s
        bus.put("/hello", {})


def test_what_another_program_publishes_as_the_station_reaches_nobody() -> None:
    """Before, all five came and were taken as true."""
    port = free_port()
    url = f"zenoh://127.0.0.1:{port}/bench"
    with Bus(parse_zenoh(url)) as bus, BusReader(url) as reader, stranger(port) as forger:
        assert states(reader, bus, forger) == ["true"] * 5
        assert (reader.lost, reader.bad) == (0, 0)
        forger.declare_queryable(STATE, lambda query: query.reply(STATE, b"forged"))
        assert list(reader._session.get(STATE, timeout=0.3)) == []


@pytest.mark.parametrize("default", ["allow", "deny"])
def test_a_files_own_access_rules_hold_beside_it(tmp_path, default: str) -> None:
    port = free_port()
    everything = ["put", "delete", "declare_subscriber"]
    rules = {
        "mode": "peer",
        "listen": {"endpoints": [f"tcp/127.0.0.1:{port}"]},
        "access_control": {
            "enabled": True, "default_permission": default,
            "rules": [{"id": "all", "permission": "allow", "flows": ["ingress", "egress"],
                       "messages": everything, "key_exprs": ["taxel/bench/**"]}],
            "subjects": [{"id": "any"}], "policies": [{"rules": ["all"], "subjects": ["any"]}],
        },
    }  # fmt: skip
    file = tmp_path / "zenoh.json5"
    file.write_text(json.dumps(rules))
    with (
        Bus(parse_zenoh(f"zenoh:///bench?config={file}")) as bus,
        BusReader(f"zenoh://127.0.0.1:{port}/bench") as reader,
        stranger(port) as forger,
    ):
        assert states(reader, bus, forger) == ["true"] * 5


@pytest.mark.parametrize("payload", [b"[" * 200_000, b"9" * 5000, b"{", b"null"])
def test_json_that_cannot_be_read_is_counted_and_raises_nothing(payload: bytes) -> None:
    """A reader may hear others through a router, which has access rules of its own."""
    url = f"zenoh://127.0.0.1:{free_port()}/bench"
    with Bus(parse_zenoh(url)), BusReader(url) as reader:
        head = SimpleNamespace(to_bytes=Head(1, 0, 1.0).pack)
        content = SimpleNamespace(to_bytes=lambda: payload)
        sample = SimpleNamespace(key_expr=STATE, attachment=head, encoding=JSON, payload=content)
        reader._take_in(sample)
        assert (reader.bad, reader.take()) == (1, [])
