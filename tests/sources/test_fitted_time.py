"""Claims about the fitted time: causal, near the truth, the same however blocks are cut."""

import numpy as np
import pytest

from taxel.sources.fitted_time import FittedTime


def late_arrivals(seconds: float, ppm: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """True, device and arrival times at 1 kHz; delays exponential with a mean of 2 ms."""
    rng = np.random.default_rng(0)
    true_s = 500.0 + np.arange(round(1000 * seconds)) / 1000
    device_s = (true_s - 500.0) * (1 - ppm * 1e-6)
    return true_s, device_s, np.maximum.accumulate(true_s + rng.exponential(2e-3, len(true_s)))


@pytest.mark.parametrize("ppm", [-80.0, 0.0, 80.0])
def test_it_is_within_a_tenth_of_a_millisecond_of_the_truth(ppm: float):
    """Where arrivals are 2 ms late on average and the clocks drift apart; after five seconds."""
    true_s, device_s, arrival_s = late_arrivals(40, ppm)
    fitted_s = FittedTime().of(device_s, arrival_s)
    assert np.abs(fitted_s - true_s)[5000:].max() < 1e-4


def test_it_never_uses_what_came_later():
    """The first half's times are the same whatever the second half brings."""
    _, device_s, arrival_s = late_arrivals(4, 30)
    worse = arrival_s.copy()
    worse[2000:] += 0.5
    np.testing.assert_array_equal(
        FittedTime().of(device_s, arrival_s)[:2000], FittedTime().of(device_s, worse)[:2000]
    )


def test_small_blocks_give_what_one_large_block_gives():
    """To within 0.3 ms while the fit learns, and 0.1 ms after five seconds."""
    _, device_s, arrival_s = late_arrivals(10, 30)
    whole = FittedTime().of(device_s, arrival_s)
    fit = FittedTime()
    cut = [fit.of(device_s[i : i + 5], arrival_s[i : i + 5]) for i in range(0, len(device_s), 5)]
    apart_s = np.abs(np.concatenate(cut) - whole)
    assert apart_s[1000:].max() < 3e-4
    assert apart_s[5000:].max() < 1e-4


def test_it_never_runs_backwards():
    _, device_s, arrival_s = late_arrivals(10, -60)
    fit = FittedTime()
    cut = [fit.of(device_s[i : i + 7], arrival_s[i : i + 7]) for i in range(0, len(device_s), 7)]
    assert (np.diff(np.concatenate(cut)) >= 0).all()


def test_no_scans_have_no_times():
    assert FittedTime().of(np.zeros(0), np.zeros(0)).shape == (0,)
