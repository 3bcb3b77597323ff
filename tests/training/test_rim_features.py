"""What the contact's rim says of a gel that shears."""

from dataclasses import replace

import numpy as np
import pytest

from taxel.gel.rim_slip import RIM_FEATURES
from taxel.gel.ring_slip import RING_FEATURES
from taxel.gel.slip_signal import PAIR_FEATURES
from taxel.training.slip.cups import GelRows, PourRows, by_rim, paper_runs
from taxel.training.slip.heads import features_of
from taxel.training.slip.pose_noise import GelNoise, PoseNoise, add_noise
from taxel.training.slip.rim_features import rim_features, ring_features

CUP = 31_000
"""Neither a training nor a test cup."""
LATE_S = 3.0


def pour(rim_share_after: float, rate_after: float = 0.05) -> PourRows:
    """Return a pour that turns by 0.05 rad a second, the rim by 0.8 of it; another from 3 s on."""
    taken_s, time_s = np.arange(125) / 25.0, np.arange(300) / 60.0
    before, after = np.minimum(taken_s, LATE_S), np.maximum(taken_s - LATE_S, 0.0)
    turn = 0.05 * before + rate_after * after
    rim = 0.8 * 0.05 * before + rim_share_after * rate_after * after

    def turned(by: np.ndarray) -> np.ndarray:
        return by[:, None] * [0.0, 0.0, 1.0]

    gel = GelRows(
        taken_s=taken_s, object=turned(turn), gel=turned(turn), rim=turned(rim),
        spread=np.zeros((125, 3)), seen=np.ones(125, np.bool_),
        shown=np.minimum(np.arange(300) * 25 // 60, 124), rings=np.zeros((125, len(RING_FEATURES))),
    )  # fmt: skip
    run = replace(paper_runs(CUP)[0], kind="pour")
    return PourRows(run, time_s, np.zeros(300), np.zeros(300, np.bool_), (gel, gel))


def at_end(found: PourRows, name: str) -> float:
    (features,) = rim_features([found])
    return float(features.rows[-1, len(PAIR_FEATURES) + RIM_FEATURES.index(name)])


def test_a_rim_that_lags_loses_its_share_while_the_gel_inside_keeps_it():
    steady, slips = pour(0.8), pour(0.2)

    assert at_end(steady, "rim_share_now") == pytest.approx(0.8 * 0.02 / 0.03, abs=0.02)
    assert at_end(slips, "rim_share_now") == pytest.approx(0.2 * 0.02 / 0.03, abs=0.02)
    assert at_end(slips, "rim_share_lost") < -0.1 < at_end(steady, "rim_share_lost") <= 0.0
    assert at_end(slips, "gel_share_now") == at_end(steady, "gel_share_now")


def test_a_turn_that_quickens_is_seen_and_looked_ahead():
    assert at_end(pour(0.8), "turn_quickens") < 1.0
    assert at_end(pour(0.8, rate_after=0.2), "object_turn_ahead") == pytest.approx(
        0.15 + 0.2 * 1.96 + 0.5 * 0.2, abs=0.02
    )
    (features,) = rim_features([pour(0.8, rate_after=0.2)])
    quickens = features.rows[:, len(PAIR_FEATURES) + RIM_FEATURES.index("turn_quickens")]
    just_after = int(np.searchsorted(features.row_s(), LATE_S + 0.4))
    assert quickens[just_after] > 2.0


def test_the_past_alone_counts():
    """Columns up to a moment are the same whatever comes later; the first are the usual ones."""
    (whole,), (other,) = rim_features([pour(0.8)]), rim_features([pour(0.1, rate_after=0.4)])
    before = whole.row_s() < LATE_S

    assert np.array_equal(whole.rows[before], other.rows[before])
    assert np.array_equal(whole.rows[:, : len(PAIR_FEATURES)], features_of(pour(0.8)).rows)


def test_noise_reaches_the_rim_and_a_still_gel_stays_still_without_it():
    none = GelNoise(np.ones((2, 3)), np.zeros((2, 3)), np.zeros((2, 3)), np.zeros((2, 3)))
    rim = replace(none, white=np.full((2, 3), 0.01))
    true = pour(0.8)
    found = add_noise(true, PoseNoise([none], [rim]), np.random.default_rng(0))

    start = np.median(true.gels[0].gel[3:6], axis=0)
    assert found.gels[0].gel == pytest.approx(true.gels[0].gel - start, abs=0.005)
    assert np.std(found.gels[0].rim[:, 0]) == pytest.approx(0.01, rel=0.3)
    assert by_rim([found])[0].gels[0].gel is found.gels[0].rim


def test_rings_are_the_mean_over_the_gels_of_the_images_that_they_show():
    found = pour(0.8)
    rings = np.arange(125)[:, None] * np.ones(len(RING_FEATURES))
    gels = (replace(found.gels[0], rings=rings), replace(found.gels[1], rings=3 * rings))
    (features,) = ring_features([replace(found, gels=gels)])
    (without,) = rim_features([found])
    image = found.gels[0].shown[np.searchsorted(features.at, np.arange(len(features.rows)))]

    assert np.array_equal(features.rows[:, : -len(RING_FEATURES)], without.rows)
    assert np.array_equal(features.rows[:, -1], (2 * image).astype(np.float32))
