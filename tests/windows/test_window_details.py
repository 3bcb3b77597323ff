"""Limits and roundings of windows, each at its edge (0049)."""

import numpy as np
import pytest

from taxel.errors import BadInput
from taxel.labels.trials import Trial
from taxel.signals import Samples, SensorInfo, Validity
from taxel.windows import gaps, grid, trial_crops, windower
from taxel.windows.checks import filled_note, grid_note, rare_note, too_old
from taxel.windows.config import FULL_SCALE_V, WindowConfig
from taxel.windows.following import RecentRest
from taxel.windows.windower import Rows, Windower, Windows


def trials(**counts: int) -> list[Trial]:
    return [
        Trial(recording="a.mcap", start_s=0.0, end_s=1.0, labels={"shape": name}, groups={})
        for name, count in counts.items()
        for _ in range(count)
    ]


@pytest.mark.parametrize(("rare", "noted"), [(1, True), (2, True), (3, False), (10, False)])
def test_a_class_is_rare_with_a_fifth_of_the_commonest_s_trials_or_less(rare: int, noted: bool):
    assert bool(rare_note(trials(ball=10, cube=rare), "shape")) is noted


def test_the_share_that_is_filled_in_is_said_in_the_mean_and_at_most():
    n = 4
    windows = Windows(
        np.zeros((n, 2, 1), np.float32), np.ones((n, 2), bool), np.ones(n, np.float32),
        np.zeros(n, np.float32), np.arange(n, dtype=float), np.arange(n) + 0.5,
        filled=np.array([0.0, 0.1, 0.2, 0.6], np.float32),
    )  # fmt: skip
    (note,) = filled_note(windows)
    assert note.startswith("3 of 4 windows with short gaps")
    assert note.endswith("30 % of their values in the mean, 60 % at most")


def test_full_scale_is_that_of_the_board_s_converter():
    assert FULL_SCALE_V == 3.3


@pytest.mark.parametrize(("steps", "stride"), [(0, 1), (1, 0), (-1, 1), (1, -1)])
def test_windows_have_a_row_and_move_on_by_one_at_least(steps: int, stride: int):
    with pytest.raises(ValueError, match=f"at least 1; got {steps} and {stride}"):
        WindowConfig(steps=steps, stride=stride)


def test_a_small_image_has_the_height_nearest_to_its_own_shape():
    wide = trial_crops._WIDTH
    image = np.zeros((3 * wide - 1, 4 * wide, 3), np.uint8)
    assert trial_crops.small_grey(image).shape == (round((3 * wide - 1) / 4), wide)
    assert (3 * wide - 1) / 4 > round((3 * wide - 1) // 4) + 0.5


def test_a_short_gap_is_five_rows_of_75_and_none_of_12():
    assert gaps.SHORT == 1 / 15


@pytest.mark.parametrize("fill", [-0.1, 1.0, 1.5])
def test_a_window_is_never_filled_as_a_whole(fill: float):
    with pytest.raises(ValueError, match="at least 0 and below 1 for fill"):
        WindowConfig(fill=fill)


@pytest.mark.parametrize(("grid_hz", "noted"), [(99.0, True), (100.0, False), (None, False)])
def test_a_grid_below_a_third_of_the_sensors_rate_is_said(grid_hz: float | None, noted: bool):
    sensor = SensorInfo(name="a", channels=("one",), units=("V",), rate_hz=300.0)
    assert bool(grid_note(sensor, WindowConfig(grid_hz=grid_hz))) is noted


def test_scans_days_apart_are_refused_before_the_ticks_between_are_made():
    most = 2_000_000 + 100 * 3
    grid._refuse_jump(most, 3, 0.01)
    for ticks in (most + 1, 10 * most):
        with pytest.raises(BadInput, match="3 of them over"):
            grid._refuse_jump(ticks, 3, 0.01)


def test_rest_is_measured_after_ten_seconds_and_then_each_second():
    rest = RecentRest(20.0, 10.0)
    due = [row for row in range(1, 151) if rest.add(np.full((1, 2), 0.1)) is not None]
    assert due == [100, 110, 120, 130, 140, 150]


def test_a_rehearsal_sees_by_the_gate_that_has_followed():
    sensor = SensorInfo(name="a", channels=("one",), units=("V",), rate_hz=100.0)
    config = WindowConfig(
        gate=1.0, gate_follow_s=20.0, steps=1, stride=1, grid_hz=None, max_gap_s=99.0
    )
    given = Windower(config, sensor)
    resting = np.random.default_rng(0).normal(0.4, 0.01, (3000, 1)).astype(np.float32)
    given.push(Samples.from_values(resting, np.arange(3000) / 100))
    for level_v, windows in ((1.2, 0), (1.6, 10)):
        touch = np.full((10, 1), level_v, np.float32)
        found = given.rehearse(Samples.from_values(touch, 30.0 + np.arange(10) / 100))
        assert len(found) == windows


def test_of_a_padded_window_the_channel_most_often_saturated_counts():
    flags = np.zeros((4, 2), np.uint8)
    flags[0, 0] = flags[0, 1] = flags[1, 1] = Validity.SATURATED
    rows = Rows(np.arange(4) / 100, np.ones((4, 2), np.float32), flags)
    found = windower._padded_window(rows, 6)
    assert found.saturated.tolist() == [0.5]
    assert found.mask.sum() == 4


def test_a_scan_s_largest_age_is_said_in_milliseconds():
    assert too_old(WindowConfig(max_age_s=0.6)) == "over 600 ms old"
    assert too_old(WindowConfig(max_age_s=1.5)) == "over 1.5 s old"
    assert too_old(WindowConfig(max_age_s=1.0)) == "over 1 s old"


def test_a_gate_follows_over_more_than_no_time():
    with pytest.raises(ValueError, match="over more than 0 s"):
        WindowConfig(gate=1.0, gate_follow_s=-1.0)


def test_the_rest_is_that_of_the_last_seconds_and_no_fewer():
    """Of four seconds two lie at 0 and two at 1: of three, most would lie at 1."""
    recent = RecentRest(4.0, 1.0)
    for value in (5.0, 0.0, 0.0, 1.0, 1.0):
        found = recent.add(np.array([[value]]))
    assert found is not None
    assert found[0].tolist() == [0.5]


def test_a_sensor_of_less_than_a_row_a_second_is_looked_at_row_by_row():
    assert list(RecentRest(20.0, 0.3).slices(2)) == [slice(0, 1), slice(1, 2)]


def test_of_two_rows_at_once_the_gate_takes_the_one_above_it():
    config = WindowConfig(steps=1, stride=1, gate=1.0, grid_hz=None)
    sensor = SensorInfo(name="t", channels=("a",), units=("V",), rate_hz=100.0)
    found = Windower(config, sensor).push(
        Samples.from_values(np.array([[0.5], [2.0]]), np.array([0.0, 0.01]))
    )
    assert found.values.ravel().tolist() == [2.0]
