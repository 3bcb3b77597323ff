"""A split that leaves too few trials of a class is refused with what was found, before any fit."""

from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from taxel.errors import BadSplit
from taxel.evaluation.nested import check_choosing
from taxel.evaluation.outer_split import OuterSplit, check_training_parts
from taxel.evaluation.splits import Split, TrialFold
from taxel.evaluation.table_split import GivenSplit
from taxel.training.choose.preparations import Base
from taxel.training.choose.search import Effort


@pytest.mark.parametrize(
    ("y", "got"),
    [
        (np.tile(np.arange(9), 2), "9 trials of 9 classes, 1 of a class, in the training part"),
        (np.array([0] * 7 + [1, 2] + [0, 1, 2] * 3), "9 trials of 3 classes, 1 to 7 of a class,"),
    ],
)
def test_how_many_trials_a_class_has_is_said(y: np.ndarray, got: str) -> None:
    """The first nine trials are learned from; the last fold is the thin one."""
    first, others = frozenset(range(9)), frozenset(range(9, len(y)))
    split = Split("session held out", (TrialFold("without day0", first, others),), None)
    base = cast(Base, SimpleNamespace(y=y, test=None))

    with pytest.raises(BadSplit) as error:
        check_choosing(base, (), split, cast(Effort, None))

    assert "at least two trials of two classes in each training part" in error.value.needed
    assert got in error.value.got
    assert "'without day0' (session held out)" in error.value.got


@pytest.mark.parametrize(
    ("outer", "test", "mend"),
    [
        (OuterSplit(), None, "with a larger --fold-count"),
        (OuterSplit(named="group:day"), None, "with a larger --fold-count"),
        (OuterSplit(named="order:day:2"), None, "name another split"),
        (OuterSplit(given=GivenSplit(table=Path("a/mine.csv"))), None, "of them in mine.csv"),
        (OuterSplit(), Path("other"), "record more of each class to train on"),
    ],
)  # fmt: skip
def test_a_larger_fold_count_is_advised_where_there_is_one(
    outer: OuterSplit, test: Path | None, mend: str
) -> None:
    """A table of folds, a split by order and another folder to test on have no --fold-count."""
    fold = TrialFold("first", frozenset({0, 1}), frozenset({2, 3}))
    base = cast(Base, SimpleNamespace(y=np.array([0, 1, 0, 1]), test=test))

    with pytest.raises(BadSplit) as error:
        check_training_parts(base, Split("a split", (fold,), None), outer)

    assert error.value.mend.endswith(mend)
    assert ("--fold-count" in error.value.mend) == ("--fold-count" in mend)
