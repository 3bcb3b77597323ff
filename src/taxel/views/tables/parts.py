"""Accuracy part by part in the terminal: classes, objects, sessions; and a bundle's score.

Knows nothing about how they were made.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from taxel.evaluation.bundle_scores import BundleScores
from taxel.evaluation.part_scores import Parts, PartScore
from taxel.evaluation.run_scores import few_groups, only_one
from taxel.labels.trials import USUAL_GROUPS
from taxel.plain_text import noun_of, number_of, visible, visible_line, visible_names
from taxel.views.tables.results import alike_note, bracketed, result_table

MOST_ROWS = 24
"""Values of a group that are printed; more fill the screen, and stand in --json."""


def parts_tables(parts: Parts) -> list[RenderableType]:
    """Return a table of the classes and one of each group, the worst values first where many.

    Groups that part the trials alike, as a day's temperature and humidity do, share a table:
    that of the session or object where there is one.
    """
    alike: dict[tuple[Any, ...], list[str]] = {}
    for key in sorted(parts.groups, key=lambda key: (key not in USUAL_GROUPS, key)):
        values = parts.groups[key]
        alike.setdefault(tuple(sorted(replace(part, name="") for part in values)), []).append(key)
    found: list[RenderableType] = [_table("class", parts.classes)]
    for key, *others in alike.values():
        found.append(_table(key, parts.groups[key]))
        if others:
            same = f"groups that divide the trials in the same way as {key}: {', '.join(others)}"
            found.append(Text(visible_line(same)))
    return found


def _table(title: str, values: tuple[PartScore, ...]) -> Table:
    table = result_table(None, (visible(title), "accuracy", "windows", "by trial", "trials"))
    shown = values
    if len(values) > MOST_ROWS:
        shown = tuple(sorted(values, key=lambda part: part.accuracy))[:MOST_ROWS]
    for part in shown:
        table.add_row(visible(part.name), f"{part.accuracy:.3f}", str(part.windows),
                      f"{part.trial_accuracy:.3f}", str(part.trials))  # fmt: skip
    if more := len(values) - len(shown):
        table.add_row(f"and {more} better (--json)", style="dim")
    return table


def bundle_score_table(found: BundleScores, bundle: str, data: str) -> RenderableType:
    """Return a bundle's score for a reader: by window and by trial, then part by part.

    Args:
        found: What `score_bundle` gave.
        bundle: The bundle's name.
        data: The recordings' name.
    """
    table = result_table(None, ("", "accuracy [95 %]", "majority", "UNKNOWN", "count"))
    table.add_row("windows", bracketed(f"{found.accuracy:.4f}", found.interval, ".3f"),
                  f"{found.majority:.4f}", f"{found.unknown:.4f}", str(found.windows))  # fmt: skip
    table.add_row("trials", f"{found.trial_accuracy:.4f}", f"{found.trial_majority:.4f}",
                  f"{found.trial_unknown:.4f}", str(found.trials))  # fmt: skip
    title = f"{visible(bundle)} on {visible(data)}: {visible(found.target)}"
    if found.split is not None:
        title += f" · test part of {visible(found.split)}"
    return Group(
        Text(title, style="bold"), table, *parts_tables(found.parts), _confusion(found),
        *(Text(visible_line(line)) for line in _lines(found)),
        *alike_note([found.interval], found.interval_group),
    )  # fmt: skip


def _lines(found: BundleScores) -> list[str]:
    odd = {name: sum(row.values()) for name, row in found.confusion.items()
           if name not in found.classes}  # fmt: skip
    but = " but for classes that the bundle does not know" if odd else ""
    lines = [f"accuracy: UNKNOWN counts as wrong{but}; majority: always naming the commonest class"]
    if odd:
        shown = ", ".join(f"{visible(name)} ({number_of(count, 'window')})"
                          for name, count in odd.items())  # fmt: skip
        lines.append(
            f"not known to the bundle, which knows {visible_names(found.classes)}: {shown}; there "
            "only UNKNOWN counts as correct; mend the label if it is misspelt"
        )
    if found.unknown:
        why = ", ".join(f"{name} {count}" for name, count in found.unknown_because.items())
        answered = "no window was answered"
        if not math.isnan(found.answered_accuracy):
            answered = (
                f"of the windows that were answered, {found.answered_accuracy:.4f} are correct"
            )
        lines.append(f"{answered}; UNKNOWN because of: {why}")
    if found.filled:
        lines.append(f"{100 * found.filled:.1f} % of the windows had short gaps filled in")
    if not math.isnan(found.loss):
        of = ", of the windows of known classes" if odd else ""
        lines.append(f"loss {found.loss:.4f} nats, expected calibration error "
                     f"{found.calibration_error:.4f}{of}")  # fmt: skip
    lines.append(f"interval: 95 %, whole groups resampled by {noun_of(found.interval_group)}")
    few = few_groups(found.interval_group, found.interval_groups)
    lone = only_one(found.lone, found.interval_group)
    return [*lines, *(line for line in (few, lone) if line), *found.notes]


def _confusion(found: BundleScores) -> Table:
    answers = list(dict.fromkeys(name for row in found.confusion.values() for name in row))
    columns = [name for name in (*found.classes, *answers) if name in answers]
    table = result_table(
        "confusion", ("true ↓  predicted →", *map(visible, dict.fromkeys(columns)))
    )
    for name, row in found.confusion.items():
        table.add_row(
            visible(name), *(str(row.get(answer, "·")) for answer in dict.fromkeys(columns))
        )
    return table
