"""Points, losses and where five points are gone: closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from taxel.evaluation.robustness.curve import (
    FaultPoint,
    SessionAnswers,
    fall_text,
    loss_between,
    point_of,
    reached,
)


def point(level: float, accuracy: float) -> FaultPoint:
    return FaultPoint(
        fault="f", level=level, unit="u", accuracy=accuracy, low=0.0, high=1.0, answered=1.0,
        windows=10, grasps=0.5, grasps_answered=1.0, outside=0.0,
    )  # fmt: skip


def answers(right: list[int], answered: list[int], sessions: str, grasps: str) -> SessionAnswers:
    """One window a touch."""
    found = np.array([[0.9, 0.1] if correct else [0.1, 0.9] for correct in right])
    return SessionAnswers(
        y=np.zeros(len(right), np.intp),
        probabilities=found,
        answered=np.array(answered, bool),
        trial=np.arange(len(right)),
        session=np.array(list(sessions)),
        grasps=np.array(list(grasps)),
        outside=3,
        minutes=2.0,
    )


def test_accuracy_is_of_what_was_answered_and_silent_grasps_are_not_right():
    """Four windows of five grasps: one grasp gave none, one window was UNKNOWN."""
    found = point_of(answers([1, 1, 0, 1], [1, 1, 1, 0], "aabb", "aabbb"), "f", 2.0, "u")

    assert found.accuracy == pytest.approx(2 / 3)
    assert found.answered == 0.75
    assert found.grasps == pytest.approx(2 / 5)
    assert found.grasps_answered == pytest.approx(3 / 5)
    assert found.windows == 4
    assert found.outside == 1.5


def test_nothing_answered_has_no_accuracy_but_no_grasp_right():
    found = point_of(answers([1, 1], [0, 0], "ab", "ab"), "f", 1.0, "u")

    assert np.isnan(found.accuracy)
    assert found.grasps == 0.0
    assert found.answered == 0.0


def test_windows_of_a_grasp_are_joined_and_passes_stay_apart():
    """One wrong window beside two right ones of the same grasp; twice over."""
    first = answers([1, 1, 0], [1, 1, 1], "aaa", "a")
    first = SessionAnswers(first.y, first.probabilities, first.answered, np.zeros(3, np.intp),
                  first.session, first.grasps, 0, 1.0)  # fmt: skip
    twice = SessionAnswers.join([first, first])

    assert point_of(twice, "f", 1.0, "u").grasps == 1.0
    assert len(set(twice.trial.tolist())) == 2
    assert twice.minutes == 2.0


def test_a_loss_is_paired_by_session():
    """Both sessions lose one of two windows: the interval knows that nothing else differs."""
    base = answers([1, 1, 1, 1], [1, 1, 1, 1], "aabb", "aabb")
    worse = answers([1, 0, 1, 0], [1, 1, 1, 1], "aabb", "aabb")
    for grasps in (False, True):
        found = loss_between(base, worse, grasps=grasps)
        assert found.points == pytest.approx(50.0)
        assert (found.low, found.high) == pytest.approx((0.5, 0.5))


def test_a_silent_condition_loses_all_grasps():
    base = answers([1, 1], [1, 1], "ab", "ab")
    silent = answers([1, 1], [0, 0], "ab", "ab")

    assert loss_between(base, silent, grasps=True).points == pytest.approx(100.0)


def test_the_level_is_read_off_straight_lines():
    points = [point(1.0, 0.90), point(2.0, 0.80)]

    assert reached(points, 0.92) == pytest.approx(1.3)
    assert reached([point(1.0, 0.80)], 0.9) == 1.0
    assert reached([point(1.0, 0.88)], 0.9) is None
    assert reached([point(40.0, 0.90), point(20.0, 0.80)], 0.9) == pytest.approx(30.0)


def test_a_fall_is_counted_from_the_windows_that_are_left():
    """0.88 of windows of which 0.90 were right is no fall from 0.95."""
    left = replace(point(1.0, 0.88), base=0.90)

    assert reached([left], 0.95) is None
    assert left.beside(0.95) == pytest.approx(0.93)


def test_words_say_whether_it_fell_or_fell_silent():
    assert fall_text([point(1.0, 0.9), point(3.0, 0.8)], 0.9) == "2 u"
    assert fall_text([point(1.0, 0.9)], 0.9) == "not up to 1 u"
    assert "nothing is answered" in fall_text([point(1.0, float("nan"))], 0.9)
    assert "without it either" in fall_text([point(1.0, 0.9)], float("nan"))
