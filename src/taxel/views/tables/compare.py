"""Two runs side by side in the terminal, and what may be claimed of them.

Knows nothing about how they were tested.
"""

from __future__ import annotations

import math

from rich.box import SIMPLE_HEAD
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from taxel.evaluation.intervals import ALIKE, all_alike
from taxel.evaluation.paired import Paired
from taxel.plain_text import number_of, visible, visible_line

MOST_GROUPS = 24
"""Groups that are printed; more fill the screen."""


def compare_table(paired: Paired, first: str, second: str) -> RenderableType:
    """Return the comparison: each group, all windows, both tests, the verdict.

    Args:
        paired: What `compare_runs` gave.
        first: Name of the first run.
        second: Name of the second run.
    """
    table = Table(box=SIMPLE_HEAD, pad_edge=False)
    table.add_column(visible(paired.group), no_wrap=True)
    for column in ("windows", "first", "second", "second − first"):
        table.add_column(column, justify="right", no_wrap=True)
    for group in paired.groups[:MOST_GROUPS]:
        change = f"{100 * (group.second - group.first):+.1f}"
        table.add_row(
            visible(group.name), str(group.windows),
            f"{group.first:.4f}", f"{group.second:.4f}", change,
        )  # fmt: skip
    if len(paired.groups) > MOST_GROUPS:
        table.add_row(f"and {len(paired.groups) - MOST_GROUPS} more (--json)", style="dim")
    table.add_section()
    table.add_row(
        "all windows", str(paired.windows), f"{paired.first:.4f}", f"{paired.second:.4f}",
        f"{100 * paired.difference:+.1f}{interval_text(paired)}", style="bold",
    )  # fmt: skip
    n = len(paired.groups)
    return Group(
        Text(f"{visible(paired.target)} · split: {visible(paired.split)}", style="bold"),
        Text(f"first: {visible(first)} · second: {visible(second)}; differences in points, [95 %]"),
        table,
        Text(
            f"over {number_of(n, visible(paired.group))} (sign-flip permutation): p = "
            f"{paired.p_groups:.2g}; smallest possible {paired.smallest_p:.2g}"
        ),
        Text(
            f"over windows (McNemar, exact): p = {paired.p_windows:.2g}; only the first "
            f"correct {paired.only_first}, only the second {paired.only_second}",
            style="dim",
        ),
        Text(),
        Text(visible_line(paired.verdict), style="bold"),
        *(Text(visible_line(note)) for note in paired.notes),
    )


def interval_text(found: Paired) -> str:
    """Return the difference's interval in points, or nothing where there is none."""
    low, high = (100 * bound for bound in found.interval)
    if all_alike(found.interval):
        return f" [{ALIKE}]"
    return "" if math.isnan(low) else f" [{low:+.1f}, {high:+.1f}]"
