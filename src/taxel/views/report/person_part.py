"""The person in the loop: reaction times and what came of grasps with and without an alarm.

Knows nothing about how they were logged.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from taxel.evaluation.cards.reaction_times import KINDS, ReactionTimes, reaction_times
from taxel.plain_text import number_of
from taxel.recordings.trial_log import OUTCOMES, GraspTrial
from taxel.views.report.charts import Axis, Line, line_chart
from taxel.views.report.page import Html, figure, join, number, percent, table, tag, tiles

_MOST_ROWS = 200
"""Grasps that are listed one by one. Source: our choice, docs/decisions/0046."""


def person_part(logs: Mapping[str, Sequence[GraspTrial]]) -> Html:
    """Return the figures of some logs, and each grasp.

    Args:
        logs: Name → its grasps.
    """
    reactions = reaction_times(list(logs.values()))
    parts: list[object] = [
        tiles(_figures(reactions)),
        tag(
            "p",
            "From the alarm to the first thing that the person did, by key, button or mark: it "
            "includes reaching for the key. Outcomes are what a person said, or the source's "
            "own truth.",
        ),
    ]
    if reactions.times_s:
        parts.append(figure(_chart(reactions), _interval_words(reactions)))
    parts.append(_outcomes(reactions))
    rows = [_row(name, trial) for name, own in logs.items() for trial in own]
    head = ["log", "cameras", "grasp", "alarm", "advice", "acknowledged, s", "reaction",
            "reaction time, s", "outcome", "by"]  # fmt: skip
    parts.append(table(head, rows[:_MOST_ROWS]))
    if len(rows) > _MOST_ROWS:
        parts.append(tag("p", f"{len(rows) - _MOST_ROWS} more not shown."))
    return join(parts)


def _figures(found: ReactionTimes) -> list[tuple[str, str]]:
    share = found.reacted / found.warned if found.warned else math.nan
    return [
        (f"{number(found.median_s, 2)} s", "median reaction time"),
        (percent(share, 0), f"of {number_of(found.warned, 'alarm')} with a reaction after it"),
        (str(found.before), "reactions before the alarm"),
        (str(found.grasps), "grasps"),
    ]


def _interval_words(found: ReactionTimes) -> str:
    low, high = found.interval_s
    if math.isnan(low):
        return "One reaction: no interval."
    return (
        f"Share of reactions within a time. Median {number(found.median_s, 2)} s, 95 % CI "
        f"[{number(low, 2)}, {number(high, 2)}], whole {found.drawn}s drawn again."
    )


def _chart(found: ReactionTimes) -> Html:
    """Return the share that has reacted within a time, as steps."""
    times, count = found.times_s, len(found.times_s)
    x, y = [0.0], [0.0]
    for index, time_s in enumerate(times):
        x += [time_s, time_s]
        y += [index / count, (index + 1) / count]
    end = max(1.0, math.ceil(times[-1] * 1.05))
    line = Line(name="reacted", x=[*x, end], y=[*y, 1.0], colour="var(--c0)")
    return line_chart(
        [line],
        Axis(label="from alarm to reaction, s", low=0, high=end),
        Axis(label="share that has reacted", low=0, high=1),
        dots=False,
    )


def _outcomes(found: ReactionTimes) -> Html:
    names = (*OUTCOMES, "unknown")
    rows: list[list[object]] = []
    for kind in KINDS:
        own = found.outcomes[kind]
        total = sum(own.values())
        rows.append([kind, str(total), *(_share(own[name], total) for name in names)])
    return table(["grasps with", "grasps", *names], rows)


def _share(count: int, total: int) -> str:
    return f"{count} ({percent(count / total, 0)})" if total else "–"


def _row(name: str, trial: GraspTrial) -> list[object]:
    seen = trial.acknowledged_s
    since = None if seen is None or trial.alarm_s is None else seen - trial.alarm_s
    return [
        name, trial.cameras or "–", str(trial.number), trial.alarm or "–", trial.advice or "–",
        number(since, 2), trial.reaction or "–", number(trial.reaction_time_s, 2),
        trial.outcome or "–", trial.outcome_by or "–",
    ]  # fmt: skip
