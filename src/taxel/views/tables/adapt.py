"""Tables of what adapting did: levels, accuracy before and after, versions.

Knows nothing about networks.
"""

from __future__ import annotations

from pathlib import Path

from rich.table import Table

from taxel.bundles.contract import Contract
from taxel.bundles.levels import TouchLevel
from taxel.bundles.versions import OF_ALL, Change, History, kept_path
from taxel.plain_text import number_of, visible, visible_line, visible_names

FELL = 0.1
"""Accuracy that a class loses from which on a warning names it. Source: our choice, decision 28."""


def level_table(contract: Contract, found: TouchLevel) -> Table:
    """Return each channel's level before and now, and what must be looked at."""
    table = Table(
        title=f"channel levels from {number_of(found.touches, 'touch')}, "
              f"{number_of(found.windows, 'window')}",
        title_justify="left", caption_justify="left",
        caption="\n".join(map(visible_line, found.warnings)) or None,
    )  # fmt: skip
    table.add_column("channel")
    for column in ("before", "now", "now / before"):
        table.add_column(column, justify="right")
    table.add_column("unit")
    for index, name in enumerate(contract.channels):
        level, change = float(found.level[index]), float(found.change[index])
        quiet = bool(found.silent[index])
        table.add_row(
            visible(name), f"{level / change:.3f}", "nothing" if quiet else f"{level:.3f}",
            "–" if quiet else f"{change:.2f}", visible(contract.units[index]),
        )  # fmt: skip
    return table


def before_after_table(change: Change, measured_on: str) -> Table:
    """Return the share of windows predicted correctly before and after, by class.

    A warning below names classes that fell far.
    """
    fell = [name for name, after in change.after.items() if change.before[name] - after > FELL]
    warning = (
        f"warning: fell by more than {100 * FELL:g} points: {visible_names(fell)}; learn grasps of "
        "known classes from this session too, or go back with --rollback"
    )
    table = Table(
        title=f"accuracy by window on {visible(measured_on)}", title_justify="left",
        caption=visible_line(warning) if fell else None, caption_justify="left",
    )  # fmt: skip
    table.add_column("class")
    for column in ("before", "after", "points"):
        table.add_column(column, justify="right")
    for name, after in change.after.items():
        before = change.before[name]
        table.add_row(
            visible(name), f"{before:.1%}", f"{after:.1%}", f"{100 * (after - before):+.1f}"
        )
    return table


def history_table(path: Path, history: History) -> Table:
    """Return all versions, the one in use marked."""
    table = Table(title=f"versions of {visible(path)}", title_justify="left")
    for column in ("", "made", "what", "from", "before → after", "kept as"):
        table.add_column(column)
    numbers = {version.digest: version.number for version in reversed(history.versions)}
    for version in history.versions:
        used = version.number == history.current
        kept = kept_path(path, version.number)
        place = path.name if used else (kept.name if kept.exists() else "gone")
        both = version.change.before.get(OF_ALL), version.change.after.get(OF_ALL)
        measured = f"{both[0]:.1%} → {both[1]:.1%}" if None not in both else "–"
        source = (
            f"version {numbers[version.parent]}"
            if version.parent in numbers
            else version.parent[:12]
        )
        table.add_row(
            f"{'→ ' if used else ''}{version.number}", visible(version.made or "–"),
            visible_line(version.change.what),
            visible(source or "–"), measured, visible(place),
        )  # fmt: skip
    return table
