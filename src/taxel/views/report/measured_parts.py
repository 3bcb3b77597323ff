"""Latency, robustness and environment, as parts of a page.

Knows nothing about how they were measured.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from taxel.errors import BadInput
from taxel.evaluation.latency import Latency
from taxel.training.environment import Made
from taxel.views.report.charts import Axis, Line, line_chart
from taxel.views.report.page import Html, band, colour, figure, join, percent, table, tag

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
    """95 % of the accuracy, 0…1."""


def latency_part(latencies: Mapping[str, Latency], thesis: bool) -> Html:
    """Return the times of one window through ONNX Runtime.

    Args:
        latencies: Run → its times.
        thesis: True prints the thesis's time beside.
    """
    rows: list[list[object]] = [
        [
            name,
            f"{1000 * one.median_ms:,.0f}",
            f"{1000 * one.p95_ms:,.0f}",
            f"{1000 * one.p99_ms:,.0f}",
            f"{one.kilobytes:,.0f}",
        ]
        for name, one in latencies.items()
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
            table(["run", "median, µs", "95 %, µs", "99 %, µs", "model, kB"], rows, quiet=quiet),
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
            )
            for row in rows
        ]
    except (TypeError, KeyError, ValueError) as error:
        raise BadInput(
            f"what taxel sweep --json prints in {name}", f"something else ({error})",
            "write it again with: taxel sweep … --json",
        ) from error  # fmt: skip
    if not points:
        raise BadInput(f"at least one fault in {name}", "none", "sweep again")
    return points


def sweep_part(points: Sequence[SweepPoint]) -> Html:
    """Return robustness curves, a chart a fault."""
    faults: dict[str, list[SweepPoint]] = {}
    for point in points:
        faults.setdefault(point.fault, []).append(point)
    charts = []
    for fault, own in faults.items():
        own.sort(key=lambda point: point.level)
        line = Line(
            name=fault,
            x=[point.level for point in own],
            y=[point.accuracy for point in own],
            low=[point.low for point in own],
            high=[point.high for point in own],
            colour=colour(0),
        )
        lowest, highest = own[0].level, own[-1].level
        if lowest == highest:
            lowest, highest = lowest - 1, highest + 1
        chart = line_chart(
            [line],
            Axis(label=f"{fault}, {own[0].unit}" if own[0].unit else fault, low=lowest,
                 high=highest),
            Axis(label="accuracy", low=0, high=1),
            size=(330, 230),
        )  # fmt: skip
        worst = min(own, key=lambda point: point.accuracy)
        said = f"least {percent(worst.accuracy)} {band(worst.low, worst.high)} at {worst.level:g}"
        charts.append(figure(chart, f"{fault}: {said} {worst.unit}".rstrip()))
    return join(
        [
            tag("p", "Accuracy as one fault grows; the band is 95 %."),
            tag("div", join(charts), "side"),
        ]
    )


def environment_part(made: Mapping[str, Made]) -> Html:
    """Return versions, processor and commit, a column each where they differ.

    Args:
        made: Run, or "this page" → how it was made.
    """
    names = list(dict.fromkeys(name for one in made.values() for name in one.environment))
    first, *others = made.items()
    alike = all(one.environment == first[1].environment for _, one in others)
    shown = dict([first]) if alike else dict(made)
    rows = [[name, *(one.environment.get(name, "–") for one in shown.values())] for name in names]
    commands = [
        join(
            [
                tag("p", f"{name}, {one.created}:" if one.created else f"{name}:"),
                tag("pre", one.command or "made from Python, not by a command"),
            ]
        )
        for name, one in made.items()
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
