"""Latency, robustness and environment, as parts of a page.

Knows nothing about how they were measured.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from taxel.errors import BadInput
from taxel.evaluation.cards.latency import NetworkLatency
from taxel.evaluation.robustness.curve import level_text
from taxel.training.environment import Provenance
from taxel.views.report.charts import Axis, Line, line_chart
from taxel.views.report.page import Html, band, colour, figure, join, key, percent, table, tag

THESIS_MS = 40.46
"""Inference of the 2D CNN, milliseconds a window. Source: TENG thesis, Table 4.1."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepPoint:
    """One level of one fault in a robustness sweep."""

    fault: str
    level: float
    unit: str
    accuracy: float
    """0…1."""
    low: float
    high: float
    """95 % of the accuracy, 0…1; NaN where there is one session only."""
    answered: float = float("nan")
    """Share of windows answered, not UNKNOWN, 0…1; NaN where it was not counted."""
    base: float = float("nan")
    """Accuracy without the fault of those windows that are left with it, 0…1; NaN where all are."""


UNCHANGED = "none"
"""The fault's name where nothing was changed."""


def latency_part(latencies: Mapping[str, NetworkLatency], thesis: bool) -> Html:
    """Return the times of one window through ONNX Runtime.

    Args:
        latencies: Run → its times.
        thesis: True prints the thesis's time beside.
    """
    rows: list[list[object]] = [
        [
            name,
            f"{1000 * latency.median_ms:,.0f}",
            f"{1000 * latency.p95_ms:,.0f}",
            f"{1000 * latency.p99_ms:,.0f}",
            f"{latency.kilobytes:,.0f}",
        ]
        for name, latency in latencies.items()
    ]
    quiet = []
    if thesis:
        rows.append(["2D CNN, thesis (Table 4.1)", f"{1000 * THESIS_MS:,.0f}", "–", "–", "–"])
        quiet = [len(rows) - 1]
    calls = next(iter(latencies.values())).calls
    return join(
        [
            tag(
                "p",
                "One window to its probabilities, scaling included, exported and run in ONNX "
                f"Runtime on one thread of this machine, while this page was made; {calls} calls.",
            ),
            table(["run", "median, µs", "p95, µs", "p99, µs", "model, kB"], rows, quiet=quiet),
        ]
    )


def read_sweep(rows: Any, name: str) -> list[SweepPoint]:
    """Return what `taxel sweep --json` wrote.

    Args:
        rows: The parsed JSON.
        name: The file's name, for the message.

    Raises:
        BadInput: It is something else.
    """
    try:
        points = [
            SweepPoint(
                fault=str(row["fault"]),
                level=float(row["level"]),
                unit=str(row["unit"]),
                accuracy=_share(row["accuracy"]),
                low=_share(row["low"]),
                high=_share(row["high"]),
                answered=_share(row.get("answered")),
                base=_share(row.get("base")),
            )
            for row in rows
        ]
    except (TypeError, KeyError, ValueError, AttributeError) as error:
        raise BadInput(
            f"what taxel sweep --json prints in {name}", "something else",
            "write it again with: taxel sweep … --json",
        ) from error  # fmt: skip
    if not points:
        raise BadInput(f"at least one fault in {name}", "none", "sweep again")
    return points


def sweep_part(points: Sequence[SweepPoint]) -> Html:
    """Return robustness curves, a chart a fault; what is unchanged is a grey line in each."""
    faults: dict[str, list[SweepPoint]] = {}
    for point in points:
        faults.setdefault(point.fault, []).append(point)
    unchanged = faults.pop(UNCHANGED, [])[:1]
    charts = [_fault_chart(fault, own, unchanged) for fault, own in faults.items()]
    legend: list[tuple[str, object]] = [(colour(0), "accuracy, 95 %")]
    if any(math.isfinite(point.answered) for point in points):
        legend.append((colour(2), "share answered, not UNKNOWN"))
    sentence = "Accuracy as one fault grows."
    if unchanged:
        legend.append(("var(--grey)", "unchanged"))
        clean = unchanged[0]
        sentence += f" Unchanged: {percent(clean.accuracy)} {band(clean.low, clean.high)}."
    return join([tag("p", sentence), tag("p", key(legend)), tag("div", join(charts), "side")])


def _fault_chart(fault: str, points: list[SweepPoint], unchanged: list[SweepPoint]) -> Html:
    points = sorted(points, key=lambda point: point.level)
    levels = [point.level for point in points]
    lowest, highest = levels[0], levels[-1]
    if lowest == highest:
        lowest, highest = lowest - 1, highest + 1
    lines = [_unchanged(name, points, (lowest, highest)) for name in unchanged]
    if any(math.isfinite(point.answered) for point in points):
        lines.append(
            Line(
                name="answered", x=levels, y=[point.answered for point in points], colour=colour(2)
            )
        )
    lines.append(
        Line(
            name=fault,
            x=levels,
            y=[point.accuracy for point in points],
            low=[point.low for point in points],
            high=[point.high for point in points],
            colour=colour(0),
        )
    )
    unit = points[0].unit
    chart = line_chart(
        lines,
        Axis(label=f"{fault}, {unit}" if unit else fault, low=lowest, high=highest),
        Axis(label="share", low=0, high=1),
        size=(300, 220),
    )
    known = [point for point in points if math.isfinite(point.accuracy)]
    if not known:
        return figure(chart, f"{fault}: nothing was answered.")
    worst = min(known, key=lambda point: point.accuracy)
    sentence = f"least {percent(worst.accuracy)} {band(worst.low, worst.high)}".rstrip()
    return figure(chart, f"{fault}: {sentence} at {level_text(worst.level, unit)}".rstrip())


def _unchanged(clean: SweepPoint, own: list[SweepPoint], ends: tuple[float, float]) -> Line:
    """Return the accuracy without a fault, of the windows that are left with it."""
    x, y = list(ends), [clean.accuracy] * 2
    if any(math.isfinite(point.base) for point in own):
        x = [point.level for point in own]
        y = [point.base if math.isfinite(point.base) else clean.accuracy for point in own]
    return Line(name="unchanged", x=x, y=y, colour="var(--grey)")


def environment_part(made: Mapping[str, Provenance]) -> Html:
    """Return versions, processor and commit, a column each where they differ.

    Args:
        made: Run, or "this page" → how it was made.
    """
    names = list(dict.fromkeys(name for facts in made.values() for name in facts.environment))
    first, *others = made.items()
    alike = all(other.environment == first[1].environment for _, other in others)
    shown = dict([first]) if alike else dict(made)
    rows = [
        [name, *(facts.environment.get(name, "–") for facts in shown.values())] for name in names
    ]
    commands = [
        join(
            [
                tag("p", f"{name}, {facts.created}:" if facts.created else f"{name}:"),
                tag("pre", facts.command or "made from Python, not by a command"),
            ]
        )
        for name, facts in made.items()
    ]
    head = [] if alike else ["", *shown]
    return join([*commands, table(head, rows, kind="words")])


def _share(value: Any) -> float:
    """Return a share of 0…1; null, as JSON has for NaN, is NaN."""
    if value is None:
        return float("nan")
    share = float(value)
    if not 0.0 <= share <= 1.0:
        raise ValueError(f"{share:g} outside 0 … 1")
    return share
