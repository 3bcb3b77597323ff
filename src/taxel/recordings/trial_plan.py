"""A plan of trials, as a table: what is to be recorded, how often, and what is done already.

    group:session,group:object,label:shape,label:material,times
    monday,ball,sphere,glass,7

Each line is so many trials of one kind, in the table's order; each trial becomes one recording,
trial-001.mcap and so on, which carries the line's labels and groups. A run that was interrupted
goes on where recordings are missing. Knows nothing about hands, grippers or screens.

Background of our choices: docs/decisions/0043.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from taxel.errors import BadInput, BadTable
from taxel.foreign.files import MIB
from taxel.foreign.text_rows import rows_of
from taxel.plain_text import number_of
from taxel.recordings.reader import read_manifest

MOST_TRIALS = 9_999
"""Trials of a plan; names have room for four digits. Source: our choice."""
_TIMES = "times"
_KINDS = ("label", "group")


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedTrial:
    """One line of a plan of trials: a recording that is still to be made, or was."""

    number: int
    """From 1, in the plan's order."""
    labels: Mapping[str, str]
    """What may be learned."""
    groups: Mapping[str, str]
    """What it belongs to; "trial_number" comes on top."""

    @property
    def file_name(self) -> str:
        """Name of its recording."""
        return f"trial-{self.number:03d}.mcap"

    @property
    def words(self) -> str:
        """The trial's groups and labels as text, such as "session 3, shape sphere"."""
        pairs = {**self.groups, **self.labels}
        return ", ".join(f"{k} {v}" for k, v in pairs.items() if k != "trial_number")


def read_plan(path: Path) -> list[PlannedTrial]:
    """Return the trials of a plan, in order.

    Raises:
        BadTable: The table is not there, has other columns, no line, or a cell that cannot be
            used.
        BadFile: It is no text, or too large.
        OSError: It may not be read.
    """
    try:
        rows = rows_of(path, MIB)
    except FileNotFoundError as error:
        raise BadTable(
            f"the plan {path}", "no such file",
            "check the path; the plans in plans/ are found from the root of a clone of taxel",
        ) from error  # fmt: skip
    header = [cell.strip() for cell in rows[0][1]] if rows else []
    names = [_name_of(cell, path) for cell in header]
    if not names or len(set(names)) < len(names) or not any(k != _TIMES for k, _ in names):
        raise BadTable(
            "a first line of label:NAME and group:NAME columns, each once, and times",
            f"{','.join(header) or 'nothing'} in {path}",
            "write for example: group:session,group:object,label:shape,times",
        )
    trials: list[PlannedTrial] = []
    for line, cells in rows[1:]:
        trials += _trials_of(cells, names, len(trials), f"{path}, line {line}")
    if not 1 <= len(trials) <= MOST_TRIALS:
        raise BadTable(
            f"a plan of 1 to {MOST_TRIALS} trials", f"{len(trials)} in {path}", "mend the plan"
        )
    return trials


def _name_of(cell: str, path: Path) -> tuple[str, str]:
    """Return a column's kind and name."""
    if cell == _TIMES:
        return _TIMES, ""
    kind, _, name = cell.partition(":")
    if kind not in _KINDS or not name.strip():
        raise BadTable(
            "columns label:NAME, group:NAME and times", f"{cell!r} in {path}", "rename the column"
        )
    return kind, name.strip()


def _trials_of(
    cells: Sequence[str], names: Sequence[tuple[str, str]], before: int, where: str
) -> list[PlannedTrial]:
    cells = [cell.strip() for cell in cells]
    if len(cells) != len(names) or not all(cells):
        raise BadTable(
            f"{number_of(len(names), 'cell')}, none empty", f"{cells} in {where}", "fill the line"
        )
    found: dict[str, dict[str, str]] = {kind: {} for kind in (*_KINDS, _TIMES)}
    for (kind, name), cell in zip(names, cells, strict=True):
        found[kind][name] = cell
    times = found[_TIMES].get("", "1")
    if not re.fullmatch(r"[0-9]{1,9}", times) or not 1 <= int(times) <= MOST_TRIALS:
        raise BadTable(f"times of 1 to {MOST_TRIALS}", f"{times[:40]!r} in {where}", "mend it")
    return [
        PlannedTrial(
            number=number,
            labels=found["label"],
            groups={**found["group"], "trial_number": str(number)},
        )
        for number in range(before + 1, before + int(times) + 1)
    ]


def done_of(trials: Sequence[PlannedTrial], folder: Path) -> list[PlannedTrial]:
    """Return the trials whose recordings are complete in a folder.

    Raises:
        BadTable: A recording there is of another plan.
        BadRecording: One cannot be read.
    """
    done = []
    for trial in trials:
        path = folder / trial.file_name
        if not path.exists():
            continue
        manifest = read_manifest(path)
        own = {**manifest.labels, **manifest.groups}
        wanted = {**trial.labels, **trial.groups}
        if any(own.get(key) != value for key, value in wanted.items()):
            raise BadTable(
                f"{path.name} of this plan ({trial.words})", f"another trial in {folder}",
                "name another folder, or the plan that it was recorded by",
            )  # fmt: skip
        done.append(trial)
    return done


def refuse_made(path: Path) -> None:
    """Refuse to make a trial's recording once more, before anything moves.

    Raises:
        BadInput: It is there: another program follows the plan in the same folder.
    """
    if path.exists():
        raise BadInput(
            "a folder in which this program alone follows the plan",
            f"{path}, which another one has made meanwhile",
            "let that one end, or name another folder; then run the same command again",
        )


def balance(
    trials: Sequence[PlannedTrial], done: Sequence[PlannedTrial]
) -> dict[str, dict[str, tuple[int, int]]]:
    """Return label or group → value → (recorded, planned)."""
    found: dict[str, dict[str, tuple[int, int]]] = {}
    ready = {trial.number for trial in done}
    for trial in trials:
        for key, value in {**trial.groups, **trial.labels}.items():
            if key != "trial_number":
                made, planned = found.setdefault(key, {}).get(value, (0, 0))
                found[key][value] = made + (trial.number in ready), planned + 1
    return found


def balance_line(trials: Sequence[PlannedTrial], done: Sequence[PlannedTrial]) -> str:
    """Return how far the plan is, in one line: all trials, then each value of each column."""
    parts = [f"{len(done)} of {number_of(len(trials), 'trial')}"]
    for key, values in balance(trials, done).items():
        if 1 < len(values) <= 12:
            each = ", ".join(f"{value} {made}/{of}" for value, (made, of) in values.items())
            parts.append(f"{key}: {each}")
    return "; ".join(parts)
