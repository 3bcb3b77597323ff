"""What the page may ask of a station: it can disarm, not arm or move, nor say where to record.

Knows nothing about HTTP.

Background of our choices: docs/decisions/0018.
"""

from __future__ import annotations

from datetime import datetime
from typing import TYPE_CHECKING

from taxel.live.station.packets import Packet

if TYPE_CHECKING:
    from taxel.live.station.station import Station


def fulfil(station: Station, request: Packet) -> None:
    """Do what the page asks.

    Raises:
        KeyError, TypeError, ValueError: It is no request.
    """
    if not isinstance(request, dict):
        raise TypeError("a request is a note")
    if request["do"] == "acknowledge":
        station.acknowledge()
    elif request["do"] == "disarm":
        station.disarm("a person at the page")
    elif request["do"] == "react":
        station.react(str(request["what"]))
    elif request["do"] == "record":
        typed = {str(key): str(value) for key, value in dict(request["labels"]).items()}
        config = station.config
        groups = {name: typed.pop(name, value) for name, value in config.groups.items()}
        stamp = datetime.now().strftime("%Y-%m-%d_%H-%M-%S")
        path = config.recordings / f"{stamp}.mcap"
        station.record(path, {**config.labels, **typed}, groups)
    elif request["do"] == "end":
        station.end_recording()
