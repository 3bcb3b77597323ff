"""95 % intervals of whole clusters: one rule for all studies."""

import numpy as np
import pytest

from taxel.evaluation.intervals import (
    NO_INTERVAL,
    RESAMPLES,
    all_alike,
    draw_clusters,
    draw_rows,
    percentile_interval,
    ratio_interval,
)


@pytest.mark.parametrize("clusters", [0, 1])
def test_fewer_than_two_clusters_give_no_draw_and_no_interval(clusters: int):
    counts = np.ones(clusters)

    assert draw_clusters(clusters).shape == (0, clusters)
    assert draw_rows(["s1"] * 5) == []
    assert np.isnan(ratio_interval(counts, counts)).all()


def test_draws_that_say_nothing_are_left_out():
    assert percentile_interval([np.nan, 3.0, np.inf, 3.0]) == (3.0, 3.0)
    assert np.isnan(percentile_interval([np.nan, np.nan])).all()
    # A draw of the empty cluster twice has no share.
    assert ratio_interval(np.array([0.0, 2.0]), np.array([0.0, 4.0])) == (0.5, 0.5)


def test_whole_clusters_are_drawn_and_the_seed_decides():
    groups = ["b", "a", "b", "c"]
    draws = draw_rows(groups, seed=3)

    assert len(draws) == RESAMPLES
    for rows in draws[:50]:
        found = [groups[row] for row in rows]
        assert found.count("b") % 2 == 0
        assert found.count("b") / 2 + found.count("a") + found.count("c") == 3
    assert [rows.tolist() for rows in draws[:9]] == [r.tolist() for r in draw_rows(groups, 3)[:9]]


def test_the_interval_of_an_accuracy_is_as_wide_as_its_sessions_differ():
    """Two sessions, all right and half right: resamples give 0.5, 0.75 or 1."""
    low, high = ratio_interval(np.array([10, 5]), np.array([10, 10]))

    assert (low, high) == (0.5, 1.0)
    assert ratio_interval(np.array([7, 7]), np.array([10, 10])) == (0.7, 0.7)


def test_clusters_that_are_all_alike_are_known_by_an_interval_without_width():
    """Sums of thirds differ in their last bits; one cluster alone has no interval to be of."""
    thirds = ratio_interval(np.array([0.1, 0.2, 0.3]), np.array([0.3, 0.6, 0.9]))

    assert all_alike(thirds)
    assert all_alike(ratio_interval(np.array([10, 20]), np.array([10, 20])))
    assert not all_alike(ratio_interval(np.array([10, 19]), np.array([10, 20])))
    assert not all_alike(NO_INTERVAL)
