"""What is knowable of a slip: the least amount that ends in it, and how likely that was."""

from dataclasses import replace

import numpy as np
import pytest

from taxel.evaluation.early_warning.perfect_observer import (
    Foreseen,
    chance_of_slip,
    foresee,
    limits_of,
    observer_track,
    soonness,
)
from taxel.evaluation.early_warning.slip_warnings import score_warnings
from taxel.sim.pour.cups import AMOUNT_G
from taxel.sim.pour.pours_at_once import first_slips
from taxel.training.slip.cups import paper_runs


@pytest.fixture(scope="module")
def pours():
    """Pours of 15 N into one cup."""
    return [run for run in paper_runs(31_000) if run.kind == "pour" and run.force_n == 15.0][:2]


@pytest.mark.slow
def test_the_least_amount_slips_and_a_little_less_holds(pours):
    limits = limits_of(pours)
    least = limits.least_g
    slipping = [(run, g) for run, g in zip(pours, least, strict=True) if np.isfinite(g)]
    assert slipping

    more = first_slips([replace(run, amount_g=g) for run, g in slipping], 300.0, 60.0, 6.0)
    less = first_slips([replace(run, amount_g=g - 1.5) for run, g in slipping], 300.0, 60.0, 6.0)
    assert (more.moment >= 0).all()
    assert (less.moment < 0).all()
    at_most = [replace(run, amount_g=AMOUNT_G[1]) for run, _ in slipping]
    due_s = first_slips(at_most, 300.0, 60.0, 6.0).moment / 60.0
    assert limits.due_s[np.isfinite(least)] == pytest.approx(due_s)
    assert np.isinf(limits.due_s[np.isinf(least)]).all()


def test_the_chance_is_the_share_of_amounts_that_are_enough(pours):
    """Nothing poured: all amounts are possible; half poured: those above; afterwards: certain."""
    least, most = AMOUNT_G
    run = replace(pours[0], start_s=1.0, flow_g_s=100.0, amount_g=300.0)
    slips = Foreseen(run=run, least_g=255.0, due_s=3.5, onset_s=2.0, event_s=3.5)
    chance = chance_of_slip(slips, np.array([0.5, 2.0, 3.0, 3.7, 4.5]))

    assert chance[0] == pytest.approx((most - 255) / (most - least))
    assert chance[1] == pytest.approx((most - 255) / (most - 100))
    assert chance[2] == pytest.approx((most - 255) / (most - 200))
    assert chance[3] == 1.0  # 270 g are poured, more than enough
    assert chance[4] == 1.0
    stops = replace(slips, run=replace(run, amount_g=250.0), event_s=None)
    assert chance_of_slip(stops, np.array([4.5])) == 0.0
    never = replace(slips, least_g=np.inf, due_s=np.inf, event_s=None)
    assert chance_of_slip(never, np.array([2.0])) == 0.0
    still = replace(never, run=replace(run, kind="still"))
    assert chance_of_slip(still, np.array([2.0])) == 0.0


def test_soonness_is_the_time_left_while_it_is_poured_and_what_happens_afterwards(pours):
    run = replace(pours[0], start_s=1.0, flow_g_s=100.0, amount_g=250.0)
    stops = Foreseen(run=run, least_g=255.0, due_s=3.6, onset_s=None, event_s=None)
    soon = soonness(stops, np.array([1.6, 3.4, 3.6]))

    assert -np.log(soon[:2]) == pytest.approx([2.0, 0.2])
    assert soon[2] == 0.0
    slips = replace(stops, run=replace(run, amount_g=300.0), event_s=3.7)
    assert -np.log(soonness(slips, np.array([4.1, 3.5]))) == pytest.approx([0.0, 0.1])


@pytest.mark.slow
def test_an_observer_misses_nothing_and_what_it_knows_late_is_the_same_later():
    known = foresee(paper_runs(31_000)[:4])
    at_once, late = ([observer_track(each, late_s) for each in known] for late_s in (0.0, 0.1))
    events = score_warnings(at_once, 0.95)[0].events

    assert events.events > 0
    assert events.missed_share == 0.0
    for now, then in zip(at_once, late, strict=True):
        assert np.allclose(then.drive[6:], now.drive[:-6], atol=1e-9)
