"""A blend that learned from one session, and is tested on another."""

from dataclasses import replace
from pathlib import Path

import pytest

from taxel.training.choose.base import load_base
from taxel.training.choose.blending import FEW_SHARPNESS
from taxel.training.choose.budget import Budget
from taxel.training.choose.inner_folds import Held
from taxel.training.choose.joining import Joining
from taxel.training.choose.preparations import prepare, prepare_all
from taxel.training.choose.search import Effort, choose


def test_a_blend_is_half_as_sure_where_nothing_shows_what_a_new_session_does(
    recordings: Path,
) -> None:
    """The same candidates, judged on the same trials of three windows: only the logarithms are
    halved, and windows are joined as before."""
    base = load_base(recordings, "kind")
    config = replace(prepare_all(base)[0].config, steps=10, stride=10)
    usual, few = (
        choose(base, [prepare(base, config, 10)], range(16), held,
               Effort(budget=Budget(0.0, at_once=1))).choice()
        for held in (Held(None), Held(None, new="session"))
    )  # fmt: skip

    assert few.last == pytest.approx(FEW_SHARPNESS * usual.last)
    assert few.members == usual.members
    assert few.joining == usual.joining != Joining()
