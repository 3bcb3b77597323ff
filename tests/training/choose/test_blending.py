"""What is blended: kinds that do about as well, camps that fail apart, and what chance allows."""

import numpy as np
import pytest

from taxel.training.choose.blending import (
    Mix,
    _champions,
    _halved,
    by_chance,
    mix,
    softmax,
    standard_error,
)


def test_kinds_that_do_about_as_well_are_averaged_and_one_far_behind_is_not():
    rng = np.random.default_rng(0)
    y = np.arange(300) % 2
    good = softmax(np.eye(2)[y] * 2 + rng.normal(size=(300, 2)))
    other = softmax(np.eye(2)[y] * 2 + rng.normal(size=(300, 2)))
    bad = np.full((300, 2), 0.5)

    groups = np.arange(300) // 10
    found = mix([good, other, bad], ["a", "b", "c"], ["a", "b", "c"], [(0,)] * 3, y, groups)

    assert found.members == (0, 1)
    assert found.weights == (0.5, 0.5)
    assert found.why.startswith("a blend, the mean")
    alone = mix([good, bad], ["a", "c"], ["a", "c"], [(0,)] * 2, y, groups)
    assert alone.members == (0,)
    assert alone.why == "one model alone, because all other kinds are far behind"
    only = mix([good, other], ["a", "a"], ["a", "a"], [(0,)] * 2, y, groups)
    assert only.why == "one model alone, because no other kind was tried"


def test_a_discriminant_that_is_alone_beside_a_better_regression_is_not_called_the_best():
    """The regression is better, but by less than 0.03 nats."""
    y = np.arange(300) % 2
    regression, steady = (softmax(np.eye(2)[y] * size) for size in (0.45, 0.42))

    found = mix([regression, steady], ["logistic", "discriminant"], ["sums", "discriminant"],
                [(0,)] * 2, y, np.arange(300) // 10)  # fmt: skip

    assert found.members == (1,)
    assert found.why.startswith("a discriminant alone: logistic regression and perceptrons are")


def test_few_groups_leave_more_to_chance_than_many():
    rng = np.random.default_rng(0)
    gain = rng.normal(size=600)
    five, many = np.arange(600) % 5, np.arange(600)

    assert by_chance(gain, five) == pytest.approx(2.776 * standard_error(gain, five), rel=1e-3)
    assert by_chance(gain, many) == pytest.approx(1.964 * standard_error(gain, many), rel=1e-3)
    assert by_chance(gain, np.zeros(600, np.intp)) == np.inf


def test_kinds_that_fail_together_share_one_weight():
    rng = np.random.default_rng(0)
    y = np.arange(300) % 2
    each = [softmax(np.eye(2)[y] * 2 + rng.normal(size=(300, 2))) for _ in range(3)]

    found = mix(each, ["linear", "perceptron", "trees"], ["sums", "sums", "trees"], [(0,)] * 3, y,
                np.arange(300) // 10)  # fmt: skip

    assert found.members == (0, 1, 2)
    assert found.weights == (0.25, 0.25, 0.5)


@pytest.mark.parametrize(
    ("camp", "loss", "stays"),
    [("network", 0.43, True), ("network", 0.45, False),
     ("discriminant", 0.69, True), ("discriminant", 0.71, False)],
)  # fmt: skip
def test_a_steady_kind_stays_up_to_twice_the_least_loss_where_no_other_does(camp, loss, stays):
    """The least loss is 0.3 nats: 1.3 times that and 0.05, twice that and 0.1."""
    by_window = np.stack([np.full(300, 0.3), np.full(300, loss)])
    groups = np.arange(300) // 10

    found = _champions(by_window, ["a", "b"], ["trees", camp], [(0,)] * 2, groups)

    assert found == ((0, 1) if stays else (0,))


def test_what_beats_the_mean_of_kinds_gets_half_of_the_weight():
    """The mean of the three loses 0.385 nats, the first alone 0.3: better by a tenth and 0.03."""
    y = np.arange(600) % 2
    each = [np.where(np.eye(2)[y] > 0, right, 1 - right) for right in (0.741, 0.65, 0.65)]

    found = mix(each, list("abc"), list("abc"), [(0,)] * 3, y, np.arange(600) // 10)

    assert found.why.startswith("half the best model, half the mean of the best model of each kind")
    assert found.members == (0, 1, 2)
    assert found.weights == pytest.approx((2 / 3, 1 / 6, 1 / 6))


def test_half_of_each_weight_is_added_where_a_member_is_in_both():
    better, mean = Mix((2, 0), (0.75, 0.25), "a greedy blend"), Mix((0, 1), (0.5, 0.5), "")

    found = _halved(better, mean)

    assert found.members == (2, 0, 1)
    assert found.weights == (0.375, 0.375, 0.25)
    assert found.why == (
        "half a greedy blend, half the mean of the best model of each kind: the former is clearly "
        "better on inner folds, the latter is safer for new groups"
    )


def test_one_model_is_not_called_a_mean_of_kinds():
    """Beside a blend of kinds of which all but one are far behind alone."""
    better, alone = Mix((0, 1), (0.5, 0.5), "a greedy blend"), Mix((0,), (1.0,), "")

    found = _halved(better, alone)

    assert found.weights == (0.75, 0.25)
    assert found.why.startswith("half a greedy blend, half one model alone: ")
