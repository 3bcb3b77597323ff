"""Results as tables in the terminal: published values, baselines and intervals beside ours.

Knows nothing about how results were made.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

from rich.box import SIMPLE_HEAD
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from taxel.evaluation.baselines import below_majority
from taxel.evaluation.checked import Checked
from taxel.evaluation.crossval import Pooled
from taxel.evaluation.intervals import ALIKE, all_alike
from taxel.evaluation.run_scores import few_groups, only_one
from taxel.evaluation.teng.table_4_1 import PUBLISHED, ROWS, Section
from taxel.plain_text import noun_of, number_of, short_names, visible, visible_line

HEADINGS = {"cnn1d": "1D", "cnn2d": "2D", "minirocket": "MiniRocket"}
"""Short names: 1D is signal-based, 2D image-based."""
LEAST_WIDTH = 80
"""Characters of a line that any terminal has: those of the VT100 and of its heirs."""
_CORNER = "true ↓  predicted →"
_BETWEEN = 3
"""Characters between two columns."""
_EDGES = 2
"""Characters at both ends of a line of a table."""
_FEWEST = 4
"""Characters of a column's name in a confusion matrix at the least: a count needs as many."""


def teng_sections(sections: list[Section]) -> RenderableType:
    """Return Table 4.1, one table a task and split, and what must stand beside it."""
    parts: list[RenderableType] = []
    for section in sections:
        parts += [_table_4_1(section), *_beside(section), Text()]
    return Group(*parts)


def _table_4_1(section: Section) -> Table:
    title = f"Table 4.1 · {section.task} · preset {section.preset} · split: {section.split}"
    table = result_table(title, ("metric",))
    for model in section.columns:
        name = HEADINGS.get(model, model)
        if model in PUBLISHED:
            table.add_column(f"{name}\nthesis", justify="right", style="dim", no_wrap=True)
        table.add_column(f"{name}\nours", justify="right", no_wrap=True)
    for row in ROWS:
        cells = []
        for model, column in section.columns.items():
            if model in PUBLISHED:
                cells.append(_value(PUBLISHED[model][row]))
            cells.append(_value(column.rows[row]))
        table.add_row(row, *cells)
    return table


def _beside(section: Section) -> list[Text]:
    """Return the pooled accuracies with intervals, and the trivial baselines."""
    lines = [
        Text("each window predicted by a model not trained on its fold, 95 % CI over sessions:")
    ]
    for model, column in section.columns.items():
        lines.append(
            Text(
                f"  {HEADINGS.get(model, model):<11}{with_interval(column.pooled)}"
                f"   whole grasps {column.pooled.trial_accuracy:.4f}"
            )
        )
    trivial = " · ".join(f"{name} {value:.3f}" for name, value in section.trivial.items())
    lines.append(Text(f"  trivial baselines: {trivial}", style="dim"))
    return [*lines, *below(section.trivial), *few(column.pooled)]


def checked_table(checked: Checked) -> RenderableType:
    """Return one recipe's result with its bars and trivial baselines."""
    dataset, pooled = checked.dataset, checked.pooled
    about = Text(
        f"{visible(checked.recipe.target)} · split: {visible(pooled.split)} · "
        f"{number_of(len(dataset), 'window')} of {dataset.config.steps} × "
        f"{len(dataset.sensor.channels)} in {number_of(len(dataset.trials), 'trial')}",
        style="bold",
    )
    columns = ("model", "accuracy [95 %]", "by trial", "loss", "ROC-AUC", "F1")
    table = result_table(None, columns)
    for name, result in {checked.recipe.model: pooled, **checked.bars}.items():
        table.add_row(
            name,
            with_interval(result),
            f"{result.trial_accuracy:.4f}",
            f"{result.scores.loss:.4f}",
            _value(result.scores.roc_auc),
            f"{result.scores.f1:.4f}",
        )
    for name, accuracy in checked.trivial.items():
        table.add_row(visible(name), f"{accuracy:.4f}", "", "", "", "", style="dim")
    folds = "folds: " + " ".join(f"{value:.4f}" for value in pooled.fold_accuracies)
    group = visible(noun_of(pooled.interval_group))
    interval = f"interval: 95 %, whole groups resampled by {group}"
    return Group(
        about, table, *below(checked.trivial), Text(folds), Text(interval),
        *few(pooled, *checked.bars.values()),
        *(Text(visible_line(note)) for note in dataset.notes),
    )  # fmt: skip


def below(trivial: Mapping[str, float]) -> list[Text]:
    """Return the line about trivial baselines that a constant answer would beat, if any."""
    sentence = below_majority(trivial)
    return [Text(visible_line(sentence), style="dim")] if sentence else []


def few(pooled: Pooled, *others: Pooled) -> list[Text]:
    """Return the lines about an interval of few groups, within one, or without width, if it is one.

    Args:
        pooled: What is judged.
        others: Printed beside it, over the same groups.
    """
    narrow = few_groups(pooled.interval_group, pooled.interval_groups)
    lines = (
        None if all_alike(pooled.interval) else narrow,
        only_one(pooled.lone, pooled.interval_group),
    )
    alike = alike_note((own.interval for own in (pooled, *others)), pooled.interval_group)
    return [*alike, *(Text(visible_line(line)) for line in lines if line)]


def with_interval(pooled: Pooled) -> str:
    """Return an accuracy with its interval, as text."""
    alone = f"one {visible(noun_of(pooled.interval_group))}"
    return bracketed(f"{pooled.scores.accuracy:.4f}", pooled.interval, ".3f", alone)


def bracketed(
    value: str, interval: tuple[float, float], form: str, alone: str = "one group"
) -> str:
    """Return a value with its interval, what stands alone where there is none (NaN), or `ALIKE`
    where it has no width.
    """
    low, high = interval
    if all_alike(interval):
        return f"{value} [{ALIKE}]"
    return f"{value} [{alone}]" if math.isnan(low) else f"{value} [{low:{form}}, {high:{form}}]"


def alike_note(intervals: Iterable[tuple[float, float]], group: str) -> list[Text]:
    """Return the line on what is printed as `ALIKE`, if an interval is.

    Args:
        intervals: Those that are printed.
        group: What was resampled whole.
    """
    if not any(map(all_alike, intervals)):
        return []
    each = f"each {visible(noun_of(group))}"
    return [Text(f"{ALIKE}: no interval, as {each} gave the same; others may differ")]


def result_table(title: str | None, columns: Sequence[str]) -> Table:
    """Return a table without rows: names to the left, which may wrap, numbers to the right."""
    table = Table(title=title, title_justify="left", title_style="bold", box=SIMPLE_HEAD,
                  pad_edge=False)  # fmt: skip
    for index, column in enumerate(columns):
        table.add_column(column, justify="right" if index else "left", no_wrap=index > 0)
    return table


def confusion_table(
    classes: Iterable[str], confusion: list[list[int]], width: int = LEAST_WIDTH
) -> Table:
    """Return a confusion matrix: rows true, columns predicted.

    Args:
        classes: Their names.
        confusion: Shape (classes, classes).
        width: Characters of a line; columns' names are cut as far as they must be to fit.
    """
    names = list(classes)
    first = max(len(visible(name)) for name in (*names, _CORNER))
    room = (width - _EDGES - first) // max(1, len(names)) - _BETWEEN
    most = max(_FEWEST, min(room, max(len(visible(name)) for name in names)))
    table = Table(
        title="confusion",
        title_justify="left",
        box=SIMPLE_HEAD,
        pad_edge=False,
    )
    table.add_column(_CORNER, no_wrap=True)
    for name in short_names(names, most, end=""):
        table.add_column(name, justify="right", no_wrap=True)
    for name, row in zip(names, confusion, strict=True):
        table.add_row(visible(name), *(str(count) if count else "·" for count in row))
    return table


def _value(value: float) -> str:
    return "–" if math.isnan(value) else f"{value:.4f}"
