"""All backbones by name, in one visible dict.

To add one: write its module, add one line to `BACKBONES`; the tests in
`tests/models/test_backbones.py` cover it. Knows nothing about weights on disk
or training.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from torch import nn

from taxel.errors import BadInput
from taxel.models.backbones.densenet121 import DenseNet121
from taxel.models.backbones.edge import FEATURES as EDGE_FEATURES
from taxel.models.backbones.edge import EdgeCnn
from taxel.models.backbones.efficientnet_b0 import EfficientNetB0
from taxel.models.backbones.efficientnet_lite import LITES, EfficientNetLite
from taxel.models.backbones.keras_layers import Top
from taxel.models.backbones.mobilenet_v2 import MobileNetV2
from taxel.models.backbones.resnet import build_resnet50, build_resnet101
from taxel.models.backbones.touch import FEATURES as TOUCH_FEATURES
from taxel.models.backbones.touch import HEIGHT_PX, WIDTH_PX, TouchEncoder


@dataclass(frozen=True, slots=True, kw_only=True)
class Backbone:
    """An image network; forward(images (n, 3, height, width), R G B, 0…255) → (n, features)."""

    summary: str
    """What it is, one line."""
    source: str
    """Where it comes from."""
    build: Callable[[Top], nn.Module]
    """What its 1000-way top gives → module; pixels are scaled inside it."""
    height_px: int
    """Of the image that it takes, pixels."""
    width_px: int
    """As above."""
    scaling: str
    """What it does to a pixel first, in words."""
    features: int
    """Numbers that it gives for one image."""
    flops: int
    """Floating-point operations for one image, a multiplication and an addition being two."""
    places: bool = True
    """Whether its features are means over places of the image, which it can give apart."""


def _build_edge(_top: Top) -> nn.Module:
    return EdgeCnn()


def _build_touch(_top: Top) -> nn.Module:
    return TouchEncoder()


_LITE_FLOPS = (770_375_104, 1_200_370_464, 1_719_472_544)
"""Of `LITES`. Source: counted."""


def _lite(number: int) -> Backbone:
    side_px = LITES[number].side_px
    return Backbone(
        summary=f"EfficientNet-Lite{number} with its 1000-way top",
        source="TensorFlow's EfficientNet-Lite",
        build=partial(EfficientNetLite, number=number),
        height_px=side_px,
        width_px=side_px,
        scaling="(pixel − 127) ÷ 128",
        features=1000,
        flops=_LITE_FLOPS[number],
    )


_TORCH_SCALING = "(pixel ÷ 255 − ImageNet's mean) ÷ its spread"

BACKBONES: dict[str, Backbone] = {
    "densenet121": Backbone(
        summary="DenseNet121 with its 1000-way top, the paper's choice",
        source="Huang et al., CVPR 2017; as Keras builds it",
        build=DenseNet121,
        height_px=224,
        width_px=224,
        scaling=_TORCH_SCALING,
        features=1000,
        flops=5_668_323_328,
    ),
    "efficientnet-b0": Backbone(
        summary="EfficientNetB0 with its 1000-way top",
        source="Tan and Le, ICML 2019; as Keras builds it",
        build=EfficientNetB0,
        height_px=224,
        width_px=224,
        scaling=f"{_TORCH_SCALING}, and once more by its root, inside the model",
        features=1000,
        flops=771_629_504,
    ),
    "resnet50": Backbone(
        summary="ResNet50 with its 1000-way top",
        source="He et al., CVPR 2016; as Keras builds it",
        build=build_resnet50,
        height_px=224,
        width_px=224,
        scaling="B G R, pixel − ImageNet's mean",
        features=1000,
        flops=7_715_946_496,
    ),
    "resnet101": Backbone(
        summary="ResNet101 with its 1000-way top",
        source="He et al., CVPR 2016; as Keras builds it",
        build=build_resnet101,
        height_px=224,
        width_px=224,
        scaling="B G R, pixel − ImageNet's mean",
        features=1000,
        flops=15_140_388_864,
    ),
    **{f"efficientnet-lite{number}": _lite(number) for number in range(len(LITES))},
    "mobilenet-v2": Backbone(
        summary="MobileNetV2 with its 1000-way top",
        source="Sandler et al., CVPR 2018; as torchvision builds it",
        build=MobileNetV2,
        height_px=224,
        width_px=224,
        scaling=_TORCH_SCALING,
        features=1000,
        flops=601_548_544,
    ),
    "edge": Backbone(
        summary="small CNN over a 160×120 frame, trained with its head",
        source="ours",
        build=_build_edge,
        height_px=120,
        width_px=160,
        scaling="(pixel − 127.5) ÷ 63.75",
        features=EDGE_FEATURES,
        flops=33_855_488,
        places=False,
    ),
    "touch": Backbone(
        summary="small CNN over a 160×120 frame, pretrained on touch; its weights come with taxel",
        source="ours",
        build=_build_touch,
        height_px=HEIGHT_PX,
        width_px=WIDTH_PX,
        scaling="(pixel − 127.5) ÷ 63.75",
        features=TOUCH_FEATURES,
        flops=97_551_360,
        places=False,
    ),
}
"""Name → backbone."""


def find_backbone(name: str) -> Backbone:
    """Return a backbone by name.

    Raises:
        BadInput: There is no backbone of this name.
    """
    if name not in BACKBONES:
        raise BadInput(
            f"one of the backbones {', '.join(BACKBONES)}",
            repr(name),
            "see them with: taxel models",
        )
    return BACKBONES[name]
