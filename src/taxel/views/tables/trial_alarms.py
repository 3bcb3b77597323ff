"""A recogniser of camera trials as an alarm, as a table in the terminal.

Knows nothing about how it was measured.
"""

from __future__ import annotations

import math

from rich.console import Group, RenderableType
from rich.text import Text

from taxel.evaluation.camera_trials.trial_alarms import AlarmShare, TrialAlarms
from taxel.plain_text import number_of, visible
from taxel.views.tables.results import result_table


def trial_alarm_table(found: TrialAlarms, target: str, by: str, foreign: int = 0) -> RenderableType:
    """Return in how many trials an alarm would be raised while they run.

    Args:
        found: The shares.
        target: What is recognised.
        by: Group that intervals are resampled by.
        foreign: Trials of a class that is never recognised, among all others.
    """
    label = visible(found.label)
    table = result_table(
        f"trials with an alarm for {visible(target)} {label} while they run",
        ("least confidence", "of this class", "others", "first alarm"),
    )  # fmt: skip
    for level in found.levels:
        first = level.first_median_s
        table.add_row(
            f"{level.least_confidence:g}", _of(level.right), _of(level.false),
            "–" if math.isnan(first) else f"{first:.1f} s",
        )  # fmt: skip
    lines = [
        f"in brackets: 95 % by {visible(by)}; first alarm: median of this class, since the first "
        "image",
    ]
    lines.append(
        "the verdict on the whole trial, at its end, can raise an alarm too: not counted here"
    )
    if foreign:
        lines.append(
            f"others: among them {foreign} whose {visible(target)} the bundle does not know; any "
            "alarm there counts as false"
        )
    if found.silent:
        lines.append(
            f"shorter than a crop, so that no alarm is possible while they run: {found.silent} of "
            f"{number_of(found.levels[0].right.of + found.levels[0].false.of, 'trial')}, counted "
            "as without one"
        )
    if not math.isnan(found.area):
        lines.append(
            f"AUC, {label} against others, in the first {found.within_s:.1f} s: largest "
            f"probability {found.area:.3f}; baseline, a trial's length {found.length_area:.3f}"
        )
    elif found.levels[0].right.of and found.levels[0].false.of:
        lines.append(
            f"no AUC: not every trial has a verdict within {found.within_s:.1f} s, the length of "
            "the shortest"
        )
    lines.append(
        "a least confidence chosen from these trials is fitted to them: state what it gives on "
        "others"
    )
    return Group(table, *(Text(line) for line in lines))


def _of(share: AlarmShare) -> str:
    if not share.of:
        return "–"
    low, high = share.interval
    return f"{share.alarmed} of {share.of} ({low:.2f} to {high:.2f})"
