"""Faults of an array: each does what its level says, and nothing else."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from taxel.errors import BadInput
from taxel.evaluation.robustness.array_faults import (
    ARRAY_FAULTS,
    Touched,
    check_level,
    find_array_fault,
    touched,
)
from taxel.signals import Samples, SensorInfo, Validity

RATE_HZ = 100.0
CHANNELS = tuple("abcdefgh")
SENSOR = SensorInfo(name="t", channels=CHANNELS, units=("V",) * 8, rate_hz=RATE_HZ, full_scale=3.3)


def presses(n: int = 3000, sensor: SensorInfo = SENSOR) -> Touched:
    """Half a second pressed at 2 V (channel k: 0.1 k more), half a second open, again and again."""
    time_s = np.arange(n) / RATE_HZ
    pressed = (time_s % 1.0 < 0.5)[:, None]
    values = pressed * (2.0 + 0.1 * np.arange(8))
    samples = Samples.from_values(values, time_s, sensor.full_scale)
    return touched(samples, sensor, 1.55, np.array([[0.0, time_s[-1]]]))


def made(name: str, level: float, touched: Touched | None = None, seed: int = 0) -> Samples:
    return ARRAY_FAULTS[name].make(touched or presses(), level, np.random.default_rng(seed))


def changed(name: str, level: float) -> NDArray[np.bool_]:
    """Return which channels a fault changes, shape (8,)."""
    return np.asarray((made(name, level).values != presses().samples.values).any(axis=0))


@pytest.mark.parametrize("name", sorted(ARRAY_FAULTS))
def test_every_fault_leaves_what_it_is_given_and_gives_the_same_twice(name: str):
    touch = presses()
    before = touch.samples.values.copy()
    fault = ARRAY_FAULTS[name]
    first, again = (made(name, fault.levels[-1], touch) for _ in range(2))

    assert (touch.samples.values == before).all()
    np.testing.assert_array_equal(first.values, again.values)
    np.testing.assert_array_equal(first.validity, again.validity)


@pytest.mark.parametrize("name", sorted(set(ARRAY_FAULTS) - {"noise"}))
def test_a_level_of_zero_changes_nothing(name: str):
    np.testing.assert_array_equal(made(name, 0.0).values, presses().samples.values)


def test_noise_has_the_ratio_to_the_signal_in_contact_that_it_says():
    """No converter's limits here, so that nothing is clipped."""
    free = SensorInfo(name="t", channels=CHANNELS, units=("V",) * 8, rate_hz=RATE_HZ)
    touch = presses(20_000, free)
    noise = made("noise", 20.0, touch).values - touch.samples.values
    signal = touch.samples.values[touch.contact]
    ratio_db = 10 * np.log10((signal**2).mean() / noise.var())

    assert ratio_db == pytest.approx(20.0, abs=0.1)
    assert noise[:, 0].std() == pytest.approx(noise[:, 7].std(), rel=0.05)


def test_channels_of_one_unit_share_their_noise_and_other_units_have_their_own():
    mixed = SensorInfo(
        name="t", channels=CHANNELS, units=("V",) * 4 + ("deg",) * 4, rate_hz=RATE_HZ
    )
    plain = presses(20_000, mixed)
    scaled = Samples.from_values(
        plain.samples.values * ([1.0] * 4 + [30.0] * 4), plain.samples.fitted_s
    )
    touch = touched(scaled, mixed, 1.55, np.array([[0.0, 200.0]]))
    sigma = (made("noise", 20.0, touch).values - touch.samples.values).std(axis=0)

    np.testing.assert_allclose(sigma[:4], sigma[0], rtol=0.05)
    np.testing.assert_allclose(sigma[4:], sigma[4], rtol=0.05)
    assert sigma[4] > 20 * sigma[0]


def test_the_converter_clips_and_marks_what_noise_brings_to_its_ends():
    samples = made("noise", 3.0)

    assert samples.values.min() == 0.0
    assert samples.values.max() == pytest.approx(3.3)
    at_end = samples.values >= np.float32(3.3)
    assert at_end.any()
    assert ((samples.validity & np.uint8(Validity.SATURATED)) != 0)[at_end].all()


def test_hum_stands_at_its_frequency_with_its_peak():
    free = SensorInfo(name="t", channels=CHANNELS, units=("V",) * 8, rate_hz=1000.0)
    time_s = np.arange(4000) / 1000.0
    flat = Samples.from_values(np.tile([1.0, 2.0], (4000, 4)) + 0 * time_s[:, None], time_s)
    touch = touched(flat, free, None, np.array([[0.0, 4.0]]))
    wave = made("hum", 10.0, touch).values[:, 0] - 1.0
    power = np.abs(np.fft.rfft(wave)) / 2000.0
    hertz = np.fft.rfftfreq(4000, 1e-3)

    assert power[hertz == 50.0][0] == pytest.approx(0.1, rel=1e-3)  # its range is unknown: 1
    assert power[hertz == 150.0][0] == pytest.approx(0.03, rel=1e-3)
    assert power[hertz == 60.0][0] < 1e-4


@pytest.mark.parametrize("name", ["dead", "missing", "stuck"])
@pytest.mark.parametrize("count", [1, 3])
def test_as_many_channels_fail_as_the_level_says(name: str, count: int):
    assert changed(name, count).sum() == count


def test_missing_channels_are_marked_and_dead_or_stuck_ones_cannot_know():
    missing, dead, stuck = (made(name, 2) for name in ("missing", "dead", "stuck"))

    assert (~missing.usable).all(axis=0).sum() == 2
    assert np.isnan(missing.values[~missing.usable]).all()
    assert dead.usable.all()
    assert (dead.values == 0).all(axis=0).sum() == 2
    assert stuck.usable.all()
    still = (stuck.values == stuck.values[0]).all(axis=0)
    assert still.sum() == 2
    assert (stuck.values[0, still] > 1.55).all()


def test_more_failures_include_the_milder_ones():
    assert (changed("dead", 3) >= changed("dead", 1)).all()


def test_swapped_channels_keep_all_values_and_come_in_pairs():
    before, after = presses().samples.values, made("swapped", 3).values
    place = [int(np.flatnonzero((before == column[:, None]).all(axis=0))[0]) for column in after.T]

    assert sorted(place) == list(range(8))
    assert sum(place[i] != i for i in range(8)) == 6
    assert all(place[place[i]] == i for i in range(8))


def test_a_fading_gain_loses_what_it_says_in_a_minute():
    touch = presses(6101)
    share = made("drift", 10.0, touch).values[6000] / touch.samples.values[6000]

    np.testing.assert_allclose(share, np.exp(-0.1), rtol=1e-5)


def test_channels_drift_apart_but_no_faster_than_the_level():
    touch = presses(6101)
    rate = np.log(made("channel-drift", 5.0, touch).values[6000] / touch.samples.values[6000])

    assert (np.abs(rate) <= 0.05 + 1e-6).all()
    assert len(set(rate.round(4).tolist())) == 8


def test_a_slow_clock_gives_fewer_scans_over_the_same_time():
    samples, before = made("skew", 50_000), presses().samples

    assert len(samples) == pytest.approx(len(before) / 1.05, abs=2)
    assert samples.fitted_s[-1] == pytest.approx(before.fitted_s[-1], abs=0.02)
    assert np.diff(samples.fitted_s).mean() == pytest.approx(0.0105, rel=1e-3)


def test_a_clock_that_is_hardly_slow_cuts_no_scan_off():
    """One scan fewer would be a whole window fewer, where windows just fill the touch."""
    samples, before = made("skew", 10), presses().samples

    assert len(samples) == len(before)
    assert (np.diff(samples.fitted_s) > 0).all()


def test_jitter_moves_edges_and_leaves_the_stamps():
    samples, before = made("jitter", 5.0), presses().samples

    np.testing.assert_array_equal(samples.fitted_s, before.fitted_s)
    assert (samples.values != before.values).any()
    rows = (before.fitted_s % 1.0 > 0.1) & (before.fitted_s % 1.0 < 0.4)
    np.testing.assert_allclose(samples.values[rows], before.values[rows], rtol=1e-6)


@pytest.mark.parametrize("name", ["loss", "burst-loss"])
def test_lost_scans_are_as_many_as_the_level_says_and_their_counters_are_missing(name: str):
    touch = presses(60_000)
    samples = made(name, 20.0, touch)
    lost = 1.0 - len(samples) / len(touch.samples)

    assert lost == pytest.approx(0.20, abs=0.02)
    gaps = np.diff(samples.counter)
    mean = (gaps[gaps > 1] - 1).mean()
    assert mean < 1.5 if name == "loss" else 8.0 < mean < 12.0


def test_an_offset_lifts_every_channel_alike():
    np.testing.assert_allclose(
        made("offset", 10.0).values - presses().samples.values, 0.33, atol=1e-6
    )


def test_a_shorter_range_clips_and_marks():
    samples = made("saturation", 25.0)

    assert samples.values.max() == pytest.approx(0.75 * 3.3)
    marked = (samples.validity & np.uint8(Validity.SATURATED)) != 0
    assert (samples.values[marked] == samples.values.max()).all()
    assert marked[:, 7].any()
    assert not marked[:, 0].any()  # its 2 V stay below


def test_contact_without_a_gate_is_what_lies_in_touches():
    touch = presses()
    without = touched(touch.samples, SENSOR, None, np.array([[1.0, 2.0], [5.0, 5.5]]))
    times = touch.samples.fitted_s[without.contact]

    assert without.contact.sum() == pytest.approx(101 + 51, abs=1)
    assert ((times >= 1.0) & (times <= 5.5)).all()


def test_an_unknown_fault_is_refused_with_those_that_there_are():
    with pytest.raises(BadInput, match=r"noise \(normal noise"):
        find_array_fault("rain")


@pytest.mark.parametrize(
    ("name", "level"), [("dead", 9), ("dead", 1.5), ("swapped", 5), ("loss", 100), ("noise", 900)]
)
def test_levels_that_mean_nothing_are_refused(name: str, level: float):
    with pytest.raises(BadInput, match="--levels"):
        check_level(name, ARRAY_FAULTS[name], level, 8)


def with_lost(rows: slice, columns: slice = slice(None), value: float = 0.0) -> Touched:
    """Return presses in which some scans never came, as drivers mark them."""
    touch = presses()
    values, validity = touch.samples.values.copy(), touch.samples.validity.copy()
    values[rows, columns] = value
    validity[rows, columns] |= np.uint8(Validity.MISSING)
    samples = replace(touch.samples, values=values, validity=validity)
    return touched(samples, SENSOR, 1.55, np.array([[0.0, 30.0]]))


@pytest.mark.parametrize(("name", "level"), [("jitter", 5.0), ("skew", 10_000)])
def test_a_scan_between_a_missing_one_and_its_neighbour_is_missing(name: str, level: float):
    """Pressed at 2 V and more before and behind the hole: nothing in between was ever there."""
    samples = made(name, level, with_lost(slice(2010, 2013)))
    pressed = (samples.fitted_s > 20.06) & (samples.fitted_s < 20.17)
    usable = samples.usable.all(axis=1)

    assert (~usable[pressed]).sum() >= 3
    assert (samples.values[pressed & usable] > 1.99).all()


def test_a_clock_that_is_not_slow_loses_no_scan_beside_one_without_a_value():
    touch = with_lost(slice(2010, 2011), value=np.nan)
    samples = made("skew", 0.0, touch)

    np.testing.assert_array_equal(samples.values, touch.samples.values)
    np.testing.assert_array_equal(samples.usable, touch.samples.usable)


def test_missing_scans_are_no_signal_that_noise_is_measured_by():
    """Half of the scans of one channel are gone: its noise is that of the others, as before."""
    noise = [
        (made("noise", 40.0, touch).values - touch.samples.values)[30:45, 1].std()
        for touch in (presses(), with_lost(slice(1000, 3000), slice(1, 2)))
    ]

    assert noise[1] == pytest.approx(noise[0], rel=0.01)


def test_a_channel_stands_at_a_value_that_it_had_not_at_a_missing_scan():
    for seed in range(5):
        touch = with_lost(slice(None), slice(0, 4))
        touch.samples.validity[2500:2540, 0:4] = 0
        touch.samples.values[2500:2540, 0:4] = 2.5
        samples = made("stuck", 8, touch, seed)

        assert (samples.values[0, :4] == 2.5).all()
        assert (samples.values[0] > 1.55).all()
