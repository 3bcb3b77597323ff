"""Claims about drawing touch in the terminal: places, colours, sizes."""

import numpy as np
import pytest

from taxel.views.terminal import (
    array_grid,
    array_map,
    hand_fingers,
    heat_map,
    share_of,
    short_number,
    sparkline,
)


def colours(text) -> list[tuple[str | None, str | None]]:
    """Foreground and background of each span of text, in order."""
    return [
        (
            span.style.color.name if span.style.color else None,
            span.style.bgcolor.name if span.style.bgcolor else None,
        )
        for span in text.spans
    ]


def test_a_sparkline_rises_from_low_to_high():
    assert sparkline(np.linspace(0, 6, 7, dtype=np.float32), 7, 0.0, 6.0) == "▁▂▃▄▅▆▇"


def test_a_sparkline_is_as_wide_as_asked_newest_at_the_right():
    assert sparkline(np.float32([6.0]), 4, 0.0, 6.0) == "   ▇"
    assert sparkline(np.zeros(0, np.float32), 4, 0.0, 6.0) == "    "
    assert len(sparkline(np.zeros(1000, np.float32), 33, 0.0, 6.0)) == 33


def test_a_short_peak_is_never_lost():
    values = np.zeros(1000, np.float32)
    values[517] = 6.0
    assert sparkline(values, 10, 0.0, 6.0).count("▇") == 1


def test_what_is_not_finite_is_blank_and_what_is_outside_is_clipped():
    values = np.float32([np.nan, -5.0, 50.0, np.inf])
    assert sparkline(values, 4, 0.0, 6.0) == " ▁▇ "


def test_two_rows_share_a_line_of_half_blocks():
    """The upper row is the letters' colour, the lower one the background."""
    text = heat_map(np.float32([[0.0, 1.0], [1.0, 0.0]]), 0.0, 1.0)
    assert text.plain == "▀▀▀▀"
    dark, bright = "#14183c", "#fde725"
    assert colours(text) == [(dark, bright), (bright, dark)]


def test_an_odd_row_has_nothing_below_it_and_bad_values_are_grey():
    text = heat_map(np.float32([[0.0], [np.nan], [1.0]]), 0.0, 1.0, cell=1)
    assert text.plain == "▀\n▀"
    assert colours(text) == [("#14183c", "#555555"), ("#fde725", None)]


def test_a_hands_map_has_fingers_across_and_distal_on_top():
    """Channel order: four fingers, each proximal, middle, distal."""
    grid = array_grid(np.arange(12, dtype=np.float32))
    np.testing.assert_array_equal(grid, [[2, 5, 8, 11], [1, 4, 7, 10], [0, 3, 6, 9]])


@pytest.mark.parametrize(
    ("channels", "shape"), [(1, (1, 1)), (5, (2, 3)), (8, (3, 3)), (60, (8, 8))]
)
def test_another_array_is_a_near_square_grid_with_every_channel_once(channels, shape):
    grid = array_grid(np.arange(channels, dtype=np.float32))
    assert grid.shape == shape
    assert sorted(grid[np.isfinite(grid)]) == list(range(channels))


@pytest.mark.parametrize("channels", [1, 5, 12, 16, 17, 60])
def test_a_map_fits_its_width(channels: int):
    text = array_map(np.full(channels, -399503.0, np.float32), -1e6, 0.0)
    assert max(map(len, text.plain.splitlines())) <= 34


def test_a_map_shows_values_coloured_on_each_channels_own_scale():
    low, high = np.float32([0, 100]), np.float32([2, 200])
    text = array_map(np.float32([2.0, 100.0]), low, high)
    assert [word for word in text.plain.split() if word] == ["2.00", "100"]
    assert [background for _, background in colours(text)] == ["#fde725", "#14183c"]


def test_shares_lie_between_nought_and_one():
    shares = share_of(np.float32([-1, 0, 1, 4, np.nan]), 0.0, 2.0)
    np.testing.assert_array_equal(shares, np.float32([0, 0, 0.5, 1, np.nan]))


def test_a_scale_without_width_divides_by_nothing():
    np.testing.assert_array_equal(share_of(np.float32([3.0]), 3.0, 3.0), np.float32([0.0]))


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0.00"),
        (-0.001, "0.00"),
        (3.3, "3.30"),
        (-43.27, "-43.3"),
        (99.97, "100"),
        (1023, "1023"),
        (-399503, "-400k"),
        (1.2e6, "1.20M"),
        (5e12, "5e12"),
        (float("nan"), "–"),
        (float("inf"), "–"),
    ],
)
def test_numbers_are_short(value: float, text: str):
    assert short_number(value) == text


def test_only_four_fingers_of_three_make_a_hand():
    names = [f"{finger}-{i}" for finger in ("a", "b", "c", "d") for i in range(3)]
    assert hand_fingers(names) == ["a", "b", "c", "d"]
    assert hand_fingers(names[:11]) is None
    assert hand_fingers([f"taxel{i}" for i in range(12)]) is None
