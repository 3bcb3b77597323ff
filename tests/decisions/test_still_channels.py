"""Claims about channels that have stopped changing: when they are named, and when not."""

from dataclasses import replace

import numpy as np
import pytest

from taxel.decisions.still_channels import (
    CHANCE,
    Motion,
    StillWatch,
    motion_from_json,
    motion_to_json,
    ranges_of,
)
from taxel.foreign.json_text import Fields
from taxel.windows.windower import Windows

STEPS, NAMES = 10, ("a", "b")


def motion(still: float = 0.0, worst: float = 0.002) -> Motion:
    """Both channels move by 1 within a window, and hardly ever not."""
    both = np.full(2, worst)
    return Motion(windows=500, usual=np.ones(2), least=0.5, still=np.full(2, still), worst=both,
                  again=both)  # fmt: skip


def window(number: int, moved: tuple[float, float], every_s: float = 0.1) -> Windows:
    """One window of 0.1 s in which each channel rises by so much."""
    values = (np.linspace(0, 1, STEPS)[:, None] * np.array(moved)).astype(np.float32)[None]
    start = np.array([number * every_s])
    return Windows(values, np.ones((1, STEPS), bool), np.ones(1, np.float32),
                   np.zeros(1, np.float32), start, start + 0.09)  # fmt: skip


def watched(windows: list[Windows], usual: Motion) -> list[tuple[str, int]]:
    watch = StillWatch(usual, NAMES)
    found = []
    for own in windows:
        watch.look(own)
        found += [(still.channel, still.windows) for still in watch.take()]
    return found


def test_a_dead_channel_is_named_once_after_as_many_windows_as_chance_allows() -> None:
    """Three windows in a row: 0.002 to the power of three is below a millionth for two channels."""
    needed = motion().needed(CHANCE)

    found = watched([window(n, (1.0, 0.0)) for n in range(50)], motion())

    assert needed.tolist() == [3, 3]
    assert found == [("b", 3)]


def test_a_channel_that_was_often_still_takes_longer_and_one_that_mostly_was_is_not_watched() -> (
    None
):
    dead = [window(n, (1.0, 0.0)) for n in range(50)]

    assert watched(dead, motion(still=0.3, worst=0.3)) == [("b", 13)]
    assert watched(dead, motion(still=0.6, worst=0.6)) == []


@pytest.mark.parametrize(
    "windows",
    [
        [window(n, (1.0, 1.0 if n % 2 else 0.0)) for n in range(50)],
        [window(n, (0.0, 0.0)) for n in range(50)],
        [window(n, (1.0, 0.0), every_s=0.0) for n in range(50)],
    ],
    ids=["moves in between", "nothing moves", "one window again and again"],
)
def test_no_channel_is_named_where_none_need_be_dead(windows: list[Windows]) -> None:
    assert watched(windows, motion()) == []


def test_padding_is_no_change() -> None:
    values = np.array([[[1.0], [2.0], [0.0]]], np.float32)

    assert ranges_of(values, np.array([[True, True, False]])).tolist() == [[1.0]]


def test_the_figures_survive_json_and_damaged_ones_are_refused() -> None:
    data = motion_to_json(motion())
    again = motion_from_json(Fields(data, "motion"), 2)

    assert motion_to_json(again) == data
    for name, value in (("worst", [0.0, 1.0]), ("usual", [-1.0, 1.0]), ("still", [2.0, 0.0])):
        with pytest.raises(ValueError, match=r"below 0|not above 0"):
            motion_from_json(Fields(data | {name: value}, "motion"), 2)
    with pytest.raises(ValueError, match="usual"):
        motion_from_json(Fields(data, "motion"), 3)


def test_another_level_of_touch_scales_what_is_usual() -> None:
    raised = replace(motion(), usual=np.array([1.0, 2.0])).at_level(
        np.array([1.0, 0.0], np.float32), np.array([3.0, 3.0], np.float32)
    )

    assert raised.usual.tolist() == [3.0, 2.0]
