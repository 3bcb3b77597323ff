"""What was tried, what was chosen and what it is worth, for the terminal.

Knows nothing about how it was found.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import isnan

from rich.console import Group, RenderableType
from rich.text import Text

from taxel.evaluation.expert import Expert
from taxel.evaluation.intervals import all_alike
from taxel.evaluation.nested import Nested
from taxel.evaluation.run_scores import (
    blind_baselines,
    few_groups,
    least_of_all_right,
    only_one,
    unnamed_line,
)
from taxel.plain_text import number_of, visible, visible_line
from taxel.training.choose.choice import Choice
from taxel.views.tables.results import result_table
from taxel.windows.checks import OUTSIDE

SHOWN = 12
"""Lines of the leaderboard; expert.json holds all."""
THINNED = "windows “1 of N”: tried on one in N of the stretches, only to compare ways to cut"
"""Said beneath a leaderboard that has such rows."""
KINDS = 4
"""Kinds of models that are named of those that were not tried; expert.json names all."""
SETTINGS = (
    "the number after a model is its setting: shrinkage (discriminants), C (logistic regression), "
    "smallest number of windows in a leaf (trees), penalty (perceptrons)"
)


def leaderboard(choice: Choice, *, repeated: bool = False) -> RenderableType:
    """Return what was tried on all data, the best first, and why the winner won.

    Args:
        choice: What was tried and chosen.
        repeated: Whether that was in an earlier run.
    """
    when = "in the run that is repeated, " if repeated else ""
    table = result_table(
        f"{visible(choice.target)} · {when}the saved model was chosen on "
        f"{number_of(choice.folds, 'inner fold')}, {visible(choice.held)} held out",
        ("model", "windows", "loss", "accuracy", "s", "weight"),
    )
    rows = choice.leaderboard
    shown_rows = [row for place, row in enumerate(rows) if place < SHOWN or row.weight]
    for row in shown_rows:
        weight = f"{row.weight:.2f}" if row.weight else ""
        table.add_row(row.name, row.windows, f"{row.loss:.4f}", f"{row.accuracy:.4f}",
                      f"{row.seconds:.1f}", weight)  # fmt: skip
    lines = [
        Text(f"chosen: {choice.why}; inner loss {choice.loss:.4f}, accuracy {choice.accuracy:.4f}")
    ]
    if rows:
        lines.append(Text(SETTINGS, style="dim"))
    if any(", 1 of " in row.windows for row in shown_rows):
        lines.append(Text(THINNED, style="dim"))
    if len(shown_rows) < len(rows):
        lines.append(Text(f"{len(rows) - len(shown_rows)} more in expert.json", style="dim"))
    if choice.behind:
        lines.append(
            Text(
                f"far behind on the first inner fold, and not compared further: windows of "
                f"{', '.join(map(visible, choice.behind))}"
            )
        )
    if choice.slow:
        lines.append(
            Text(
                f"features left out, because with them a window would take longer than --max-us: "
                f"{', '.join(map(visible, choice.slow))}; a larger --max-us may be more accurate"
            )
        )
    if choice.left_out and not repeated:
        count = len(choice.left_out)
        lines.append(
            Text(
                f"{count} not tried, because the time was up: {_first_kinds(choice.left_out)}; "
                "expert.json lists all; --minutes allows more"
            )
        )
    return Group(table, *lines)


def _first_kinds(left_out: Sequence[str]) -> str:
    """Return the first of each kind of model that was not tried, a few of them."""
    first: dict[str, str] = {}
    for name in left_out:
        first.setdefault(name.split()[0], name.partition(" · ")[0])
    shown = list(first.values())[:KINDS]
    return ", ".join(map(visible, shown)) + (" …" if len(shown) < len(left_out) else "")


def nested_table(nested: Nested) -> RenderableType:
    """Return the outer score, by window and by trial, with its bars on the same windows."""
    scores, by_trial = nested.scores, nested.by_trial
    how = f"nested: each of {len(nested.choices)} folds chose on its own training part"
    if len(nested.choices) == 1:
        how = "nested: chosen on the training part alone"
    if nested.fixed:
        how = "chosen before, then trained on each training part; not nested if the choice saw it"
    heading = Text(  # not the table's title, which would break at the table's width
        f"split: {visible(nested.split)} · {how} · "
        f"{number_of(len(nested.predictions), 'test window')}, "
        f"{number_of(by_trial.trials, 'trial')}",
        style="bold",
    )
    table = result_table(
        None, ("model", "accuracy", "by trial", "loss", "loss by trial", "calibration error")
    )
    first = "as chosen before" if nested.fixed else "chosen by default"
    for name, (own, trials) in {first: (scores, by_trial), **nested.bars}.items():
        table.add_row(
            name, f"{own.scores.accuracy:.4f}", f"{trials.accuracy:.4f}",
            f"{own.scores.loss:.4f}", f"{trials.loss:.4f}", f"{own.calibration_error:.4f}",
        )  # fmt: skip
    blind = [name for name in blind_baselines(nested.predictions) if name in nested.trivial]
    for name, accuracy in nested.trivial.items():
        if name not in blind:
            table.add_row(name, f"{accuracy:.4f}", style="dim")
    interval = scores.intervals[scores.group]
    over = number_of(interval.groups, visible(scores.group))
    lines = [Text(f"{interval_words(interval.low, interval.high, over)}{_all_right(nested)}")]
    if blind:
        hidden = ", ".join(blind)
        text = f"baselines not shown, because they carry no information here: {hidden}"
        lines.append(Text(text, style="dim"))
    if not isnan(interval.low) and not all_alike((interval.low, interval.high)):
        few = few_groups(scores.group, interval.groups)
        lines += [Text(visible_line(few), style="yellow")] if few else []
    if note := only_one(scores.lone, scores.group):
        lines.append(Text(visible_line(note), style="yellow"))
    if nested.warning:
        lines.append(Text(f"warning: {visible_line(nested.warning)}", style="yellow"))
    if note := unnamed_line(nested.predictions):
        lines.append(Text(note, style="yellow" if note.startswith("warning") else ""))
    return Group(heading, table, *lines)


def interval_words(low: float, high: float, over: str) -> str:
    """Return an accuracy's interval in words, or why there is none.

    Args:
        low: Its lower bound, 0…1; NaN where there is none.
        high: Its upper one.
        over: What was resampled, as in "4 sessions".
    """
    if isnan(low):
        return f"no 95 % CI: {over} only"
    if all_alike((low, high)):
        return f"no 95 % CI: {over}, all alike; others may differ"
    return f"95 % CI over {over}: {low:.4f} … {high:.4f}"


def _all_right(nested: Nested) -> str:
    """Return what an interval without width hides: what so few trials can show."""
    trials = nested.by_trial
    if trials.accuracy < 1.0:
        return ""
    least = least_of_all_right(trials.trials)
    return (
        f"; all {number_of(trials.trials, 'trial')} correct; with that many, the 95 % lower bound "
        f"is {least:.3f}"
    )


def expert_report(expert: Expert) -> RenderableType:
    """Return everything that is printed of a training."""
    parts: list[RenderableType] = [leaderboard(expert.choice, repeated=expert.repeated)]
    if expert.nested is not None:
        parts += [Text(), nested_table(expert.nested)]
    measured = expert.measured
    parts.append(
        Text(
            f"bundle: {measured.mb:.2f} MB, {measured.us:.0f} µs a window on one core; "
            f"probabilities differ from offline by at most {measured.parity:.1e}"
        )
    )
    parts += [Text(visible_line(f"given up: {line}")) for line in expert.given_up]
    # Windows overlap where they are searched among: how many of those fit no trial says nothing.
    parts += [Text(visible_line(note)) for note in expert.notes if OUTSIDE not in note]
    if expert.tries_kept:
        parts.append(
            Text(f"{number_of(expert.tries_kept, 'try')} kept from a run that was interrupted")
        )
    return Group(*parts)
