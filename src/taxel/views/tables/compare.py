"""Two runs side by side in the terminal, and what may be claimed of them.

Knows nothing about how they were tested.
"""

from __future__ import annotations

import math

from rich.box import SIMPLE_HEAD
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from taxel.evaluation.paired import Paired
from taxel.plain_text import visible, visible_line

MOST_GROUPS = 24
"""Groups that are printed; more fill the screen."""


def compare_table(found: Paired, first: str, second: str) -> RenderableType:
    """Return the comparison: each group, all windows, both tests, the verdict.

    Args:
        found: What `compare_runs` gave.
        first: Name of the first run.
        second: Name of the second run.
    """
    table = Table(box=SIMPLE_HEAD, pad_edge=False)
    table.add_column(visible(found.group), no_wrap=True)
    for column in ("windows", "first", "second", "second − first"):
        table.add_column(column, justify="right", no_wrap=True)
    for group in found.groups[:MOST_GROUPS]:
        change = f"{100 * (group.second - group.first):+.1f}"
        table.add_row(
            visible(group.name), str(group.windows),
            f"{group.first:.4f}", f"{group.second:.4f}", change,
        )  # fmt: skip
    if len(found.groups) > MOST_GROUPS:
        table.add_row(f"and {len(found.groups) - MOST_GROUPS} more (--json)", style="dim")
    table.add_section()
    table.add_row(
        "all windows", str(found.windows), f"{found.first:.4f}", f"{found.second:.4f}",
        f"{100 * found.difference:+.1f}{interval_text(found)}", style="bold",
    )  # fmt: skip
    n = len(found.groups)
    return Group(
        Text(f"{visible(found.target)} · split: {visible(found.split)}", style="bold"),
        Text(f"first: {visible(first)} · second: {visible(second)}; differences in points, [95 %]"),
        table,
        Text(
            f"over {n} {visible(found.group)}s (sign-flip permutation): p = {found.p_groups:.2g}; "
            f"smallest possible {found.smallest_p:.2g}"
        ),
        Text(
            f"over windows (McNemar, exact): p = {found.p_windows:.2g}; only the first "
            f"correct {found.only_first}, only the second {found.only_second}",
            style="dim",
        ),
        Text(),
        Text(visible_line(found.verdict), style="bold"),
        *(Text(visible_line(note)) for note in found.notes),
    )


def interval_text(found: Paired) -> str:
    """Return the difference's interval in points, or nothing where there is none."""
    low, high = (100 * bound for bound in found.interval)
    return "" if math.isnan(low) else f" [{low:+.1f}, {high:+.1f}]"
