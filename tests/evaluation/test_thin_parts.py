"""A split that leaves too few trials of a class is refused with what was found, before any fit."""

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from taxel.errors import BadSplit
from taxel.evaluation.nested import check_choosing
from taxel.evaluation.splits import Split, TrialFold
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
    base = cast(Base, SimpleNamespace(y=y))

    with pytest.raises(BadSplit) as error:
        check_choosing(base, (), split, cast(Effort, None))

    assert "at least two trials of two classes in each training part" in error.value.needed
    assert got in error.value.got
    assert "'without day0' (session held out)" in error.value.got
