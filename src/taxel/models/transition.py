"""The grasp-transition networks by name, with what the paper published of each.

A name is backbone+head. Counts are computed from the networks themselves, built
on PyTorch's meta device, which holds shapes and no numbers. Knows nothing about
weights, videos or training.

Source: Zhao, Zheng and Chen, Sensors 2024, 24, 5080, Tables 1 to 3.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import torch

from taxel.errors import BadInput
from taxel.models.backbones.catalogue import find_backbone
from taxel.models.counting import keras_parameters
from taxel.models.sequence import find_head

FRAMES = 8
"""k, frames in a window. Source: the paper, section 5.2 and Table 3."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PublishedResult:
    """A row of the paper's Table 1 or 2, on its own data and an RTX 4090."""

    accuracy_percent: float
    parameters: int
    step_ms: float
    """Milliseconds per inference step by the tables; section 5.2 calls 31.84 ms the time for "an
    entire video" too (docs/decisions/0042). Ours is a step."""
    size_mb: float
    """MiB, of a file in which the backbone seems to stand twice (docs/decisions/0042)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TransitionModel:
    """A backbone, shared by both sensors and all frames, and a head over their features."""

    backbone: str
    """A name in `BACKBONES`."""
    head: str
    """A name in `HEADS`."""
    published: PublishedResult | None = None
    """What the paper says of it; None for ours."""

    @property
    def name(self) -> str:
        """backbone+head, such as "densenet121+lstm"."""
        return f"{self.backbone}+{self.head}"

    @property
    def summary(self) -> str:
        """The backbone and the head, each in a few words."""
        return f"{find_backbone(self.backbone).summary}; {find_head(self.head).summary}"

    @property
    def parameters(self) -> int:
        """Its numbers as Keras counts them, at windows of `FRAMES` frames."""
        return _count_backbone(self.backbone) + _count_head(self.head, self.backbone)

    def size_mb(self, backbones: int = 1) -> float:
        """Return the size of its numbers as 32-bit floats, MiB.

        Args:
            backbones: How often the shared backbone is stored: 2 as the paper's files seem to,
                once for each camera (docs/decisions/0042).
        """
        numbers = backbones * _count_backbone(self.backbone)
        return (numbers + _count_head(self.head, self.backbone)) * 4 / 2**20


def split_name(name: str) -> tuple[str, str]:
    """Return backbone's and head's names of a backbone+head.

    Raises:
        BadInput: The name is not of this form, or there is no such backbone or head.
    """
    backbone, plus, head = name.partition("+")
    if not plus:
        raise BadInput(
            "a name of the form backbone+head, such as densenet121+lstm",
            repr(name),
            "see them with: taxel models",
        )
    find_backbone(backbone)
    find_head(head)
    return backbone, head


def find_transition(name: str) -> TransitionModel:
    """Return a model by its name, also one that is in no table.

    Raises:
        BadInput: The name is not of the form backbone+head, or there is no such part.
    """
    if name in TRANSITION_MODELS:
        return TRANSITION_MODELS[name]
    backbone, head = split_name(name)
    return TransitionModel(backbone=backbone, head=head)


@cache
def _count_backbone(name: str) -> int:
    with torch.device("meta"):
        return keras_parameters(find_backbone(name).build("logits"))


@cache
def _count_head(name: str, backbone: str) -> int:
    with torch.device("meta"):
        return keras_parameters(find_head(name).build(find_backbone(backbone).features, FRAMES))


def _published(accuracy: float, parameters: int, step_ms: float, size: float) -> PublishedResult:
    return PublishedResult(
        accuracy_percent=accuracy, parameters=parameters, step_ms=step_ms, size_mb=size
    )


_ROWS = (
    # Table 1.
    ("densenet121", "lstm", _published(98.90, 8_126_801, 31.84, 62.72)),
    ("efficientnet-b0", "lstm", _published(92.27, 5_394_868, 22.32, 41.43)),
    ("resnet50", "lstm", _published(96.13, 25_701_009, 25.81, 196.3)),
    ("resnet101", "lstm", _published(95.58, 44_771_473, 42.61, 342.22)),
    ("densenet121", "transformer", _published(96.69, 9_242_921, 33.56, 66.99)),
    ("efficientnet-b0", "transformer", _published(91.71, 6_510_988, 23.84, 45.71)),
    ("resnet50", "transformer", _published(90.61, 26_817_129, 26.78, 200.58)),
    ("resnet101", "transformer", _published(87.29, 45_887_593, 44.96, 346.5)),
    # Table 2; its first row is Table 1's.
    ("densenet121", "lstm2", _published(97.24, 8_127_345, 36.00, 62.72)),
    ("densenet121", "lstm4", _published(95.03, 8_128_433, 37.72, 62.74)),
    # Ours.
    ("efficientnet-lite0", "lstm", None),
    ("edge", "lstm", None),
)

TRANSITION_MODELS: dict[str, TransitionModel] = {
    f"{backbone}+{head}": TransitionModel(backbone=backbone, head=head, published=published)
    for backbone, head, published in _ROWS
}
"""Name → model: the paper's ten in the order of its tables, then ours."""

PUBLISHED_BY_FRAMES: dict[int, float] = {
    2: 88.15,
    3: 94.66,
    4: 94.03,
    5: 94.39,
    6: 94.76,
    7: 96.77,
    8: 98.90,
    9: 95.45,
    10: 96.49,
    11: 95.78,
}
"""Frames k in a window → accuracy in percent of DenseNet121 + LSTM. Source: Table 3."""
