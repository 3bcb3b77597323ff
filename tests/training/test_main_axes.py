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
