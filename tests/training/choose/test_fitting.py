"""Heads that are fitted on features: what each must be able to learn."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import softmax
from sklearn.ensemble import ExtraTreesClassifier, RandomForestClassifier

from taxel.training.choose.candidates import Candidate
from taxel.training.choose.fitting import DEEPEST, TREES, fit_head, head_logits


def windows(count: int, seed: int) -> tuple[NDArray[np.float32], NDArray[np.intp]]:
    """Four classes that two of 1,000 features know about."""
    y = np.arange(count) % 4
    x = np.random.default_rng(seed).normal(size=(count, 1000)).astype(np.float32)
    x[:, 500] += 1.5 * (y // 2)
    x[:, 501] += 1.5 * (y % 2)
    return x, y


def test_extra_trees_find_the_few_features_that_matter_among_many():
    """Chance is 0.25; scikit-learn's own settings, which look at 32 of 1,000, stay near it."""
    (x, y), (test_x, test_y) = windows(120, 0), windows(400, 1)

    head = fit_head(Candidate("trees", "extra-trees", "all", 2), x, y, 4)
    usual = ExtraTreesClassifier(TREES, min_samples_leaf=2, random_state=0).fit(x, y)

    right = (head_logits(head, test_x).argmax(axis=1) == test_y).mean()
    usual_right = (usual.predict(test_x) == test_y).mean()
    assert right > usual_right + 0.1
    assert right > 0.4


@pytest.mark.parametrize("model", ["extra-trees", "random-forest"])
def test_trees_look_at_both_of_two_features(model: str):
    """The root of two is one: trees that see one feature a split would give other answers."""
    x = np.random.default_rng(0).normal(size=(600, 2)).astype(np.float32)
    y = (np.arctan2(x[:, 1], x[:, 0]) > 0).astype(np.intp)

    head = fit_head(Candidate("trees", model, "rows", 2), x[:300], y[:300], 2)

    got = softmax(head_logits(head, x[300:]), axis=1)
    both, single = (grown(model, seen, x[:300], y[:300]).predict_proba(x[300:]) for seen in (2, 1))
    np.testing.assert_allclose(got, both, atol=0.005)
    assert np.abs(got - single).max() > 0.1


def grown(model: str, seen: int, x: NDArray[np.float32], y: NDArray[np.intp]) -> Any:
    """Return scikit-learn's own forest."""
    settings = {"max_features": seen, "min_samples_leaf": 2, "max_depth": DEEPEST}
    if model == "extra-trees":
        return ExtraTreesClassifier(TREES, criterion="entropy", random_state=0, **settings).fit(
            x, y
        )
    return RandomForestClassifier(TREES, random_state=0, **settings).fit(x, y)


@pytest.mark.parametrize("model", ["extra-trees", "random-forest"])
def test_trees_can_be_fitted_on_a_single_feature(model: str):
    y = np.arange(40) % 2
    x = y[:, None].astype(np.float32)

    head = fit_head(Candidate("trees", model, "means", 2), x, y, 2)

    assert (head_logits(head, x).argmax(axis=1) == y).all()
