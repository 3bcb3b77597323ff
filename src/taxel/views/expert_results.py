"""What was tried, what was chosen and what it is worth, for the terminal.

Knows nothing about how it was found.
"""

from __future__ import annotations

from rich.console import Group, RenderableType
from rich.text import Text

from taxel.evaluation.expert import Expert
from taxel.evaluation.nested import Nested
from taxel.plain_text import visible, visible_line
from taxel.training.choose.choice import Choice
from taxel.views.results import result_table

SHOWN = 12
"""Lines of the leaderboard; expert.json holds all."""


def leaderboard(choice: Choice) -> RenderableType:
    """Return what was tried on all data, the best first, and why the winner won."""
    table = result_table(
        f"{visible(choice.target)} · tried on {choice.folds} inner folds, "
        f"{visible(choice.held)} held out",
        ("model", "windows", "loss", "accuracy", "s", "weight"),
    )
    rows = choice.leaderboard
    shown = [row for place, row in enumerate(rows) if place < SHOWN or row.weight]
    for row in shown:
        weight = f"{row.weight:.2f}" if row.weight else ""
        table.add_row(row.name, row.windows, f"{row.loss:.4f}", f"{row.accuracy:.4f}",
                      f"{row.seconds:.1f}", weight)  # fmt: skip
    lines = [
        Text(f"chosen: {choice.why}; inner loss {choice.loss:.4f}, accuracy {choice.accuracy:.4f}")
    ]
    if len(shown) < len(rows):
        lines.append(Text(f"{len(rows) - len(shown)} more in expert.json", style="dim"))
    if choice.left_out:
        count = len(choice.left_out)
        lines.append(Text(f"{count} not tried, for the time was up; --minutes allows more"))
    return Group(table, *lines)


def nested_table(nested: Nested) -> RenderableType:
    """Return the outer score, by window and by trial, with its bars on the same windows."""
    scores, by_trial = nested.scores, nested.by_trial
    table = result_table(
        f"split: {visible(nested.split)} · nested: each of {len(nested.choices)} folds chose anew "
        f"on its training part · {len(nested.predictions)} test windows, {by_trial.trials} trials",
        ("model", "accuracy", "by trial", "loss", "loss by trial", "calibration error"),
    )
    for name, (own, trials) in {"chosen by default": (scores, by_trial), **nested.bars}.items():
        table.add_row(
            name, f"{own.scores.accuracy:.4f}", f"{trials.accuracy:.4f}",
            f"{own.scores.loss:.4f}", f"{trials.loss:.4f}", f"{own.calibration_error:.4f}",
        )  # fmt: skip
    table.add_row("majority", f"{majority(nested):.4f}", style="dim")
    interval = scores.intervals[scores.group]
    said = f"95 % CI over {interval.groups} {visible(scores.group)}s: "
    return Group(table, Text(f"{said}{interval.low:.4f} … {interval.high:.4f}"))


def majority(nested: Nested) -> float:
    """Return the share of the commonest class among the test windows, 0…1."""
    y = list(nested.predictions.y)
    return max(map(y.count, set(y))) / len(y)


def expert_report(expert: Expert) -> RenderableType:
    """Return everything that is printed of a training."""
    parts: list[RenderableType] = [leaderboard(expert.choice)]
    if expert.nested is not None:
        parts += [Text(), nested_table(expert.nested)]
    measured = expert.measured
    parts.append(
        Text(
            f"bundle: {measured.mb:.2f} MB, {measured.us:.0f} µs a window on one core; "
            f"probabilities differ from offline by at most {measured.parity:.1e}"
        )
    )
    parts += [Text(visible_line(f"given up: {line}")) for line in expert.given_up]
    parts += [Text(visible_line(note)) for note in expert.notes]
    if expert.tries_kept:
        parts.append(Text(f"{expert.tries_kept} tries kept from a run that was interrupted"))
    return Group(*parts)
