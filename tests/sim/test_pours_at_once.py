"""Many pours at once are the same pours."""

import numpy as np
import pytest

from taxel.sim.pour.cup_pour import CupPourConfig, list_runs, simulate_pour
from taxel.sim.pour.cups import OTHER_KINDS, draw_cup, draw_run
from taxel.sim.pour.pours_at_once import first_slips, simulate_pours


@pytest.mark.slow
def test_pours_at_once_equal_pours_one_by_one():
    """Every kind, one that is dropped and one whose grip falls among them."""
    cup = draw_cup(0, 31_000)
    runs = list_runs(CupPourConfig(cups=1, first_cup=31_000))[:1]
    runs += [draw_run(0, cup, "lower", 15.0, kind, 1) for kind in OTHER_KINDS]
    together = simulate_pours(runs)
    for run, found in zip(runs, together, strict=True):
        alone = simulate_pour(run)
        assert np.abs(found.truth - alone.truth).max() < 1e-6, run.kind
        assert np.array_equal(found.time_s, alone.time_s)
        for mine, its in zip(found.motions, alone.motions, strict=True):
            for name in ("depth_mm", "object_mm", "object_rad", "gel_mm", "gel_rad", "patch_mm"):
                assert np.abs(getattr(mine, name) - getattr(its, name)).max() < 1e-9, name
    assert together[0].truth[-1, 7] == 1.0, "the first one is dropped"


def test_a_rate_that_does_not_divide_the_step_is_refused():
    runs = list_runs(CupPourConfig(cups=1))[:1]
    with pytest.raises(ValueError, match="divides"):
        simulate_pours(runs, 100.0)
    assert simulate_pours([]) == []


@pytest.mark.slow
def test_first_slips_are_those_of_the_whole_simulation():
    """The moment and the poured mass at 300 µm, or at the end, as the track has them."""
    runs = list_runs(CupPourConfig(cups=1, first_cup=31_000))[:4]
    found = first_slips(runs, 300.0, 60.0, 6.0)
    for place, track in enumerate(simulate_pours(runs)):
        beyond = (track.truth[:, 0] > 300.0) | (track.truth[:, 7] > 0)
        moment = int(np.argmax(beyond)) if beyond.any() else -1
        assert found.moment[place] == moment
        assert found.poured_g[place] == track.truth[moment, 6]
    assert {int(moment) >= 0 for moment in found.moment} == {True, False}
    assert first_slips([], 300.0, 60.0, 6.0).moment.shape == (0,)
