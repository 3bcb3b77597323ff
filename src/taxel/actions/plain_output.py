"""A plain output for any other robot: JSON over UDP, or a Python function.

One datagram a tick, UTF-8, one JSON object:

    schema       "taxel-action-1"
    sequence     counts datagrams from 1; a hole is a lost one
    time_s       sender's monotonic clock, seconds
    state        STABLE, WARNING, UNSTABLE or UNKNOWN
    reason       why it is UNKNOWN; empty otherwise
    probability  of instability, 0…1; null where there is none
    since_s      since when this state has lasted, on the same clock; null where unknown
    order        none, grip, hold or stop
    order_reason why, in words
    force_n      newtons, with grip, hold and stop; null with none
    expires_in_s void this long after it was sent; null for a stop, which never expires

The receiver must act on silence itself: with no datagram for `expires_in_s`, hold or stop.
UDP neither answers nor encrypts: keep it on this machine or on a line of its own. Nothing here
waits: a full buffer drops the datagram and counts it. Knows nothing about grippers or models.
"""

from __future__ import annotations

import ipaddress
import json
import math
import socket
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

from taxel.actions.interlock import Order, OrderKind
from taxel.decisions.stability import StabilityDecision
from taxel.errors import BadInput

SCHEMA = "taxel-action-1"


@dataclass(frozen=True, slots=True, kw_only=True)
class Action:
    """What is told to another robot; fields as above."""

    sequence: int
    time_s: float
    state: str
    reason: str
    probability: float | None
    since_s: float | None
    order: str
    order_reason: str
    force_n: float | None
    expires_in_s: float | None
    schema: str = SCHEMA

    def as_json(self) -> bytes:
        """Return it as the bytes of a datagram."""
        return json.dumps(asdict(self), allow_nan=False).encode()


def action_of(decision: StabilityDecision, order: Order, sequence: int, now_s: float) -> Action:
    """Return what to tell; a value that is not finite becomes None."""
    lasts_s = None if order.kind is OrderKind.STOP else max(0.0, order.expires_s - now_s)
    return Action(
        sequence=sequence,
        time_s=_finite(now_s) or 0.0,
        state=decision.state.name,
        reason=decision.reason,
        probability=_finite(decision.probability),
        since_s=_finite(decision.since_s),
        order=order.kind.value,
        order_reason=order.reason,
        force_n=_finite(order.force_n),
        expires_in_s=_finite(lasts_s),
    )


class UdpOutput:
    """Send each action as a datagram; use it in a `with` block.

    Args:
        host: An IP address.
        port: Of the receiver, 1…65535.
        allow_other_hosts: Needed for any address that is not this machine's own loopback.

    Raises:
        BadInput: The address is none, or leaves this machine without being allowed to.
    """

    def __init__(self, host: str, port: int, allow_other_hosts: bool = False) -> None:
        try:
            address = ipaddress.ip_address("127.0.0.1" if host == "localhost" else host)
        except ValueError as error:
            raise BadInput(
                "an IP address to send to", repr(host), "use 127.0.0.1 or the receiver's number"
            ) from error
        if not 1 <= port <= 65535:
            raise BadInput("a port of 1 to 65535", f"{port}", "mend the address")
        if not address.is_loopback and not allow_other_hosts:
            raise BadInput(
                "an address of this machine, 127.0.0.1",
                host,
                "allow other hosts explicitly (allow_other_hosts=1)",
            )
        self._to = (str(address), port)
        family = socket.AF_INET6 if address.version == 6 else socket.AF_INET
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self.sent = 0
        """Datagrams handed to the system."""
        self.dropped = 0
        """Datagrams that the system did not take."""

    def tell(self, decision: StabilityDecision, order: Order, now_s: float) -> None:
        """Send what is decided and ordered now; never waits, never raises for the network."""
        action = action_of(decision, order, self.sent + self.dropped + 1, now_s)
        try:
            self._socket.sendto(action.as_json(), self._to)
            self.sent += 1
        except OSError:
            self.dropped += 1

    @property
    def lost(self) -> int:
        """What did not get out."""
        return self.dropped

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def __enter__(self) -> UdpOutput:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class CallbackOutput:
    """Call a function with each action, in the tick's own thread: it must be quick.

    An exception of it is counted and kept in `last_error`; it never stops the tick.
    """

    def __init__(self, call: Callable[[Action], Any]) -> None:
        self._call = call
        self.sent = 0
        """Calls that came back."""
        self.failed = 0
        """Calls that raised."""
        self.last_error = ""
        """The newest exception, in words."""

    def tell(self, decision: StabilityDecision, order: Order, now_s: float) -> None:
        """Call the function with what is decided and ordered now."""
        try:
            self._call(action_of(decision, order, self.sent + self.failed + 1, now_s))
            self.sent += 1
        except Exception as error:  # whatever a user's function raises, the tick goes on
            self.failed += 1
            self.last_error = f"{type(error).__name__}: {error}"

    @property
    def lost(self) -> int:
        """What was not taken."""
        return self.failed

    def close(self) -> None:
        """Nothing to let go of."""


def _finite(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None


def open_udp(name: str, allow_other_hosts: bool) -> UdpOutput:
    """Open host:port as an address writes it, [::1]:5005 for IPv6.

    Raises:
        BadInput: It is no host and port.
    """
    host, found, port = name.rpartition(":")
    if not found or not port.isascii() or not port.isdigit():
        raise BadInput("udp://HOST:PORT", f"udp://{name}", "try udp://127.0.0.1:5005")
    return UdpOutput(host.strip("[]"), int(port), allow_other_hosts)
