"""What a search for settings found, as a table: the honest score beside what was chosen by."""

from __future__ import annotations

import math

from rich.table import Table

from taxel.evaluation.crossval import Pooled
from taxel.evaluation.intervals import ALIKE, all_alike
from taxel.evaluation.tune.nested import Tuned
from taxel.plain_text import number_of, visible_line


def tune_table(found: Tuned) -> Table:
    """Return inner and outer accuracies, with the trivial baselines of the same folds."""
    title = f"{visible_line(found.recipe.target)}: settings searched"
    if found.outer is not None:
        title += f" · split: {visible_line(found.outer.tuned.split)}"
    table = Table(title=title, title_justify="left")
    for column in ("", "accuracy", "95 % CI", "CI over"):
        table.add_column(column, justify="left" if column in ("", "CI over") else "right")
    outer, own = found.outer, found.found
    if outer is not None:
        table.add_row("outer folds, settings found without them", *_cells(outer.tuned))
        table.add_row("outer folds, the recipe as it is", *_cells(outer.as_is))
        for name, accuracy in outer.trivial.items():
            table.add_row(f"trivial: {visible_line(name)}", f"{accuracy:.1%}", "–", "")
    table.add_row("inner folds, best trial (chosen by: too high)", f"{own.accuracy:.1%}", "–", "")
    table.add_row("inner folds, the recipe as it is", f"{own.as_is:.1%}", "–", "")
    table.caption = (
        f"{number_of(own.trials, 'trial')} on all recordings, {own.pruned} of them pruned"
    )
    return table


def _cells(pooled: Pooled) -> tuple[str, str, str]:
    low, high = pooled.interval
    interval = "–" if math.isnan(low) else f"{low:.1%} … {high:.1%}"
    if all_alike(pooled.interval):
        interval = ALIKE
    by = number_of(pooled.interval_groups, visible_line(pooled.interval_group))
    return f"{pooled.scores.accuracy:.1%}", interval, by
