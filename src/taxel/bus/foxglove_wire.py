"""What Foxglove's WebSocket protocol says, as far as one who only shows needs it.

Channels and messages of a station: JSON with named channels, so that plots show names; images as
`sensor_msgs/CompressedImage` in CDR, as in a recording. Source: the protocol as the
package foxglove-sdk 0.30 speaks it (`foxglove.sdk.v1`), and before it `foxglove.websocket.v1`.
Knows nothing about sockets.

Background of our choices: docs/decisions/0052.
"""

from __future__ import annotations

import json
import math
import struct
from dataclasses import dataclass
from typing import Any

import numpy as np

from taxel.bus.batches import json_bytes
from taxel.bus.following import Item
from taxel.recordings.frame_layout import FRAME_SCHEMA, FRAME_SCHEMA_NAME
from taxel.signals import ROUNDING_S, Samples

SUBPROTOCOLS = ("foxglove.sdk.v1", "foxglove.websocket.v1")
ROW_S = 0.01
"""Time between shown rows of an array: the common grid's, docs/decisions/0003."""
_MESSAGE = struct.Struct("<BIQ")
_MESSAGE_DATA = 0x01


@dataclass(frozen=True, slots=True)
class Channel:
    """One topic as a viewer sees it."""

    number: int
    topic: str
    image: bool
    """True for frames, False for JSON."""
    name: str
    """Of its schema."""
    fields: tuple[str, ...] = ()
    """Numbers in a message, by name; for plots."""

    def as_json(self) -> dict[str, Any]:
        """Return the channel as the protocol advertises it."""
        numbers = {name: {"type": "number"} for name in self.fields}
        schema = {"type": "object", "properties": numbers}
        return {
            "id": self.number, "topic": self.topic,
            "encoding": "cdr" if self.image else "json",
            "schemaName": FRAME_SCHEMA_NAME if self.image else self.name,
            "schemaEncoding": "ros2msg" if self.image else "jsonschema",
            "schema": FRAME_SCHEMA.decode() if self.image else json.dumps(schema),
        }  # fmt: skip


class Rows:
    """Thins an array's scans to what a screen shows.

    Args:
        channels: Names of the columns.
    """

    def __init__(self, channels: tuple[str, ...]) -> None:
        self.channels = channels
        self._shown_s = -math.inf

    def of(self, samples: Samples) -> list[tuple[float, bytes]]:
        """Return (time, JSON) of the scans that are a grid's step apart; unusable is null."""
        found = []
        values = np.where(samples.usable, samples.values, np.nan)
        for time_s, row in zip(samples.fitted_s.tolist(), values.tolist(), strict=True):
            if time_s - self._shown_s >= ROW_S - ROUNDING_S:
                self._shown_s = time_s
                found.append((time_s, json_bytes(dict(zip(self.channels, row, strict=True)))))
        return found


def message(subscription: int, wall_ns: int, payload: bytes) -> bytes:
    """Return a payload as a viewer takes it."""
    return _MESSAGE.pack(_MESSAGE_DATA, subscription, wall_ns) + payload


def read_request(text: str) -> tuple[str, dict[int, int] | list[int]]:
    """Return what a viewer asks: subscribe {its number: channel}, or unsubscribe [its numbers].

    Everything else the protocol knows would change something here, and is no request.

    Raises:
        ValueError: It is neither.
    """
    given = json.loads(text)
    if not isinstance(given, dict):
        raise ValueError("needed a JSON object")
    try:
        if given.get("op") == "subscribe":
            return "subscribe", {
                _number(subscription["id"]): _number(subscription["channelId"])
                for subscription in given["subscriptions"]
            }
        if given.get("op") == "unsubscribe":
            return "unsubscribe", [
                _number(subscription) for subscription in given["subscriptionIds"]
            ]
    except (KeyError, TypeError) as error:
        raise ValueError(f"needed {error}") from error
    raise ValueError("needed subscribe or unsubscribe")


def item_name(item: Item) -> str:
    """Return a schema's name for a topic that holds JSON."""
    return "taxel." + item.topic.strip("/").partition("/")[0].capitalize()


def _number(value: object) -> int:
    if type(value) is not int or not 0 <= value < 2**32:
        raise ValueError("needed a whole number of 32 bits")
    return value
