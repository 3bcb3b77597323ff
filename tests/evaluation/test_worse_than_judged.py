"""A saved model whose own search was cut short is not what the score beside it is of."""

from types import SimpleNamespace
from typing import cast

import pytest

from taxel.evaluation.nested import Nested, worse_than_judged
from taxel.training.choose.choice import Choice


def choice(accuracy: float, *, cut_short: bool = True, held: str = "successive trials") -> Choice:
    left_out = ("extra-trees 2 on rows",) if cut_short else ()
    return cast(Choice, SimpleNamespace(accuracy=accuracy, left_out=left_out, held=held))


def nested(low: float, *judged: float) -> Nested:
    interval = SimpleNamespace(low=low)
    scores = SimpleNamespace(group="depth", intervals={"depth": interval})
    choices = tuple(choice(accuracy) for accuracy in judged)
    return cast(Nested, SimpleNamespace(choices=choices, scores=scores))


def test_a_model_chosen_in_too_little_time_carries_a_warning() -> None:
    """A set of 779 presses on a tube, on a busy machine: two tries for it, trees for others."""
    (line,) = worse_than_judged(choice(0.544), nested(0.674, 0.71, 0.83))
    assert line.startswith(
        "warning: the saved model is right for 54.4% of its inner folds' windows"
    )
    assert "71.0%" in line


@pytest.mark.parametrize(
    ("saved", "judged"),
    [
        (choice(0.70), nested(0.674, 0.71, 0.83)),  # within the interval
        (choice(0.60), nested(0.674, 0.55, 0.83)),  # no worse than one that was judged
        (choice(0.544, cut_short=False), nested(0.674, 0.71, 0.83)),
        (choice(0.544), None),
        (choice(0.544, held="whole days"), nested(0.674, 0.71, 0.83)),  # not the same folds
    ],
)
def test_a_model_that_is_as_good_or_had_its_time_carries_none(saved, judged) -> None:
    assert worse_than_judged(saved, judged) == ()
