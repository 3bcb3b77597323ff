"""Claims about the gate that follows, and about the untouched channel that is taken away."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from taxel.signals import Samples, SensorInfo, Validity
from taxel.windows.config import WindowConfig
from taxel.windows.following import LIMITS, RecentRest, rest_and_noise
from taxel.windows.windower import Windower, Windows, cut_windows

RATE_HZ = 100.0
SENSOR = SensorInfo(name="a", channels=("one", "two"), units=("V", "V"), rate_hz=RATE_HZ)
FIXED = WindowConfig(gate=1.0, steps=1, stride=1, grid_hz=None, max_gap_s=9.0)
FOLLOWS = replace(FIXED, gate_follow_s=20.0)


def resting(seconds: float, level_v: float, noise_v: float = 0.01) -> NDArray[np.float64]:
    rng = np.random.default_rng(0)
    return rng.normal([0.0, level_v], noise_v, (round(seconds * RATE_HZ), 2))


def samples(values: NDArray[np.float64]) -> Samples:
    return Samples.from_values(values.astype(np.float32), np.arange(len(values)) / RATE_HZ)


def in_calls(config: WindowConfig, given: Samples, size: int) -> tuple[Windows, list[object]]:
    windower = Windower(config, SENSOR)
    found, moves = [], []
    for first in range(0, len(given), size):
        found.append(windower.push(given[first : first + size]))
        moves += windower.gate_moves()
    return Windows.join([*found, windower.flush()]), moves


def test_a_channel_that_rests_higher_opens_a_fixed_gate_and_not_one_that_follows():
    values = samples(resting(60.0, 1.2))
    fixed, follows = (cut_windows(values, each, SENSOR) for each in (FIXED, FOLLOWS))
    assert len(fixed) > 5_900
    assert 9.9 < follows.end_s.max() < 10.1  # until so much was seen the stated gate holds
    after = follows.start_s > 10.1
    assert not after.any()


def test_every_move_is_reported_with_its_channel_and_its_cause():
    _, moves = in_calls(FOLLOWS, samples(resting(30.0, 0.4)), 100)
    assert [move.channel for move in moves] == ["two"]
    assert moves[0].before == 1.0
    assert moves[0].after == pytest.approx(1.4, abs=0.01)
    assert "two moved from 1 to 1.4: it rests at 0.4" in moves[0].words()


def test_a_quiet_channel_at_zero_keeps_the_stated_gate_and_nothing_is_reported():
    given = samples(resting(60.0, 0.0))
    assert in_calls(FOLLOWS, given, 50)[1] == []


def test_noise_raises_the_gate_to_six_deviations():
    _, moves = in_calls(FOLLOWS, samples(resting(40.0, 0.0, noise_v=0.25)), 100)
    assert moves[0].after == pytest.approx(1.5, rel=0.1)


def test_touch_for_less_than_half_of_the_time_moves_nothing():
    values = resting(60.0, 0.0)
    values[(np.arange(len(values)) // 100) % 5 >= 3] += 2.5
    assert in_calls(FOLLOWS, samples(values), 100)[1] == []


def test_the_gate_stays_within_its_limits_and_says_so():
    _, moves = in_calls(FOLLOWS, samples(resting(30.0, 3.0)), 100)
    assert moves[-1].after == LIMITS[1] * 1.0
    assert LIMITS == (0.5, 2.0)  # decision 0047
    assert moves[-1].limited
    assert "it goes no further" in moves[-1].words()


def test_a_channel_that_rests_far_below_zero_lowers_its_gate_to_the_limit_and_says_so():
    _, moves = in_calls(FOLLOWS, samples(resting(30.0, -3.0)), 100)
    assert (moves[-1].channel, moves[-1].after) == ("two", LIMITS[0] * 1.0)
    assert moves[-1].limited


def test_at_one_row_a_second_rest_is_measured_at_each_row():
    recent = RecentRest(20.0, 1.0)
    row = np.zeros((1, 2))
    found = [recent.add(row) for _ in range(12)]
    assert [rest is not None for rest in found] == [False] * 9 + [True] * 3


def test_windows_and_moves_do_not_depend_on_how_the_stream_is_cut():
    values = resting(45.0, 0.3)
    values[1000:1040, 0] += 2.0
    values[3000:3040, 1] += 2.0
    given = samples(values)
    whole, moves = in_calls(FOLLOWS, given, len(given))
    for size in (1, 7, 133):
        cut, found = in_calls(FOLLOWS, given, size)
        np.testing.assert_array_equal(cut.start_s, whole.start_s)
        assert found == moves


def test_rehearsing_moves_no_gate():
    windower = Windower(FOLLOWS, SENSOR)
    given = samples(resting(40.0, 0.4))
    for first in range(0, len(given), 100):
        windower.rehearse(given[first : first + 100])
    assert windower.gate_moves() == []


def test_steps_measure_noise_beside_slow_touch():
    """A slow wave of fifty deviations hardly changes what is measured."""
    time_s = np.arange(3000) / RATE_HZ
    noise = np.random.default_rng(1).normal(0.0, 0.02, (3000, 1))
    wave = np.maximum(np.sin(2 * np.pi * 0.2 * time_s), 0.0)[:, None]
    assert rest_and_noise(noise + wave)[1][0] == pytest.approx(0.02, rel=0.25)


def test_no_gate_cannot_be_followed():
    for given in ({}, {"gate": 0.0}, {"gate": 1.0, "gate_follow_s": 0.0}):
        with pytest.raises(ValueError, match="gate above 0 to follow, over more than 0 s"):
            WindowConfig(**{"gate_follow_s": 20.0, **given})


def test_what_all_channels_pick_up_alike_is_gone_with_the_untouched_one():
    """To the last bit that float32 keeps."""
    rng = np.random.default_rng(0)
    touch, pickup = rng.uniform(0.0, 1.0, 400), rng.normal(0.0, 0.5, 400)
    values = np.stack([touch + pickup, pickup], axis=1)
    config = replace(FIXED, gate=None, subtract="two")
    windows = cut_windows(samples(values), config, SENSOR)
    np.testing.assert_allclose(windows.values[:, 0, 0], touch, atol=1e-6)
    assert not windows.values[:, 0, 1].any()


def test_an_untouched_channel_that_is_missing_makes_its_row_unusable():
    given = samples(resting(1.0, 0.0))
    validity = np.array(given.validity)
    validity[40, 1] = Validity.MISSING
    config = replace(FIXED, gate=None, fill=0.0, subtract="two")
    windows = cut_windows(replace(given, validity=validity), config, SENSOR)
    assert np.flatnonzero(windows.usable < 1.0).tolist() == [40]


def test_subtracting_leaves_the_samples_as_they_are():
    given = samples(resting(1.0, 0.4))
    before = given.values.copy()
    cut_windows(given, replace(FIXED, gate=None, subtract="two"), SENSOR)
    np.testing.assert_array_equal(given.values, before)
