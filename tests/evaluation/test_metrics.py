"""Scores equal their closed forms; intervals widen with the groups, not the windows."""

import numpy as np
import pytest

from taxel.evaluation.metrics import accuracy_interval, by_trial, score


def test_scores_of_a_known_confusion() -> None:
    y = np.array([0, 0, 0, 1, 1, 2])
    predicted = np.array([0, 0, 1, 1, 1, 0])
    probabilities = np.full((6, 3), 0.1)
    probabilities[np.arange(6), predicted] = 0.8

    scores = score(y, probabilities)

    assert scores.accuracy == pytest.approx(4 / 6)
    assert scores.confusion == [[2, 1, 0], [0, 2, 0], [1, 0, 0]]
    assert scores.precision == pytest.approx((2 / 3 + 2 / 3 + 0) / 3)
    assert scores.recall == pytest.approx((2 / 3 + 1 + 0) / 3)
    assert scores.loss == pytest.approx(-(4 * np.log(0.8) + 2 * np.log(0.1)) / 6)


def test_a_perfect_ranking_has_auc_one() -> None:
    y = np.array([0, 1, 2, 0, 1, 2])
    assert score(y, np.eye(3)[y] * 0.9 + 0.05).roc_auc == pytest.approx(1.0)


def test_repeating_windows_does_not_narrow_the_interval() -> None:
    rng = np.random.default_rng(0)
    share = rng.uniform(0.6, 1.0, 6)
    groups = np.repeat(np.arange(6).astype(str), 50)
    correct = rng.random(300) < np.repeat(share, 50)

    once = accuracy_interval(correct, groups)
    tenfold = accuracy_interval(np.repeat(correct, 10), np.repeat(groups, 10))

    assert once[1] - once[0] > 0.05
    assert tenfold == pytest.approx(once, abs=1e-9)


def test_one_group_gives_no_interval() -> None:
    low, high = accuracy_interval(np.array([True, False]), np.array(["s", "s"]))

    assert np.isnan(low)
    assert np.isnan(high)


def test_windows_of_a_trial_are_joined_by_their_mean_log_probability() -> None:
    probabilities = np.array([[0.9, 0.1], [0.4, 0.6], [0.2, 0.8]])

    numbers, y, joined = by_trial(np.array([4, 4, 7]), np.array([0, 0, 1]), probabilities)

    np.testing.assert_array_equal(numbers, [4, 7])
    np.testing.assert_array_equal(y, [0, 1])
    odds = np.sqrt(0.9 * 0.4) / np.sqrt(0.1 * 0.6)
    assert joined[0, 0] == pytest.approx(odds / (1 + odds))
