"""A table from what was recognised to what is to be done: class, least confidence, action.

    class,least_confidence,action
    aluminium,0.9,metal bin
    aluminium,0.6,sort by hand
    *,0.6,glass and plastic

A column `target` may stand beside: a line then holds for that label alone. A class may have
several lines: that with the largest confidence which is reached counts. `*` is each class that
has no line of its own, UNKNOWN a class like any other but for `*`. What no line is for gives no
action. An action is a word for another program or a person: nothing is moved by it here. A column
`alarm` may stand beside, too: warning or danger, or nothing. Knows nothing about models, sources or
sockets.

Background of our choices: docs/decisions/0046.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from taxel.actions.alarm import Level
from taxel.decisions.recognition import UNKNOWN
from taxel.errors import BadTable
from taxel.foreign.files import MIB
from taxel.foreign.text_rows import rows_of

ANY = "*"
"""In the column class: each that has no line of its own."""
_COLUMNS = ("class", "least_confidence", "action")
_TARGET, _ALARM = "target", "alarm"
_LONGEST = 64
"""Characters of an action. Source: our choice; it is shown on the page and read aloud."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Rule:
    """One line."""

    label: str
    """A class, UNKNOWN or `ANY`."""
    least: float
    """Confidence from which on it holds, 0…1."""
    action: str
    target: str = ""
    """The label that it is about; empty for all."""
    alarm: Level | None = None
    """The alarm that is on while this is the newest answer."""


@dataclass(frozen=True, slots=True)
class RuleTable:
    """All lines of a table."""

    rules: tuple[Rule, ...]

    @property
    def alarms(self) -> bool:
        """True where a line raises an alarm, which a station alone can show."""
        return any(rule.alarm is not None for rule in self.rules)

    def action(self, target: str, label: str, confidence: float | None) -> str:
        """Return the action for an answer; empty where no line of the table fits: see `rule`."""
        found = self.rule(target, label, confidence)
        return "" if found is None else found.action

    def rule(self, target: str, label: str, confidence: float | None) -> Rule | None:
        """Return the line that holds for an answer; None where none does.

        Args:
            target: What was recognised, such as "material".
            label: Its class, or UNKNOWN.
            confidence: 0…1; None or NaN where there is none, which reaches a least of 0 alone.
        """
        sure = 0.0 if confidence is None or math.isnan(confidence) else confidence
        about = [rule for rule in self.rules if rule.target in ("", target)]
        own = [rule for rule in about if rule.label == label]
        if not own and label != UNKNOWN:
            own = [rule for rule in about if rule.label == ANY]
        reached = [rule for rule in own if sure >= rule.least]
        return max(reached, key=lambda rule: rule.least, default=None)


def read_rules(path: Path | str, known: Mapping[str, Sequence[str]]) -> RuleTable:
    """Return a table's rules.

    Args:
        path: A CSV file.
        known: Target → its classes, of every recogniser that runs.

    Raises:
        BadTable: Its columns or a cell cannot be used, or it names what is never recognised.
        BadFile: It is no text, or too large.
        OSError: It is not there.
    """
    rows = rows_of(Path(path), MIB)
    header = [cell.strip() for cell in rows[0][1]] if rows else []
    more = sorted(set(header) - set(_COLUMNS))
    if sorted(header) != sorted((*_COLUMNS, *more)) or not {_TARGET, _ALARM}.issuperset(more):
        raise BadTable(
            "a first line class,least_confidence,action, and target and alarm where wanted",
            f"{','.join(header) or 'nothing'} in {path}", "mend the first line",
        )  # fmt: skip
    if not rows[1:]:
        raise BadTable("at least one line of rules", f"none in {path}", "add one")
    rules = []
    for number, cells in rows[1:]:
        where = f"line {number} of {path}"
        if len(cells) != len(header):
            raise BadTable(f"{len(header)} cells", f"{len(cells)} in {where}", "mend the line")
        rules.append(_rule(dict(zip(header, map(str.strip, cells), strict=True)), known, where))
    twice = [rule for at, rule in enumerate(rules) if _key(rule) in map(_key, rules[:at])]
    if twice:
        raise BadTable(
            "one action for a class and confidence",
            f"two for {twice[0].label} from {twice[0].least:g} in {path}", "leave one out",
        )  # fmt: skip
    return RuleTable(tuple(rules))


def _key(rule: Rule) -> tuple[str, str, float]:
    return rule.target, rule.label, rule.least


def _rule(cells: Mapping[str, str], known: Mapping[str, Sequence[str]], where: str) -> Rule:
    target, label, action = cells.get(_TARGET, ""), cells["class"], cells["action"]
    if target and target not in known:
        raise BadTable(
            f"a target among {', '.join(known)}", f"{target!r} in {where}", "mend the line"
        )
    classes = {name for own, names in known.items() if target in ("", own) for name in names}
    if label not in {*classes, ANY, UNKNOWN}:
        raise BadTable(
            f"a class among {', '.join(sorted(classes))}, {UNKNOWN} and {ANY}",
            f"{label!r} in {where}", "mend the line",
        )  # fmt: skip
    if not 1 <= len(action) <= _LONGEST or not action.isprintable():
        raise BadTable(
            f"an action of 1 to {_LONGEST} printable characters", f"{action!r} in {where}",
            "mend the line",
        )  # fmt: skip
    try:
        least = float(cells["least_confidence"])
    except ValueError:
        least = math.nan
    if not 0 <= least <= 1:
        raise BadTable(
            "a least_confidence within 0 and 1",
            f"{cells['least_confidence']!r} in {where}", "mend the line",
        )  # fmt: skip
    if label == UNKNOWN and least > 0:
        raise BadTable(
            f"least_confidence 0 for {UNKNOWN}, which has no confidence",
            f"{least:g} in {where}", "write 0",
        )  # fmt: skip
    alarm = cells.get(_ALARM, "")
    if alarm not in ("", *Level):
        raise BadTable(
            f"an alarm that is {' or '.join(Level)}, or nothing", f"{alarm!r} in {where}",
            "mend the line",
        )  # fmt: skip
    level = Level(alarm) if alarm else None
    return Rule(label=label, least=least, action=action, target=target, alarm=level)
