"""A network that is to learn from another: built, and filled with the best start at hand.

A file that the user names, else a relative's trained weights, else weights of its own that were
trained on something else, else random numbers; the words that come with it say which. Knows
nothing about images or training.

Background of our choices: docs/decisions/0057.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from torch import nn

from taxel.errors import BadInput
from taxel.models.backbones.catalogue import find_backbone
from taxel.models.backbones.random_start import fill_randomly
from taxel.models.backbones.relatives import RELATIVES, begin_with_relative
from taxel.models.backbones.weight_files import load_backbone_weights
from taxel.models.published.origins import STARTS, network_of
from taxel.models.weights import (
    LEAST_SIDE_PX,
    MOST_SIDE_PX,
    RANDOM,
    fetched_weights,
    find_weights,
)

ANSWERS = 1000
"""Of a teacher and of its students. Source: ImageNet's classes."""
NEAR, FAR = 3e-4, 1e-3
"""Adam's largest step size from a relative's weights, and from others. Source: our choice."""


@dataclass(frozen=True, slots=True)
class Student:
    """A network before it learns."""

    module: nn.Module
    start: str
    """What its numbers are, in words."""
    learning_rate: float
    """Adam's largest step size that fits the start: smaller where little is left to learn."""
    start_digest: str = ""
    """Of the weights that its numbers come from; empty where they are random."""


def check_student(backbone: str, teacher: str, side_px: int) -> None:
    """Refuse a pair that cannot be, before anything is read.

    Raises:
        BadInput: There is no such backbone, one lacks the 1000-way top, both are one, or images
            would be too small or large.
    """
    for name in (backbone, teacher):
        if find_backbone(name).features != ANSWERS:
            raise BadInput("a backbone with a 1000-way top", name, "name another: taxel models")
    if backbone == teacher:
        raise BadInput("a student other than its teacher", backbone, "name another --backbone")
    if not LEAST_SIDE_PX <= side_px <= MOST_SIDE_PX:
        raise BadInput(
            f"--side-px within {LEAST_SIDE_PX} and {MOST_SIDE_PX}", str(side_px), "choose another"
        )


def begin_student(backbone: str, start: Path | None, seed: int) -> Student:
    """Return a backbone ready to learn.

    Args:
        backbone: Its name.
        start: A file of its weights to begin with; the best at hand unless given.
        seed: Of random numbers.

    Raises:
        BadInput: The file is missing, damaged or another network's.
    """
    module = find_backbone(backbone).build("logits")
    if start is not None:
        start_weights = find_weights(backbone, start)
        start_weights.load_into(module)
        return Student(module, start_weights.words, NEAR, start_weights.digest)
    relative = RELATIVES.get(backbone, "")
    weights = find_weights(relative) if relative else None
    if weights is not None and weights.label != RANDOM:
        other = find_backbone(relative).build("logits")
        weights.load_into(other)
        begin_with_relative(module, backbone, other, seed)
        return Student(module, f"{relative}'s {weights.words}", NEAR, weights.digest)
    for name in STARTS:
        weights = fetched_weights(name) if network_of(name) == backbone else None
        if weights is not None and weights.path is not None:
            load_backbone_weights(module, backbone, weights.path)
            return Student(module, f"{name} ({weights.origin})", FAR, weights.digest)
    fill_randomly(module, backbone, seed)
    return Student(module, "random numbers", FAR)
