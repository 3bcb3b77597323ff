"""A pretrained touch encoder as it is stored: numbers of 16 bits, and what the file says of itself.

Knows nothing about videos' pixels.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor, nn

from taxel.errors import BadFile, BadInput
from taxel.foreign.files import MIB, read_text
from taxel.foreign.json_text import parse_json
from taxel.models.backbones.touch import HEIGHT_PX, WIDTH_PX, TouchEncoder
from taxel.models.backbones.weight_files import backbone_tensors, load_backbone_weights
from taxel.models.export_onnx import export_backbone
from taxel.models.published.about import About
from taxel.models.weights import shipped_weights
from taxel.plain_text import number_of
from taxel.training.encoder.fit import EncoderConfig
from taxel.training.encoder.videos import TouchVideo


@dataclass(frozen=True, slots=True)
class StoredEncoder:
    """An encoder's weights and the description stored in the file's head."""

    tensors: dict[str, Tensor]
    about: About


@dataclass(frozen=True, slots=True)
class ReadEncoder:
    """A stored encoder's weights, and the card of the data it was pretrained on."""

    tensors: dict[str, Tensor]
    card: Mapping[str, object]


def read_encoder(path: Path) -> ReadEncoder:
    """Return an encoder that `taxel train-encoder` wrote, with the card beside it.

    Args:
        path: Its file; touch names the one that comes with taxel.

    Raises:
        BadInput: One of the files is missing, damaged or another network's.
    """
    if path == Path("touch"):
        path = _shipped_path()
    module = TouchEncoder()
    load_backbone_weights(module, "touch", path)
    place = path.with_suffix(".json")
    try:
        card = parse_json(read_text(place, MIB))
    except (OSError, BadFile) as error:
        card = error
    if not isinstance(card, dict):
        raise BadInput(
            f"the card of {path.name}, which says what it saw", f"none that can be read in {place}",
            "give weights that train-encoder wrote",
        )  # fmt: skip
    return ReadEncoder(backbone_tensors(module), card)


def shipped_encoder() -> TouchEncoder:
    """Return the encoder that comes with taxel, pretrained in simulation alone, ready for use."""
    module = TouchEncoder().eval()
    load_backbone_weights(module, "touch", _shipped_path())
    return module


def _shipped_path() -> Path:
    shipped = shipped_weights("touch")
    assert shipped is not None, "it lies in the package"
    assert shipped.path is not None
    return shipped.path


def encoder_onnx(tensors: Mapping[str, Tensor]) -> bytes:
    """Return an encoder as ONNX: frames, uint8 (n, 120, 160, 3), R G B → features (n, 192).

    Raises:
        BadBundle: ONNX Runtime gives other features than PyTorch.
    """
    module = TouchEncoder().eval()
    module.load_state_dict(dict(tensors), strict=False)
    return export_backbone(module, "touch", HEIGHT_PX, WIDTH_PX)


def halved(
    encoder: nn.Module, videos: Sequence[TouchVideo], config: EncoderConfig
) -> StoredEncoder:
    """Return an encoder's tensors in 16 bits, and where they come from.

    Args:
        encoder: A `TouchEncoder`.
        videos: What it was pretrained on last.
        config: How.
    """
    tensors = {key: value.to(torch.float16).contiguous()
               for key, value in backbone_tensors(encoder).items()}  # fmt: skip
    folders = ", ".join(sorted({video.folder for video in videos}))
    about = About(
        origin="taxel train-encoder",
        licence="as taxel",
        trained=f"without labels, {number_of(config.epochs, 'epoch')}, "
        f"{number_of(len(videos), 'video')} of {folders}",
    )
    return StoredEncoder(tensors, about)
