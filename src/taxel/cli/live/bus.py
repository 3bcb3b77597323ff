"""What `taxel live --publish` sends to other programs, each in a process of its own.

Knows nothing about what is published.
"""

from __future__ import annotations

import socket
from collections.abc import Callable, Iterator, Sequence
from secrets import token_urlsafe
from typing import TYPE_CHECKING, Any

from taxel.cli.extras import need_extra
from taxel.errors import BadInput

if TYPE_CHECKING:
    from taxel.live.station.station import Station
    from taxel.live.station.worker import Place

SCHEMES = ("zenoh", "mqtt", "mqtts")
FOXGLOVE, RERUN = "foxglove", "rerun"
"""What is published to without an address."""


def check_bus(publish: Sequence[str]) -> None:
    """Refuse addresses that are wrong, before anything is started.

    Raises:
        BadInput: One is wrong, or named twice.
        MissingExtra: A package is not installed.
    """
    from taxel.bus.addresses import parse_mqtt, parse_zenoh

    for url in publish:
        scheme = url.partition("://")[0]
        if url == FOXGLOVE:
            import taxel.bus.foxglove_server  # noqa: F401  # names its extra where it is missing
        if url == RERUN:
            need_extra("rerun", "a Rerun viewer")
        if url in (FOXGLOVE, RERUN):
            continue
        if scheme not in SCHEMES:
            raise BadInput("--publish with zenoh://, mqtt://, mqtts://, foxglove or rerun",
                           repr(url), "try zenoh://127.0.0.1:7447")  # fmt: skip
        if scheme == "zenoh":
            from taxel.bus.zenoh_session import zenoh_module

            parse_zenoh(url)
            zenoh_module()
        else:
            from taxel.fleet.broker import mqtt_module

            parse_mqtt(url)
            mqtt_module()
    if len(set(publish)) < len(publish):
        raise BadInput("each address of --publish once", "one twice", "leave one out")


def open_bus(station: Station, publish: Sequence[str]) -> Iterator[str]:
    """Start what was asked for; yield a line for the person about each."""
    for number, url in enumerate(publish, 1):
        name = "publisher" if len(publish) == 1 else f"publisher {number}"
        if url == FOXGLOVE:
            yield f"for Foxglove: {_open_foxglove(station)}"
        elif url == RERUN:
            _open_rerun(station)
        elif url.startswith("zenoh://"):
            yield f"publishing: {_open_zenoh(station, name, url)}"
        else:
            yield f"reporting: {_open_reports(station, name, url)}"


def _open_zenoh(station: Station, name: str, url: str) -> str:
    from taxel.bus.addresses import parse_zenoh
    from taxel.bus.zenoh_publisher import ZenohPublishing, publish

    address, view = parse_zenoh(url), station.view_config()
    return _added(
        station, name, publish,
        lambda place: ZenohPublishing(place=place, view=view, address=address),
    )  # fmt: skip


def _open_reports(station: Station, name: str, url: str) -> str:
    from taxel.bus.addresses import parse_mqtt
    from taxel.fleet.reporter import Reporting, bundle_names, report

    address, view = parse_mqtt(url), station.view_config()
    # Now: a reporter that is started again finds the file gone, or another one than what runs.
    bundles = bundle_names([str(path) for path in station.config.bundles])
    return _added(
        station, name, report,
        lambda place: Reporting(place=place, view=view, address=address, bundles=bundles),
    )  # fmt: skip


def _open_foxglove(station: Station) -> str:
    from taxel.bus.foxglove_server import PORT, FoxgloveView, show

    # Drawn once: a server that is started again is found under the same address.
    view, token, port = station.view_config(), token_urlsafe(32), _free_port(PORT)
    return _added(
        station, "foxglove", show,
        lambda place: FoxgloveView(place=place, view=view, port=port, token=token),
    )  # fmt: skip


def _open_rerun(station: Station) -> None:
    from taxel.views.rerun_bridge import RerunJob, stream

    view = station.view_config()
    station.add_process("rerun", stream, lambda place: RerunJob(place=place, view=view))


def _added(
    station: Station, name: str, entry: Callable[[Any], None], job: Callable[[Place], Any]
) -> str:
    (where,) = station.add_process(name, entry, job)
    return str(where)


def _free_port(wanted: int) -> int:
    """Return a port that is free on this machine: the wanted one where it is."""
    for port in (wanted, 0):
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind(("127.0.0.1", port))
            except OSError:
                continue
            return int(probe.getsockname()[1])
    return wanted
