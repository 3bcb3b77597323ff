"""Rows of `taxel bench transitions` on what a slip warning can reach: observers who know the cup.

Knows nothing about images or how rows are printed.

Source: docs/decisions/0036.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from taxel.bench.rows import Row
from taxel.evaluation.early_warning.events import EventScores
from taxel.evaluation.early_warning.learn_slip_warning import PER_MIN
from taxel.evaluation.early_warning.perfect_observer import (
    LITTLE_G,
    chance_of_slip,
    foresee,
    observer_track,
    soonness,
)
from taxel.evaluation.early_warning.slip_warnings import (
    WarningTrack,
    keep_promise,
    score_warnings,
)
from taxel.live.closed_loop import SEEN_S
from taxel.training.slip.cups import TEST_CUPS, other_part, paper_runs

LATE_S: Final = (SEEN_S, 0.0)
"""How old what is known is, seconds: as old as an image's, and not at all."""
OBSERVERS: Final = {
    "who knows all but when the pouring ends": chance_of_slip,
    "who knows when slip would come if the pouring went on, not how amounts are drawn": soonness,
}
"""What an observer knows → what its warning follows."""
_PAPERS: Final = ("pour", "still")
_LESS: Final = "no-slip pour"


def bound_rows() -> list[Row]:
    """Judge observers on the paper's pours, and on those of less: minutes of one core."""
    less = [run for cup in TEST_CUPS for part in (0, 1) for run in other_part(cup, part)]
    runs = [run for cup in TEST_CUPS for run in paper_runs(cup)]
    known = foresee(runs + [run for run in less if run.kind == _LESS])
    rows = []
    for knows, drive in OBSERVERS.items():
        for late_s in LATE_S:
            when = f"{late_s * 1e3:.0f} ms late" if late_s else "at once"
            tracks = [observer_track(foreseen, late_s, drive) for foreseen in known]
            rows.append(_row(f"{knows}, {when}", tracks))
    return rows


def _row(name: str, tracks: Sequence[WarningTrack]) -> Row:
    papers = [track for track in tracks if track.groups["kind"] in _PAPERS]
    promise = keep_promise(papers, PER_MIN)

    def events(part: Sequence[WarningTrack]) -> EventScores:
        return score_warnings(part, promise.threshold)[0].events

    of_papers = events(papers)
    low, high = of_papers.lead_interval_s
    little, more = (
        events([track for track in papers if track.groups["enough"] == enough])
        for enough in ("little", "more")
    )
    less = events([track for track in tracks if track.groups["kind"] == _LESS])
    return Row(
        name=f"slip warning, bound: {name}: median lead before 300 um",
        value=of_papers.lead_median_s,
        unit="s",
        note=f"95 % {low:.2f} … {high:.2f}; 5 % {of_papers.lead_p5_s:.2f} s, missed "
        f"{of_papers.missed_share:.3f} of {of_papers.events}; "
        f"{of_papers.false_alarms_per_min:.2f} false alarms a minute in "
        f"{of_papers.hold_min:.1f} min, the threshold of {promise.threshold:.3f} chosen on these "
        f"pours; {little.lead_median_s:.2f} s where {LITTLE_G:.0f} g are enough "
        f"({little.events} slips), {more.lead_median_s:.2f} s where not; in pours of less "
        f"{less.false_alarms_per_min:.2f} a minute in {less.hold_min:.1f} min",
    )
