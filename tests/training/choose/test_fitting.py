"""Heads that are fitted on features: what each must be able to learn."""

import numpy as np
from numpy.typing import NDArray
from sklearn.ensemble import ExtraTreesClassifier

from taxel.training.choose.candidates import Candidate
from taxel.training.choose.fitting import TREES, fit_head, head_logits


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


def test_extra_trees_can_be_fitted_on_a_single_feature():
    y = np.arange(40) % 2
    x = y[:, None].astype(np.float32)

    head = fit_head(Candidate("trees", "extra-trees", "means", 2), x, y, 2)

    assert (head_logits(head, x).argmax(axis=1) == y).all()
