"""A split by order has one test part: a number of folds beside it is refused, not ignored."""

from collections.abc import Callable

import pytest

ORDER = ["--split", "order:trial_number:70%", "--fold-count", "3"]


@pytest.mark.parametrize(
    "words",
    [
        ["tune", "d", *ORDER],
        ["learning-curve", "d", *ORDER],
        ["learning-curve", "d", "--recipe", "icub-grasp", "--fold-count", "3"],
        ["evaluate", "d", *ORDER],
        ["evaluate-trials", "d", *ORDER],
        ["train-trials", "d", *ORDER],
        ["train-trials", "d", "--split", "split", "--fold-count", "3"],
    ],
)
def test_folds_are_not_counted_beside_one_test_part(
    words: list[str], refused: Callable[[list[str]], str]
) -> None:
    assert "--fold-count, which would change nothing" in refused(words)
