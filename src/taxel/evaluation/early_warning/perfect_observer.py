"""The best that any slip warning could do: an observer who knows all but when the pouring ends.

A pour's amount is drawn evenly from a range, and nothing in an image says when the person will
stop. An observer who knows the cup, its friction, the grip and all forces exactly therefore still
has to bet: a pour that stops just short of gross slip looks like one that goes on until it slips.
The same pour, simulated with other amounts, gives the least amount that ends in gross slip, and so
how likely gross slip is at each moment. To warn from a fixed likelihood on is what gives the most
slips warned of for each false alarm; no warning that sees less can be earlier at the same number
of false alarms, except by luck. Knows nothing about images, features, heads or files.

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
from taxel.sim.cups import AMOUNT_G, PourRun
from taxel.sim.pours_at_once import FirstSlips, first_slips
from taxel.training.slip_cups import DURATION_S, FRAME_HZ, GROSS_UM

_BEFORE_G: Final = 40.0
"""Where the search for the least amount begins: so far below what had been poured when the object
slipped while more was poured. The gel rarely gives way to more than that afterwards."""
_HALVINGS: Final = 6
"""Of what is left of these 40 g: to 0.6 g, one hundredth of a second of pouring."""
_TOGETHER: Final = 20
"""Cups that are simulated side by side. Source: our choice: small arrays bound the speed."""
_NEVER: Final = 1e-6
"""Likelihood that stands for 0: a drive must be above 0."""
Values = NDArray[np.float64]


def needed_g(runs: Sequence[PourRun]) -> Values:
    """Return the least amount that ends in gross slip, grams, shape (runs,).

    Infinite where even the largest amount does not, within the time that a pour is looked at.

    Args:
        runs: Pours of the kind "pour", whose amounts are drawn from `AMOUNT_G`. Each is simulated
            eight times with other amounts; the rest of it stays as it is.
    """
    needed = np.full(len(runs), np.inf)
    at_most = _slips(runs, np.full(len(runs), AMOUNT_G[1]))
    slips = np.flatnonzero(at_most.moment >= 0)
    tried = [runs[place] for place in slips]
    enough, too_little = at_most.poured_g[slips], np.zeros(len(slips))
    for turn in range(_HALVINGS + 1):
        middle = (too_little + enough) / 2
        amount_g = middle if turn else np.maximum(enough - _BEFORE_G, 0.0)
        slipped = _slips(tried, amount_g).moment >= 0
        enough = np.where(slipped, amount_g, enough)
        too_little = np.where(slipped, too_little, amount_g)
    needed[slips] = enough
    return needed


@dataclass(frozen=True, slots=True, kw_only=True)
class Foreseen:
    """One of the paper's runs, and what an observer knows of it."""

    run: PourRun
    """Of the kind "pour" or "still"."""
    least_g: float
    """Least amount that ends in gross slip, grams; infinite where none does or none is poured."""
    onset_s: float | None
    """When it first slips more than `ONSET_UM`, seconds since the grasp; None: never."""
    event_s: float | None
    """When it first slips more than `GROSS_UM`, seconds since the grasp; None: it holds."""


def foresee(
    runs: Sequence[PourRun], on_step: Callable[[str], None] = lambda _: None
) -> list[Foreseen]:
    """Return what an observer knows of the paper's runs, simulated some cups at a time.

    Args:
        runs: Of the kinds "pour" and "still".
        on_step: Called with a line before each part.
    """
    found = []
    cups = sorted({run.cup.index for run in runs})
    for part in np.array_split(cups, -(-len(cups) // _TOGETHER)):
        on_step(f"what is knowable of cups {part[0]} to {part[-1]}")
        own = [run for run in runs if run.cup.index in part]
        pours = [run for run in own if run.kind == "pour"]
        names = ((run.cup.index, run.name) for run in pours)
        least = dict(zip(names, needed_g(pours), strict=True))
        onsets, events = (
            first_slips(own, above_um, FRAME_HZ, DURATION_S) for above_um in (ONSET_UM, GROSS_UM)
        )
        found += [
            Foreseen(
                run=run,
                least_g=float(least.get((run.cup.index, run.name), np.inf)),
                onset_s=_seconds(onsets, place),
                event_s=_seconds(events, place),
            )
            for place, run in enumerate(own)
        ]
    return found


def chance_of_slip(foreseen: Foreseen, time_s: Values) -> Values:
    """Return how likely gross slip is at some moments, 0…1, shape (moments,).

    Once the pouring has ended, and where nothing is poured, it is what then happens.

    Args:
        foreseen: The run, and what is known of it.
        time_s: Shape (moments,), seconds since the grasp.
    """
    run, happens = foreseen.run, float(foreseen.event_s is not None)
    if run.kind != "pour":
        return np.full(len(time_s), happens)
    least, most = AMOUNT_G
    poured_g = np.clip((time_s - run.start_s) * run.flow_g_s, 0.0, run.amount_g)
    so_far = np.maximum(poured_g, least)
    room_g = np.maximum(most - so_far, 1e-9)
    chance = np.clip((most - np.maximum(foreseen.least_g, so_far)) / room_g, 0.0, 1.0)
    return np.where(poured_g < run.amount_g, chance, happens)


def observer_track(foreseen: Foreseen, late_s: float) -> WarningTrack:
    """Return a run that is driven by how likely gross slip is.

    Args:
        foreseen: The run, and what is known of it.
        late_s: How old what the observer knows is, seconds.
    """
    time_s = np.arange(round(DURATION_S * FRAME_HZ)) / FRAME_HZ
    return WarningTrack(
        drive=np.maximum(chance_of_slip(foreseen, time_s - late_s), _NEVER),
        time_s=time_s,
        onset_s=None if foreseen.event_s is None else foreseen.onset_s,
        event_s=foreseen.event_s,
        later_s={},
        largest_um=float("nan"),
        groups={"cup": str(foreseen.run.cup.index), "kind": foreseen.run.kind},
    )


def _seconds(found: FirstSlips, place: int) -> float | None:
    moment = int(found.moment[place])
    return None if moment < 0 else moment / FRAME_HZ


def _slips(runs: Sequence[PourRun], amount_g: Values) -> FirstSlips:
    return first_slips(
        [replace(run, amount_g=float(most)) for run, most in zip(runs, amount_g, strict=True)],
        GROSS_UM, FRAME_HZ, DURATION_S,
    )  # fmt: skip
