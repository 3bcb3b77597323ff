"""What a split holds out, as lines for the terminal. Knows nothing about how it was made."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from taxel.evaluation.fold_summary import FoldSummary, SplitSummary
from taxel.evaluation.table_split import MOST_KNOWN
from taxel.labels.trials import TIME, as_numbers
from taxel.plain_text import number_of, visible, visible_line, visible_names


def split_lines(found: SplitSummary) -> list[str]:
    """Return a line on the whole, then some on each fold: what is held out, and its classes."""
    total = number_of(found.total, found.counted, ",")
    lines = [
        f"{visible(found.target)} · split: {visible(found.split)} · {total} in "
        f"{number_of(len(found.folds), 'fold')}"
    ]
    if found.left_out:
        stand = "stands" if found.left_out == 1 else "stand"
        lines.append(f"note: {found.left_out} of {total} {stand} on no side: left out")
    lines += [f"note: {visible_line(note)}" for note in found.notes]
    for fold in found.folds:
        lines += _fold_lines(fold, found)
    return lines


def _fold_lines(fold: FoldSummary, found: SplitSummary) -> list[str]:
    held = ""
    if found.group is not None and fold.held_out:
        values = number_of(len(fold.held_out), visible(found.group))
        held = f": holds out {values}, {_range(fold.held_out, found.group)}"
    lines = [f"{visible(fold.name)}{held}"]
    for what, side in (
        ("trained on", fold.train), ("to choose by", fold.validation), ("tested", fold.test),
    ):  # fmt: skip
        if count := sum(side.values()):
            lines.append(f"  {what}: {number_of(count, found.counted, ',')}, {_classes(side)}")
    for what, side in (("trained on", fold.train), ("tested", fold.test)):
        if absent := [name for name, count in side.items() if not count]:
            lines.append(f"  not {what}: {_names(absent)}")
    return lines


def _range(names: Sequence[str], group: str) -> str:
    """Return values in order by name; of moments the first and the last."""
    if group == TIME and len(names) > 1:
        try:
            first, *_, last = sorted(as_numbers(names).tolist())
        except ValueError:
            return _names(names)
        return f"from {first:.6g} to {last:.6g}"
    return _names(names)


def _names(names: Sequence[str]) -> str:
    more = len(names) - MOST_KNOWN
    return visible_names(names[:MOST_KNOWN]) + (f" and {more} more" if more > 0 else "")


def _classes(side: Mapping[str, int]) -> str:
    return ", ".join(f"{visible_names([name])}={count}" for name, count in side.items() if count)
