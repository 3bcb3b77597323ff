"""Results as tables in the terminal: published values, baselines and intervals beside ours.

Knows nothing about how results were made.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from taxel.evaluation.checked import Checked
from taxel.evaluation.crossval import Pooled
from taxel.evaluation.teng_table import PUBLISHED, ROWS, Section

HEADINGS = {"cnn1d": "signal (1D)", "cnn2d": "image (2D)", "minirocket": "MiniRocket"}


def teng_sections(sections: list[Section]) -> RenderableType:
    """Return Table 4.1, one table a preset and split, and what must stand beside it."""
    parts: list[RenderableType] = []
    for key in dict.fromkeys((section.preset, section.split) for section in sections):
        own = [section for section in sections if (section.preset, section.split) == key]
        parts += [_table_4_1(*key, own), _pooled_table(own), Text()]
    return Group(*parts)


def _table_4_1(preset: str, split: str, sections: list[Section]) -> Table:
    table = Table(
        title=f"Table 4.1 · preset {preset} · split: {split}", title_justify="left", pad_edge=False
    )
    table.add_column("metric", no_wrap=True)
    models = list(sections[0].columns)
    for model in models:
        if model in PUBLISHED:
            table.add_column(f"{HEADINGS[model]}\npublished", justify="right", style="dim")
        for section in sections:
            table.add_column(f"{HEADINGS.get(model, model)}\n{section.task}", justify="right")
    for row in ROWS:
        cells = []
        for model in models:
            if model in PUBLISHED:
                cells.append(_value(row, PUBLISHED[model][row]))
            cells += [_value(row, section.columns[model].rows[row]) for section in sections]
        table.add_row(row, *cells)
    return table


def _pooled_table(sections: list[Section]) -> Table:
    table = Table(
        title="every window told by a model that did not train on its fold · trivial baselines",
        title_justify="left",
        pad_edge=False,
    )
    table.add_column("what")
    for section in sections:
        table.add_column(f"{section.task}: accuracy", justify="right")
    first = sections[0]
    for model in first.columns:
        cells = [with_interval(section.columns[model].pooled) for section in sections]
        table.add_row(HEADINGS.get(model, model), *cells)
    for model in first.columns:
        cells = [f"{section.columns[model].pooled.trial_accuracy:.4f}" for section in sections]
        table.add_row(f"{HEADINGS.get(model, model)}, whole grasp", *cells)
    for name in first.trivial:
        table.add_row(name, *(f"{section.trivial[name]:.4f}" for section in sections), style="dim")
    return table


def checked_table(checked: Checked) -> RenderableType:
    """Return one recipe's result with its bars and trivial baselines."""
    dataset, pooled = checked.dataset, checked.pooled
    table = Table(
        title=f"{checked.recipe.target} · split: {pooled.split} · {len(dataset)} windows of "
        f"{dataset.config.steps} × {len(dataset.sensor.channels)} in {len(dataset.trials)} trials",
        title_justify="left",
        pad_edge=False,
    )
    for column in ("model", "accuracy, windows", "accuracy, trials", "loss", "ROC-AUC", "F1"):
        table.add_column(column, justify="left" if column == "model" else "right")
    for name, result in {checked.recipe.model: pooled, **checked.bars}.items():
        table.add_row(
            name,
            with_interval(result),
            f"{result.trial_accuracy:.4f}",
            f"{result.scores.loss:.4f}",
            _value("", result.scores.roc_auc),
            f"{result.scores.f1:.4f}",
        )
    for name, accuracy in checked.trivial.items():
        table.add_row(name, f"{accuracy:.4f}", "", "", "", "", style="dim")
    folds = "folds: " + " ".join(f"{value:.4f}" for value in pooled.fold_accuracies)
    interval = f"interval: 95 %, whole groups resampled by {pooled.interval_group}"
    return Group(table, *(Text(line) for line in (folds, interval, *dataset.notes)))


def with_interval(pooled: Pooled) -> str:
    """Return an accuracy with its interval, as text."""
    low, high = pooled.interval
    if math.isnan(low):
        return f"{pooled.scores.accuracy:.4f} [one {pooled.interval_group}]"
    return f"{pooled.scores.accuracy:.4f} [{low:.3f}, {high:.3f}]"


def confusion_table(classes: Iterable[str], confusion: list[list[int]]) -> Table:
    """Return a confusion matrix: rows true, columns predicted."""
    table = Table(title="confusion (rows: true, columns: told)", title_justify="left")
    names = list(classes)
    table.add_column("")
    for name in names:
        table.add_column(name, justify="right")
    for name, row in zip(names, confusion, strict=True):
        table.add_row(name, *map(str, row))
    return table


def _value(row: str, value: float) -> str:
    return "–" if math.isnan(value) else f"{value:.4f}"
