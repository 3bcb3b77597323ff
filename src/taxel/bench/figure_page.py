"""All stored figures as a page: one figure a row, missed goals first.

Reads what `taxel bench NAME --full` stored; measures nothing. Knows nothing about how rows are
measured.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from taxel.bench.rows import Row, short, stored
from taxel.bench.scale.plan import plan_lines
from taxel.recordings.whole import write_whole

COMMAND = "taxel bench --page docs/reference/figures.md"
TITLES = {
    "teng": "The TENG hand",
    "transitions": "Grasp transitions",
    "closed-loop": "The closed loop",
    "audit": "Splits, leaks, adaptation, robustness",
    "data": "Real recordings, the default beside its bars",
    "boards": "Boards and firmware",
    "faults": "Faults",
    "soak": "Endurance",
    "scale": "More than one worker, more than one machine",
}
"""Bench → its heading, in the page's order."""
_HEAD = ["| figure | value | unit | goal | | note |", "|---|---:|---|---|---|---|"]


def figure_page(rows: Mapping[str, Sequence[Row]]) -> str:
    """Return the page as Markdown.

    Args:
        rows: Bench → its stored rows.
    """
    every = [row for bench in TITLES for row in rows.get(bench, ())]
    missed = [row for row in every if row.ok is False]
    goals = sum(row.ok is not None for row in every)
    lines = [
        "# Figures",
        "",
        f"Written by `{COMMAND}`; do not edit by hand. {len(every)} stored figures, {goals} of "
        f"them with a goal: {goals - len(missed)} met, {len(missed)} missed. Below each table "
        "stand the commands that measured it, each with its commit and day. An accuracy's name "
        "says its split.",
        "",
        "Figures that take less than a few minutes are not stored unless asked for: "
        "`taxel bench …` with a name measures them on your machine, beside their goals. Those of "
        "faults stand in [faults](faults.md), those of both papers' tables in [claims](claims.md).",
        "",
        f"## Missed goals ({len(missed)})",
        "",
        *_table(missed),
    ]
    for bench, title in TITLES.items():
        if rows.get(bench):
            lines += ["", f"## {title}: `taxel bench {bench}`", "", *_table(rows[bench])]
            lines += ["", *_stamps(rows[bench])]
        if bench == "scale" and rows.get(bench):
            lines += ["", *plan_lines(rows[bench])]
    return "\n".join(lines) + "\n"


def write_figure_page(path: Path) -> int:
    """Write the page of all stored rows, whole or not at all; return how many rows it holds.

    Raises:
        RecordingFailed: The disk refused.
    """
    rows = {bench: stored(bench) for bench in TITLES}
    write_whole(path, figure_page(rows))
    return sum(map(len, rows.values()))


def _table(rows: Sequence[Row]) -> list[str]:
    return [*_HEAD, *map(_figure, rows)] if rows else ["None."]


def _figure(row: Row) -> str:
    value = "–" if row.value is None else short(row.value)
    verdict = {True: "met", False: "**missed**", None: ""}[row.ok]
    goal = row.goal.replace("<=", "≤").replace(">=", "≥")
    cells = (row.name, value, row.unit, goal, verdict, row.note)
    return f"| {' | '.join(map(_cell, cells))} |"


def _stamps(rows: Sequence[Row]) -> list[str]:
    """Return a line for each run that measured some of the rows."""
    return [f"- {_cell(stamp)}" for stamp in dict.fromkeys(row.stamp for row in rows) if stamp]


def _cell(words: str) -> str:
    """Return words as one cell of a Markdown table."""
    return words.replace("|", "\\|").replace("<", "&lt;").replace("\n", " ")
