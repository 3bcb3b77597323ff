"""Where a station publishes: zenoh:// and mqtt:// addresses, read and checked.

    zenoh://127.0.0.1:7447/bench-1                      listens there; subscribers connect
    zenoh://127.0.0.1:7447/bench-1?connect=yes          connects to a Zenoh router there
    zenoh:///bench-1?config=FILE                        Zenoh's own file says where, TLS and access
    mqtt://127.0.0.1:1883/bench-1                       reports to a broker
    mqtts://fleet.example:8883/bench-1?ca=FILE&cert=FILE&key=FILE

The last part is the station's name; this machine's unless given. No address holds a password.
Knows nothing about connections.

Background of our choices: docs/decisions/0052.
"""

from __future__ import annotations

import ipaddress
import re
import socket
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from taxel.errors import BadInput
from taxel.foreign.addresses import bracketed, read_options

ZENOH_PORT, MQTT_PORT, MQTTS_PORT = 7447, 1883, 8883
"""Source: Zenoh's default; IANA's ports of MQTT, plain and over TLS."""
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}")
"""A station's name: fit for a Zenoh key, an MQTT topic and a table's cell."""
_WORDS = {"yes": True, "no": False}
_MQTT_FILES = ("ca", "cert", "key", "password_file")


@dataclass(frozen=True, slots=True, kw_only=True)
class ZenohAddress:
    """Where a station publishes over Zenoh, or where a reader finds it."""

    station: str
    host: str = ""
    """Empty where the file of `config` says all."""
    port: int = ZENOH_PORT
    connect: bool = False
    """Connect to a router at host and port instead of listening there."""
    config: Path | None = None
    """Zenoh's own configuration file (JSON5)."""

    @property
    def endpoint(self) -> str:
        """The address as Zenoh writes it."""
        return f"tcp/{bracketed(self.host)}:{self.port}"


@dataclass(frozen=True, slots=True, kw_only=True)
class MqttAddress:
    """An MQTT broker's address, the station's name there, and its credentials."""

    station: str
    host: str
    port: int
    tls: bool = False
    ca: Path | None = None
    """Certificates that are trusted; the system's unless given."""
    cert: Path | None = None
    key: Path | None = None
    """Who this is, where the broker asks for certificates."""
    user: str = ""
    password_file: Path | None = None


def parse_zenoh(url: str) -> ZenohAddress:
    """Return where an address points.

    Raises:
        BadInput: It is wrong, or leaves this machine without saying so.
    """
    host, port, station, options = _split(url, ("zenoh",), ZENOH_PORT)
    _only(options, ("connect", "config", "allow_other_hosts"), "zenoh://")
    config = _file(options, "config")
    connect, away = (_flag(options, name) for name in ("connect", "allow_other_hosts"))
    if not host and config is None:
        raise BadInput("HOST:PORT or config=FILE in a zenoh:// address", repr(url),
                       "try zenoh://127.0.0.1:7447")  # fmt: skip
    if host and not (away or is_this_machine(host)):
        raise BadInput(
            "a zenoh:// address on this machine", repr(host),
            "add allow_other_hosts=yes, or better config=FILE with TLS and access rules",
        )  # fmt: skip
    return ZenohAddress(station=station, host=host, port=port, connect=connect, config=config)


def parse_mqtt(url: str) -> MqttAddress:
    """Return where an address points.

    Raises:
        BadInput: It is wrong, or a password would cross the network in plain text.
    """
    tls = url.startswith("mqtts://")
    usual_port = MQTTS_PORT if tls else MQTT_PORT
    host, port, station, options = _split(url, ("mqtt", "mqtts"), usual_port)
    _only(options, ("user", *_MQTT_FILES), f"{'mqtts' if tls else 'mqtt'}://")
    files = {name: _file(options, name) for name in _MQTT_FILES}
    if not host:
        raise BadInput("HOST:PORT in an mqtt:// address", repr(url), "try mqtt://127.0.0.1:1883")
    if not tls and any(files[name] is not None for name in ("ca", "cert", "key")):
        raise BadInput("mqtts:// with ca, cert or key", "mqtt://", "write mqtts://")
    if (files["cert"] is None) != (files["key"] is None):
        raise BadInput("cert=FILE and key=FILE together", "one of them", "name both")
    user = options.get("user", "")
    if user and not (tls or is_this_machine(host)):
        raise BadInput("mqtts:// where a password crosses the network", "mqtt://", "write mqtts://")
    if files["password_file"] is not None and not user:
        raise BadInput("user=NAME with password_file", "no user", "name the user")
    return MqttAddress(station=station, host=host, port=port, tls=tls, user=user, **files)


def is_this_machine(host: str) -> bool:
    """Return whether a host is this machine's own address."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def is_station_name(text: str) -> bool:
    """Return whether a text may be a station's name."""
    return _NAME.fullmatch(text) is not None


def own_name() -> str:
    """Return this machine's name, as a station's."""
    name = re.sub(r"[^A-Za-z0-9_-]", "-", socket.gethostname().partition(".")[0])[:64]
    return name if is_station_name(name) else "station"


def _split(
    url: str, schemes: tuple[str, ...], port: int
) -> tuple[str, int, str, Mapping[str, str]]:
    """Return host, port, station and options."""
    scheme, found, rest = url.partition("://")
    if not found or scheme not in schemes:
        raise BadInput(f"an address that starts with {schemes[0]}://", repr(url), "mend it")
    place, _, query = rest.partition("?")
    where, _, station = place.partition("/")
    options = read_options(query)
    if station and not is_station_name(station):
        raise BadInput("a station's name of letters, digits, - and _, 64 at most", repr(station),
                       "choose another")  # fmt: skip
    host, number = _host_port(where, port)
    return host, number, station or own_name(), options


def _host_port(where: str, port: int) -> tuple[str, int]:
    host, colon, number = where.rpartition(":")
    if not colon or where.endswith("]"):
        host, number = where, str(port)
    if not re.fullmatch(r"[0-9]{1,5}", number) or not 0 < int(number) < 1 << 16:
        raise BadInput("a port within 1 and 65535", repr(where), "mend the address")
    if ":" in host and not (host.startswith("[") and host.endswith("]")):
        raise BadInput("an IPv6 address in brackets, such as [::1]", repr(where),
                       "write its brackets")  # fmt: skip
    host = host.removeprefix("[").removesuffix("]")
    if not re.fullmatch(r"[A-Za-z0-9.:-]*", host):
        raise BadInput("a host's name or address", repr(host), "mend the address")
    return host, int(number)


def _only(options: Mapping[str, str], known: tuple[str, ...], scheme: str) -> None:
    for name in options:
        if name not in known:
            raise BadInput(f"options of {scheme} among {', '.join(known)}", repr(name),
                           "mend the address")  # fmt: skip


def _flag(options: Mapping[str, str], name: str) -> bool:
    text = options.get(name, "no")
    if text not in _WORDS:
        raise BadInput(f"{name}=yes or {name}=no", repr(text), "mend the address")
    return _WORDS[text]


def _file(options: Mapping[str, str], name: str) -> Path | None:
    if name not in options:
        return None
    path = Path(options[name])
    if not path.is_file():
        raise BadInput(f"a file for {name}", repr(str(path)), "name one that exists")
    return path
