"""The shrunk discriminant: equal to the textbook's, and deaf to what varies within classes."""

from __future__ import annotations

import numpy as np
import pytest

from taxel.training.choose.blending import mix
from taxel.training.discriminant import fit_discriminant


@pytest.mark.parametrize("features", [6, 90])
def test_its_logits_order_as_the_textbook_s_with_few_features_and_with_more_than_windows(
    features: int,
):
    rng = np.random.default_rng(0)
    y = np.arange(40) % 3
    data = rng.normal(size=(40, features)) + rng.normal(size=(3, features))[y]

    found = fit_discriminant(data, y, 0.3)

    means = np.stack([data[y == number].mean(axis=0) for number in range(3)])
    apart = data - means[y]
    scatter = apart.T @ apart / 40
    even = np.trace(scatter) / features * np.eye(features)
    weight = np.linalg.solve(0.7 * scatter + 0.3 * even, means.T).T
    whole = np.log(np.bincount(y) / 40) - 0.5 * (weight * means).sum(axis=1)
    new = rng.normal(size=(20, features))
    ours, theirs = new @ found.weight.T + found.bias, new @ weight.T + whole
    spread = data @ weight.T + whole
    scale = (spread - spread.mean(axis=1, keepdims=True)).std()
    np.testing.assert_allclose(ours, theirs / scale, rtol=1e-5, atol=1e-6)


def test_what_varies_within_classes_hardly_counts():
    """Two columns know the class equally well where it was learned; one of them drifts."""
    rng = np.random.default_rng(1)
    y = np.arange(400) % 2
    steady = y - 0.5 + 0.1 * rng.normal(size=400)
    drifting = 2.0 * (y - 0.5) + 3.0 * rng.normal(size=400)

    found = fit_discriminant(np.stack([steady, drifting], axis=1), y, 0.01)

    ours = np.abs(found.weight[1] - found.weight[0])
    assert ours[0] > 10 * ours[1]


def mixed(discriminant: float, logistic: float) -> dict[int, float]:
    """Mix four camps with these probabilities of the truth; trees and a network have 0.7."""
    y = np.arange(60) % 2
    camps = ["discriminant", "sums", "trees", "network"]
    each = []
    for right in (discriminant, logistic, 0.7, 0.7):
        found = np.full((60, 2), 1.0 - right)
        found[np.arange(60), y] = right
        each.append(found)
    result = mix(each, camps, camps, [(0.0,)] * 4, y, np.arange(60) % 6)
    return dict(zip(result.members, result.weights, strict=True))


def test_a_discriminant_counts_twice_and_sums_stay_only_where_they_are_better():
    assert mixed(0.7, 0.7) == pytest.approx({0: 0.5, 2: 0.25, 3: 0.25})
    assert mixed(0.7, 0.73) == pytest.approx({0: 0.4, 1: 0.2, 2: 0.2, 3: 0.2})
