"""Rows of a bench: a measured value beside its goal, and a store for the slow ones.

Knows nothing about what is measured.
"""

from __future__ import annotations

import json
import shlex
import subprocess
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal

from rich.table import Table
from rich.text import Text

from taxel.errors import BadInput
from taxel.plain_text import visible_line
from taxel.recordings.whole import write_whole

STORE = Path(__file__).with_name("stored")
"""The figures that ship: what takes longer than a few minutes, as measured last."""


def store_folder(given: Path | None) -> Path:
    """Return where `--full` keeps its rows: in a checkout, the figures that ship.

    Raises:
        BadInput: taxel is installed, and no folder is given.
    """
    if given is not None:
        return given
    if (STORE.parents[3] / "pyproject.toml").is_file():
        return STORE
    raise BadInput(
        "a folder for what --full measures", "an installed taxel, which is left as it is",
        "name one with --store FOLDER",
    )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One measured figure."""

    name: str
    """What was measured; an accuracy's name says its split."""
    value: float | None
    """None where it could not be measured; the note says why."""
    unit: str
    goal: str = ""
    """Such as "<= 90", ">= 0.96" or "0.72 … 0.82"; empty where there is none."""
    ok: bool | None = None
    """None where there is no goal, or no value."""
    note: str = ""
    """What a reader must know."""
    stamp: str = ""
    """Commit, data and command of a stored row; empty for one measured now."""


Side = Literal["<=", ">="]


def row(name: str, value: float, unit: str, side: Side, limit: float, note: str = "") -> Row:
    """Return a row with a goal on one side."""
    value = float(value)  # of NumPy's numbers JSON takes none
    ok = value <= limit if side == "<=" else value >= limit
    return Row(name=name, value=value, unit=unit, goal=f"{side} {limit:g}", ok=ok, note=note)


def accuracy_row(name: str, value: float, note: str = "") -> Row:
    """Return an accuracy of 0…1 as a row without a goal; its name says the split."""
    return Row(name=name, value=value, unit="accuracy", note=note)


def quietest(name: str, rounds: Sequence[float], unit: str, limit: float, note: str = "") -> Row:
    """Return the least of some rounds as a row; all of them stand in its note.

    A time can only be lengthened by what else runs on a shared machine, so the least of
    a few rounds says most about the program. Each round's figure is itself a median
    or a percentile over many repeats.
    """
    each = ", ".join(f"{value:.1f}" for value in rounds)
    rounds_note = f"the quietest of {len(rounds)} rounds ({each})"
    return row(
        name, min(rounds), unit, "<=", limit, f"{rounds_note}; {note}" if note else rounds_note
    )


def row_within(
    name: str, value: float, unit: str, middle: float, off: float, note: str = ""
) -> Row:
    """Return a row whose goal is an interval."""
    low, high = middle - off, middle + off
    ok = low - 1e-9 <= value <= high + 1e-9
    return Row(name=name, value=value, unit=unit, goal=f"{low:.2f} … {high:.2f}", ok=ok, note=note)


def missing(name: str, unit: str, goal: str, why: str) -> Row:
    """Return a row that could not be measured here."""
    return Row(name=name, value=None, unit=unit, goal=goal, ok=None, note=why)


def store(
    bench: str, rows: Iterable[Row], data: str, *, only: str = "", folder: Path | None = None
) -> list[Row]:
    """Keep slow rows with commit, data hash, time and command; return them stamped.

    Args:
        bench: The bench's name.
        rows: What was measured.
        data: Digest of the recordings that were used.
        only: What `--only` chose: rows kept earlier under other names stay as they are.
        folder: Where; the figures that ship unless given.
    """
    stamp = f"commit {commit()}, data {data[:12]}, {today()}, taxel bench {bench} --full"
    if only:
        stamp += f' --only "{only}"' if "'" in only else f" --only {shlex.quote(only)}"
    stamped = [replace(row, stamp=stamp) for row in rows]
    if only:
        new = {row.name for row in stamped}
        stamped = [row for row in stored(bench, folder) if row.name not in new] + stamped
    text = json.dumps([asdict(row) for row in stamped], indent=1)
    folder = folder or STORE
    folder.mkdir(parents=True, exist_ok=True)
    write_whole(folder / f"{bench}.json", text + "\n")
    return stamped


def stored(bench: str, folder: Path | None = None) -> list[Row]:
    """Return the rows that `--full` kept; none where it never ran."""
    path = (folder or STORE) / f"{bench}.json"
    if not path.exists():
        return []
    return [Row(**entry) for entry in json.loads(path.read_text())]


def measure(
    steps: Iterable[tuple[str, Callable[[], list[Row]]]], on_step: Callable[[str], None]
) -> list[Row]:
    """Run measurements one after another; each gives one or more rows."""
    rows: list[Row] = []
    for name, step in steps:
        on_step(name)
        rows += step()
    return rows


def rows_table(rows: list[Row]) -> Table:
    """Return the rows for the terminal."""
    table = Table(pad_edge=False)
    for column in ("figure", "value", "unit", "goal", "", "note"):
        table.add_column(column, justify="right" if column == "value" else "left")
    for row in rows:
        mark = {True: Text("met", "green"), False: Text("missed", "red"), None: Text("–")}[row.ok]
        value = "–" if row.value is None else short(row.value)
        note = " · ".join(part for part in (row.note, row.stamp) if part)
        table.add_row(visible_line(row.name), value, row.unit, row.goal, mark, visible_line(note))
    return table


def short(value: float) -> str:
    """Return a figure as tables show it: whole from 1000 on, else to four digits."""
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.4g}"


def today() -> str:
    """Return the date, year first."""
    return datetime.now(UTC).strftime("%Y-%m-%d")


def commit() -> str:
    """Return the short name of the commit that is measured; "unknown" outside a checkout."""
    found = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"],
        capture_output=True,
        text=True,
        check=False,
        cwd=Path(__file__).parent,
    )
    return found.stdout.strip() or "unknown"
