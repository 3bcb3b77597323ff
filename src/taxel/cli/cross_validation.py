"""How a cross-validation is printed: by `taxel train`, and by `taxel evaluate`.

Knows nothing about how it was made.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from taxel.cli.printing import console, say

if TYPE_CHECKING:
    from taxel.evaluation.checked import Checked


def print_checked(checked: Checked) -> None:
    """Print a cross-validation: accuracies, warnings, confusions, each class and group."""
    from taxel.evaluation.run_scores import unnamed_line
    from taxel.views.tables.parts import parts_tables
    from taxel.views.tables.results import checked_table, confusion_table

    pooled = checked.pooled
    console.print(checked_table(checked))
    if checked.kept:
        say(_kept_line(checked))
    if text := warning(checked):
        say(f"warning: {text}", style="yellow")
    if text := unnamed_line(checked.predictions):
        say(text, style="yellow" if text.startswith("warning") else "")
    classes = checked.dataset.classes(checked.recipe.target)
    console.print(confusion_table(classes, pooled.scores.confusion, console.width))
    for table in parts_tables(pooled.parts) if pooled.parts is not None else ():
        console.print(table)


def _kept_line(checked: Checked) -> str:
    """Return a note on the folds that an interrupted run had already fitted."""
    folds = f"{checked.kept} fold{'s' if checked.kept > 1 else ''}"
    return f"{folds} kept from an interrupted run; --fresh fits all of them again"


def warning(checked: Checked) -> str | None:
    """Return a warning where accuracy is no better than a trivial baseline; else nothing."""
    from taxel.evaluation.run_scores import GroupInterval, baseline_warning

    pooled = checked.pooled
    return baseline_warning(
        checked.recipe.model,
        pooled.scores,
        GroupInterval(*pooled.interval, pooled.interval_groups),
        pooled.interval_group,
        checked.trivial,
    )
