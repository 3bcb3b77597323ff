"""Claims about learning from simulated trials: nothing of a test object is seen, and ranks by
domain carry what differs by level and spread alone.
"""

import numpy as np
import pytest

from taxel.errors import BadDataset
from taxel.evaluation.camera_trials.encoder_study import few_trials
from taxel.evaluation.camera_trials.probe import Labelled, probe
from taxel.evaluation.camera_trials.sides import split_trials
from taxel.evaluation.camera_trials.sim_to_real import (
    gain,
    score_draws,
    transfer,
    transfer_once,
)
from taxel.evaluation.rank_area import area
from taxel.training.camera_trials.learning import Learning

CROPS, COLUMNS = 3, 6


def domain(objects: int, each: int, level: float, spread: float, seed: int) -> Learning:
    """Trials whose first column says the class, at some level and spread."""
    random = np.random.default_rng(seed)
    y = np.tile([0, 1], objects * each // 2).astype(np.intp)
    trial = np.repeat(np.arange(len(y)), CROPS)
    rows = random.normal(size=(len(trial), COLUMNS))
    rows[:, 0] += 4 * y[trial]
    names = np.repeat([f"object {i}" for i in range(objects)], each)
    return Learning((level + spread * rows).astype(np.float32), trial, y, names, 2)


SIMULATED, REAL = domain(6, 4, 0.0, 1.0, 0), domain(10, 4, 100.0, 5.0, 1)
SPLIT = split_trials([{"object": str(name)} for name in REAL.groups], REAL.y, "group:object", 5, 0)


def test_ranks_by_domain_carry_over_where_level_and_spread_differ() -> None:
    found = transfer(SIMULATED, REAL, SPLIT, 0)
    together = transfer(SIMULATED, REAL, SPLIT, 0, ranking="together")

    assert found.shape == (1, len(REAL.y), 2)
    assert area(REAL.y, found[0]) > 0.95
    assert area(REAL.y, together[0]) < 0.6


def test_real_trials_alone_give_what_the_probe_gives() -> None:
    labelled = Labelled(REAL.trial, REAL.y, REAL.groups)
    expected = probe("", [REAL.rows] * len(SPLIT.folds), labelled, SPLIT).probabilities

    assert transfer(None, REAL, SPLIT, None)[0] == pytest.approx(expected, abs=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("objects", [0, 1, None])
def test_neither_labels_nor_rows_of_other_test_trials_count(objects: int | None) -> None:
    before = transfer(SIMULATED, REAL, SPLIT, objects)[0]
    test = SPLIT.folds[0].test_rows
    y, rows = REAL.y.copy(), REAL.rows.copy()
    y[test] = 1 - y[test]
    rows[np.isin(REAL.trial, test[1:])] += 50
    fold = SPLIT.folds[0]
    one_fold = type(SPLIT)(SPLIT.name, (fold,), SPLIT.group)
    other = Learning(rows, REAL.trial, y, REAL.groups, 2)

    found = transfer(SIMULATED, other, one_fold, objects)[0]

    assert found[test[0]] == pytest.approx(before[test[0]])
    assert np.isnan(found[fold.train_rows]).all()


def test_few_objects_are_drawn_anew_and_repeatably() -> None:
    found = transfer(SIMULATED, REAL, SPLIT, 1, draws=3)

    assert found.shape[0] == 3
    assert not np.allclose(found[0], found[1])
    assert np.array_equal(found, transfer(SIMULATED, REAL, SPLIT, 1, draws=3))


def test_scores_are_means_over_draws_and_gains_are_paired() -> None:
    sure = np.stack([1.0 - REAL.y, REAL.y], axis=1)
    found = np.stack([sure, 1.0 - sure])

    scores = score_draws(REAL.y, found, REAL.groups)
    more = gain(REAL.y, sure[None], found, REAL.groups)

    assert (scores.accuracy, scores.auc) == (0.5, 0.5)
    assert (more.accuracy, more.auc) == (0.5, 0.5)
    assert more.accuracy_interval == (0.5, 0.5)


def test_without_any_labelled_trial_nothing_is_learned() -> None:
    with pytest.raises(BadDataset, match="simulated or real"):
        transfer_once(None, None, REAL.rows, REAL)


@pytest.mark.parametrize("objects", [1, 5])
def test_a_training_side_of_one_class_ends_in_an_error_not_in_a_loop(objects: int) -> None:
    y = np.array([0, 0, 0, 0, 1], np.intp)
    groups = np.array(["a", "b", "c", "d", "e"])

    with pytest.raises(BadDataset, match="every class"):
        few_trials(y, groups, np.arange(4), objects, np.random.default_rng(0))


def test_few_objects_have_every_class_between_them() -> None:
    y = np.array([0, 0, 0, 1], np.intp)
    groups = np.array(["a", "b", "c", "d"])

    for seed in range(20):
        kept = few_trials(y, groups, np.arange(4), 2, np.random.default_rng(seed))
        assert set(y[kept]) == {0, 1}
        assert len(set(groups[kept])) == 2
