"""A plain output for any other robot: JSON over UDP, or a Python function.

What is recognised goes out as datagrams of a schema of their own (`answer_output.py`). Of a
grasp that is watched: one datagram a tick, UTF-8, one JSON object:

    schema       "taxel-action-1"
    sequence     counts datagrams from 1; a hole is a lost one
    time_s       sender's monotonic clock, seconds
    state        STABLE, WARNING, UNSTABLE or UNKNOWN
                 (UNKNOWN also between two grasps)
    reason       why it is UNKNOWN (docs/reference/unknown.md); empty otherwise
    probability  of instability, 0…1; null where the monitor gives none
    score        0…1, of a monitor that gives a warning's score and no probability, such as
                 slip-both-gels; what it is compared with stands in the bundle; null otherwise
    slip         how far the object has slipped, as an object with slip_mm, slip_rate_mm_s,
                 slip_compliance, the standard deviation of each (…_sd…) and slip_seen; null
                 where the monitor does not follow it
    since_s      since when this state has lasted, on the same clock; null where unknown
    order        none, grip, hold or stop
    order_reason why, in words
    force_n      newtons, with grip, hold and stop; null with none. It never falls, but for
                 a "gripping" of the robot's own (below)
    expires_in_s void this long after it was sent; null for a stop, which never expires
    grasp        which grasp this is, from 1: it grows with each new grasp that begins. That
                 alone: `force_n` stays, since only the robot knows what its hand holds now

The receiver must act on silence itself: with no datagram for `expires_in_s`, hold or stop. It
may answer, to the address that the datagrams come from, one JSON object a datagram:

    {"schema": "taxel-action-1", "do": "disarm"}
        act no more; nothing but a person at taxel arms again
    {"schema": "taxel-action-1", "do": "gripping", "force_n": 15.0}
        my own program grips with this force: raises begin here. Not once stopped, not with
        less while the grasp is in doubt, and not where taxel drives a gripper itself. Above the
        largest force that taxel orders, hold takes the place of grip: nothing is lowered

Answers count from the very address and port that the datagrams go to; what others send, the
system refuses. UDP does not encrypt, and knows who answers by address alone: keep it on this
machine or on a line of its own. Nothing here waits: a datagram for which the buffer has no room,
and an order that expires before it can be sent, are dropped and counted. Knows nothing about
grippers or models.

Background of our choices: docs/decisions/0016.
"""

from __future__ import annotations

import ipaddress
import json
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

from taxel.actions.answer_output import Recognised, finite_number, recognised_of
from taxel.actions.interlock import Order, OrderKind
from taxel.actions.udp_line import UdpLine
from taxel.clock import Clock, SystemClock
from taxel.decisions.stability import Stability, StabilityDecision
from taxel.errors import BadInput

SCHEMA = "taxel-action-1"
_LONGEST = 512
"""Bytes of an answer. Source: our choice; the longest above has 70."""
_ANSWERS = 8
"""Answers taken in at a time: a flood must not hold up the tick. Source: our choice."""
_STRONGEST_N = 1e6
"""A force above this is no number of newtons. Source: our choice."""


@dataclass(frozen=True, slots=True)
class Disarm:
    """The robot's program wants no more orders."""


@dataclass(frozen=True, slots=True)
class Gripping:
    """The robot's program grips with a force of its own choice."""

    force_n: float
    """Newtons, at least 0."""


Word = Disarm | Gripping
"""What the other robot's program may say."""


def read_word(answer: object) -> Word | None:
    """Return what an answer says; None where it says nothing that is known.

    Args:
        answer: A datagram's bytes, or what a function returned: such an object, or "disarm".
    """
    if isinstance(answer, bytes):
        try:
            answer = json.loads(answer) if len(answer) <= _LONGEST else None
        except (ValueError, RecursionError):
            return None
        if not isinstance(answer, dict) or answer.get("schema") != SCHEMA:
            return None
    if answer == "disarm":
        return Disarm()
    if not isinstance(answer, dict):
        return None
    if answer.get("do") == "disarm":
        return Disarm()
    force_n = answer.get("force_n")
    if answer.get("do") != "gripping" or isinstance(force_n, bool):
        return None
    if isinstance(force_n, int | float) and 0 <= force_n < _STRONGEST_N:
        return Gripping(float(force_n))
    return None


@dataclass(frozen=True, slots=True, kw_only=True)
class Action:
    """What is sent to another robot; fields as above."""

    sequence: int
    time_s: float
    state: str
    reason: str
    probability: float | None
    score: float | None
    slip: dict[str, float | bool | None] | None
    since_s: float | None
    order: str
    order_reason: str
    force_n: float | None
    expires_in_s: float | None
    grasp: int = 1
    schema: str = SCHEMA

    def as_json(self) -> bytes:
        """Return it as the bytes of a datagram."""
        return json.dumps(asdict(self), allow_nan=False).encode()


def action_of(
    decision: StabilityDecision,
    order: Order,
    sequence: int,
    now_s: float,
    grasp: int = 1,
    least_n: float = -math.inf,
) -> Action:
    """Return what to send; a value that is not finite becomes None.

    Args:
        decision: The newest.
        order: What is ordered.
        sequence: Number of the datagram.
        now_s: The moment of sending, monotonic seconds.
        grasp: Which grasp this is, from 1.
        least_n: The force that was sent before, newtons: no less is sent now.
    """
    lasts_s = None if order.kind is OrderKind.STOP else max(0.0, order.expires_s - now_s)
    return Action(
        sequence=sequence,
        time_s=finite_number(now_s) or 0.0,
        state=_word(decision.state),
        reason=decision.reason,
        probability=None if decision.is_score else finite_number(decision.probability),
        score=finite_number(decision.probability) if decision.is_score else None,
        slip=None if decision.slip is None else decision.slip.as_dict(),
        since_s=finite_number(decision.since_s),
        order=order.kind.value,
        order_reason=order.reason,
        force_n=finite_number(max(order.force_n, least_n)),
        expires_in_s=finite_number(lasts_s),
        grasp=grasp,
    )


def _word(state: Stability) -> str:
    """Return a state's name in this schema, which knows four: between two grasps is UNKNOWN."""
    return (Stability.UNKNOWN if state is Stability.NO_GRASP else state).name


class _Output:
    """What both outputs send: the grasp's number, and a force that never falls by itself."""

    def __init__(self, clock: Clock | None) -> None:
        self._clock = clock or SystemClock()
        self._grasp = 1
        self._sent_n = -math.inf
        self._own_n = -math.inf
        """What the robot said last that it grips with, newtons."""

    def new_grasp(self) -> None:
        """Say from now on that another grasp has begun; the force sent stays."""
        self._grasp += 1

    def grips_with(self, force_n: float) -> None:
        """Begin again at the force that the robot says it grips with, newtons."""
        self._sent_n = self._own_n = force_n

    def _action(
        self, decision: StabilityDecision, order: Order, sequence: int, now_s: float
    ) -> Action | None:
        """Return what to send at this very moment; None where the order has expired.

        The tick's own time may be long ago: this process may have stood still since.
        """
        now_s = max(now_s, self._clock.now_s())
        if order.kind is not OrderKind.NONE and not order.valid(now_s):
            return None
        if order.kind is OrderKind.GRIP and order.force_n < self._own_n:
            reason = f"the robot grips with {self._own_n:g} N, and no more is ordered"
            order = replace(order, kind=OrderKind.HOLD, reason=reason)
        action = action_of(decision, order, sequence, now_s, self._grasp, self._sent_n)
        if action.force_n is not None:
            self._sent_n = action.force_n
        return action


class UdpOutput(_Output):
    """Send each action as a datagram; use it in a `with` block.

    Args:
        host: An IP address.
        port: Of the receiver, 1…65535.
        allow_other_hosts: Needed for any address that is not this machine's own loopback.
        clock: Looked at when something is sent; the host's unless given.

    Raises:
        BadInput: The address is none, or leaves this machine without being allowed to.
    """

    def __init__(
        self,
        host: str,
        port: int,
        allow_other_hosts: bool = False,
        clock: Clock | None = None,
    ) -> None:
        super().__init__(clock)
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
        self._line = UdpLine(address, port)
        self.sent = 0
        """Datagrams handed to the system."""
        self.dropped = 0
        """Datagrams that the system did not take, or whose order had expired."""
        self.refused = 0
        """Answers that said nothing known."""

    def send(self, decision: StabilityDecision, order: Order, now_s: float) -> None:
        """Send what is decided and ordered now; never waits, never raises for the network."""
        action = self._action(decision, order, self.sent + self.dropped + 1, now_s)
        if action is None:
            self.dropped += 1
            return
        self._send(action.as_json())

    def recognised(self, answer: Mapping[str, Any]) -> None:
        """Send what a recogniser has answered; never waits, never raises for the network."""
        number, now_s = self.sent + self.dropped + 1, self._clock.now_s()
        self._send(recognised_of(answer, number, now_s).as_json())

    def _send(self, content: bytes) -> None:
        if self._line.send(content):
            self.sent += 1
        else:
            self.dropped += 1

    def heard(self) -> list[Word]:
        """Return what the receiver has answered since the last call; never waits or raises."""
        words = [read_word(answer) for answer in self._line.take(_LONGEST + 1, _ANSWERS)]
        known = [word for word in words if word is not None]
        self.refused += len(words) - len(known)
        return known

    @property
    def lost(self) -> int:
        """What did not get out, or came back as nobody listens."""
        return self.dropped + self._line.returned

    def close(self) -> None:
        """Close the socket."""
        self._line.close()

    def __enter__(self) -> UdpOutput:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class CallbackOutput(_Output):
    """Call a function with each action and each answer, in the tick's own thread: it must be quick.

    What it returns may be an answer as above, or just "disarm". An exception of it is counted
    and kept in `last_error`; it never stops the tick.

    Args:
        call: The function.
        clock: Looked at when it is called; the host's unless given.
    """

    def __init__(
        self, call: Callable[[Action | Recognised], Any], clock: Clock | None = None
    ) -> None:
        super().__init__(clock)
        self._call = call
        self._words: list[Word] = []
        self.sent = 0
        """Calls that came back."""
        self.failed = 0
        """Calls that raised."""
        self.last_error = ""
        """The newest exception, in words."""

    def send(self, decision: StabilityDecision, order: Order, now_s: float) -> None:
        """Call the function with what is decided and ordered now."""
        action = self._action(decision, order, self.sent + self.failed + 1, now_s)
        try:
            if action is None:
                raise TimeoutError("the order had expired before it could be sent")
            word = read_word(self._call(action))
            self._words += [] if word is None else [word]
            self.sent += 1
        except Exception as error:  # whatever a user's function raises, the tick goes on
            self.failed += 1
            self.last_error = f"{type(error).__name__}: {error}"

    def recognised(self, answer: Mapping[str, Any]) -> None:
        """Call the function with what a recogniser has answered."""
        try:
            number, now_s = self.sent + self.failed + 1, self._clock.now_s()
            self._call(recognised_of(answer, number, now_s))
            self.sent += 1
        except Exception as error:  # as above
            self.failed += 1
            self.last_error = f"{type(error).__name__}: {error}"

    def heard(self) -> list[Word]:
        """Return what the function has answered since the last call."""
        words, self._words = self._words, []
        return words

    @property
    def lost(self) -> int:
        """What was not taken."""
        return self.failed

    def close(self) -> None:
        """Nothing to let go of."""


def open_udp(name: str, allow_other_hosts: bool, clock: Clock | None = None) -> UdpOutput:
    """Open host:port as an address writes it, [::1]:5005 for IPv6.

    Raises:
        BadInput: It is no host and port.
    """
    host, found, port = name.rpartition(":")
    if not found or not re.fullmatch(r"[0-9]{1,5}", port):
        raise BadInput("udp://HOST:PORT", f"udp://{name}", "try udp://127.0.0.1:5005")
    return UdpOutput(host.strip("[]"), int(port), allow_other_hosts, clock)
