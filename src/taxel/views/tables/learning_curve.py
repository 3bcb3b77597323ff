"""Accuracy against the amount of data in the terminal, and what more data may be expected to give.

Knows nothing about how it was measured.
"""

from __future__ import annotations

from rich.console import Group, RenderableType
from rich.text import Text

from taxel.evaluation.learning_curve import LearningCurve
from taxel.plain_text import several, visible
from taxel.views.tables.results import alike_note, bracketed, result_table


def learning_curve_table(found: LearningCurve) -> RenderableType:
    """Return a row an amount: groups, windows, accuracy, and the best trivial baseline's."""
    table = result_table(
        None,
        (several(visible(found.group)), "windows", "accuracy [95 %]", "best baseline", "which"),
    )
    for amount in found.amounts:
        best = max(amount.trivial, key=lambda name: amount.trivial[name])
        table.add_row(
            str(amount.groups), str(amount.windows),
            bracketed(f"{amount.accuracy:.4f}", (amount.low, amount.high), ".3f"),
            f"{amount.trivial[best]:.4f}", visible(best),
        )  # fmt: skip
    about = f"{visible(found.target)} · {visible(found.model)} · split: {visible(found.split)}"
    interval = f"interval: 95 %, whole {several(visible(found.group))} of the test parts resampled"
    alike = alike_note(((own.low, own.high) for own in found.amounts), found.group)
    return Group(Text(about, style="bold"), table, Text(interval), *alike, Text(last_step(found)))


def last_step(found: LearningCurve) -> str:
    """Return what the last addition of data gave, in words: whether the curve still rises."""
    before, last = found.amounts[-2], found.amounts[-1]
    points = 100 * (last.accuracy - before.accuracy)
    return (
        f"from {before.groups} to {last.groups} {several(visible(found.group))} accuracy changed "
        f"by {points:+.1f} points"
    )
