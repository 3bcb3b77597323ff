"""Recipes: for each kind of recording, a window, a model and a way to train that go together.

A recipe is a starting point that every option of the command line can change.
Knows nothing about files.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from taxel.errors import BadInput
from taxel.training.loop import TrainConfig
from taxel.windows.config import TENG_WINDOW, WindowConfig


@dataclass(frozen=True, slots=True, kw_only=True)
class Recipe:
    """What to do with one kind of recording."""

    summary: str
    """For what, one line."""
    window: WindowConfig
    model: str
    target: str
    """The label that it tells unless another is asked for."""
    split: str
    """The split that its accuracy is measured under, as in `--split`."""
    train: TrainConfig = field(default_factory=TrainConfig)
    train_stride: int | None = None
    """Stride of the training windows, rows; None is the window's own."""
    members: int = 1
    """Networks whose probabilities are averaged."""


RECIPES: dict[str, Recipe] = {
    "teng": Recipe(
        summary="the TENG hand, image-based (thesis, section 3.6)",
        window=TENG_WINDOW,
        model="cnn2d",
        target="shape",
        split="group:session",
    ),
    "teng-signal": Recipe(
        summary="the TENG hand, signal-based (thesis, section 3.5)",
        window=TENG_WINDOW,
        model="cnn1d",
        target="shape",
        split="group:session",
    ),
}
"""Name → recipe."""


def find_recipe(name: str) -> Recipe:
    """Return a recipe by name.

    Raises:
        BadInput: There is none of this name.
    """
    if name not in RECIPES:
        listed = "; ".join(f"{key} ({recipe.summary})" for key, recipe in RECIPES.items())
        raise BadInput(f"one of the recipes {listed}", repr(name), "name one of them")
    return RECIPES[name]
