"""Forests on several threads leave Python's warning filters as they were, and print nothing."""

import warnings
from typing import Any, Self

import numpy as np
import pytest
from sklearn.ensemble import RandomForestClassifier

from taxel.training.camera_trials.members import learned
from taxel.training.choose.cores import working_threads
from taxel.training.kept_warnings import warnings_kept

LOST = (
    "`sklearn.utils.parallel.delayed` should be used with `sklearn.utils.parallel.Parallel` to make"
)


def grow_two_at_once() -> None:
    """Do to the filters what two threads of scikit-learn may do in an unlucky order."""
    warnings.filters[:] = []  # type: ignore[index]
    for _ in range(3):
        warnings.warn(LOST, UserWarning, stacklevel=1)


class Unlucky(RandomForestClassifier):  # type: ignore[misc]
    """A forest whose threads get into each other's way."""

    def fit(self, *_: Any) -> Self:
        grow_two_at_once()
        return self


def in_a_pool() -> None:
    with working_threads() as pool:
        pool.submit(grow_two_at_once).result()


def as_a_member() -> None:
    learned(Unlucky(), np.zeros((2, 1), np.float32), np.arange(2))


@pytest.mark.parametrize("train", [in_a_pool, as_a_member])
def test_a_race_for_the_filters_is_not_printed_and_loses_none(train: Any) -> None:
    """Thousands of lines were printed in place of a result."""
    with warnings.catch_warnings(record=True) as printed:
        before = list(warnings.filters)
        train()

        assert list(warnings.filters) == before
    assert printed == []


def test_other_warnings_are_given_at_the_end() -> None:
    with pytest.warns(RuntimeWarning, match="overflow"), warnings_kept():
        warnings.warn("overflow", RuntimeWarning, stacklevel=1)
