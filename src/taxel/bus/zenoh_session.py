"""A Zenoh session as taxel opens it: explicit endpoints, nothing found by itself, nothing shared.

Multicast, gossip, shared memory and the admin space are off, whatever a configuration file says:
a station is found where it is named, and a process that is killed leaves no segment behind. A
station lets nobody publish through its port: who listens to it hears it alone. Knows nothing
about touch.

Background of our choices: docs/decisions/0052.
"""

from __future__ import annotations

import json
from pathlib import Path
from types import ModuleType
from typing import Any

from taxel.bus.addresses import ZenohAddress
from taxel.errors import BadInput, MissingExtra

_OFF = {
    "scouting/multicast/enabled": False,
    "scouting/gossip/enabled": False,
    "transport/shared_memory/enabled": False,
    "adminspace/enabled": False,
}
_ACCESS = "access_control"
_READ_ONLY = "taxel: subscribers only listen"
_DENIED = ("put", "delete", "reply", "declare_queryable")
"""What nobody may send into a station: it would pass it on to the others as its own."""
_DROP = "transport/link/tx/queue/congestion_control/drop"
_WAIT_US, _WAIT_FRAGMENTS_US = 5_000, 20_000
"""How long a message, and all parts of a large one, wait for room before they are dropped,
microseconds; once a subscriber is full, Zenoh waits for it no more. Source: our choice: half a
batch and two, docs/decisions/0052."""


def zenoh_module() -> ModuleType:
    """Return the package.

    Raises:
        MissingExtra: It is not installed.
    """
    try:
        import zenoh
    except ModuleNotFoundError as error:
        raise MissingExtra("eclipse-zenoh", "bus", "a live bus") from error
    found: ModuleType = zenoh
    return found


def open_session(address: ZenohAddress, *, listen: bool) -> Any:
    """Return an open session.

    Args:
        address: Where.
        listen: A station: wait there for subscribers, unless the address says connect. A reader
            connects.

    Raises:
        BadInput: The configuration is none, or the address cannot be used.
        MissingExtra: eclipse-zenoh is not installed.
    """
    zenoh = zenoh_module()
    settings: dict[str, Any] = dict(_OFF)
    settings[_DROP] = {
        "wait_before_drop": _WAIT_US, "max_wait_before_drop_fragments": _WAIT_FRAGMENTS_US,
    }  # fmt: skip
    if address.host:
        waits = listen and not address.connect
        settings |= {
            "mode": "peer" if waits else "client",
            "listen/endpoints": [address.endpoint] if waits else [],
            "connect/endpoints": [] if waits else [address.endpoint],
        }
    elif address.config is not None:
        settings |= _only_named(zenoh, address.config)
    config = _read(zenoh, address.config)
    if listen:
        settings[_ACCESS] = _read_only(json.loads(config.get_json(_ACCESS)))
    for name, value in settings.items():
        config.insert_json5(name, json.dumps(value))
    try:
        return zenoh.open(config)
    except zenoh.ZError as error:
        raise BadInput(
            "a Zenoh address that can be used", _short(error),
            "choose a free port, or start what listens there",
        ) from error  # fmt: skip


def _read_only(given: dict[str, Any]) -> dict[str, Any]:
    """Return access rules by which nobody publishes through a station; a file's own stay in force.

    Args:
        given: The file's, or Zenoh's own.
    """
    enabled = bool(given.get("enabled"))
    added: dict[str, dict[str, Any]] = {
        "rules": {"id": _READ_ONLY, "permission": "deny", "flows": ["ingress"],
                  "messages": _DENIED, "key_exprs": ["**"]},
        "subjects": {"id": _READ_ONLY},
        "policies": {"rules": [_READ_ONLY], "subjects": [_READ_ONLY]},
    }  # fmt: skip
    found: dict[str, Any] = {
        "enabled": True, "default_permission": given["default_permission"] if enabled else "allow",
    }  # fmt: skip
    for part, entry in added.items():
        found[part] = [*((given.get(part) or []) if enabled else []), entry]
    return found


def _read(zenoh: Any, path: Path | None) -> Any:
    if path is None:
        return zenoh.Config()
    try:
        return zenoh.Config.from_file(str(path))
    except zenoh.ZError as error:
        raise BadInput("a Zenoh configuration (JSON5)", f"{path}: {_short(error)}",
                       "mend the file") from error  # fmt: skip


def _only_named(zenoh: Any, path: Path) -> dict[str, Any]:
    """Return what keeps a file that names no address from listening on all of them, as Zenoh's
    own default does.
    """
    given, default = _read(zenoh, path), zenoh.Config()
    listens = given.get_json("listen/endpoints") != default.get_json("listen/endpoints")
    if not listens and not _endpoints(json.loads(given.get_json("connect/endpoints"))):
        raise BadInput("listen or connect endpoints in Zenoh's configuration", str(path),
                       "name them, or give HOST:PORT")  # fmt: skip
    return {} if listens else {"listen/endpoints": []}


def _endpoints(value: Any) -> list[str]:
    """Return endpoints, which a file gives as a list or for each mode."""
    if isinstance(value, dict):
        return [text for part in value.values() for text in _endpoints(part)]
    return list(value) if isinstance(value, list) else [value] if value else []


def _short(error: Exception) -> str:
    """Return an error of Zenoh's without its source files."""
    return str(error).partition(" at /")[0].strip(" !")[:200]
