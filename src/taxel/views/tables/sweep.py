"""Robustness curves in the terminal: each fault's levels beside the recogniser without any.

Knows nothing about how they were measured.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import groupby

from rich.box import SIMPLE_HEAD
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from taxel.evaluation.robustness.curve import FALL, FaultPoint, fall_text, level_text, reached
from taxel.plain_text import visible_line
from taxel.views.tables.results import bracketed

_CAMERA_COLUMNS = ("balanced [95 %]", "moments", "warned", "any", "false")
_ARRAY_COLUMNS = ("accuracy [95 %]", "windows", "grasps", "any", "outside")


def sweep_table(
    points: Sequence[FaultPoint], about: str, *, cameras: bool = False
) -> RenderableType:
    """Return the curves as one table, and at which level each falls by five points.

    Args:
        points: The point without faults first.
        about: What was judged on what, one line.
        cameras: True for a grasp bundle.
    """
    accuracy, windows, grasps, any_answer, outside = _CAMERA_COLUMNS if cameras else _ARRAY_COLUMNS
    table = Table(box=SIMPLE_HEAD, pad_edge=False, collapse_padding=True)
    table.add_column("fault", overflow="fold")  # a figure goes on below, and is never cut off
    for column in ("level", accuracy, "change", "answered", windows, grasps, any_answer, outside):
        table.add_column(column, justify="right", overflow="fold")
    base = points[0]
    for fault, group in groupby(points, key=lambda point: point.fault):
        of_fault = list(group)
        draws = f"{of_fault[0].draws} draws" if of_fault[0].draws > 1 else ""
        heads = [head for head in (fault, of_fault[0].unit, draws) if head]
        if len(of_fault) < len(heads):
            heads = [", ".join(heads)]
        for index, point in enumerate(of_fault):
            change = 100 * (point.beside(base.accuracy) - base.accuracy)
            table.add_row(
                heads[index] if index < len(heads) else "",
                f"{point.level:g}" if point.unit else "",
                _accuracy(point),
                "" if point is base or math.isnan(change) else f"{change:+.1f}",
                _percent(point.answered),
                f"{point.windows:,}",
                _percent(point.grasps),
                _percent(point.grasps_answered),
                "–" if math.isnan(point.outside) else f"{point.outside:.1f}",
                style=_style(change),
            )
        table.add_section()
    return Group(
        Text(visible_line(about), style="bold"), table, *_falls(points), *_notes(points, cameras)
    )


def _falls(points: Sequence[FaultPoint]) -> list[Text]:
    if len(points) < 2:
        return []
    lines = [Text(f"accuracy falls by {100 * FALL:g} points at:")]
    for fault, group in groupby(points[1:], key=lambda point: point.fault):
        own = list(group)
        words = fall_text(own, points[0].accuracy) + _silence(own, points[0])
        lines.append(Text(f"  {fault:<14} {words}"))
    return lines


def _silence(own: Sequence[FaultPoint], base: FaultPoint) -> str:
    """Return from which level on less than half is answered of what is without the fault, and
    from which on nothing, where `fall_text` does not say that.
    """
    few = [point for point in own if point.grasps_answered < base.grasps_answered / 2]
    silent = [point for point in few if math.isnan(point.accuracy)]
    words = ""
    if few and few[0] not in silent:
        level = level_text(few[0].level, few[0].unit)
        words = f"; at {level} only {_percent(few[0].grasps_answered)} with an answer"
    if silent and reached(own, base.accuracy) is not None:
        words += f"; at {level_text(silent[0].level, silent[0].unit)} nothing is answered"
    return words


def _notes(points: Sequence[FaultPoint], cameras: bool) -> list[Text]:
    single = math.isnan(points[0].low) and not math.isnan(points[0].accuracy)
    if cameras:
        words = (
            "accuracy: over moments whose state is known; stable and unstable moments have equal "
            "weight. "
            "warned: slips with an alarm in time. any: recordings with any known state. "
            "false: alarms a minute of grasps that hold. "
            + ("No interval: one cup only." if single else "Interval: cups resampled.")
        )
    else:
        words = (
            "accuracy: over the windows that were answered (UNKNOWN: unusable input, or novel "
            "touch). grasps: share of all grasps that are correct; any: share with any answer. "
            "outside: windows a minute where nothing was touched. "
            + ("No interval: one session only." if single else "Interval: sessions resampled.")
        )
    if any(point.base is not None for point in points):
        words += " change of skew: against as many first windows of each touch without it."
    if any(point.draws > 1 for point in points):
        words += " draws: passes over the recordings, each with other random choices, pooled."
    return [Text(words, style="dim")]


def _accuracy(point: FaultPoint) -> str:
    if math.isnan(point.accuracy):
        return "nothing answered"
    if math.isnan(point.low):
        return f"{point.accuracy:.3f}"
    return bracketed(f"{point.accuracy:.3f}", (point.low, point.high), ".3f")


def _percent(value: float) -> str:
    return "–" if math.isnan(value) else f"{100 * value:.1f} %"


def _style(change: float) -> str:
    if math.isnan(change) or change <= -100 * FALL:
        return "red"
    return "yellow" if change <= -40 * FALL else ""
