"""What a page may say to the server: nine short commands, each checked to the letter.

One is about the gripper: to disarm, the safe direction. None arms or moves it, but that the program
that records a plan with a gripper closes it when a person is ready. Knows nothing about sockets.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NoReturn

from taxel.recordings.trial_log import OUTCOMES, REACTIONS

STEPS = ("ready", "again", "discard")
"""How a plan of trials may go on."""
LARGEST_BYTES = 4096
"""Of one message. Source: our choice, docs/decisions/0018; 16 labels fit."""
MOST_LABELS = 16
LONGEST_VALUE = 64
"""Characters of a label's value."""
FASTEST = 64.0
"""Of a replay, times real time; the slowest is its inverse."""
_KEY = re.compile(r"[a-z][a-z0-9_]{0,31}")


class RefusedMessage(ValueError):
    """A message that is no command; its text is what the page shows."""


@dataclass(frozen=True, slots=True)
class Seen:
    """The page took in push number `number`: the next may be sent."""

    number: int


@dataclass(frozen=True, slots=True)
class Acknowledge:
    """A person saw the alarm."""


@dataclass(frozen=True, slots=True)
class Disarm:
    """A person wants the gripper to be given no more orders."""


@dataclass(frozen=True, slots=True)
class Record:
    """Start (`on`) or stop recording."""

    on: bool
    labels: dict[str, str]


@dataclass(frozen=True, slots=True)
class React:
    """A person's reaction to a grasp, or its outcome; a word of `trial_log`."""

    what: str


@dataclass(frozen=True, slots=True)
class Step:
    """A person says how a plan of trials goes on: ready, again or discard."""

    what: str


@dataclass(frozen=True, slots=True)
class Seek:
    """Put the replay's cursor at a moment, seconds of the recording's clock."""

    time_s: float


@dataclass(frozen=True, slots=True)
class Play:
    """Let the replay's cursor run, times real time."""

    speed: float


@dataclass(frozen=True, slots=True)
class Pause:
    """Hold the replay's cursor."""


Command = Seen | Acknowledge | Disarm | Record | React | Step | Seek | Play | Pause


def read_command(message: str | bytes) -> Command:
    """Return the command that a message is.

    Args:
        message: As it came over the WebSocket; bytes are never a command.

    Raises:
        RefusedMessage: It is anything but exactly one of the commands.
    """
    if isinstance(message, bytes):
        raise RefusedMessage("needed text; got bytes")
    if len(message) > LARGEST_BYTES or len(message.encode("utf-8", "replace")) > LARGEST_BYTES:
        raise RefusedMessage(f"needed at most {LARGEST_BYTES} bytes")
    try:
        command = json.loads(message, object_pairs_hook=_once, parse_constant=_no_constant)
    except RefusedMessage:
        raise
    except (ValueError, RecursionError) as error:
        raise RefusedMessage("needed JSON") from error
    if not isinstance(command, dict):
        raise RefusedMessage("needed a JSON object")
    name = command.pop("do", None)
    if not isinstance(name, str) or name not in _COMMANDS:
        raise RefusedMessage(f"needed do as one of {', '.join(_COMMANDS)}")
    fields, build = _COMMANDS[name]
    if set(command) != set(fields):
        raise RefusedMessage(f"needed exactly {', '.join(('do', *fields))}")
    return build(command)


def check_labels(given: object) -> dict[str, str]:
    """Return labels that may be written into a recording.

    Raises:
        RefusedMessage: There are too many, a name is not lower-case ASCII letters, digits and _,
            or a value is empty, too long, or holds characters that cannot be printed.
    """
    if not isinstance(given, dict):
        raise RefusedMessage("needed labels as an object")
    if len(given) > MOST_LABELS:
        raise RefusedMessage(f"needed at most {MOST_LABELS} labels")
    labels: dict[str, str] = {}
    for key, value in given.items():
        if not _KEY.fullmatch(key):
            raise RefusedMessage("needed label names of a to z, 0 to 9 and _, 32 at most")
        if not isinstance(value, str) or not 1 <= len(value) <= LONGEST_VALUE:
            raise RefusedMessage(f"needed label values of 1 to {LONGEST_VALUE} characters")
        if not value.isprintable() or value != value.strip():
            raise RefusedMessage("needed label values of printable characters, no space around")
        labels[key] = value
    return labels


def _seen(given: dict[str, Any]) -> Command:
    number = given["number"]
    if type(number) is not int or not 0 <= number < 2**53:
        raise RefusedMessage("needed number as a whole number")
    return Seen(number)


def _record(given: dict[str, Any]) -> Command:
    if type(given["on"]) is not bool:
        raise RefusedMessage("needed on as true or false")
    return Record(given["on"], check_labels(given["labels"]))


def _one_of(given: dict[str, Any], words: tuple[str, ...]) -> str:
    what = given["what"]
    if not isinstance(what, str) or what not in words:
        raise RefusedMessage(f"needed what as one of {', '.join(words)}")
    return what


def _seek(given: dict[str, Any]) -> Command:
    return Seek(_number(given["time_s"], "time_s", -1e12, 1e12))


def _play(given: dict[str, Any]) -> Command:
    return Play(_number(given["speed"], "speed", 1 / FASTEST, FASTEST))


def _number(value: object, name: str, least: float, most: float) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not least <= value <= most:
        raise RefusedMessage(f"needed {name} as a number within {least:g} and {most:g}")
    return float(value)


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        raise RefusedMessage("needed each name once")
    return found


def _no_constant(_: str) -> NoReturn:
    raise RefusedMessage("needed finite numbers")


_COMMANDS: dict[str, tuple[tuple[str, ...], Callable[[dict[str, Any]], Command]]] = {
    "seen": (("number",), _seen),
    "acknowledge": ((), lambda _: Acknowledge()),
    "disarm": ((), lambda _: Disarm()),
    "record": (("on", "labels"), _record),
    "react": (("what",), lambda given: React(_one_of(given, (*REACTIONS, *OUTCOMES)))),
    "step": (("what",), lambda given: Step(_one_of(given, STEPS))),
    "seek": (("time_s",), _seek),
    "play": (("speed",), _play),
    "pause": ((), lambda _: Pause()),
}
"""Name → its other fields, all needed, and what builds it."""
