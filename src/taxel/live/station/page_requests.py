"""What the page may ask of a station: it can disarm, not arm or move, nor say where to record.

Knows nothing about HTTP.

Background of our choices: docs/decisions/0018.
"""

from __future__ import annotations

from collections.abc import Collection
from datetime import datetime
from pathlib import Path
from typing import Any, Protocol

from taxel.live.station.packets import Packet
from taxel.live.station.recording import beside
from taxel.live.station.wiring import StationConfig


class Askable(Protocol):
    """What a page may ask: the part of a station that it reaches."""

    @property
    def config(self) -> StationConfig:
        """Labels, groups and the folder of recordings."""

    def acknowledge(self, seen: Collection[int]) -> Any:
        """Let alarms end that a person has seen: those of these keys."""

    def disarm(self, by: str) -> Any:
        """Take the grip's power to follow."""

    def react(self, what: str) -> Any:
        """Log what the person did."""

    def record(self, path: Path, labels: dict[str, str], groups: dict[str, str]) -> Any:
        """Begin a recording."""

    def end_recording(self) -> Any:
        """End it."""


def fulfil(station: Askable, request: Packet) -> None:
    """Do what the page asks.

    Raises:
        KeyError, TypeError, ValueError: It is no request.
    """
    if not isinstance(request, dict):
        raise TypeError("a request is a note")
    if request["do"] == "acknowledge":
        station.acknowledge(_keys(request["seen"]))
    elif request["do"] == "disarm":
        station.disarm("a person at the page")
    elif request["do"] == "react":
        station.react(str(request["what"]))
    elif request["do"] == "record":
        typed = {str(key): str(value) for key, value in dict(request["labels"]).items()}
        config = station.config
        groups = {name: typed.pop(name, value) for name, value in config.groups.items()}
        stamp = datetime.now().strftime("%Y-%m-%d_%H-%M-%S")
        path = beside(config.recordings / f"{stamp}.mcap")  # two may begin within a second
        station.record(path, {**config.labels, **typed}, groups)
    elif request["do"] == "end":
        station.end_recording()


def _keys(seen: object) -> frozenset[int]:
    if not isinstance(seen, list) or not all(type(key) is int for key in seen):
        raise TypeError("seen is a list of keys")
    return frozenset(seen)
