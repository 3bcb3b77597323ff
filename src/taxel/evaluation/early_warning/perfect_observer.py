"""What a slip warning could do if it knew all but when the pouring ends.

A pour's amount is drawn evenly from a range, and nothing in an image says when the person will
stop. An observer who knows the cup, its friction, the grip and all forces exactly therefore still
has to bet: a pour that stops just short of gross slip looks like one that goes on until it slips.
The same pour, simulated with other amounts, gives the least amount that ends in gross slip. From
it follow how likely gross slip is at each moment, and how soon it would come if the pouring went
on. One observer warns from a fixed likelihood on, and so uses how amounts are drawn, too: that
each pour has at least 90 g. The other warns a fixed time ahead, and uses nothing of the kind.
Neither is the best of all rules: one that warns early only where that costs few false alarms has
a longer median lead. Knows nothing about images, features, heads or files.

Source: docs/decisions/0036.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.evaluation.early_warning.learn_slip_warning import ONSET_UM
from taxel.evaluation.early_warning.slip_warnings import WarningTrack
from taxel.sim.pour.cups import AMOUNT_G, PourRun
from taxel.sim.pour.pours_at_once import FirstSlips, first_slips
from taxel.training.slip.cups import DURATION_S, FRAME_HZ, GROSS_UM

_BEFORE_G: Final = 40.0
"""Where the search for the least amount begins: so far below what had been poured when the object
slipped while more was poured. The gel rarely gives way to more than that afterwards."""
_HALVINGS: Final = 6
"""Of what is left of these 40 g: to 0.6 g, one hundredth of a second of pouring."""
_TOGETHER: Final = 20
"""Cups that are simulated side by side. Source: our choice: small arrays bound the speed."""
_NEVER: Final = 1e-6
"""Likelihood that stands for 0: a drive must be above 0."""
POURED: Final = ("pour", "no-slip pour")
"""Kinds whose amount an observer does not know."""
LITTLE_G: Final = 110.0
"""Of what the paper's pours have, 90 to 420 g, nearly all have more. Source: our choice."""
Values = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """What some pours can bear."""

    least_g: Values
    """Shape (runs,): the least amount that ends in gross slip, grams; infinite where even the
    largest amount does not, within the time that a pour is looked at."""
    due_s: Values
    """Shape (runs,): when gross slip comes if the largest amount is poured, seconds since the
    grasp; infinite where it does not."""


def limits_of(runs: Sequence[PourRun]) -> Limits:
    """Return what pours can bear, by simulating each eight times with other amounts.

    Args:
        runs: Of the kinds in `POURED`; all but their amounts stays as it is.
    """
    least, due_s = (np.full(len(runs), np.inf) for _ in range(2))
    at_most = _slips(runs, np.full(len(runs), AMOUNT_G[1]))
    slips = np.flatnonzero(at_most.moment >= 0)
    due_s[slips] = at_most.moment[slips] / FRAME_HZ
    tried = [runs[place] for place in slips]
    enough, too_little = at_most.poured_g[slips], np.zeros(len(slips))
    for turn in range(_HALVINGS + 1):
        middle = (too_little + enough) / 2
        amount_g = middle if turn else np.maximum(enough - _BEFORE_G, 0.0)
        slipped = _slips(tried, amount_g).moment >= 0
        enough = np.where(slipped, amount_g, enough)
        too_little = np.where(slipped, too_little, amount_g)
    least[slips] = enough
    return Limits(least_g=least, due_s=due_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class Foreseen:
    """A run, and what an observer knows of it."""

    run: PourRun
    """Of the kind "still" or one of `POURED`."""
    least_g: float
    """Least amount that ends in gross slip, grams; infinite where none does or none is poured."""
    due_s: float
    """When gross slip comes if the largest amount is poured, seconds since the grasp; infinite
    where it does not or nothing is poured."""
    onset_s: float | None
    """When it first slips more than `ONSET_UM`, seconds since the grasp; None: never."""
    event_s: float | None
    """When it first slips more than `GROSS_UM`, seconds since the grasp; None: it holds."""


def foresee(runs: Sequence[PourRun]) -> list[Foreseen]:
    """Return what an observer knows of some runs, simulated some cups at a time.

    Args:
        runs: Of the kind "still" and those in `POURED`.
    """
    foreseen = []
    cups = sorted({run.cup.index for run in runs})
    for part in np.array_split(cups, -(-len(cups) // _TOGETHER)):
        chosen = [run for run in runs if run.cup.index in part]
        pours = [run for run in chosen if run.kind in POURED]
        limits = limits_of(pours)
        known = {
            (run.cup.index, run.name): (float(least_g), float(due_s))
            for run, least_g, due_s in zip(pours, limits.least_g, limits.due_s, strict=True)
        }
        onsets, events = (
            first_slips(chosen, above_um, FRAME_HZ, DURATION_S) for above_um in (ONSET_UM, GROSS_UM)
        )
        foreseen += [
            Foreseen(
                run=run,
                least_g=least_g,
                due_s=due_s,
                onset_s=_seconds(onsets, place),
                event_s=_seconds(events, place),
            )
            for place, run in enumerate(chosen)
            for least_g, due_s in [known.get((run.cup.index, run.name), (np.inf, np.inf))]
        ]
    return foreseen


def chance_of_slip(foreseen: Foreseen, time_s: Values) -> Values:
    """Return how likely gross slip is at some moments, 0…1, shape (moments,).

    Once the pouring has ended, and where nothing is poured, it is what then happens.

    Args:
        foreseen: The run, and what is known of it.
        time_s: Shape (moments,), seconds since the grasp.
    """
    run, happens = foreseen.run, float(foreseen.event_s is not None)
    if run.kind not in POURED:
        return np.full(len(time_s), happens)
    least, most = AMOUNT_G
    poured_g = np.clip((time_s - run.start_s) * run.flow_g_s, 0.0, run.amount_g)
    so_far = np.maximum(poured_g, least)
    room_g = np.maximum(most - so_far, 1e-9)
    chance = np.clip((most - np.maximum(foreseen.least_g, so_far)) / room_g, 0.0, 1.0)
    return np.where(poured_g < run.amount_g, chance, happens)


def soonness(foreseen: Foreseen, time_s: Values) -> Values:
    """Return a number that falls with the time until gross slip if the pouring goes on.

    Its natural logarithm, with its sign turned, is that time in seconds; 0 where none would come.
    Once the pouring has ended, and where nothing is poured, it is the time until what then happens.

    Args:
        foreseen: The run, and what is known of it.
        time_s: Shape (moments,), seconds since the grasp.
    """
    run = foreseen.run
    happens_s = np.inf if foreseen.event_s is None else foreseen.event_s
    going_on = (run.kind in POURED) & ((time_s - run.start_s) * run.flow_g_s < run.amount_g)
    due_s = np.where(going_on, foreseen.due_s, happens_s)
    return np.asarray(np.exp(-np.maximum(due_s - time_s, 0.0)))


def observer_track(
    foreseen: Foreseen,
    late_s: float,
    drive: Callable[[Foreseen, Values], Values] = chance_of_slip,
) -> WarningTrack:
    """Return a run as an observer's warning sees it.

    Args:
        foreseen: The run, and what is known of it.
        late_s: How old what the observer knows is, seconds.
        drive: What the warning follows: `chance_of_slip` or `soonness`.
    """
    time_s = np.arange(round(DURATION_S * FRAME_HZ)) / FRAME_HZ
    little = foreseen.least_g <= LITTLE_G
    return WarningTrack(
        drive=np.maximum(drive(foreseen, time_s - late_s), _NEVER),
        time_s=time_s,
        onset_s=None if foreseen.event_s is None else foreseen.onset_s,
        event_s=foreseen.event_s,
        later_s={},
        largest_um=float("nan"),
        groups={
            "cup": str(foreseen.run.cup.index),
            "kind": foreseen.run.kind,
            "enough": "little" if little else "more",
        },
    )


def _seconds(found: FirstSlips, place: int) -> float | None:
    moment = int(found.moment[place])
    return None if moment < 0 else moment / FRAME_HZ


def _slips(runs: Sequence[PourRun], amount_g: Values) -> FirstSlips:
    return first_slips(
        [replace(run, amount_g=float(most)) for run, most in zip(runs, amount_g, strict=True)],
        GROSS_UM, FRAME_HZ, DURATION_S,
    )  # fmt: skip
