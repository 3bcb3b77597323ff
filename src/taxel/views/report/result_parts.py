"""Accuracies of runs: beside each other, trivial baselines and the thesis, and each run's own.

Knows nothing about recordings or how runs were trained.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import isnan

from taxel.evaluation.intervals import all_alike
from taxel.evaluation.paired import Paired
from taxel.evaluation.run_scores import RunScores, beside_baselines, few_groups, only_one
from taxel.evaluation.teng.table_4_1 import PUBLISHED, TASKS
from taxel.plain_text import noun_of, number_of, several
from taxel.training.curves import Curve
from taxel.training.run import Run
from taxel.views.report.charts import Axis, Dot, Line, dot_chart, line_chart, matrix
from taxel.views.report.curves_part import curves_part
from taxel.views.report.page import (
    Html,
    band,
    figure,
    join,
    number,
    percent,
    split_name,
    table,
    tag,
)
from taxel.views.tables.compare import interval_text
from taxel.views.tables.results import HEADINGS
from taxel.windows.config import TENG_WINDOW

_MOST_GROUPS = 40
"""Groups whose accuracy is drawn, each on a line: about a page."""


def accuracies(
    runs: Mapping[str, Run], judged: Mapping[str, RunScores], inks: Mapping[str, str]
) -> Html:
    """Return runs of one data set, target and split beside their trivial baselines.

    Args:
        runs: Name → run.
        judged: Name → its predictions, judged.
        inks: Name → its colour on the page.
    """
    first = next(iter(runs.values()))
    assert first.predictions is not None
    trivial = _baselines(runs)
    dots = [
        Dot(
            f"{name} ({run.contract.model})" if run.contract.model not in name else name,
            judged[name].scores.accuracy,
            *_main_interval(judged[name]),
            inks[name],
        )
        for name, run in runs.items()
    ]
    dots += [Dot(name, value, colour="var(--grey)") for name, value in trivial.items()]
    group = judged[next(iter(runs))].group
    own = [judged[name] for name in runs]
    notes = dict.fromkeys([*map(_few, own), *map(_lone, own)])
    rows = [_accuracy_row(name, run, judged[name]) for name, run in runs.items()]
    rows += [[name, "", percent(value), "", "", "", "", "", ""] for name, value in trivial.items()]
    return join(
        [
            tag(
                "h3",
                join([first.contract.target, ", split: ", split_name(first.predictions.split)]),
            ),
            figure(
                dot_chart(dots),
                "Accuracy over all test windows, with 95 % CI, bootstrapped over "
                f"{several(group)}. Grey: baselines, which see no touch, hardly any, or only "
                "channel means.",
            ),
            join([tag("p", note) for note in notes if note]),
            _cleared({name: judged[name] for name in runs}, runs),
            table(
                ["run", "model", "accuracy", f"95 % CI over {several(group)}, %",
                 "by trial", "loss, nats",
                 "ROC-AUC", "F1", "parameters"],
                rows,
                quiet=range(len(runs), len(rows)),
            ),
        ]
    )  # fmt: skip


def _baselines(runs: Mapping[str, Run]) -> dict[str, float]:
    """Return the trivial baselines' accuracies, once where they are the same for all runs.

    Runs of other windows have other baselines: each run is judged by its own.
    """
    first = next(iter(runs.values())).trivial
    if all(run.trivial == first for run in runs.values()):
        return dict(first)
    return {
        f"{what} ({name})": value
        for name, run in runs.items()
        for what, value in run.trivial.items()
    }


def _accuracy_row(name: str, run: Run, judged: RunScores) -> list[object]:
    scores, parameters = judged.scores, run.contract.parameters
    return [
        name,
        run.contract.model,
        percent(scores.accuracy),
        band(*_main_interval(judged)),
        percent(judged.trial_accuracy),
        number(scores.loss, 3),
        number(scores.roc_auc, 3),
        number(scores.f1, 3),
        f"{parameters:,}" if parameters else "–",
    ]


def _few(judged: RunScores) -> str | None:
    """Return a warning on an interval of so few groups that it is too narrow, if it is one."""
    interval = judged.intervals[judged.group]
    if isnan(interval.low) or all_alike((interval.low, interval.high)):
        return None
    note = few_groups(judged.group, interval.groups)
    return note and f"{note}."


def _lone(judged: RunScores) -> str | None:
    """Return a warning on intervals within one session, if they are such."""
    note = only_one(judged.lone, judged.group)
    return note and f"{note[0].upper()}{note[1:]}."


def _cleared(judged: Mapping[str, RunScores], runs: Mapping[str, Run]) -> Html:
    """Say whether each run stands clear of the best of its own trivial baselines."""
    lines, bad = [], False
    for name, own in judged.items():
        trivial = runs[name].trivial
        if not trivial:
            continue
        standing, line = beside_baselines(
            name, own.scores.accuracy, own.intervals[own.group], own.group, trivial
        )
        bad = bad or standing == "behind"
        lines.append(line)
    if not lines:
        return Html("")
    return tag("p", "; ".join(lines) + ".", "note leaks" if bad else "note")


def published_beside(runs: Mapping[str, Run], judged: Mapping[str, RunScores]) -> Html:
    """Return Table 4.1's values beside the runs that follow the thesis's recipe; else nothing."""
    ours = {
        name: run
        for name, run in runs.items()
        if run.contract.model in PUBLISHED
        and run.contract.window == TENG_WINDOW
        and run.contract.target in TASKS
    }
    if not ours:
        return Html("")
    head = ["metric"]
    for name, run in ours.items():
        head += [f"{HEADINGS[run.contract.model]}, thesis", name]
    rows: list[list[object]] = []
    for metric in (
        "Mean K-Fold Acc", "Multi-Class ROC-AUC", "Precision", "Recall", "F1-Score"
    ):  # fmt: skip
        row: list[object] = [metric]
        for name, run in ours.items():
            value = _metric(judged[name], metric)
            published = number(PUBLISHED[run.contract.model][metric])
            row += [tag("span", published, "published"), number(value)]
        rows.append(row)
    return join(
        [
            Html("<h3>Beside the thesis</h3>"),
            tag(
                "p",
                join(
                    [
                        "The thesis (Balapan, 2025, Table 4.1) names no split; its figures fit "
                        "windows split at random, which leaks. It does not say "
                        "whether its values are of shape or of material. "
                        "Its other rows need a test part of their own: ",
                        tag("code", "taxel reproduce table-4-1"),
                        ".",
                    ]
                ),
            ),
            table(head, rows),
        ]
    )


def each_run(name: str, run: Run, scores: RunScores, ink: str) -> Html:
    """Return one run's confusion, reliability, groups and learning curve, in its colour."""
    assert run.predictions is not None
    intervals = [
        [
            key,
            str(interval.groups),
            band(interval.low, interval.high) if interval.groups > 2 else "too few to say",
        ]
        for key, interval in scores.intervals.items()
    ]
    parts: list[object] = [
        figure(
            matrix(run.predictions.classes, scores.scores.confusion), "All test windows.", "free"
        ),
        figure(_reliability(scores, ink), _trust(scores)),
    ]
    few = [
        Dot(f"{g.name} · {g.windows}", g.accuracy, colour=ink)
        for g in scores.by_group[:_MOST_GROUPS]
    ]
    return join(
        [
            tag("h3", name),
            tag("div", join(parts), "side"),
            figure(
                dot_chart(few),
                f"Accuracy in each {noun_of(scores.group)} (and its windows), each window "
                "predicted by a model that did not train on it; folds: "
                + ", ".join(percent(value) for value in scores.fold_accuracies)
                + "."
                + (
                    f" {len(scores.by_group) - _MOST_GROUPS} more not shown."
                    if len(scores.by_group) > _MOST_GROUPS
                    else ""
                ),
            ),
            *_training(run, ink),
            tag("p", "How wide the interval is depends on what is resampled as independent:"),
            table(["resampled whole", "how many", "95 % CI of the accuracy, %"], intervals),
        ]
    )


def comparison(found: Paired, first: str, second: str) -> Html:
    """Return two runs' paired test."""
    n = len(found.groups)
    return join(
        [
            Html("<h3>"), f"{second} against {first}", Html("</h3>"),
            tag("p", found.say(first, second), "note"),
            table(
                ["", first, second, "difference, points [95 %]",
                 f"p over {number_of(n, found.group)}", "smallest possible", "p over windows"],
                [["accuracy", percent(found.first), percent(found.second),
                  f"{100 * found.difference:+.1f}{interval_text(found)}",
                  f"{found.p_groups:.2g}", f"{found.smallest_p:.2g}", f"{found.p_windows:.2g}"]],
            ),
        ]
    )  # fmt: skip


def _metric(own: RunScores, name: str) -> float:
    scores = own.scores
    return {
        "Mean K-Fold Acc": sum(own.fold_accuracies) / len(own.fold_accuracies),
        "Multi-Class ROC-AUC": scores.roc_auc,
        "Precision": scores.precision,
        "Recall": scores.recall,
        "F1-Score": scores.f1,
    }[name]


def _main_interval(own: RunScores) -> tuple[float, float]:
    interval = own.intervals[own.group]
    return interval.low, interval.high


def _reliability(own: RunScores, ink: str) -> Html:
    line = Line(
        name="reliability",
        x=[bin_.confidence for bin_ in own.reliability],
        y=[bin_.accuracy for bin_ in own.reliability],
        colour=ink,
    )
    axes = (
        Axis(label="confidence", low=0, high=1),
        Axis(label="share correct", low=0, high=1),
    )
    return line_chart([line], *axes, diagonal=True, size=(300, 240))


def _trust(own: RunScores) -> str:
    windows = sum(bin_.windows for bin_ in own.reliability)
    says = sum(bin_.confidence * bin_.windows for bin_ in own.reliability) / windows
    off = says - own.scores.accuracy
    kind = (
        "overconfident"
        if off > 0.02
        else "underconfident"
        if off < -0.02
        else "well calibrated on average"
    )
    return (
        f"Mean confidence {percent(says)}, accuracy {percent(own.scores.accuracy)}: {kind}. "
        f"Expected calibration error {own.calibration_error:.3f}."
    )


def _training(run: Run, ink: str) -> list[Html]:
    """Return how each fold's network learned; the last one, on all recordings, where none did."""
    curves = run.curves
    if not curves and len(run.history) > 1:
        curves = (Curve("all recordings, for use", run.history),)
    return [tag("h4", "Training"), curves_part(curves, ink)] if curves else []
