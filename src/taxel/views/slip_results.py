"""Slip on objects never seen, as a table in the terminal. Knows nothing about how it was made."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from rich.box import SIMPLE_HEAD
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from taxel.evaluation.slip_crops import PLACES, SlipCrops
from taxel.evaluation.slip_trials import SlipResult, SlipScores

GOAL_ACCURACY, GOAL_AUC = 0.92, 0.97
"""Goals for a trial's three crops together."""
PUBLISHED = "a random forest on motion statistics: 87.5 %, AUC 0.958"


def slip_tables(results: Sequence[SlipResult], crops: SlipCrops, folds: int) -> RenderableType:
    """Return scores by trial and by crop, and what the controls know.

    Args:
        results: One a contender, ours first.
        crops: What was judged.
        folds: How many parts the objects were put in.
    """
    held, slipped = int((crops.slipped == 0).sum()), int(crops.slipped.sum())
    head = (
        f"{len(crops.slipped)} trials ({slipped} slipped, {held} held) of "
        f"{len(set(crops.objects.tolist()))} objects; of each the first, the middle and the last "
        f"{crops.crop} frames. Objects in {folds} folds, each held out once; nothing is chosen on "
        "a test fold."
    )
    by_place = [
        _table(f"by its {place} crop alone", results, lambda one, i=i: one.places[i])  # type: ignore[misc]
        for i, place in enumerate(PLACES)
    ]
    return Group(
        Text(head),
        _table("by trial, mean over its three crops", results, lambda one: one.trials),
        *by_place,
        *(Text(f"leaks · {one.name}: {one.leaks}.") for one in results if one.leaks),
        Text(
            "A trial has one label and no onset, and slip trials are shorter: so every trial has "
            "as many crops, at the same places. Intervals in []: 95 %, whole objects resampled."
        ),
        Text(_against_goal(results[0].trials)),
    )  # fmt: skip


def _table(
    title: str,
    results: Sequence[SlipResult],
    scores: Callable[[SlipResult], SlipScores],
) -> Table:
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, pad_edge=False)
    table.add_column("sees")
    for column in ("accuracy %", "balanced %", "AUC"):
        table.add_column(column, justify="right", no_wrap=True)
    for one in results:
        table.add_row(one.name, *_cells(scores(one)))
    return table


def _cells(one: SlipScores) -> list[str]:
    low, high = one.accuracy_interval
    least, most = one.auc_interval
    return [
        f"{100 * one.accuracy:.1f} [{100 * low:.1f}, {100 * high:.1f}]",
        f"{100 * one.balanced:.1f}",
        f"{one.auc:.3f} [{least:.3f}, {most:.3f}]",
    ]


def _against_goal(ours: SlipScores) -> str:
    reached = ours.accuracy >= GOAL_ACCURACY and ours.auc >= GOAL_AUC
    return (
        f"Goal by trial, three fixed crops: {GOAL_ACCURACY:.0%} and AUC {GOAL_AUC} "
        f"({PUBLISHED}). Ours: "
        f"{100 * ours.accuracy:.1f} % and {ours.auc:.3f}: {'reached' if reached else 'missed'}."
    )
