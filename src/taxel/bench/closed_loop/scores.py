"""What a closed loop is worth: drops prevented, grips raised needlessly, force spent.

Each pour is played three times with one seed: without taxel, at full force from the start,
and with a policy. Only drops that full force would have prevented count, since no policy
can do more. Intervals resample whole cups. Knows nothing about how pours were simulated.

Source: docs/decisions/0017.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadInput
from taxel.evaluation.early_warning.events import share_of
from taxel.evaluation.intervals import Interval, at_least_exact, ratio_interval
from taxel.live.closed_loop import LoopTrack

PERSON_S = 0.5
"""How long after an alarm a person stops pouring. Source: our choice."""
PREVENTED, NEEDLESS = 0.98, 0.02
"""Goals: share of preventable drops prevented, and of pours that hold raised needlessly."""
PERSON_PREVENTED = 0.8
"""Goal: share prevented by a person who stops to pour."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopCase:
    """One pour, three ways."""

    bare: LoopTrack
    """Without taxel."""
    full: LoopTrack
    """With full force from the start."""
    held: LoopTrack
    """With the policy that is judged."""

    @property
    def preventable(self) -> bool:
        """True where the cup drops without taxel and full force would have held it."""
        return self.bare.dropped and not self.full.dropped


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopScores:
    """Counts and shares over many pours; NaN where there is nothing to share."""

    pours: int
    cups: int
    drops: int
    """Without taxel."""
    preventable: int
    """Of those, drops that full force from the start prevents."""
    prevented: int
    """Of those, drops that the policy prevents."""
    prevented_share: float
    prevented_interval: Interval
    """95 %: resampled cups, or exact binomial where that reaches lower."""
    holds: int
    """Pours that hold without taxel: not dropped, slip up to 300 µm."""
    needless: int
    """Of those, pours in which the policy raised the grip."""
    needless_share: float
    needless_interval: Interval
    slides: int
    """Pours that slip further than 300 µm without taxel but are not dropped."""
    slides_raised: int
    """Of those, pours in which the policy raised the grip: neither needed nor needless."""
    caused: int
    """Pours that drop with the policy and not without it."""
    force_n: float
    """Mean over all pours of the mean grip force while held, newtons."""
    bare_force_n: float
    """The same without taxel."""
    full_force_n: float
    """The same at full force."""
    slip_to_raise_s: float
    """Median over preventable drops from the first slip > 100 µm to the first raise, seconds;
    negative: raised before it."""


def score_loops(cases: Sequence[LoopCase], seed: int = 0) -> LoopScores:
    """Return what a policy is worth.

    Args:
        cases: All pours.
        seed: Of the resampling.

    Raises:
        BadInput: There are no pours.
    """
    if not cases:
        raise BadInput("at least one pour", "none", "simulate some first")
    preventable = np.array([case.preventable for case in cases])
    prevented = np.array([case.preventable and not case.held.dropped for case in cases])
    holds = np.array([case.bare.holds for case in cases])
    raised = np.array([case.held.raised_s is not None for case in cases])
    slides = np.array([not case.bare.holds and not case.bare.dropped for case in cases])
    cups = np.array([case.bare.run.cup.index for case in cases])
    needless = holds & raised
    return LoopScores(
        pours=len(cases),
        cups=len(set(cups.tolist())),
        drops=sum(case.bare.dropped for case in cases),
        preventable=int(preventable.sum()),
        prevented=int(prevented.sum()),
        prevented_share=share_of(prevented, preventable),
        prevented_interval=_interval(cups, prevented, preventable, seed),
        holds=int(holds.sum()),
        needless=int(needless.sum()),
        needless_share=share_of(needless, holds),
        needless_interval=_interval(cups, needless, holds, seed),
        slides=int(slides.sum()),
        slides_raised=int((slides & raised).sum()),
        caused=sum(case.held.dropped and not case.bare.dropped for case in cases),
        force_n=_mean(cases, lambda case: case.held),
        bare_force_n=_mean(cases, lambda case: case.bare),
        full_force_n=_mean(cases, lambda case: case.full),
        slip_to_raise_s=_slip_to_raise_s(cases),
    )


def _mean(cases: Sequence[LoopCase], which: Callable[[LoopCase], LoopTrack]) -> float:
    return float(np.mean([which(case).mean_force_n for case in cases]))


def _slip_to_raise_s(cases: Sequence[LoopCase]) -> float:
    found = []
    for case in cases:
        slip_s, raised_s = case.bare.slips_s(), case.held.raised_s
        if case.preventable and slip_s is not None and raised_s is not None:
            found.append(raised_s - slip_s)
    return float(np.median(found)) if found else float("nan")


def _interval(
    cups: NDArray[np.intp], part: NDArray[np.bool_], whole: NDArray[np.bool_], seed: int
) -> Interval:
    """Return a 95 % interval of a share: the wider of resampled cups and exact binomial."""
    if not whole.any():
        return float("nan"), float("nan")
    members = [np.flatnonzero(cups == cup) for cup in np.unique(cups)]
    counts = np.array([[part[rows].sum(), whole[rows].sum()] for rows in members])
    resampled = ratio_interval(counts[:, 0], counts[:, 1], seed)
    return at_least_exact(resampled, int(part.sum()), int(whole.sum()))
