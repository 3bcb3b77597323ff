"""Claims about tiny signals: what trees learn and name does not depend on the unit (0024)."""

import numpy as np
import pytest
import torch

from taxel.evaluation.audit.evidence import predict
from taxel.evaluation.bars import BARS
from taxel.evaluation.baselines import _trees
from taxel.models.forest import CourseForest
from taxel.models.tiny_values import enlarged, enlarging
from taxel.models.touchnet import TouchNet

UNIT = 2.0**-30
"""About 1e-9, as of charges in nanocoulombs."""
Y = np.arange(60) % 3


def signals() -> tuple[np.ndarray, np.ndarray]:
    """Return windows (60, 8, 2) whose level is the class, and which rows are measured."""
    rng = np.random.default_rng(0)
    values = rng.normal(0.0, 0.2, (60, 8, 2)) + Y[:, None, None]
    return values.astype(np.float32), np.ones((60, 8), np.bool_)


def test_factors_are_powers_of_two_for_tiny_features_alone():
    learned = np.array([[1e-9, 0.002, 0.0, 1e-40], [-3e-9, 0.0, 0.0, np.nan]])
    factors = enlarging(learned)
    assert factors.tolist() == [2.0**29, 1.0, 1.0, 2.0**100]
    assert np.log2(factors).tolist() == np.round(np.log2(factors)).tolist()
    assert 1.0 <= abs(enlarged(learned, factors)[1, 0]) < 2.0
    usual = np.array([[0.5, 1e6]], np.float32)
    assert enlarged(usual, enlarging(usual)) is usual
    far = enlarged(np.array([[1e30]], np.float32), np.array([2.0**60]))
    assert np.isfinite(far).all()


def test_the_audit_and_the_baselines_see_tiny_values_as_any_others():
    values, _ = signals()
    features = values.mean(axis=1)
    folds = [(np.arange(45), np.arange(45, 60))]
    found = predict(features, Y, folds)
    np.testing.assert_array_equal(found, predict(features * np.float32(UNIT), Y, folds))
    assert (found[45:].argmax(axis=1) == Y[45:]).mean() > 0.9
    tiny = features * np.float32(UNIT)
    named = _trees(tiny[:45], Y[:45], tiny[45:])
    np.testing.assert_array_equal(named, _trees(features[:45], Y[:45], features[45:]))


@pytest.mark.parametrize("name", ["extra-trees", "random forest", "channel means"])
def test_a_model_to_compare_with_answers_alike_in_any_unit(name: str):
    values, mask = signals()
    answers = []
    for unit in (1.0, UNIT):
        model = BARS[name](0)
        model.fit(values[:45] * np.float32(unit), mask[:45], Y[:45])
        answers.append(model.predict_proba(values[45:] * np.float32(unit), mask[45:]))
    np.testing.assert_allclose(answers[0], answers[1], atol=1e-6)
    assert (answers[0].argmax(axis=1) == Y[45:]).mean() > 0.9


def test_a_forest_in_a_bundle_answers_alike_in_any_unit():
    values, mask = signals()
    answers = []
    for unit in (1.0, UNIT):
        forest = CourseForest(8, 2, 3)
        forest.grow(values[:45] * np.float32(unit), mask[:45], Y[:45], seed=0)
        scaled = torch.from_numpy(values[45:] * np.float32(unit))
        answers.append(forest(scaled, torch.from_numpy(mask[45:])).numpy())
    np.testing.assert_array_equal(answers[0], answers[1])
    assert (answers[0].argmax(axis=1) == Y[45:]).mean() > 0.9


def test_touchnet_sees_tiny_values_as_any_others():
    values, mask = signals()
    rows = torch.from_numpy(np.repeat(values, 8, axis=1)), torch.from_numpy(np.repeat(mask, 8, 1))
    answers = []
    for unit in (1.0, UNIT):
        torch.manual_seed(0)
        network = TouchNet(64, 2, 3).eval()
        network.prepare(rows[0] * unit, rows[1])
        with torch.inference_mode():
            answers.append(network(rows[0] * unit, rows[1]))
    torch.testing.assert_close(answers[0], answers[1], atol=1e-3, rtol=1e-3)


def test_touchnet_sees_a_tiny_channel_beside_a_usual_one():
    values, mask = signals()
    units = torch.tensor([1.0, UNIT])
    usual, mixed = TouchNet(8, 2, 3), TouchNet(8, 2, 3)
    usual.prepare(torch.from_numpy(values), torch.from_numpy(mask))
    mixed.prepare(torch.from_numpy(values) * units, torch.from_numpy(mask))
    for name in ("wander", "scale", "change"):
        torch.testing.assert_close(
            getattr(mixed, name) / units, getattr(usual, name), atol=0.0, rtol=0.01
        )
