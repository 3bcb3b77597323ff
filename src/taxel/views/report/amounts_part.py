"""Accuracy against the amount of data, as `taxel learning-curve --json` wrote it.

Knows nothing about how it was measured.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from taxel.plain_text import several
from taxel.views.report.charts import Axis, Line, line_chart
from taxel.views.report.page import (
    Html,
    band,
    figure,
    join,
    key,
    percent,
    split_name,
    table,
    tag,
)


def amounts_part(data: Mapping[str, Any]) -> Html:
    """Return the curve with its interval and the best trivial baseline, and a row an amount.

    Raises:
        KeyError, TypeError, ValueError: It is something else.
    """
    amounts, group = data["amounts"], data["group"]
    groups = [int(amount["groups"]) for amount in amounts]
    best = [max(amount["trivial"].values()) for amount in amounts]
    lines = [
        Line(name="best trivial baseline", x=groups, y=best, colour="var(--grey)"),
        Line(
            name=data["model"], x=groups, y=[float(amount["accuracy"]) for amount in amounts],
            low=[_number(amount["low"]) for amount in amounts],
            high=[_number(amount["high"]) for amount in amounts], colour="var(--c0)",
        ),
    ]  # fmt: skip
    chart = line_chart(
        lines,
        Axis(label=f"{several(group)} to learn from", low=0, high=max(groups), ticks=groups),
        Axis(label="accuracy", low=0, high=1),
    )
    legend = key([("var(--c0)", f"{data['model']}, 95 %"), ("var(--grey)", lines[0].name)])
    sentence = ["Split: ", split_name(data["split"]), ". Each amount holds the one before; "
                f"{several(group)} are added whole, in an order drawn by seed {data['seed']}; "
                f"the test parts stay. Interval: whole {several(group)} of the test parts drawn "
                "again."]  # fmt: skip
    rows: list[list[object]] = []
    for amount, value in zip(amounts, best, strict=True):
        name = max(amount["trivial"], key=amount["trivial"].get)
        rows.append([
            str(amount["groups"]), f"{amount['windows']:,}", percent(float(amount["accuracy"])),
            band(_number(amount["low"]), _number(amount["high"])), percent(float(value)), name,
        ])  # fmt: skip
    head = [several(group), "windows", "accuracy", "95 %", "best trivial baseline", "which"]
    return join([tag("p", join(sentence)), figure(chart, legend), table(head, rows)])


def _number(value: Any) -> float:
    return math.nan if value is None else float(value)
