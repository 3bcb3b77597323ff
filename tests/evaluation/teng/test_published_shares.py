"""What Table 4.1's digits say of how many windows were split into which parts."""

import pytest

from taxel.evaluation.teng.table_4_1 import FOLDS, PUBLISHED, TEST_SHARE, VALIDATION_SHARE

WINDOWS = 8775
"""All windows that decision 42 infers: 1,755 for the test, 7,020 for five folds."""


def fits(accuracies: list[float], windows: int) -> bool:
    """True where each accuracy is a number of windows out of so many, to four digits."""
    return all(
        any(round(right / windows, 4) == accuracy
            for right in range(int(accuracy * windows) - 1, int(accuracy * windows) + 3))
        for accuracy in accuracies
    )  # fmt: skip


def values(*rows: str) -> list[float]:
    return [PUBLISHED[model][row] for model in ("cnn1d", "cnn2d") for row in rows]


FOLD_ROWS = values(*(f"K-Fold Acc (Fold {i})" for i in range(1, 6)))
TEST_ROWS = values("Test Accuracy", "Noisy Data Accuracy")
WATCHED_ROWS = values("Validation Accuracy")


def test_our_shares_are_those_that_the_published_digits_fit():
    """20 % for the test, a fold of the rest, and 20 % of the rest watched."""
    test = round(WINDOWS * TEST_SHARE)
    rest = WINDOWS - test
    assert (test, rest // FOLDS, rest % FOLDS) == (1755, 1404, 0)
    assert fits(TEST_ROWS, test)
    assert fits(FOLD_ROWS, rest // FOLDS)
    assert fits(WATCHED_ROWS, round(rest * VALIDATION_SHARE))


@pytest.mark.parametrize("windows", [775, 1550])
def test_ten_per_cent_or_our_own_number_of_windows_would_not_give_these_digits(windows: int):
    assert not fits(TEST_ROWS, windows)


def test_no_other_size_of_a_fold_fits_all_ten():
    """Of 1,000 to 2,000 windows a fold only 1,404 give all ten accuracies, digit by digit."""
    assert [n for n in range(1000, 2001) if fits(FOLD_ROWS, n)] == [1404]
