"""Slip is a length, a rate and a readiness, each with what it is worth."""

from dataclasses import replace

import numpy as np
import pytest

from taxel.gel.scale import mm_per_row_px
from taxel.gel.slip_signal import (
    NO_SLIP,
    PAIR_FEATURES,
    TREND_FEATURES,
    TURN_MM,
    GelSlip,
    PairSlip,
    Slip,
    pair_features,
)

SPREAD = np.array([0.001, 0.001, 0.0003])
STILL = np.zeros(3)


def column(features, name):
    return features[TREND_FEATURES.index(name)]


def slide(gel, mm_s, count=20, step_s=0.04, give_mm_s=0.0):
    """Let an object slide along x while the gel gives along y."""
    for i in range(count):
        at = i * step_s
        moved = np.array([mm_s * at, give_mm_s * at, 0.0])
        gel.push(moved, np.array([0.0, give_mm_s * at, 0.0]), SPREAD, at)
    return gel


def test_a_steady_slide_is_measured_as_distance_and_rate():
    gel = slide(GelSlip(), mm_s=0.3)

    assert gel.slip.seen
    assert gel.slip.distance_mm == pytest.approx(0.3 * 19 * 0.04)
    assert gel.slip.rate_mm_s == pytest.approx(0.3)
    assert gel.slip.words == "slip 0.23 mm, 0.3 mm/s"
    assert replace(gel.slip, rate_mm_s=-0.04).words == "slip 0.23 mm, 0.0 mm/s"
    for lag in (1, 2, 4, 8, 16):
        assert column(gel.features, f"slip_rate_{lag}") == pytest.approx(0.3)


def test_a_turn_counts_by_the_patchs_lever():
    gel = GelSlip()
    gel.push(np.array([0.0, 0.0, 0.05]), STILL, SPREAD, 0.0)

    assert gel.slip.distance_mm == pytest.approx(TURN_MM * 0.05)


def test_an_object_that_goes_with_the_gel_does_not_slip():
    gel = slide(GelSlip(), mm_s=0.0, give_mm_s=0.5)

    assert gel.slip.distance_mm == 0.0
    assert gel.slip.compliance == 0.0
    assert column(gel.features, "gel") == pytest.approx(0.5 * 19 * 0.04)


def test_compliance_is_slip_a_millimetre_of_gel():
    ready = slide(GelSlip(), mm_s=1.0, give_mm_s=1.0).slip.compliance
    sticks = slide(GelSlip(), mm_s=0.05, give_mm_s=1.0).slip.compliance

    assert ready == pytest.approx(0.32 / 0.37)
    assert sticks < 0.1 * ready


def test_sides_and_directions_do_not_matter():
    left, right = GelSlip(), GelSlip()
    for i in range(10):
        moved = np.array([0.01 * i, 0.02 * i, 0.003 * i])
        left.push(moved, 0.3 * moved, SPREAD, 0.04 * i)
        right.push(moved * (-1, 1, -1), 0.3 * moved * (-1, 1, -1), SPREAD, 0.04 * i)

    assert left.features == pytest.approx(right.features)


def test_an_image_that_was_not_followed_changes_nothing_but_says_so():
    gel = slide(GelSlip(), mm_s=0.3)
    before = gel.features.copy()
    gel.push(np.array([9.0, 0.0, 0.0]), STILL, SPREAD, 1.0, seen=False)

    assert not gel.slip.seen
    assert gel.slip.words == "slip unknown"
    assert np.array_equal(gel.features, before)


def test_the_same_image_again_changes_nothing():
    gel = slide(GelSlip(), mm_s=0.3)
    before, slip = gel.features.copy(), gel.slip
    gel.push(np.array([9.0, 0.0, 0.0]), STILL, SPREAD, 19 * 0.04)

    assert gel.slip == slip
    assert np.array_equal(gel.features, before)


def test_spread_grows_with_the_poses_and_is_never_less_than_theirs():
    fine, rough = GelSlip(), GelSlip()
    fine.push(np.array([0.2, 0.0, 0.0]), STILL, SPREAD, 0.0)
    rough.push(np.array([0.2, 0.0, 0.0]), STILL, 3 * SPREAD, 0.0)

    assert fine.slip.distance_sd_mm >= SPREAD[0]
    assert rough.slip.distance_sd_mm > fine.slip.distance_sd_mm


def test_a_pair_follows_the_gel_that_slipped_further():
    pair = PairSlip()
    slide(pair.gels[0], mm_s=0.1)
    slide(pair.gels[1], mm_s=0.4)

    assert pair.slip == pair.gels[1].slip
    features = pair.features()
    assert features.shape == (len(PAIR_FEATURES),)
    assert features[PAIR_FEATURES.index("slip_rate_4_max")] == pytest.approx(0.4)
    assert features[PAIR_FEATURES.index("slip_rate_4_mean")] == pytest.approx(0.25)
    assert PairSlip().slip == NO_SLIP


def test_batch_equals_live_to_the_last_bit():
    rng = np.random.default_rng(1)
    taken = [np.cumsum(rng.uniform(0.03, 0.05, 40)) for _ in range(2)]
    moved = [np.cumsum(rng.normal(0, 0.01, (40, 3)), axis=0) for _ in range(2)]
    gel = [0.5 * each for each in moved]
    shown = [np.minimum(np.arange(90) * 40 // 90, 39), np.minimum(np.arange(90) * 39 // 88, 39)]

    rows, at = pair_features(taken, moved, gel, shown)

    pair, before = PairSlip(), [-1, -1]
    for moment in range(90):
        for side in range(2):
            image = shown[side][moment]
            if image != before[side]:
                pair.gels[side].push(
                    moved[side][image], gel[side][image], SPREAD, taken[side][image]
                )
                before[side] = image
        assert np.array_equal(rows[at[moment]], pair.features())


def test_slip_travels_as_json():
    slip = slide(GelSlip(), mm_s=0.3).slip
    back = Slip.from_dict(slip.as_dict())

    assert back.distance_mm == pytest.approx(slip.distance_mm, abs=1e-4)
    assert back.words == slip.words
    endless = Slip(0.1, 0.2, 0.3, np.inf, np.inf, np.inf, True)
    assert endless.as_dict()["slip_sd_mm"] is None
    assert Slip.from_dict(endless.as_dict()).distance_sd_mm == np.inf


def test_a_pixel_is_scaled_for_a_row_of_320_and_is_a_gelsight_minis_where_nothing_is_stated():
    assert mm_per_row_px(640, 0.05) == pytest.approx(0.1)
    assert mm_per_row_px(320, 0.06) == pytest.approx(0.06)
    assert mm_per_row_px(640, None) == 0.065
