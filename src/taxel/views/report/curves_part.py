"""How networks learned: loss and accuracy over the epochs, learned from and held out, and the gap.

Knows nothing about how they were trained.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from taxel.training.curves import Curve, Epoch
from taxel.views.report.charts import Axis, Line, line_chart
from taxel.views.report.page import Html, figure, join, key, number, percent, table, tag

_HELD = "var(--c1)"
_SIDE = (360, 260)
"""Width and height of a chart, pixels."""
_Value = Callable[[Epoch], float | None]


def curves_part(curves: Sequence[Curve], ink: str = "var(--c0)") -> Html:
    """Return trainings as two charts, and a table of the gap after the last epoch.

    Args:
        curves: One a fold, each with more than one epoch.
        ink: Colour of what was learned from.
    """
    watched = [
        curve for curve in curves if any(e.validation_loss is not None for e in curve.epochs)
    ]
    if not watched:
        chart = _chart(curves, [("loss", lambda e: e.loss, ink)], "loss, nats", None)
        return figure(chart, "Training only: nothing was held out.")
    losses = _chart(
        watched,
        [("training", lambda e: e.training_loss, ink),
         ("held out", lambda e: e.validation_loss, _HELD)],
        "loss, nats", None,
    )  # fmt: skip
    accuracies = _chart(
        watched,
        [("training", lambda e: e.training_accuracy, ink),
         ("held out", lambda e: e.validation_accuracy, _HELD)],
        "accuracy", 1.0,
    )  # fmt: skip
    legend = key([(ink, "training"), (_HELD, "held out")])
    folds = f"{len(watched)} folds: mean, least to most" if len(watched) > 1 else watched[0].name
    sentence = (
        f"{folds}. After each epoch, up to 256 windows of each part are predicted. Nothing is "
        "chosen by them, and the last epoch's network is kept. "
        f"{_gap_words(watched)}"
    )
    return join(
        [
            tag("div", join([figure(own, kind="free") for own in (losses, accuracies)]), "side"),
            tag("p", legend), tag("p", sentence), _gaps(watched),
        ]
    )  # fmt: skip


def _gap_words(curves: Sequence[Curve]) -> str:
    """Return the mean gap in words."""
    sides = np.array([curve.gap for curve in curves]).T
    loss, points = (
        float(np.nanmean(side)) if np.isfinite(side).any() else math.nan for side in sides
    )
    return f"Gap after the last epoch: {number(loss, 3)} nats, {number(100 * points, 1)} points."


def _gaps(curves: Sequence[Curve]) -> Html:
    rows: list[list[object]] = []
    for curve in curves:
        last, (_, points) = curve.epochs[-1], curve.gap
        rows.append([
            curve.name, str(len(curve.epochs)), number(last.training_loss, 3),
            number(last.validation_loss, 3), percent(last.training_accuracy),
            percent(last.validation_accuracy),
            "–" if math.isnan(points) else f"{100 * points:+.1f}",
        ])  # fmt: skip
    head = ["fold", "epochs", "loss, training", "loss, held out", "accuracy, training",
            "accuracy, held out", "gap, points"]  # fmt: skip
    return table(head, rows)


def _chart(
    curves: Sequence[Curve],
    sides: Sequence[tuple[str, _Value, str]],
    label: str,
    most: float | None,
) -> Html:
    count = max(len(curve.epochs) for curve in curves)
    lines = [_line(curves, name, value, ink) for name, value, ink in sides]
    seen = [v for line in lines for v in (*line.y, *line.high) if math.isfinite(v)]
    top = most if most is not None else 1.05 * max([1e-3, *seen])
    step = max(1, round(count / 6))
    return line_chart(
        lines,
        Axis(label="epoch", low=1, high=max(2, count), ticks=range(1, count + 1, step)),
        Axis(label=label, low=0, high=top),
        size=_SIDE, dots=count <= 30,
    )  # fmt: skip


def _line(curves: Sequence[Curve], name: str, value: _Value, ink: str) -> Line:
    """Return the mean over trainings at each epoch, with the least and the most."""
    epochs = sorted({epoch.number for curve in curves for epoch in curve.epochs})
    found: dict[int, list[float]] = {at: [] for at in epochs}
    for curve in curves:
        for epoch in curve.epochs:
            here = value(epoch)
            if here is not None and math.isfinite(here):
                found[epoch.number].append(here)
    known = [at for at in epochs if found[at]]
    several = len(curves) > 1
    return Line(
        name=name,
        x=known,
        y=[float(np.mean(found[at])) for at in known],
        low=[min(found[at]) for at in known] if several else (),
        high=[max(found[at]) for at in known] if several else (),
        colour=ink,
    )
