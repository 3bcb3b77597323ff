"""Rows of robustness: goals are judged at the worst level, and faults have none."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from taxel.bench.audit import robustness as rows
from taxel.evaluation.robustness.conditions import LEVELS
from taxel.evaluation.robustness.curve import CLEAN, FaultPoint, SessionAnswers
from taxel.evaluation.robustness.touches import Model


def answers(right: int, of: int = 100) -> SessionAnswers:
    """Two sessions of single-window grasps, the same share right in both."""
    half = np.arange(of) < right
    flags = np.concatenate([half, half])
    sessions = np.repeat(["a", "b"], of)
    return SessionAnswers(
        y=np.zeros(2 * of, np.intp),
        probabilities=np.where(flags[:, None], [0.9, 0.1], [0.1, 0.9]),
        answered=np.ones(2 * of, bool),
        trial=np.arange(2 * of),
        session=sessions,
        grasps=sessions,
        outside=0,
        minutes=1.0,
    )


def at_dust(shares: list[int]) -> dict[tuple[str, float], SessionAnswers]:
    levels = LEVELS["dust"][1]
    own = {("dust", level): answers(share) for level, share in zip(levels, shares, strict=True)}
    return {(CLEAN, 0.0): answers(95), **own}


@pytest.mark.parametrize("grasps", [False, True])
def test_a_condition_is_judged_at_its_worst_level(grasps: bool):
    plain, robust = at_dust([95, 90, 85, 80, 70]), at_dust([95, 94, 92, 94, 95])
    row = rows._condition_row("shape by windows", "dust", plain, robust, grasps)

    assert row.value == pytest.approx(3.0)
    assert row.goal == "<= 2"
    assert row.ok is False
    assert "worst at 0.3" in row.note
    assert "0.5: +25.0" in row.note  # the plain recipe beside it
    assert "above 95 %" in row.note  # the thesis beside both


@pytest.mark.parametrize("grasps", [False, True])
def test_the_commonest_class_stands_beside_the_accuracy(grasps: bool):
    """Of a hundred grasps sixty are of one class; each of the others gave two windows."""
    many = answers(95)
    y = np.repeat([0, 1], [120, 80])
    trial = np.concatenate([np.arange(120), 120 + np.arange(80) // 2])
    own = {(CLEAN, 0.0): replace(many, y=y, trial=trial)}
    row = rows._base_row("shape", own, own, grasps)

    assert f"majority {0.75 if grasps else 0.6:.3f}" in row.note


def test_a_fault_has_no_goal_and_says_where_nothing_is_answered():
    base = FaultPoint(
        fault=CLEAN, level=0.0, unit="", accuracy=0.9, low=0.8, high=1.0, answered=1.0, windows=9,
        grasps=0.9, grasps_answered=1.0, outside=0.0,
    )  # fmt: skip
    silent = replace(base, fault="missing", unit="channels", level=1.0, accuracy=float("nan"),
                     answered=0.0)  # fmt: skip
    row = rows._fall_row("missing", [silent], base, rows._words(silent))

    assert (row.value, row.goal, row.ok) == (None, "", None)
    assert "nothing is answered" in row.note
    assert "nan" not in row.note


def test_sessions_that_choose_nothing_are_those_tested():
    assert rows.TESTED.seed not in (rows.TRAIN_SEED, 0, 6023, 9023)


def test_two_recognisers_side_by_side_predict_both_labels_in_the_order_of_one():
    def knows(classes: tuple[str, ...], given: list[float]) -> Model:
        contract = SimpleNamespace(classes=classes)
        return Model(contract, lambda values, _: np.tile(given, (len(values), 1)))  # type: ignore[arg-type]

    both = knows(("b x", "a x", "a y", "b y"), [0.25] * 4)
    model = rows._side_by_side(knows(("a", "b"), [0.3, 0.7]), knows(("x", "y"), [0.9, 0.1]), both)
    found = model.probabilities(np.zeros((2, 5, 3), np.float32), np.ones((2, 5), bool))

    assert model.contract is both.contract
    np.testing.assert_allclose(found, np.tile([0.63, 0.27, 0.03, 0.07], (2, 1)))
