"""How well the unknown is recognised, as tables. Knows nothing about how it was measured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from taxel.evaluation.unknown.scores import COVERAGES, OURS, SCORES, Auroc, UnknownResult
from taxel.plain_text import number_of, visible, visible_line
from taxel.views.tables.results import bracketed, result_table


def unknown_tables(results: Sequence[UnknownResult]) -> RenderableType:
    """Return one table of scores and one of coverage a target.

    Args:
        results: As `find_unknown` gives them.
    """
    return Group(
        *(
            part
            for result in results
            for part in (_scores(result), _coverage(result), _rejection_text(result))
        )
    )


def left_out_table(
    results: Mapping[str, UnknownResult], refused: Mapping[str, str]
) -> RenderableType:
    """Return one table: each class left out in turn, their mean and the least.

    Args:
        results: As `leave_each_out` gives them.
        refused: As above: classes that could not be left out, and why.
    """
    first = next(iter(results.values()))
    table = result_table(
        f"{visible(first.target)} · each class left out of the training in turn · "
        f"split: {visible(first.split)}",
        [heading.replace(" ", "\n") for heading in ("left out", *SCORES, "by trial",
                                                    "known rejected")],
    )  # fmt: skip
    for name, result in results.items():
        each = [result.auroc(name, score) for score in SCORES]
        rejected = f"{result.rejected_windows:.1%}"
        table.add_row(
            visible(name), *(f"{own.windows:.3f}" for own in each), _interval(each[0]), rejected
        )
    for name, join in (("mean", np.mean), ("least", np.min)):
        cells = [f"{join([r.auroc(key, score).windows for key, r in results.items()]):.3f}"
                 for score in SCORES]  # fmt: skip
        trials = join([result.auroc(key).grasps for key, result in results.items()])
        rejected = f"{np.mean([o.rejected_windows for o in results.values()]):.1%}"
        table.add_row(name, *cells, f"{trials:.3f}", rejected if name == "mean" else "")
    return Group(
        table,
        Text(
            "Area under the ROC curve over windows, known ones of held-out groups against those of "
            "the class that was left out of training; by trial: a trial's windows joined, "
            "with its 95 % interval."
        ),
        *(
            Text(visible_line(f"{visible(name)} could not be left out: {why}"))
            for name, why in refused.items()
        ),
    )


def _scores(result: UnknownResult) -> Table:
    table = result_table(
        f"unknown to {visible(result.target)} · split: {visible(result.split)} · "
        f"{number_of(result.known_windows, 'window')} and "
        f"{number_of(result.known_grasps, 'grasp')} known",
        ("not trained on", "score", "AUROC\nwindows", "grasps [95 %]", "found\nwindows", "grasps"),
    )
    for own in result.aurocs:
        ours = own.score == OURS
        table.add_row(
            f"{visible(own.kind)} ({number_of(own.unknown_grasps, 'grasp')})" if ours else "",
            own.score,
            f"{own.windows:.3f}",
            _interval(own) if ours else f"{own.grasps:.3f}",
            f"{own.found_windows:.1%}" if ours else "",
            f"{own.found_grasps:.1%}" if ours else "",
            style=None if ours else "dim",
        )
    return table


def _coverage(result: UnknownResult) -> Table:
    table = result_table(
        f"accuracy over the known touch that is answered, {visible(result.target)}",
        ("answered", *(f"{share:.0%}" for share in COVERAGES)),
    )
    for curve in result.curves:
        for name, values in (("windows", curve.windows), ("grasps", curve.grasps)):
            table.add_row(f"{curve.score}, {name}", *(f"{value:.3f}" for value in values))
    for name, values in (("windows", result.majority.windows), ("grasps", result.majority.grasps)):
        cells = [f"{value:.3f}" for value in values]
        table.add_row(f"majority by {OURS}, {name}", *cells, style="dim")
    return table


def _rejection_text(result: UnknownResult) -> Text:
    each = ", ".join(
        f"{visible(name)} {share:.1%}" for name, share in result.rejected_by_class.items()
    )
    accuracy, constant = result.curves[0].windows[0], result.majority.windows[0]
    behind = accuracy <= constant < 1.0  # one known class alone is always predicted
    return Text(
        f"false rejection rate: {result.rejected_windows:.1%} of windows, "
        f"{result.rejected_grasps:.1%} of grasps ({each})\n"
        + f"warning: the answers ({accuracy:.3f}) are no better than always naming the commonest "
        f"class ({constant:.3f}): they are of little use, whatever is rejected\n" * behind
    )


def _interval(own: Auroc) -> str:
    return bracketed(f"{own.grasps:.3f}", own.interval, ".3f")
