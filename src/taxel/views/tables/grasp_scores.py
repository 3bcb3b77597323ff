"""What a bundle that watches a grasp is worth on recordings, as a table in the terminal.

Knows nothing about how it was measured.
"""

from __future__ import annotations

import math

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from taxel.evaluation.early_warning.bundle_warnings import GraspScores
from taxel.plain_text import number_of, visible
from taxel.views.tables.results import result_table


def grasp_score_table(found: GraspScores, bundle: str, data: str) -> RenderableType:
    """Return the scores with their baseline.

    Args:
        found: The scores.
        bundle: What the bundle is called.
        data: Where the recordings lie.
    """
    title = f"{visible(bundle)} on {visible(data)}: {number_of(found.grasps, 'grasp')}"
    table: Table = result_table(None, ("", "grasps", "with an alarm"))
    table.add_row("held", str(found.held), _of(found.held_alarmed, found.held))
    table.add_row("slipped", str(found.slipped), _of(found.slipped_alarmed, found.slipped))
    lines = [*_false(found), *_lead(found)]
    if not math.isnan(found.area):
        lines.append(
            f"AUC, slipped against held: largest score {found.area:.3f}; baseline, the shorter "
            f"grasp slips {found.length_area:.3f}"
        )
    if found.slipped > found.timed:
        unknown = number_of(found.slipped - found.timed, "grasp")
        lines.append(
            f"no lead of {unknown}: when it slipped is not known (of a recording of one grasp: "
            "taxel label --onsets)"
        )
    lines.append(f"state UNKNOWN in {100 * found.unknown_share:.1f} % of the time")
    lines += [
        f"left out: {number_of(count, 'grasp')} with "
        + (f"the outcome {visible(word)}, which says neither" if word else "no outcome")
        for word, count in found.left_out.items()
    ]
    return Group(Text(title, style="bold"), table, *(Text(line) for line in lines))


def _of(count: int, of: int) -> str:
    return f"{count} ({100 * count / of:.0f} %)" if of else "–"


def _false(found: GraspScores) -> list[str]:
    if not found.held_min:
        return []
    low, high = found.false_alarms_interval
    return [
        f"false alarms: {found.false_alarms_per_min:.2f} a minute, in {found.held_min:.1f} min of "
        f"grasps that held (95 % by Poisson {low:.2f} to {high:.2f})"
    ]


def _lead(found: GraspScores) -> list[str]:
    if not found.timed:
        return []
    low, high = found.missed_interval
    words = f"missed: {100 * found.missed_share:.0f} % of {number_of(found.timed, 'slip')}"
    if not math.isnan(low):
        words += f" (95 % by {found.cluster} {100 * low:.0f} to {100 * high:.0f} %)"
    if math.isnan(found.lead_median_s):
        return [words]
    low, high = found.lead_interval_s
    lead = f"lead before the slip: median {found.lead_median_s:.2f} s"
    if not math.isnan(low):
        lead += f" (95 % by {found.cluster} {low:.2f} to {high:.2f} s)"
    return [words, f"{lead}, 5 % {found.lead_p5_s:.2f} s"]
