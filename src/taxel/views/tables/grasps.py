"""Results of grasp transitions as tables in the terminal: published values beside ours.

Knows nothing about how results were made.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from rich.box import SIMPLE_HEAD
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from taxel.evaluation.early_warning.events import EventScores
from taxel.evaluation.early_warning.grasp_warnings import WarningResult
from taxel.evaluation.transitions.precisions import PrecisionRow
from taxel.evaluation.transitions.step_times import StepTime
from taxel.evaluation.transitions.tables import TableRow, TrivialRow, WindowScores
from taxel.plain_text import number_of

TITLES = {
    1: "Table 1 · backbones and heads, k = 8",
    2: "Table 2 · LSTM layers, k = 8",
    3: "Table 3 · frames k in a window, LSTM",
}


def transition_tables(
    rows: Sequence[TableRow],
    baselines: Sequence[TrivialRow],
    times: dict[str, StepTime],
    rule: str,
    unstable: float,
) -> RenderableType:
    """Return Tables 1 to 3 and the trivial baselines.

    Args:
        rows: What was measured.
        baselines: Trivial answers on the same windows.
        times: Model's name → its step; models without are left blank.
        rule: Name of the labels' rule.
        unstable: Share of frames that are unstable, 0…1.
    """
    parts: list[RenderableType] = [
        Text(f"labels: rule {rule}, {unstable:.0%} of frames unstable. Accuracy in %, 95 % in []:"),
        Text("one cup out = the paper's split, binomial over windows; every cup = each held out."),
        Text("of limit = share of this machine's matrix product that a step reached, same run."),
        Text("RANDOM = no trained weights at hand: the row has no accuracy to compare."),
    ]
    for number, title in TITLES.items():
        own = [row for row in rows if number in row.plan.tables]
        if own:
            parts.append(_table(title, own, times if number < 3 else {}))
    origins = {row.plan.model.split("+")[0]: row.origin for row in rows if row.origin}
    parts += [Text(f"weights of {name}: {origin}") for name, origin in origins.items()]
    parts.append(_baseline_table(baselines))
    return Group(*parts)


def precision_table(rows: Sequence[PrecisionRow], rule: str, threads: int) -> RenderableType:
    """Return what engines and precisions of backbones lose and cost.

    Args:
        rows: What was measured.
        rule: Name of the labels' rule.
        threads: Of the engines.
    """
    table = Table(box=SIMPLE_HEAD, pad_edge=False)
    columns = ("model", "features", "accuracy", "lost", "decisions that differ", "largest Δp",
               "ms a step")  # fmt: skip
    for column in columns:
        table.add_column(column, justify="left" if column in columns[:2] else "right", no_wrap=True)
    for row in rows:
        table.add_row(
            row.model.replace("efficientnet", "effnet"), f"{row.engine} {row.precision}",
            f"{row.accuracy:.4f}", f"{row.lost:+.4f}", f"{row.differ:.2%}",
            f"{row.largest_difference:.2g}", f"{row.step_ms:.1f}",
        )  # fmt: skip
    return Group(
        Text(f"labels: rule {rule}; the last cup held out, "
             f"{number_of(rows[0].windows, 'window')}. One head, "),
        Text("trained on the first line's features; a step is two new frames and the head, "
             f"{number_of(threads, 'thread')}."),
        table,
    )  # fmt: skip


def _table(title: str, rows: Sequence[TableRow], times: dict[str, StepTime]) -> Table:
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, pad_edge=False)
    for column in ("model", "k", "weights", "paper", "one cup out", "every cup", "parameters"):
        table.add_column(column, justify="left" if column in ("model", "weights") else "right",
                         no_wrap=True)  # fmt: skip
    if times:
        for column in ("ms paper", "ms ours", "of limit", "MB paper", "MB ours"):
            table.add_column(column, justify="right", no_wrap=True)
    for row in rows:
        step = times.get(row.plan.model)
        cells = [
            row.plan.model.replace("efficientnet", "effnet"),
            str(row.plan.frames),
            row.weights,
            _number(row.plan.published, 2),
            _percent(row.single),
            _percent(row.every_cup) if row.every_cup else "",
            f"{row.parameters:,}",
        ]
        if times:
            cells += [_number(row.published_ms, 1), _number(step.stream_ms if step else None, 1),
                      f"{step.share:.0%}" if step and step.share else "",
                      _number(row.published_mb, 1), f"{row.size_mb:.1f}"]  # fmt: skip
        table.add_row(*cells)
    return table


def _baseline_table(baselines: Sequence[TrivialRow]) -> Table:
    table = Table(title="trivial baselines, same windows", title_justify="left", box=SIMPLE_HEAD,
                  pad_edge=False)  # fmt: skip
    for column in ("sees only", "one cup out", "every cup", "balanced"):
        table.add_column(column, justify="left" if column == "sees only" else "right")
    for baseline in baselines:
        table.add_row(
            baseline.name, _percent(baseline.single), _percent(baseline.every_cup),
            f"{100 * baseline.every_cup.balanced:.1f}",
        )  # fmt: skip
    return table


def warning_tables(results: Sequence[WarningResult], rule: str) -> RenderableType:
    """Return what monitors do on unseen cups, and by group for the first of them."""
    table = Table(
        title=f"warnings before gross slip, cups never seen · trained on rule {rule}",
        title_justify="left", box=SIMPLE_HEAD, pad_edge=False,
    )  # fmt: skip
    for column in ("monitor", "balanced %", "AUC", "lead s: median [95 %]", "p5 … p95",
                   "missed %", "false/min [95 %]", "early %"):  # fmt: skip
        table.add_column(column, justify="left" if column == "monitor" else "right")
    for result in results:
        table.add_row(result.name, f"{100 * result.windows.balanced:.1f}",
                      f"{result.windows.auc:.3f}", *_event_cells(result.events))  # fmt: skip
    parts: list[RenderableType] = [table]
    first = results[0]
    for key, groups in first.by.items():
        small = Table(title=f"{first.name}, by {key}", title_justify="left", box=SIMPLE_HEAD,
                      pad_edge=False)  # fmt: skip
        for column in (key, "runs", "slips", "lead s: median [95 %]", "p5 … p95", "missed %",
                       "false/min [95 %]", "early %"):  # fmt: skip
            small.add_column(column, justify="left" if column == key else "right")
        for value, scores in groups.items():
            small.add_row(value, str(scores.runs), str(scores.events), *_event_cells(scores))
        parts.append(small)
    config = first.tuned[-1].config
    parts.append(
        Text(
            f"thresholds, tuned on training cups only (last fold): warn {config.warn:.2f}, clear "
            f"{config.clear:.2f}, raised after {config.raise_s:g} s, cleared after "
            f"{config.clear_s:g} s. False alarms: in runs that hold, {first.events.hold_min:.1f} "
            "minutes. Intervals: whole cups resampled "
            f"({number_of(first.events.clusters, 'cup')}); false alarms: exact Poisson."
        )
    )
    return Group(*parts)


def _event_cells(scores: EventScores) -> list[str]:
    low, high = scores.lead_interval_s
    least, most = scores.false_alarms_poisson
    warned = not math.isnan(scores.lead_median_s)  # of any event, so that there is a lead
    interval = "" if math.isnan(low) else f" [{low:.2f}, {high:.2f}]"
    return [
        f"{scores.lead_median_s:.2f}{interval}" if warned else "–",
        f"{scores.lead_p5_s:.2f} … {scores.lead_p95_s:.2f}" if warned else "–",
        f"{100 * scores.missed_share:.0f}" if scores.events else "–",
        f"{scores.false_alarms_per_min:.2f} [{least:.2f}, {most:.2f}]" if scores.hold_min else "–",
        f"{100 * scores.early_share:.0f}" if scores.events else "–",
    ]


def _percent(scores: WindowScores) -> str:
    low, high = (100 * bound for bound in scores.interval)
    return f"{100 * scores.accuracy:.1f} [{low:.1f}, {high:.1f}]"


def _number(value: float | None, digits: int) -> str:
    return "" if value is None or math.isnan(value) else f"{value:.{digits}f}"
