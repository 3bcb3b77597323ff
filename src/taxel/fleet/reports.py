"""What a station reports to its fleet: state, alarms, losses and versions; JSON, once a second.

    taxel/fleet/1/STATION/report   retained; the newest report
    taxel/fleet/1/STATION/alive    retained; {"boot", "alive", "ended"}; its last will says false

A report that is received is not trusted: its size and every field are checked. Knows nothing
about MQTT.

Background of our choices: docs/decisions/0052.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from taxel.foreign.json_text import Fields, parse_json

PERIOD_S = 1.0
"""Time between two reports, seconds. Source: the most that a fleet's broker is asked to take
from a station; our choice, docs/decisions/0052."""
LARGEST = 1 << 14
"""Bytes of the largest report that is read. Source: our choice; ours are about 1.5 KB."""
ROOT = "taxel/fleet/1"
REPORT, ALIVE = "report", "alive"
_MOST = 16
"""Alarms, sources, processes and bundles in a report, each; further ones are counted only."""
_LONGEST = 300
"""Characters of a text in a report."""
_SHORTER = (_LONGEST, 100, 30, 12)
"""Characters of the texts in lists, the most that a report of many has room for. Our choice."""
_LARGE = 1e15
"""Seconds above which no time or age in a report is believed."""
_LEVELS = ("warning", "danger")


@dataclass(frozen=True, slots=True, kw_only=True)
class Alarm:
    """One alarm of a station."""

    kind: str
    text: str
    level: str
    """"warning" or "danger"."""
    age_s: float
    acknowledged: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """One source or process of a station."""

    name: str
    state: str
    lost: int
    """Scans and frames a source lost, or messages a process missed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """A station at one moment."""

    station: str
    boot: str
    """Drawn at each start, so that an old last will and a new start can be distinguished."""
    number: int
    """Reports before this, since the start."""
    version: str
    """Of taxel."""
    bundles: tuple[str, ...]
    """Names of what runs, each with the beginning of its SHA-256."""
    state: str
    reason: str
    age_s: float
    """How long the state has held, seconds."""
    alarms: tuple[Alarm, ...]
    sources: tuple[Part, ...]
    processes: tuple[Part, ...]
    lost: int
    """Everything that was lost or missed, counted since the start."""
    recording: bool
    sent_unix_s: float
    """The station's wall clock; only as true as that is."""

    def as_bytes(self) -> bytes:
        """Return the report as JSON of at most `LARGEST` bytes; long texts are cut for that."""
        content = b""
        for longest in _SHORTER:
            values = {name: _shortened(value, longest) for name, value in asdict(self).items()}
            text = json.dumps(values, allow_nan=False, ensure_ascii=False, separators=(",", ":"))
            content = text.encode("utf-8", "replace")  # a path may hold half a letter
            if len(content) <= LARGEST:
                break
        return content


@dataclass(frozen=True, slots=True, kw_only=True)
class Identity:
    """A station's name, which start of it this is, and its versions."""

    station: str
    boot: str
    version: str
    bundles: tuple[str, ...]


def make_report(
    identity: Identity,
    number: int,
    state: Mapping[str, Any],
    sources: Sequence[Mapping[str, Any]],
    now_unix_s: float,
) -> Report:
    """Return a station's report.

    Args:
        identity: Who reports.
        number: Reports before this one.
        state: The station's newest state, as its page has it; empty before the first.
        sources: The newest note of each source.
        now_unix_s: Wall time, seconds since 1970.
    """
    now_s = float(state.get("time_s", 0.0))
    parts = state.get("consumers", [])
    return Report(
        station=identity.station, boot=identity.boot, number=number, version=identity.version,
        bundles=identity.bundles[:_MOST],
        state=_cut(state.get("state", "UNKNOWN")), reason=_cut(state.get("reason", "")),
        age_s=_age(now_s, state.get("since_s")),
        alarms=tuple(
            Alarm(kind=_cut(a["kind"]), text=_cut(a["text"]), level=_cut(a["level"]),
                  age_s=_age(now_s, a["since_s"]), acknowledged=bool(a["acknowledged"]))
            for a in state.get("alarms", [])[:_MOST]
        ),
        sources=tuple(
            Part(name=_cut(s["name"]), state=_cut(s["state"]), lost=int(s["lost"]))
            for s in sources[:_MOST]
        ),
        processes=tuple(
            Part(name=_cut(c["name"]), state=_cut(c["state"]), lost=int(c["dropped"]))
            for c in parts[:_MOST]
        ),
        lost=sum(int(s["lost"]) for s in sources) + sum(int(c["dropped"]) for c in parts),
        recording=bool(state.get("recording", {}).get("on")),
        sent_unix_s=now_unix_s,
    )  # fmt: skip


def read_report(content: bytes) -> Report:
    """Return the report that a message holds.

    Raises:
        ValueError: It is none.
    """
    if len(content) > LARGEST:
        raise ValueError(f"needed a report of at most {LARGEST} bytes; got {len(content)}")
    given = Fields(parse_json(content, finite=True), "a report")
    given.only(Report.__dataclass_fields__)
    return Report(
        station=_text(given, "station"), boot=_text(given, "boot"),
        number=given.count("number", 0, 2**53), version=_text(given, "version"),
        bundles=tuple(map(_cut, given.texts("bundles")[:_MOST])),
        state=_text(given, "state"), reason=_text(given, "reason"),
        age_s=given.number("age_s", 0.0, _LARGE),
        alarms=tuple(_alarm(alarm) for alarm in given.items("alarms")[:_MOST]),
        sources=tuple(_part(entry) for entry in given.items("sources")[:_MOST]),
        processes=tuple(_part(entry) for entry in given.items("processes")[:_MOST]),
        lost=given.count("lost", 0, 2**53), recording=given.flag("recording"),
        sent_unix_s=given.number("sent_unix_s", 0.0, _LARGE),
    )  # fmt: skip


def alive_bytes(boot: str, *, alive: bool, ended: bool = False) -> bytes:
    """Return the message that says whether a station is there, as JSON.

    Args:
        boot: Which start of it.
        alive: False in the last will.
        ended: It ended by itself.
    """
    return json.dumps({"boot": boot, "alive": alive, "ended": ended}).encode()


def read_alive(content: bytes) -> tuple[str, bool, bool]:
    """Return (boot, alive, ended).

    Raises:
        ValueError: It is none.
    """
    if len(content) > LARGEST:
        raise ValueError("needed a short message")
    given = Fields(parse_json(content), "a sign of life")
    given.only(("boot", "alive", "ended"))
    return _text(given, "boot"), given.flag("alive"), given.flag("ended")


def topic_of(station: str, what: str) -> str:
    """Return the topic of a station's reports or of its signs of life."""
    return f"{ROOT}/{station}/{what}"


def _alarm(value: object) -> Alarm:
    given = Fields(value, "an alarm")
    given.only(Alarm.__dataclass_fields__)
    level = given.text("level")
    if level not in _LEVELS:
        raise ValueError(f"needed a level of {' or '.join(_LEVELS)}")
    return Alarm(
        kind=_text(given, "kind"), text=_text(given, "text"), level=level,
        age_s=given.number("age_s", 0.0, _LARGE), acknowledged=given.flag("acknowledged"),
    )  # fmt: skip


def _part(value: object) -> Part:
    given = Fields(value, "a source or process")
    given.only(Part.__dataclass_fields__)
    return Part(name=_text(given, "name"), state=_text(given, "state"),
                lost=given.count("lost", 0, 2**53))  # fmt: skip


def _text(given: Fields, name: str) -> str:
    return _cut(given.text(name))


def _shortened(value: object, longest: int) -> object:
    """Return a field of a report with the texts in its lists cut."""
    if isinstance(value, tuple):
        return [_shortened(entry, longest) if isinstance(entry, dict) else entry[:longest]
                for entry in value]  # fmt: skip
    if isinstance(value, dict):
        return {key: text[:longest] if isinstance(text, str) else text
                for key, text in value.items()}  # fmt: skip
    return value


def _cut(text: object) -> str:
    return str(text)[:_LONGEST]


def _age(now_s: float, since_s: object) -> float:
    age = now_s - float(since_s) if isinstance(since_s, int | float) else 0.0
    return max(0.0, age) if math.isfinite(age) else 0.0
