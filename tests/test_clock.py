"""Claims about clocks: the manual one moves when told, the fit finds a device's clock causally."""

import numpy as np
import pytest
from numpy.typing import NDArray

from taxel.clock import ClockFit, ManualClock, SystemClock

RATE_HZ = 100.0
DRIFT = 40e-6
BOOTED_S = 12_345.0


def arrivals(seconds: float, seed: int = 0) -> tuple[NDArray[np.float64], NDArray[np.float64],
                                                     NDArray[np.float64]]:  # fmt: skip
    """Return true host time, device time and arrivals: jitter, and each 7 s a stall of 0.3 s."""
    rng = np.random.default_rng(seed)
    host_s = BOOTED_S + np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    device_s = (host_s - BOOTED_S) * (1 + DRIFT)
    late_s = rng.exponential(0.002, len(host_s))
    into_s = (host_s - BOOTED_S) % 7.0
    late_s += np.where((into_s > 3.0) & (into_s < 3.3), 3.3 - into_s, 0.0)
    return host_s, device_s, np.maximum.accumulate(host_s + late_s)


def estimates(device_s: NDArray[np.float64], arrival_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the estimate for each scan, from nothing that came after it."""
    fit = ClockFit()
    out = []
    for device, arrival in zip(device_s, arrival_s, strict=True):
        fit.add(float(device), float(arrival))
        out.append(fit.host_s(float(device)))
    return np.array(out)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_bias_is_below_half_a_millisecond_in_spite_of_drift_and_stalls(seed: int):
    host_s, device_s, arrival_s = arrivals(90.0, seed)
    error_s = (estimates(device_s, arrival_s) - host_s)[round(5 * RATE_HZ) :]
    assert abs(error_s.mean()) < 0.5e-3
    assert np.abs(error_s).max() < 1e-3
    assert (arrival_s - host_s).mean() > 2e-3  # what believing arrivals would cost


def test_the_rate_is_recovered():
    _, device_s, arrival_s = arrivals(90.0)
    fit = ClockFit()
    for device, arrival in zip(device_s, arrival_s, strict=True):
        fit.add(float(device), float(arrival))
    assert fit.rate == pytest.approx(1 / (1 + DRIFT), abs=5e-6)


def test_an_estimate_depends_on_nothing_later():
    _, device_s, arrival_s = arrivals(20.0)
    whole = estimates(device_s, arrival_s)
    spoilt = arrival_s.copy()
    spoilt[1000:] += 3.0
    np.testing.assert_array_equal(estimates(device_s, spoilt)[:1000], whole[:1000])


def test_one_second_in_which_all_is_late_moves_nothing():
    host_s, device_s, arrival_s = arrivals(60.0)
    late = (device_s >= 30.0) & (device_s < 31.0)
    arrival_s = np.maximum.accumulate(arrival_s + 0.5 * late)
    after = device_s > 33.0
    error_s = (estimates(device_s, arrival_s) - host_s)[after]
    assert np.abs(error_s).max() < 1e-3


def test_the_first_arrival_is_all_there_is_at_first():
    fit = ClockFit()
    fit.add(2.0, 102.5)
    assert fit.host_s(2.0) == 102.5
    assert fit.rate == 1.0
    fit.add(2.1, 102.55)
    assert fit.host_s(2.1) == pytest.approx(102.55)


def test_a_fit_without_arrivals_says_so():
    with pytest.raises(ValueError, match="at least one arrival"):
        ClockFit().host_s(0.0)


def test_a_manual_clock_moves_only_when_told():
    clock = ManualClock(5.0)
    assert clock.now_s() == clock.now_s() == 5.0
    clock.advance(1.5)
    clock.sleep(0.5)
    clock.sleep(-3.0)
    assert clock.now_s() == 7.0
    with pytest.raises(ValueError, match="at least 0 s"):
        clock.advance(-0.1)
    assert clock.now_s() == 7.0


def test_the_system_clock_never_runs_backwards_and_does_not_wait_for_nothing():
    clock = SystemClock()
    before_s = clock.now_s()
    clock.sleep(0.0)
    clock.sleep(-1.0)
    assert clock.now_s() >= before_s
