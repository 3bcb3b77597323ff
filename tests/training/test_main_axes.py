"""Novelty of camera trials is learned where LAPACK's quick decomposition gives up."""

import numpy as np
import pytest

from taxel.training.camera_trials.novelty import Novelty


def test_novelty_is_learned_where_the_quick_decomposition_does_not_converge(
    monkeypatch: pytest.MonkeyPatch,
):
    rng = np.random.default_rng(0)
    rows, others = rng.normal(size=(2, 40, 12)).astype(np.float32)
    usual = Novelty.of(rows).measure(others)

    def gives_up(*_: object, **__: object) -> None:
        raise np.linalg.LinAlgError("SVD did not converge")

    monkeypatch.setattr("numpy.linalg.svd", gives_up)

    assert Novelty.of(rows).measure(others) == pytest.approx(usual, rel=1e-4)


def test_novelty_without_columns_or_with_equal_crops_alone_is_nothing():
    """Views may be those alone that novelty does not look at."""
    nothing = Novelty.of(np.zeros((6, 4), np.float32), np.arange(0))
    assert nothing.directions.shape == (0, 0)
    assert nothing.measure(np.ones((3, 4), np.float32)).tolist() == [0.0] * 3
    assert Novelty.of(np.ones((6, 4), np.float32)).measure(np.ones((1, 4), "f4")).tolist() == [0.0]


def test_directions_along_which_equal_crops_differ_by_rounding_alone_are_left_out():
    """Scaled to the others' spread, rounding errors gave distances of 140, and a bundle that
    differed from what was trained."""
    rng = np.random.default_rng(0)
    rows = np.repeat(rng.normal(size=(8, 300)), 3, axis=0).astype(np.float32)
    rows *= 1 + rng.normal(0.0, 1e-6, rows.shape).astype(np.float32)
    novelty = Novelty.of(rows)
    assert novelty.directions.shape == (300, 7)
    assert novelty.measure(rows[::3]).max() < 5.0
