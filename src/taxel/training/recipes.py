"""Recipes: for each kind of recording, a window, a model and a way to train that go together.

A recipe is a starting point that every option of the command line can change.
Knows nothing about files.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from taxel.errors import BadInput
from taxel.training.augment import Augment
from taxel.training.loop import TrainConfig
from taxel.windows.config import TENG_WINDOW, WindowConfig


@dataclass(frozen=True, slots=True, kw_only=True)
class Recipe:
    """Window, model, label, split and training for one kind of sensor."""

    summary: str
    """What the recipe is for, in one line."""
    window: WindowConfig
    model: str
    target: str
    """The label that it predicts unless another is asked for."""
    split: str | None = None
    """The split that its accuracy is measured under, as in `--split`; None holds out what is usual,
    see `taxel.evaluation.usual_split`."""
    train: TrainConfig = field(default_factory=TrainConfig)
    train_stride: int | None = None
    """Stride of the training windows, rows; None is the window's own."""
    train_steps: int | None = None
    """Rows of the training windows, from which `Augment.warp` draws stretches; None is the
    window's own."""
    members: int = 1
    """Networks whose probabilities are averaged."""
    own_gate: bool = False
    """Whether the window's gate was chosen for the recordings, in their channels' unit; gates of
    recipes are in volts."""


_GLOVE_WINDOW = WindowConfig(steps=400, stride=400, grid_hz=None, max_gap_s=1.0)
"""400 samples in a row, as in Yang et al., Advanced Science 2025."""
_GLOVE_TRAIN = TrainConfig(
    epochs=10,
    steps=15,
    batch=64,
    learning_rate=4e-3,
    warmup=0.2,
    weight_decay=0.02,
    label_smoothing=0.05,
    clip=5.0,
    augment=Augment(noise=0.02, gain=0.3, channel_gain=0.2, offset=0.3, drift=0.5, warp=0.2),
)
"""Chosen inside one training part, docs/decisions/0011."""

_GLOVE = Recipe(
    summary="the TENG glove, five TENG channels and three angles",
    window=_GLOVE_WINDOW,
    model="touchnet",
    target="sign",
    split="group:file",
    train=_GLOVE_TRAIN,
    train_stride=20,
    train_steps=480,
    members=3,
)

RECIPES: dict[str, Recipe] = {
    "array": Recipe(
        summary="any array: each scan a row, no gate",
        window=WindowConfig(steps=50, stride=50, grid_hz=None, max_gap_s=1.0, pad=True),
        model="touchnet",
        target="shape",
    ),
    "teng": Recipe(
        summary="the TENG hand, image-based (thesis, section 3.6)",
        window=TENG_WINDOW,
        model="cnn2d",
        target="shape",
    ),
    "teng-signal": Recipe(
        summary="the TENG hand, signal-based (thesis, section 3.5)",
        window=TENG_WINDOW,
        model="cnn1d",
        target="shape",
    ),
    "teng-referenced": Recipe(
        summary="the TENG hand, each session brought to the level of three known touches",
        window=replace(TENG_WINDOW, reference="object=cylinder-glass:3"),
        model="cnn2d",
        target="shape",
    ),
    "teng-robust": Recipe(
        summary="the TENG hand in damp, dust and motion: weak touches too, 0.6 s of contact",
        window=replace(
            TENG_WINDOW, gate=0.6, steps=60, stride=60, reference="object=cylinder-glass:3"
        ),
        model="cnn2d",
        target="shape",
        train=TrainConfig(epochs=25),
        train_stride=12,
    ),
    "teng-glove": _GLOVE,
    "teng-glove-touch": replace(
        _GLOVE,
        summary="the TENG glove, its five TENG channels alone",
        window=replace(_GLOVE.window, channels=("Data0", "Data1", "Data2", "Data3", "Data4")),
    ),
    "icub-grasp": Recipe(
        summary="iCub grasps, a whole grasp a window, tared by its first row",
        window=WindowConfig(steps=22, stride=22, grid_hz=None, max_gap_s=10.0, pad=True, tare=True),
        model="course-forest",
        target="object",
        split="order:trial_number:10:20",
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
