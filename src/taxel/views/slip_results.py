"""Slip on objects never seen, as a table in the terminal. Knows nothing about how it was made."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from rich.box import SIMPLE_HEAD
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from taxel.evaluation.slip_crops import SlipCrops
from taxel.evaluation.slip_trials import SlipResult, SlipScores

GOAL_ACCURACY, GOAL_AUC = 0.92, 0.97
"""Goals at crop level."""
PUBLISHED = "a random forest on motion statistics: 87.5 %, AUC 0.958"


def slip_tables(results: Sequence[SlipResult], crops: SlipCrops, folds: int) -> RenderableType:
    """Return scores by crop and by trial, and what the controls know.

    Args:
        results: One a contender, ours first.
        crops: What was judged.
        folds: How many parts the objects were put in.
    """
    held, slipped = int((crops.slipped == 0).sum()), int(crops.slipped.sum())
    head = (
        f"{len(crops.slipped)} trials ({slipped} slipped, {held} held) of "
        f"{len(set(crops.objects.tolist()))} objects, {len(crops.trial)} crops of {crops.crop} "
        f"frames, {crops.y.mean():.0%} of them from slip trials. Objects in {folds} folds, each "
        "held out once; nothing is chosen on a test fold."
    )
    return Group(
        Text(head),
        _table("by crop", results, lambda one: one.crops, position=True),
        _table("by trial, its first crop only (every trial has one)", results,
               lambda one: one.first_crops),
        _table("by trial, mean over its crops", results, lambda one: one.trials),
        *(Text(f"leaks · {one.name}: {one.leaks}.") for one in results if one.leaks),
        Text(
            "A trial has one label and no onset: slip trials are shorter, so crops of later "
            "positions are more often of trials that held. “AUC same pos.” compares crops of the "
            "same position only. Intervals in []: 95 %, whole objects resampled."
        ),
        Text(_against_goal(results[0].crops)),
    )  # fmt: skip


def _table(
    title: str,
    results: Sequence[SlipResult],
    scores: Callable[[SlipResult], SlipScores],
    position: bool = False,
) -> Table:
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, pad_edge=False)
    table.add_column("sees")
    for column in ("accuracy %", "balanced %", "AUC", *(("AUC same pos.",) if position else ())):
        table.add_column(column, justify="right", no_wrap=True)
    for one in results:
        cells = _cells(scores(one))
        if position:
            cells.append(f"{one.auc_same_position:.3f}")
        table.add_row(one.name, *cells)
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
        f"Goal by crop: {GOAL_ACCURACY:.0%} and AUC {GOAL_AUC} ({PUBLISHED}). Ours: "
        f"{100 * ours.accuracy:.1f} % and {ours.auc:.3f}: {'reached' if reached else 'missed'}."
    )
