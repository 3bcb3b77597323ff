"""Baselines, drift, noise and hum, against what was put in."""

import numpy as np
import pytest

from taxel.calibration.baseline import measure_noise, rest_blocks, rest_line, smoothed


@pytest.mark.parametrize(("scans", "rate_hz"), [(100, 1000.0), (7, 1000.0), (50, 250.0), (1, 60.0)])
def test_the_moving_mean_is_the_mean_of_what_lies_around(scans: int, rate_hz: float) -> None:
    values = np.random.default_rng(0).normal(size=(scans, 3))
    width = min(max(1, round(0.02 * rate_hz)), scans)
    first = width // 2
    plain = [values[max(i - first, 0) : i - first + width].mean(axis=0) for i in range(scans)]

    assert smoothed(values, rate_hz) == pytest.approx(np.array(plain))


def test_values_that_are_missing_have_no_part_in_the_moving_mean() -> None:
    values = np.full((200, 2), 1.5)
    values[[0, 50, 52, 199], 0] = np.nan
    values[100:130, 0] = np.inf
    near = np.ones(200, bool)
    near[110:121] = False  # further from any value than the mean reaches

    found = smoothed(values, 1000.0)

    assert found[:, 1] == pytest.approx(1.5)
    assert found[near, 0] == pytest.approx(1.5)
    assert found[110:121, 0] == pytest.approx(0.0)


def test_50_hz_and_its_harmonics_are_smoothed_away() -> None:
    turn = 2 * np.pi * 50.0 * np.arange(1000) / 1000.0
    hum = (np.sin(turn) + 0.3 * np.sin(3 * turn))[:, None]

    assert np.abs(smoothed(hum, 1000.0)[20:-20]).max() < 1e-9


def test_rest_is_cut_into_blocks_and_short_rests_are_left_out() -> None:
    resting = np.ones(100, bool)
    resting[30:32] = resting[40:42] = False

    found = [(block.start, block.stop) for block in rest_blocks(resting, 60.0)]

    assert found == [(0, 15), (15, 30), (42, 57), (57, 72), (72, 87)]


def test_a_drifting_baseline_is_found_though_a_fifth_of_the_blocks_is_far_off() -> None:
    rng = np.random.default_rng(1)
    time_s = np.arange(0.0, 600.0, 5.0)
    level = 0.05 + 0.12 * time_s / 3600.0 + rng.normal(0.0, 0.001, len(time_s))
    level[::5] += 0.5

    line = rest_line(time_s, level)

    assert line.per_hour == pytest.approx(0.12, abs=0.01)
    assert line.per_hour_95[0] < 0.12 < line.per_hour_95[1]
    assert line.at(300.0) == pytest.approx(0.06, abs=0.001)


def test_hum_is_told_apart_from_noise_and_50_from_60_hz() -> None:
    rng = np.random.default_rng(2)
    time_s = np.arange(20_000) / 1000.0
    values = 1.0 + rng.normal(0.0, 0.02, len(time_s))
    values += 0.03 * np.sin(2 * np.pi * 60.0 * time_s + 1.0)
    blocks = rest_blocks(np.ones(len(time_s), bool), 1000.0)
    noise = measure_noise(values, smoothed(values[:, None], 1000.0)[:, 0], blocks, 1000.0)

    assert noise.hum_60_v == pytest.approx(0.03, rel=0.05)
    assert noise.hum_50_v < 0.002
    assert noise.rms_v == pytest.approx(np.hypot(0.02, 0.03 / np.sqrt(2)), rel=0.05)
    assert noise.at_floor == 0.0


def test_no_rest_is_no_noise_instead_of_a_silent_sensor() -> None:
    assert np.isnan(measure_noise(np.zeros(9), np.zeros(9), [], 1000.0).rms_v)
    with pytest.raises(ValueError, match="rest"):
        rest_line(np.zeros(0), np.zeros(0))
