"""Claims about channels that have stopped changing: when they are named, and when not."""

from dataclasses import replace

import numpy as np
import pytest

from taxel.decisions.still_channels import (
    CHANCE,
    CHANCE_ONCE,
    Motion,
    StillChannel,
    StillWatch,
    changed_words,
    longest_alike,
    looked_at,
    loudest_of,
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


def test_a_channel_dead_from_the_start_is_named_at_lower_gains_too() -> None:
    """Nothing moves as much as it must to count in training, 0.5, but half as much."""
    weak = [window(n, (0.3, 0.0)) for n in range(50)]

    assert watched(weak, motion()) == [("b", 3)]
    assert watched([window(n, (0.2, 0.0)) for n in range(50)], motion()) == []


def test_at_lower_gains_a_channel_that_moved_once_is_not_named() -> None:
    """Of weak touch nobody knows how often a channel rests: only one that never moved is dead."""
    assert watched([window(0, (0.3, 0.1)), *(window(n, (0.3, 0.0)) for n in range(1, 50))],
                   motion()) == []  # fmt: skip


def test_a_channel_dead_from_the_start_is_dead_since_the_first_window() -> None:
    found = first_found([window(n, (0.3, 0.0)) for n in range(9)], motion())
    assert (found.windows, found.still_s) == (3, pytest.approx(0.29))


def test_padding_is_no_change() -> None:
    values = np.array([[[1.0], [2.0], [0.0]]], np.float32)

    assert ranges_of(values, np.array([[True, True, False]])).tolist() == [[1.0]]


def test_padding_does_not_hide_a_dead_channel() -> None:
    """It stands at 1 in the five measured rows; padding holds 0."""
    mask = (np.arange(STEPS) < 5)[None]
    values = np.stack([np.arange(STEPS), np.ones(STEPS)], axis=1).astype(np.float32)[None]
    padded = replace(window(0, (1.0, 0.0)), values=values * mask[:, :, None], mask=mask)
    starts_s = (0.1 * np.arange(5))[:, None]
    windows = [replace(padded, start_s=start, end_s=start + 0.09) for start in starts_s]
    assert watched(windows, motion()) == [("b", 3)]


def test_where_chance_allows_more_than_a_single_still_window_one_is_needed() -> None:
    """A window in 500 is rarer than 0.01 for two channels, however long a channel then rests."""
    rests = replace(motion(), again=np.array([0.5, 0.9]))
    assert rests.needed(CHANCE_ONCE).tolist() == [1, 1]


def test_training_of_as_many_windows_as_json_counts_exactly_is_read() -> None:
    data = motion_to_json(motion())
    assert motion_from_json(Fields(data | {"windows": 2**53}, "motion"), 2).windows == 2**53
    for bad in (0, 2**53 + 1):
        with pytest.raises(ValueError, match="windows"):
            motion_from_json(Fields(data | {"windows": bad}, "motion"), 2)


def test_the_loudest_window_is_that_of_the_middle_channel_without_the_hundredth_part() -> None:
    ranges = np.ones((200, 3)) * np.array([1.0, 4.0, 9.0])
    ranges[:1, :2] *= 500.0
    assert loudest_of(ranges, np.array([1.0, 2.0, 0.0])) == pytest.approx(1.5)
    kept = replace(motion(), loudest=1.5, longest=3)
    again = motion_from_json(Fields(motion_to_json(kept), "motion"), 2)
    assert (again.loudest, again.longest) == (1.5, 3)
    assert motion_from_json(Fields(motion_to_json(motion()), "motion"), 2).loudest is None


def test_the_figures_survive_json_and_damaged_ones_are_refused() -> None:
    data = motion_to_json(replace(motion(still=0.3), windows=1))
    again = motion_from_json(Fields(data, "motion"), 2)

    assert motion_to_json(again) == data
    assert motion_from_json(Fields(data | {"still": [0.0, 1.0]}, "motion"), 2).windows == 1
    for name, value in (("worst", [0.0, 0.5]), ("again", [0.5, 1.0]), ("usual", [-1.0, 1.0]),
                        ("still", [2.0, 0.0]), ("still", [0.0, -0.1])):  # fmt: skip
        with pytest.raises(ValueError, match=r"below 0|not above 0"):
            motion_from_json(Fields(data | {name: value}, "motion"), 2)
    with pytest.raises(ValueError, match="usual"):
        motion_from_json(Fields(data, "motion"), 3)


def test_another_level_of_touch_scales_what_is_usual() -> None:
    raised = replace(motion(), usual=np.array([1.0, 2.0])).at_level(
        np.array([1.0, 0.0], np.float32), np.array([3.0, 3.0], np.float32)
    )

    assert raised.usual.tolist() == [3.0, 2.0]


def first_found(windows: list[Windows], usual: Motion) -> StillChannel:
    watch = StillWatch(usual, NAMES)
    for own in windows:
        watch.look(own)
    return watch.take()[0]


def test_it_is_said_since_when_and_how_often_the_channel_moved_in_training() -> None:
    """It moves in two windows, stops in the third; the fifth is the third without change."""
    moves = [window(n, (1.0, 1.0)) for n in range(2)]
    found = first_found([*moves, *(window(n, (1.0, 0.0)) for n in range(2, 9))], motion(still=0.25))
    assert (found.windows, found.usable, found.changed) == (3, True, 0.75)
    assert found.time_s == pytest.approx(0.49)
    assert found.still_s == pytest.approx(0.29)
    assert found.words() == (
        "channel b has not changed for 0.3 s; in training it changed in 75 % of the windows: "
        "check its cable"
    )
    lost = replace(found, usable=False)
    assert lost.words().startswith("channel b has given no value, or the same one, for 0.3 s;")


def test_a_channel_that_moves_in_between_is_counted_from_nothing() -> None:
    moved = [0.0, 1.0, *[0.0] * 6]
    found = first_found([window(n, (1.0, each)) for n, each in enumerate(moved)], motion())
    assert (found.windows, found.time_s) == (3, pytest.approx(0.49))


@pytest.mark.parametrize(
    ("changed", "words"), [(1.0, "every window"), (0.9999, "99.9 %"), (0.5, "50 %")]
)
def test_a_channel_that_once_stood_still_did_not_change_in_every_window(
    changed: float, words: str
) -> None:
    assert f"in training it changed in {words}" in changed_words(changed)


def test_windows_that_overlap_the_last_one_are_not_counted() -> None:
    """Every other of windows half a length apart: as late as without those between."""
    found = first_found([window(n, (1.0, 0.0), every_s=0.05) for n in range(50)], motion())
    assert (found.windows, found.time_s) == (3, pytest.approx(0.29))


def test_a_clock_that_was_set_back_begins_the_count_anew() -> None:
    later = [window(n, (1.0, 0.0)) for n in (100, 101)]
    found = first_found([*later, *(window(n, (1.0, 0.0)) for n in range(9))], motion())
    assert (found.windows, found.time_s) == (3, pytest.approx(0.29))


@pytest.mark.parametrize("starts_s", [(0.0, 0.0, 0.0), (9.0, 8.95, 2.0), (0.0, 50.0, 99.0)])
def test_recordings_of_a_single_window_are_counted_together_whatever_their_clocks(
    starts_s: tuple[float, ...],
) -> None:
    watch = StillWatch(motion(), NAMES)
    for start_s in starts_s:
        assert watch.take() == []
        watch.next_recording()
        own = window(0, (1.0, 0.0))
        watch.look(replace(own, start_s=own.start_s + start_s, end_s=own.end_s + start_s))
    (found,) = watch.take()
    assert (found.channel, found.windows) == ("b", 3)
    assert found.still_s == pytest.approx(3 * 0.09)  # what lies between them was not watched
    assert found.time_s == pytest.approx(starts_s[-1] + 0.09)


def test_within_the_next_recording_windows_that_overlap_are_not_counted() -> None:
    watch = StillWatch(motion(), NAMES)
    assert watch.look(window(0, (1.0, 0.0))) is not None
    watch.next_recording()
    watch.next_recording()  # one without a window between
    looked = [watch.look(window(n, (1.0, 0.0), every_s=0.05)) for n in range(3)]
    assert [moved is not None for moved in looked] == [True, False, True]
    assert watch.take()[0].windows == 3


def test_values_that_are_missing_are_named_as_such() -> None:
    whole = [window(n, (1.0, 0.0)) for n in range(3)]
    found = first_found(
        [replace(own, usable=np.full(1, 0.9, np.float32)) for own in whole], motion()
    )
    assert not found.usable


def test_a_channel_that_stood_still_in_half_of_a_class_is_still_watched() -> None:
    assert watched([window(n, (1.0, 0.0)) for n in range(99)], motion(still=0.5, worst=0.5)) != []


def test_moving_means_as_much_as_in_training_of_any_channel_that_ever_moved() -> None:
    """Half a millivolt is much for a channel that moves by a millivolt."""
    small = replace(motion(), usual=np.array([1e-3, 0.0]))
    ranges = np.array([[4e-4, 9.0], [5e-4, 0.0], [9e-4, 0.0]])
    assert small.moving(ranges).tolist() == [False, True, True]


def test_of_each_trials_windows_those_are_looked_at_that_do_not_overlap() -> None:
    starts_s = np.array([0.2, 0.0, 0.05, 0.1, 0.0, 0.3])
    trial = np.array([0, 0, 0, 0, 1, 1])
    mask = np.ones((6, STEPS), bool)
    mask[5, 1:], mask[4, 2:] = False, False  # a single row; two
    values = np.zeros((6, STEPS, 2), np.float32)
    none = np.zeros(6, np.float32)
    windows = Windows(values, mask, none + 1, none, starts_s, starts_s + 0.09)
    assert looked_at(windows, trial).tolist() == [1, 3, 0, 4]


def test_figures_of_training_are_compared_by_identity() -> None:
    """They hold arrays, whose equality is no yes or no."""
    own = motion()
    assert own == own
    assert own != motion()


def test_a_range_far_below_the_usual_one_is_no_change() -> None:
    small = replace(motion(), usual=np.array([1.0, 1e-3]))
    ranges = np.array([[5e-6, 5e-6], [2e-5, 5e-9]])
    assert small.unchanged(ranges).tolist() == [[True, False], [False, True]]


def test_a_channel_that_never_changed_in_training_does_not_make_a_window_move() -> None:
    rest = replace(motion(), usual=np.array([1.0, 0.0]))
    assert watched([window(n, (0.0, 0.0)) for n in range(50)], rest) == []


def test_rows_that_are_all_alike_are_frozen_if_they_are_three_times_as_many_as_ever() -> None:
    alike = np.ones((6, 2), np.float32)
    moved = alike.copy()
    moved[3, 1] += 0.1

    assert replace(motion(), longest=2).frozen(alike)
    assert not replace(motion(), longest=2).frozen(moved)
    assert not replace(motion(), longest=2).frozen(alike[:5])
    assert not replace(motion(), longest=3).frozen(alike)
    assert not motion().frozen(alike)


def test_the_longest_run_of_rows_alike_is_counted_within_windows_and_without_padding() -> None:
    values = np.arange(400, dtype=np.float32).reshape(2, 100, 2)
    values[0, 10:14] = values[0, 10]
    values[1, 20:30, 0] = 0.0
    values[1, 40:] = 0.0
    mask = np.ones((2, 100), bool)
    mask[1, 41:] = False

    assert longest_alike(values, mask, np.ones(2)) == 4
    assert longest_alike(values[:1, :99], mask[:1, :99], np.ones(2)) is None


def test_a_bundle_of_before_does_not_say_how_long_rows_were_alike() -> None:
    old = motion_to_json(motion())
    new = motion_to_json(replace(motion(), longest=3))

    assert motion_from_json(Fields(old, "motion"), 2).longest is None
    assert motion_from_json(Fields(new, "motion"), 2).longest == 3
    with pytest.raises(ValueError, match="longest"):
        motion_from_json(Fields(new | {"longest": 0}, "motion"), 2)
