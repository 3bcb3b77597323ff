"""A camera trial's verdict is the sharpened mean of its crops, or UNKNOWN with the reason."""

import numpy as np
import pytest

from taxel.decisions.recognition import UNKNOWN
from taxel.decisions.trial_verdict import VerdictConfig, join_crops, no_verdict

CLASSES = ("a", "b", "c")
CROPS = np.array([[0.6, 0.3, 0.1], [0.2, 0.7, 0.1]])
"""Their mean: 0.4, 0.5, 0.1."""


def verdict(crops: np.ndarray = CROPS, novelty: float = 1.0, **config: float | None):
    return join_crops(crops, np.array([novelty, novelty + 2.0]), CLASSES, VerdictConfig(**config))


def test_the_mean_of_the_crops_decides():
    found = verdict()

    assert (found.label, found.reason, found.crops, found.novelty) == ("b", "", 2, 2.0)
    assert found.confidence == pytest.approx(0.5)
    np.testing.assert_allclose(found.probabilities, [0.4, 0.5, 0.1])


def test_crops_count_as_their_places_do_and_alike_while_a_trial_runs():
    """A running trial gives one mean, of crops that lie elsewhere."""
    np.testing.assert_allclose(verdict(places=(0.75, 0.25)).probabilities, [0.5, 0.4, 0.1])
    np.testing.assert_allclose(verdict(places=(0.2, 0.3, 0.5)).probabilities, [0.4, 0.5, 0.1])


def test_the_mean_is_sharpened_and_adds_up_to_one():
    """Squares of 0.4, 0.5 and 0.1, over their sum of 0.42."""
    np.testing.assert_allclose(verdict(sharpness=2.0).probabilities, np.array([16, 25, 1]) / 42)


def test_a_class_that_no_crop_believes_in_keeps_a_millionth():
    found = verdict(np.array([[1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), sharpness=2.0)

    np.testing.assert_allclose(found.probabilities, [1.0, 1e-12, 1e-12])


def test_without_a_threshold_no_novelty_is_too_much_and_half_a_chance_is_enough():
    assert verdict(novelty=1e9).label == "b"
    unsure = verdict(np.array([[0.41, 0.49, 0.1]] * 2))
    assert (unsure.label, unsure.reason) == (UNKNOWN, "confidence 0.49 is below 0.50")
    assert verdict(np.array([[0.41, 0.49, 0.1]] * 2), least_confidence=0.49).label == "b"


@pytest.mark.parametrize(("novelty", "label"), [(1.0, "b"), (1.1, UNKNOWN)])
def test_above_the_threshold_a_trial_is_novel(novelty: float, label: str):
    found = verdict(novelty=novelty, threshold=2.0)

    assert found.label == label
    assert found.reason in ("", "novel touch (novelty score 2.1, limit 2.0)")


@pytest.mark.parametrize(("crops", "novelty"), [
    (np.full((2, 3), np.nan), 1.0), (CROPS, np.nan), (CROPS, np.inf),
])  # fmt: skip
def test_what_is_no_number_is_unknown(crops: np.ndarray, novelty: float):
    found = verdict(crops, novelty, threshold=2.0)

    assert (found.label, found.reason) == (UNKNOWN, "the model gave NaN")


def test_a_trial_without_a_crop_has_no_number_at_all():
    found = no_verdict(CLASSES, "too short")

    assert (found.label, found.reason, found.crops) == (UNKNOWN, "too short", 0)
    assert np.isnan([found.confidence, found.novelty, *found.probabilities]).all()
    assert found.probabilities.shape == (3,)
