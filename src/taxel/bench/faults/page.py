"""The table of faults as a page: what goes wrong, how soon it is found, what is lost.

Joins the rows of `taxel bench faults` with the faults that they measure. A row that belongs to no
fault still stands on the page, in a table of its own. Knows nothing about how rows are measured.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from taxel.bench.faults.catalogue import FAULTS
from taxel.bench.rows import Row, commit, today
from taxel.recordings.whole import write_whole

COMMAND = "taxel bench faults --page docs/reference/faults.md"
_NOT_HERE = "not measured"


@dataclass(frozen=True, slots=True)
class _Cell:
    """One cell of the table, and the rows that it took."""

    text: str
    rows: tuple[Row, ...]


def fault_page(rows: Sequence[Row]) -> str:
    """Return the page as Markdown.

    Args:
        rows: What was measured, by this run or stored.
    """
    used: set[str] = set()
    lines = [
        "# Faults",
        "",
        f"Written by `{COMMAND}`; do not edit by hand. Each fault is brought about in real "
        "processes and files, on emulated boards and cameras. A dash: the column does not apply. "
        "Goals, spreads and notes of all figures stand in the second table.",
        "",
        f"Measured at commit {commit()} on {today()}; a row that takes longer than a few minutes "
        "has a stamp of its own.",
        "",
        "| fault | found in | lost or harmed | state shown |",
        "|---|---|---|---|",
    ]
    for fault in FAULTS:
        found, lost = _cell(fault.found, rows), _cell(fault.lost, rows)
        used |= {row.name for row in (*found.rows, *lost.rows)}
        lines.append(f"| {_text(fault.what)} | {found.text} | {lost.text} | {_text(fault.shown)} |")
    lines += ["", "## The figures", "", "| figure | value | goal | | note |",
              "|---|---:|---|---|---|"]  # fmt: skip
    lines += [_figure(row) for row in rows]
    return "\n".join(lines) + "\n"


def write_fault_page(path: Path, rows: Sequence[Row]) -> None:
    """Write the page, whole or not at all.

    Raises:
        RecordingFailed: The disk refused.
    """
    write_whole(path, fault_page(rows))


def _cell(names: Sequence[str], rows: Sequence[Row]) -> _Cell:
    if not names:
        return _Cell("–", ())
    found = [row for name in names for row in _matching(name, rows)]
    if not found:
        return _Cell(_NOT_HERE, ())
    return _Cell("; ".join(_value(row) for row in found), tuple(found))


def _matching(name: str, rows: Sequence[Row]) -> list[Row]:
    """Return the rows of a name, which may hold `*`."""
    pattern = re.compile(".*".join(map(re.escape, name.split("*"))))
    return [row for row in rows if pattern.fullmatch(row.name)]


def _value(row: Row) -> str:
    value = "–" if row.value is None else f"{row.value:.3g}"
    missed = " (**missed**)" if row.ok is False else ""
    return _text(f"{value} {row.unit}".strip()) + missed


def _figure(row: Row) -> str:
    value = "–" if row.value is None else f"{row.value:,.4g} {row.unit}"
    verdict = {True: "met", False: "**missed**", None: ""}[row.ok]
    note = " · ".join(part for part in (row.note, row.stamp) if part)
    return f"| {_text(row.name)} | {_text(value)} | {_text(row.goal)} | {verdict} | {_text(note)} |"


def _text(words: str) -> str:
    """Return words as one cell of a Markdown table."""
    return words.replace("|", "\\|").replace("\n", " ")
