"""Claims about levels that follow: what a session's earlier touches do to the next one."""

import json
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from taxel.errors import BadDataset, BadInput
from taxel.labels.trials import Trial
from taxel.windows.level_follow import (
    MOST_CHANGE,
    LevelFollow,
    LevelFollower,
    UsualLevel,
    WatchedLevel,
    factor_of,
    followed_factors,
    mean_squares,
    parse_level_follow,
)
from taxel.windows.windower import Windows

FOLLOW = LevelFollow(key="session", touches=2)
USUAL = UsualLevel(squares=(1.0, 4.0), quietest=0.1)


def trials(sessions: str) -> list[Trial]:
    """One trial a letter, a second apart."""
    return [
        Trial(recording=f"{name}.mcap", start_s=float(i), end_s=i + 0.5, labels={},
              groups={"session": name, "trial": str(i)})
        for i, name in enumerate(sessions)
    ]  # fmt: skip


def windows(levels: list[list[float]]) -> Windows:
    """One window of four rows a trial, each channel at one value."""
    values = np.repeat(np.array(levels, np.float32)[:, None], 4, axis=1)
    n, start = len(levels), np.arange(len(levels), dtype=np.float64)
    return Windows(values, np.ones((n, 4), bool), np.ones(n, np.float32), np.zeros(n, np.float32),
                   start, start + 0.5)  # fmt: skip


def factors(levels: list[list[float]], sessions: str, usual: UsualLevel | None = USUAL
            ) -> NDArray[np.float32]:  # fmt: skip
    own = windows(levels)
    return followed_factors(own, np.arange(len(own)), trials(sessions), FOLLOW, usual).learned_from


@pytest.mark.parametrize("text", ["session", "session:", ":10", "session:0", "session:x", "a:-1",
                                  "a:1000001", "a:" + 5000 * "9"])  # fmt: skip
def test_a_text_that_names_no_group_and_count_is_refused(text: str) -> None:
    with pytest.raises(BadInput, match="KEY:TOUCHES"):
        parse_level_follow(text)


def test_levels_of_single_touches_are_refused() -> None:
    """Live, nothing would say that each is a session of its own."""
    with pytest.raises(BadInput, match=r"a group of many touches .* session:10"):
        parse_level_follow("trial:10")


def test_a_text_names_the_group_and_how_many_touches_the_usual_level_counts_as() -> None:
    assert parse_level_follow("day:10") == LevelFollow(key="day", touches=10)


def test_a_session_begins_at_the_usual_level_and_follows_touch_by_touch() -> None:
    """Twice the usual level: mean squares 4 and 16, of which the usual 1 and 4 count as two."""
    found = factors([[2.0, 4.0]] * 3, "aaa")

    assert found[0].tolist() == [1.0, 1.0]
    assert found[1].tolist() == pytest.approx([(1 / ((2 + 4) / 3)) ** 0.5] * 2)
    assert found[2].tolist() == pytest.approx([(1 / ((2 + 8) / 4)) ** 0.5] * 2)


def test_a_touch_and_later_ones_do_not_change_its_own_factor() -> None:
    first = factors([[1.0, 2.0], [1.0, 2.0], [9.0, 0.5]], "aaa")
    other = factors([[1.0, 2.0], [5.0, 7.0], [1.0, 2.0]], "aaa")

    assert first[:2].tolist() == other[:2].tolist()


def test_sessions_do_not_share_a_level() -> None:
    assert factors([[2.0, 4.0], [2.0, 4.0]], "ab").tolist() == [[1.0, 1.0], [1.0, 1.0]]


def test_in_training_the_own_session_has_no_part_in_where_it_begins() -> None:
    """Each session's first touch is brought to all sessions' level from that of the others."""
    found = followed_factors(windows([[1.0, 1.0], [4.0, 4.0]]), np.arange(2), trials("ab"), FOLLOW)

    assert found.usual.squares == pytest.approx((4.0, 4.0))
    for own in (found.learned_from, found.tested):
        assert own[0].tolist() == pytest.approx([(4 / 16) ** 0.5] * 2)
        assert own[1].tolist() == pytest.approx([2.0, 2.0])


def test_trials_are_tested_in_order_of_time_though_learned_from_at_random() -> None:
    """As live; of a bundle nothing is learned, so that both are the same."""
    rising = windows([[1.0 + 0.1 * i, 1.0 + 0.1 * i] for i in range(30)])
    trained = followed_factors(rising, np.arange(30), trials("a" * 30), FOLLOW)
    bundle = followed_factors(rising, np.arange(30), trials("a" * 30), FOLLOW, trained.usual)

    assert trained.tested.tolist() == bundle.tested.tolist() == bundle.learned_from.tolist()
    assert trained.learned_from.tolist() != trained.tested.tolist()


def test_recordings_of_a_session_come_as_people_count_them() -> None:
    """cup_2 before cup_10: the louder cup_10 is no earlier touch of cup_2's."""
    own = [replace(trial, recording=f"cup_{number}.mcap")
           for trial, number in zip(trials("aaa"), (1, 10, 2), strict=True)]  # fmt: skip
    found = followed_factors(windows([[1.0, 2.0], [9.0, 18.0], [1.0, 2.0]]), np.arange(3), own,
                             FOLLOW, USUAL).tested  # fmt: skip

    assert found.tolist() == [[1.0, 1.0]] * 3


def test_in_training_earlier_touches_are_drawn_at_random() -> None:
    """A rising session: by time, every factor would be below the one before."""
    rising = [[1.0 + 0.1 * i, 1.0 + 0.1 * i] for i in range(30)]
    by_time = factors(rising, "a" * 30, UsualLevel(squares=(1.0, 1.0), quietest=0.0))[:, 0]
    drawn = factors(rising, "a" * 30, None)[:, 0]

    assert (np.diff(by_time) <= 0).all()
    assert (np.diff(drawn) > 0).any()
    assert drawn.tolist() == factors(rising, "a" * 30, None)[:, 0].tolist()


def test_windows_at_rest_and_those_that_cannot_be_used_show_no_level() -> None:
    own = windows([[2.0, 4.0], [0.1, 0.2], [2.0, 4.0], [2.0, 4.0]])
    own = replace(own, usable=np.array([1.0, 1.0, 0.5, 1.0], np.float32))
    found = followed_factors(own, np.arange(4), trials("aaaa"), FOLLOW, USUAL).tested

    assert found[1:, 0].tolist() == pytest.approx([0.5**0.5] * 3)


def test_a_trial_without_the_group_is_refused() -> None:
    with pytest.raises(BadDataset, match="the group 'day' on every trial"):
        followed_factors(windows([[1.0, 1.0]]), np.zeros(1, np.intp), trials("a"),
                         LevelFollow(key="day", touches=1))  # fmt: skip


def test_of_a_bundle_trials_that_name_no_session_are_one() -> None:
    levels = [[2.0, 4.0], [2.0, 4.0]]
    unnamed = [replace(trial, groups={}) for trial in trials("ab")]
    found = followed_factors(windows(levels), np.arange(2), unnamed, FOLLOW, USUAL).tested

    assert found.tolist() == factors(levels, "aa").tolist()


def test_a_factor_is_bounded_and_a_channel_that_gives_nothing_stays_as_it_is() -> None:
    found = factor_of(np.array([1.0, 1.0, 0.0, 1.0]), np.array([1e4, 1e-4, 5.0, 0.0]))

    assert found.tolist() == pytest.approx([1 / MOST_CHANGE, MOST_CHANGE, 1.0, 1.0])


def test_padding_does_not_lower_a_level() -> None:
    mask = np.array([[True, True, False, False]])

    assert mean_squares(np.full((1, 4, 1), 3.0, np.float32), mask).tolist() == [[9.0]]


def live(levels: list[list[float]], starts: list[float], most: int | None) -> list[float]:
    """The first channel's factor of each window of 0.5 s."""
    follower, found = LevelFollower(USUAL, FOLLOW.touches, 0.8, most), []
    for level, start in zip(levels, starts, strict=True):
        window = windows([level])
        window = replace(window, start_s=np.array([start]), end_s=np.array([start + 0.5]))
        follower.begin(window)
        found.append(float(follower.factor[0]))
        follower.add(window)
    return found


def test_live_a_pause_ends_a_touch_and_the_level_is_that_of_recordings() -> None:
    levels = [[2.0, 4.0], [3.0, 1.0], [2.0, 4.0]]

    assert live(levels, [0.0, 2.0, 4.0], None) == pytest.approx(factors(levels, "aaa")[:, 0])


def test_live_windows_of_a_touch_share_a_factor() -> None:
    found = live([[2.0, 4.0]] * 4, [0.0, 0.5, 1.0, 3.0], None)

    assert found[:3] == [1.0, 1.0, 1.0]
    assert found[3] == pytest.approx(0.5**0.5)


def test_a_recording_that_ends_ends_its_touch_though_the_next_has_a_clock_of_its_own() -> None:
    follower = LevelFollower(USUAL, FOLLOW.touches, 0.8, None)
    for _ in range(2):
        follower.begin(windows([[2.0, 4.0]]))
        follower.add(windows([[2.0, 4.0]]))
        follower.over()

    assert follower.now().touches == 2
    assert follower.now().least == pytest.approx(2.5**0.5)


def test_live_without_pauses_a_touch_has_as_many_windows_as_a_usual_trial() -> None:
    found = live([[2.0, 4.0]] * 4, [0.0, 0.5, 1.0, 1.5], 2)

    assert found == pytest.approx([1.0, 1.0, 0.5**0.5, 0.5**0.5])


def test_live_padding_and_windows_that_cannot_be_used_change_no_level() -> None:
    """Half of the first window is padding, the second's values are missing."""
    first, second = windows([[2.0, 4.0]]), windows([[9.0, np.nan]])
    first.values[0, 2:], first.mask[0, 2:] = 0.0, False
    second.usable[:] = 0.5
    follower = LevelFollower(USUAL, FOLLOW.touches, 0.8, None)
    for window in (first, second):
        follower.begin(window)
        follower.add(window)
    follower.over()

    assert follower.now().touches == 1
    assert follower.factor.tolist() == pytest.approx(factors([[2.0, 4.0]] * 2, "aa")[1].tolist())


def test_a_follower_goes_on_from_anothers_state() -> None:
    first, second = (LevelFollower(USUAL, FOLLOW.touches, 0.8, None) for _ in range(2))
    for start in (0.0, 2.0):
        window = replace(windows([[2.0, 4.0]]), start_s=np.array([start]))
        first.begin(window)
        first.add(window)
    first.over()
    second.resume(json.loads(json.dumps(first.state())))

    assert second.now() == first.now()
    assert second.factor.tolist() == first.factor.tolist()
    assert second.state() == first.state()
    with pytest.raises(ValueError, match="a level of 1 channels for 2"):
        second.resume({"level": [1.0], "weight": 1.0, "touches": 0})


def test_windows_of_an_array_that_hangs_show_no_level_in_recordings_as_live() -> None:
    """Of three touches the second is of one scan that is sent again and again."""
    levels = [[2.0, 4.0], [9.0, 9.0], [3.0, 1.0]]
    hung = WatchedLevel(usual=USUAL, hung=lambda rows: bool(rows[0, 0] == 9.0))
    own = windows(levels)
    found = followed_factors(own, np.arange(3), trials("aaa"), FOLLOW, hung).tested
    known = followed_factors(own[np.array([0, 2])], np.arange(2), trials("aa"), FOLLOW, USUAL)

    assert np.allclose(found[[0, 2]], known.tested)
    assert not np.allclose(found[2], 1.0)


def test_live_rest_between_touches_changes_nothing() -> None:
    assert live([[0.1, 0.1]] * 5, [0.0, 2.0, 4.0, 6.0, 8.0], None) == [1.0] * 5


def test_a_channel_that_no_other_session_measured_begins_at_its_own_level() -> None:
    """It would seem to be nearly silent at first, and be scaled up."""
    found = followed_factors(
        windows([[1.0, 0.0], [1.0, 5.0], [1.0, 5.0]]), np.arange(3), trials("abb"), FOLLOW
    )

    assert found.usual.squares == pytest.approx((1.0, 25.0))
    assert found.learned_from.tolist() == found.tested.tolist() == [[1.0, 1.0]] * 3


@pytest.mark.parametrize(
    ("squares", "quietest"),
    [((-1.0,), 0.0), ((1.0,), -1.0), ((1.0, np.nan), 0.0), ((1e300,), 0.0), ((1.0,), np.inf)],
)
def test_a_usual_level_that_no_values_have_is_refused(
    squares: tuple[float, ...], quietest: float
) -> None:
    with pytest.raises(ValueError, match="below 0, or beyond"):
        UsualLevel(squares=squares, quietest=quietest)
