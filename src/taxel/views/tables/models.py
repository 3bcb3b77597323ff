"""Models side by side, and what cleaning gives, as tables. Knows nothing about how it was made."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Group, RenderableType
from rich.text import Text

from taxel.evaluation.teng.cleaning_gains import BASE, NOTHING, Gain
from taxel.evaluation.teng.model_comparison import LITERATURE, ModelResult, TrivialResult
from taxel.plain_text import noun_of, number_of, visible
from taxel.views.tables.results import below, bracketed, few, result_table, with_interval


def model_tables(
    results: Sequence[ModelResult], trivial: Sequence[TrivialResult]
) -> RenderableType:
    """Return one table a target and split, trivial baselines below the models.

    Args:
        results: As `compare_models` gives them.
        trivial: As above.
    """
    parts: list[RenderableType] = []
    for beside in trivial:
        shown = beside.target, beside.split
        own = [result for result in results if (result.target, result.pooled.split) == shown]
        table = result_table(
            f"{visible(beside.target)} · split: {visible(beside.split)} · "
            f"{number_of(beside.windows, 'window')}",
            (
                "model",
                "accuracy [95 %]",
                "by trial",
                "literature",
                "parameters",
                "s a fold",
                "µs a window",
            ),
        )
        for result in own:
            table.add_row(
                result.model,
                with_interval(result.pooled),
                f"{result.pooled.trial_accuracy:.4f}",
                LITERATURE.get(result.model, "–"),
                "–" if result.parameters is None else f"{result.parameters:,}",
                f"{result.fold_s:.1f}",
                f"{result.inference_us:,.0f}",
            )
        for name, accuracy in beside.accuracies.items():
            table.add_row(visible(name), f"{accuracy:.4f}", "", "", "", "", "", style="dim")
        parts += [table, *below(beside.accuracies)]
    group = noun_of(results[0].pooled.interval_group)
    return Group(
        *parts,
        Text(
            f"Intervals: 95 %, every {visible(group)} as a whole resampled. Seconds to fit one "
            "fold and predict its test part, one thread. µs: the median for one window on one "
            "thread, networks in ONNX Runtime as live, library models (parameters –) as they are. "
            "Literature: what the TENG thesis (sections 1 and 2.5) quotes for such networks, on "
            "other hands and objects, by splits that it does not name."
        ),
        *few(*(result.pooled for result in results)),
    )


def cleaning_tables(gains: Sequence[Gain], trivial: Sequence[TrivialResult]) -> RenderableType:
    """Return one table a target: each way of cleaning or changing windows against nothing.

    Args:
        gains: As `compare_cleaning` gives them.
        trivial: As above.
    """
    parts: list[RenderableType] = []
    for beside in trivial:
        own = [gain for gain in gains if gain.target == beside.target]
        table = result_table(
            f"{visible(beside.target)} · {BASE} · split: {visible(beside.split)} · "
            f"{number_of(len(own[0].by_run), 'run')}",
            ("windows", "accuracy", "by trial", "difference, points [95 %]", "p", "each run"),
        )
        table.add_column("what it gives")
        for result in own:
            plain = result.way == NOTHING
            table.add_row(
                result.way,
                f"{result.accuracy:.4f}",
                f"{result.trial_accuracy:.4f}",
                "" if plain else _points(result),
                "" if plain else f"{result.p:.3f}",
                "" if plain else " ".join(f"{100 * each:+.1f}" for each in result.by_run),
                result.verdict,
            )
        for name, accuracy in beside.accuracies.items():
            table.add_row(visible(name), f"{accuracy:.4f}", "", "", "", "", "", style="dim")
        parts += [table, *below(beside.accuracies)]
    return Group(
        *parts,
        Text(
            f"Each way alone, paired with nothing on the same windows and folds; intervals and p "
            f"(sign-flip) over {gains[0].groups} held-out groups. A claim is made where p is below "
            f"0.05 / {gains[0].ways}, for {gains[0].ways} ways were tried. Trivial baselines: of "
            "the first run's recordings."
        ),
    )


def _points(gain: Gain) -> str:
    low, high = gain.interval
    return bracketed(f"{100 * gain.difference:+.1f}", (100 * low, 100 * high), "+.1f")
