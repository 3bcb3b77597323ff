"""Claims about the linear probe of image networks by trial."""

import numpy as np
import pytest

from taxel.evaluation.camera_trials.probe import Labelled, ProbeResult, less_than, pooled, probe
from taxel.evaluation.camera_trials.sides import TrialSplit, split_trials

CROPS = 3


def trials(objects: int = 12, each: int = 4) -> tuple[np.ndarray, np.ndarray, TrialSplit]:
    y = np.tile([0, 1], objects * each // 2)
    names = np.repeat([f"object {i}" for i in range(objects)], each)
    groups = [{"object": str(name)} for name in names]
    return y, names, split_trials(groups, y, "group:object", 4, 0)


def rows(y: np.ndarray, apart: float) -> np.ndarray:
    random = np.random.default_rng(0)
    found = random.normal(size=(len(y) * CROPS, 300))
    found[:, :5] += apart * y.repeat(CROPS)[:, None]
    return found.astype(np.float32)


def test_a_crop_is_its_cameras_largest_and_least_mean_deviation_and_change() -> None:
    """Two cameras, one crop, three images, one column, by hand."""
    features = np.array([[[[[0.0], [2.0], [4.0]]], [[[1.0], [1.0], [1.0]]]]])

    spread = float(np.std([0, 2, 4]))
    assert pooled(features)[0].tolist() == pytest.approx([2, spread, 2, 1, 0, 0])


@pytest.mark.slow
def test_what_differs_between_classes_is_found_and_noise_is_not() -> None:
    y, names, split = trials()
    trial = np.arange(len(y)).repeat(CROPS)

    def accuracy(apart: float) -> float:
        found = probe("x", [rows(y, apart)] * len(split.folds), Labelled(trial, y, names), split)
        return float((found.probabilities.argmax(axis=1) == y).mean())

    assert accuracy(3.0) == 1.0
    assert accuracy(0.0) < 0.75


@pytest.mark.slow
def test_a_test_trial_changes_nothing_of_what_is_said_of_others() -> None:
    """Rows of the first fold's test side are all moved: other test sides stay as they were."""
    y, names, split = trials()
    trial = np.arange(len(y)).repeat(CROPS)
    first, moved = rows(y, 1.0), rows(y, 1.0)
    held = split.folds[0].test_rows
    own = np.isin(trial, held)
    moved[own] += 7.0
    one, two = (
        probe("x", [own_rows] + [first] * (len(split.folds) - 1), Labelled(trial, y, names), split)
        for own_rows in (first, moved)
    )
    others = np.setdiff1d(np.arange(len(y)), held)

    assert one.inner == two.inner
    assert np.array_equal(one.probabilities[others], two.probabilities[others])


def test_the_better_probe_has_a_difference_above_zero_and_a_small_p() -> None:
    y, names, _ = trials()
    sure = np.eye(2)[y] * 0.9 + 0.05
    wrong = np.where((np.arange(len(y)) % 4 == 0)[:, None], sure[:, ::-1], sure)
    good, bad = (ProbeResult(name="x", probabilities=own, inner=()) for own in (sure, wrong))

    found = less_than(good, bad, y, names)

    assert found.accuracy == pytest.approx(0.25)
    assert found.p_accuracy == pytest.approx(2 / 2**12)
    assert found.loss < 0
    assert found.p_loss < 0.01
    assert less_than(good, good, y, names).p_accuracy == 1.0
