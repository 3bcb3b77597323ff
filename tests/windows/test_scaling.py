"""Claims about scaling: what is fitted, what padding becomes, and what cannot be fitted."""

import numpy as np
import pytest

from taxel.windows.scaling import fit_scaling

RNG = np.random.default_rng(0)
VALUES = RNG.normal([1.0, -3.0, 7.0], [0.5, 2.0, 0.1], (40, 6, 3)).astype(np.float32)
WHOLE = np.ones((40, 6), bool)


def test_full_scale_divides_and_moves_nothing():
    scaled = fit_scaling("full-scale", VALUES, WHOLE, 3.3).apply(VALUES, WHOLE)
    np.testing.assert_allclose(scaled, VALUES / 3.3, rtol=1e-6)
    assert scaled.dtype == np.float32


def test_full_scale_without_one_is_refused():
    with pytest.raises(ValueError, match="full scale"):
        fit_scaling("full-scale", VALUES, WHOLE, None)


def test_standard_gives_mean_0_and_deviation_1_over_the_measured_rows():
    mask = WHOLE.copy()
    mask[:, 4:] = False
    values = VALUES.copy()
    values[:, 4:] = 1e6
    scaled = fit_scaling("standard", values, mask, None).apply(values, mask)
    np.testing.assert_allclose(scaled[mask].mean(axis=0), 0.0, atol=1e-5)
    np.testing.assert_allclose(scaled[mask].std(axis=0), 1.0, atol=1e-5)
    assert (scaled[~mask] == 0).all()


def test_a_channel_that_never_changes_becomes_zero_and_not_nan():
    values = VALUES.copy()
    values[:, :, 1] = 4.0
    scaled = fit_scaling("standard", values, WHOLE, None).apply(values, WHOLE)
    np.testing.assert_array_equal(scaled[:, :, 1], 0.0)
    assert np.isfinite(scaled).all()
    assert fit_scaling("standard", values, WHOLE, None).factor[1] == 1.0


def test_none_changes_nothing():
    scaled = fit_scaling("none", VALUES, WHOLE, None).apply(VALUES, WHOLE)
    np.testing.assert_array_equal(scaled, VALUES)


def test_a_window_is_scaled_alike_alone_and_among_others():
    """The live path scales one window at a time."""
    scaling = fit_scaling("standard", VALUES, WHOLE, None)
    alone = scaling.apply(VALUES[3:4], WHOLE[3:4])
    np.testing.assert_array_equal(alone[0], scaling.apply(VALUES, WHOLE)[3])
