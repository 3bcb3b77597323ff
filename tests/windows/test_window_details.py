"""Limits and roundings of windows, each at its edge (0049)."""

import numpy as np
import pytest

from taxel.labels.trials import Trial
from taxel.windows import trial_crops
from taxel.windows.checks import filled_note, rare_note
from taxel.windows.config import FULL_SCALE_V, WindowConfig
from taxel.windows.windower import Windows


def trials(**counts: int) -> list[Trial]:
    return [
        Trial(recording="a.mcap", start_s=0.0, end_s=1.0, labels={"shape": name}, groups={})
        for name, count in counts.items()
        for _ in range(count)
    ]


@pytest.mark.parametrize(("rare", "said"), [(1, True), (2, True), (3, False), (10, False)])
def test_a_class_is_rare_with_a_fifth_of_the_commonest_s_trials_or_less(rare: int, said: bool):
    assert bool(rare_note(trials(ball=10, cube=rare), "shape")) is said


def test_the_share_that_is_filled_in_is_said_in_the_mean_and_at_most():
    n = 4
    windows = Windows(
        np.zeros((n, 2, 1), np.float32), np.ones((n, 2), bool), np.ones(n, np.float32),
        np.zeros(n, np.float32), np.arange(n, dtype=float), np.arange(n) + 0.5,
        filled=np.array([0.0, 0.1, 0.2, 0.6], np.float32),
    )  # fmt: skip
    (note,) = filled_note(windows)
    assert note.startswith("3 of 4 windows have short gaps")
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
    assert trial_crops._small_grey(image).shape == (round((3 * wide - 1) / 4), wide)
    assert (3 * wide - 1) / 4 > round((3 * wide - 1) // 4) + 0.5
