"""Claims about taps that are found by themselves, and what many of them say of a pad."""

import math

import numpy as np
import pytest

from taxel.calibration.durability import durability_of
from taxel.calibration.taps import Tap, TapMeter
from taxel.sim.teng.force_gauge import ForceGauge, GaugeConfig
from taxel.sim.teng.hand import TengHandConfig

RATE_HZ = 500.0


def trapezes(taps: int, rise_s: float, fall_s: float, height: float = 1.0) -> np.ndarray:
    """Rest for 3 s, then straight rises and falls, one a second, with a little noise."""
    time_s = np.arange(round((3.0 + taps) * RATE_HZ)) / RATE_HZ
    inside = np.mod(time_s - 3.0, 1.0)
    up = np.clip(inside / rise_s, 0.0, 1.0)
    down = np.clip((inside - 0.5) / fall_s, 0.0, 1.0)
    values = 0.1 + height * (up - down) * (time_s >= 3.0)
    return values + np.random.default_rng(0).normal(0.0, 0.001, len(values))


def measured(values: np.ndarray, size: int) -> list[Tap]:
    meter = TapMeter(RATE_HZ)
    time_s = np.arange(len(values)) / RATE_HZ
    for first in range(0, len(values), size):
        part = slice(first, first + size)
        meter.push(values[part], time_s[part], np.zeros(len(values[part]), bool))
    return meter.taps


def test_each_tap_is_found_once_with_its_height_response_and_recovery():
    """Straight flanks of 100 and 200 ms: 80 and 160 ms from 10 to 90 %."""
    taps = measured(trapezes(30, 0.1, 0.2), 1000)
    assert len(taps) == 30
    assert np.allclose([tap.height for tap in taps], 1.0, atol=0.01)
    assert np.median([tap.response_s for tap in taps]) == pytest.approx(0.08, abs=0.004)
    assert np.median([tap.recovery_s for tap in taps]) == pytest.approx(0.16, abs=0.004)


def test_how_the_stream_is_cut_changes_no_tap():
    values = trapezes(6, 0.1, 0.1)
    assert measured(values, 7) == measured(values, len(values))


def test_what_stays_is_no_tap():
    values = trapezes(1, 0.1, 0.2)
    values = np.concatenate([values, np.full(4000, 0.9), np.full(1000, 0.9)])
    assert len(measured(values, 500)) == 1


def tapped(hand: TengHandConfig, plan: list[tuple[float, int]]) -> list[Tap]:
    gauge = ForceGauge(hand, GaugeConfig())
    meter = TapMeter(hand.rate_hz)
    parts = [gauge.rest(3.0)]
    for rate, taps in plan:
        for number in range(taps):
            parts += [gauge.rest(2.0)] if number % 50 == 0 else []
            parts.append(gauge.tap(0, 1.0, rate))
    for samples in parts:
        none = np.zeros(len(samples), bool)
        meter.push(samples.values[:, 0].astype(np.float64), samples.fitted_s, none)
    return meter.taps


def test_the_simulators_fatigue_is_measured_within_its_interval():
    """30 % in 10,000 presses, seen in 800 taps; a pad that does not wear shows no loss."""
    worn, new = (
        durability_of("a", tapped(TengHandConfig(seed=1, rate_hz=250.0, fatigue=f), [(2.0, 800)]))
        for f in (0.3, 0.0)
    )
    assert worn.taps == 800
    assert worn.lost[1] < 0.3 < worn.lost[2]
    assert worn.lost[1] > 0.15
    assert new.lost[1] < 0.0 < new.lost[2]
    assert worn.last < worn.first


def test_faster_taps_give_more_volts_as_less_charge_leaks_meanwhile():
    found = durability_of(
        "a", tapped(TengHandConfig(seed=1, rate_hz=500.0), [(0.5, 20), (2.0, 40), (8.0, 20)])
    )
    assert [row.tap_hz for row in found.by_rate] == pytest.approx([0.5, 2.0, 8.0], rel=0.05)
    slow, middle, fast = (row.height[0] for row in found.by_rate)
    assert slow < 0.8 * min(middle, fast)
    assert found.tap_hz == pytest.approx(2.0, rel=0.02)


def test_taps_at_the_converters_end_count_and_are_left_out():
    taps = [Tap(float(i), 1.0 + 0.01 * (i % 3), 0.1, 0.1, i % 10 == 0) for i in range(100)]
    found = durability_of("a", taps)
    assert (found.taps, found.at_end) == (100, 10)
    assert math.isfinite(found.lost[0])


@pytest.mark.parametrize("growth", [-0.03, 0.01, 0.2])
def test_a_loss_that_few_taps_cannot_show_is_not_stated(growth: float) -> None:
    """Heights that fall or rise with the force of each tap: a loss of all, whose interval would
    look narrow, a gain of 10^40, or no number at all.
    """
    heights = np.exp(growth * np.arange(36) + np.random.default_rng(0).normal(0.0, 0.3, 36))
    taps = [
        Tap(at_s=float(number), height=float(height), response_s=0.05, recovery_s=0.1, at_end=False)
        for number, height in enumerate(heights)
    ]
    found = durability_of("a", taps)

    assert all(math.isnan(end) for end in found.lost)
    assert (found.last > found.first > 0.0) == (growth > 0.0)
