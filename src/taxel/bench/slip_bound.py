"""Rows of `taxel bench transitions` on what no slip warning can exceed: a perfect observer.

Knows nothing about images or how rows are printed.

Source: docs/decisions/0036.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

from taxel.bench.rows import Row
from taxel.evaluation.early_warning.learn_slip_warning import PER_MIN
from taxel.evaluation.early_warning.perfect_observer import foresee, observer_track
from taxel.evaluation.early_warning.slip_warnings import keep_promise, score_warnings
from taxel.live.closed_loop import SEEN_S
from taxel.training.slip_cups import TEST_CUPS, paper_runs

LATE_S: Final = (SEEN_S, 0.0)
"""How old what is known is, seconds: as old as an image's, and not at all."""


def bound_rows(
    cups: Sequence[int] = TEST_CUPS, on_step: Callable[[str], None] = lambda _: None
) -> list[Row]:
    """Judge a perfect observer on the paper's pours: three minutes of one core for all test cups.

    Args:
        cups: Their numbers.
        on_step: Called with a line before each cup.
    """
    known = foresee([run for cup in cups for run in paper_runs(cup)], on_step)
    rows = []
    for late_s in LATE_S:
        tracks = [observer_track(foreseen, late_s) for foreseen in known]
        promise = keep_promise(tracks, PER_MIN)
        events = score_warnings(tracks, promise.threshold)[0].events
        low, high = events.lead_interval_s
        when = f"{late_s * 1e3:.0f} ms late" if late_s else "at once"
        rows.append(
            Row(
                name=f"slip warning, bound: who knows all but when the pouring ends, {when}: "
                "median lead before 300 um",
                value=events.lead_median_s,
                unit="s",
                goal="",
                ok=None,
                note=f"95 % {low:.2f} … {high:.2f}; 5 % {events.lead_p5_s:.2f} s, missed "
                f"{events.missed_share:.3f} of {events.events}; {events.false_alarms_per_min:.2f} "
                f"false alarms a minute in {events.hold_min:.1f} min, the threshold of "
                f"{promise.threshold:.3f} chosen on these pours",
            )
        )
    return rows
