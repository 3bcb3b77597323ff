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


def grant(station: Station, wish: Packet) -> None:
    """Do what the page asks.

    Raises:
        KeyError, TypeError, ValueError: It is no wish.
    """
    if not isinstance(wish, dict):
        raise TypeError("a wish is a note")
    if wish["do"] == "acknowledge":
        station.acknowledge()
    elif wish["do"] == "disarm":
        station.disarm("a person at the page")
    elif wish["do"] == "react":
        station.react(str(wish["what"]))
    elif wish["do"] == "record":
        typed = {str(key): str(value) for key, value in dict(wish["labels"]).items()}
        config = station.config
        groups = {name: typed.pop(name, value) for name, value in config.groups.items()}
        stamp = datetime.now().strftime("%Y-%m-%d_%H-%M-%S")
        path = config.recordings / f"{stamp}.mcap"
        station.record(path, {**config.labels, **typed}, groups)
    elif wish["do"] == "end":
        station.end_recording()
