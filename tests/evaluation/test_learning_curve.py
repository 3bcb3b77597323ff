"""Accuracy against amount of data: nested, whole groups, test parts untouched, baselines beside."""

from dataclasses import replace
from pathlib import Path

import pytest
from make_dataset import make_dataset
from make_pads import RECIPE as OF_PADS
from make_pads import make_pads

from taxel.errors import BadSplit
from taxel.evaluation import learning_curve as curve
from taxel.evaluation.checked import check_recipe
from taxel.evaluation.splits import by_group, random_windows
from taxel.training.loop import TrainConfig
from taxel.training.recipes import find_recipe

RECIPE = find_recipe("teng")


def small(**changes: object):
    return replace(RECIPE, target="shape", train_stride=None, train=TrainConfig(epochs=2),
                   **changes)  # fmt: skip


def test_each_amount_holds_the_one_before_and_the_last_is_all() -> None:
    dataset = make_dataset(sessions=6)
    split = by_group(dataset, "shape", "session", 3, 0)
    orders = [curve._order(dataset, fold, "session", small()) for fold in split.folds]
    amounts = [curve.given(dataset, split, orders, n / 4, "session") for n in (1, 2, 4)]

    for number, fold in enumerate(split.folds):
        parts = [amount.folds[number] for amount in amounts]
        assert [len({dataset.group("session")[t] for t in part.train}) for part in parts] == [
            1, 2, 4,
        ]  # fmt: skip
        assert parts[0].train < parts[1].train < parts[2].train
        assert parts[2].train == fold.train
        assert all(part.test == fold.test for part in parts)
        names = dataset.group("session")
        for part in parts:  # a session is given whole or not at all
            given = {names[t] for t in part.train}
            assert part.train == {t for t in fold.train if names[t] in given}


def test_amounts_rise_in_even_ratios_from_one_group_to_all() -> None:
    assert curve.shares(16, 5) == [1, 2, 4, 8, 16]
    assert curve.shares(3, 6) == [1, 2, 3]
    assert curve.shares(2, 6) == [1, 2]


def test_the_order_depends_on_seed_and_fold_alone() -> None:
    dataset = make_dataset(sessions=8)
    split = by_group(dataset, "shape", "session", 2, 0)
    first, second = (curve._order(dataset, split.folds[0], "session", small()) for _ in range(2))

    assert first == second
    assert sorted(first) == sorted({dataset.group("session")[t] for t in split.folds[0].train})


def test_a_split_of_single_windows_is_refused() -> None:
    split = random_windows(make_dataset(sessions=4), "shape", 2, 0, 0.0)
    with pytest.raises(BadSplit, match="a split of whole trials, to take some away"):
        split.whole_trials("to take some away", "choose another")


def test_the_last_amount_is_the_recipe_s_cross_validation(tmp_path: Path) -> None:
    """Windows to learn from start as often as the recipe says, as in evaluate."""
    pads = make_pads(tmp_path / "pads")
    recipe = replace(OF_PADS, train_stride=5, train=TrainConfig(epochs=2))
    last = curve.learning_curve(pads, recipe, steps=2).amounts[-1]
    checked = check_recipe(pads, recipe, bars=())

    assert last.windows == 8 * 13  # of 80 rows 13 windows of 20, every 5 rows
    assert last.fold_accuracies == checked.pooled.fold_accuracies
    assert last.trivial == checked.trivial


@pytest.mark.slow
def test_more_sessions_lift_the_accuracy_and_baselines_stand_beside(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The data's only difficulty is a gain of each session's own."""
    dataset = make_dataset(sessions=6)
    monkeypatch.setattr(curve, "load_dataset", lambda *_args, **_more: dataset)
    found = curve.learning_curve(
        Path("d"), small(model="extra-trees", split="group:session"), folds=3, steps=3
    )

    assert [amount.groups for amount in found.amounts] == [1, 2, 4]
    assert (found.group, found.split) == ("session", "session held out")
    assert found.amounts[-1].accuracy >= found.amounts[0].accuracy > 0.5
    assert found.amounts[-1].windows == 72
    for amount in found.amounts:
        assert amount.trivial["majority"] == pytest.approx(1 / 3)
        assert amount.low <= amount.accuracy <= amount.high
