"""Addresses of the live bus and of a fleet's broker."""

import pytest

from taxel.bus.addresses import own_name, parse_mqtt, parse_zenoh
from taxel.bus.batches import key_of
from taxel.errors import BadInput


def test_an_address_names_host_port_and_station() -> None:
    found = parse_zenoh("zenoh://127.0.0.1:7001/bench-1")
    assert (found.host, found.port, found.station) == ("127.0.0.1", 7001, "bench-1")
    assert found.endpoint == "tcp/127.0.0.1:7001"
    assert parse_zenoh("zenoh://[::1]:7001").endpoint == "tcp/[::1]:7001"
    assert parse_zenoh("zenoh://localhost").station == own_name()
    assert parse_mqtt("mqtt://127.0.0.1").port == 1883
    assert parse_mqtt("mqtts://broker").port == 8883
    assert parse_mqtt("mqtts://[2001:db8::1]/a").port == 8883
    assert parse_mqtt("mqtts://broker:1883").port == 1883


@pytest.mark.parametrize(
    ("url", "needed"),
    [
        ("zenoh://", "HOST:PORT"),
        ("zenoh://0.0.0.0:7447/a", "on this machine"),
        ("zenoh://lab.example:7447/a?connect=yes", "on this machine"),
        ("zenoh://127.0.0.1:0/a", "a port within 1 and 65535"),
        ("zenoh://127.0.0.1:99999/a", "a port within 1 and 65535"),
        ("zenoh://::1", "IPv6 address in brackets"),
        ("zenoh://fe80::1:7447/a", "IPv6 address in brackets"),
        ("zenoh://127.0.0.1:7447/a/b", "a station's name"),
        ("zenoh://127.0.0.1:7447/**", "a station's name"),
        ("zenoh://127.0.0.1:7447/a?speed=2", "options of zenoh://"),
        ("zenoh://127.0.0.1:7447/a?connect=1", "connect=yes or connect=no"),
        ("zenoh://127.0.0.1:7447/a?connect=no&connect=yes", "each option once"),
        ("zenoh:///a?config=no-such-file", "a file for config"),
        ("tcp://127.0.0.1:7447", "starts with zenoh://"),
    ],
)
def test_a_wrong_address_of_the_bus_is_refused(url: str, needed: str) -> None:
    with pytest.raises(BadInput, match=needed.replace("*", "[*]")):
        parse_zenoh(url)


@pytest.mark.parametrize(
    ("url", "needed"),
    [
        ("mqtt://", "HOST:PORT"),
        ("mqtt://lab.example/a?user=me", "mqtts:// where a password"),
        ("mqtt://127.0.0.1/a?ca=pyproject.toml", "mqtts:// with ca"),
        ("mqtts://lab.example/a?cert=pyproject.toml", "cert=FILE and key=FILE"),
        ("mqtts://lab.example/a?password_file=pyproject.toml", "user=NAME"),
        ("mqtt://127.0.0.1/a+b", "a station's name"),
        ("http://127.0.0.1/a", "starts with mqtt://"),
    ],
)
def test_a_wrong_address_of_a_broker_is_refused(url: str, needed: str) -> None:
    with pytest.raises(BadInput, match=needed):
        parse_mqtt(url)


def test_names_that_no_key_may_hold_stay_apart() -> None:
    """`*`, `$`, `?`, `#` and `//` mean something to Zenoh; a recording's camera may be so named."""
    names = ["/camera/le*ft", "/camera/le?ft", "/camera/le ft", "/camera/le_ft"]
    keys = {key_of("bench", name) for name in names}
    assert len(keys) == len(names)
    assert not any(set("*$?# ") & set(key) for key in keys)
    assert key_of("bench", "/touch/teng") == "taxel/bench/touch/teng"
