"""A pretrained touch encoder as it is stored: numbers of 16 bits, and what the file says of itself.

Knows nothing about videos' pixels.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn

from taxel.models.backbones.weight_files import backbone_tensors
from taxel.models.published.about import About
from taxel.training.encoder.fit import EncoderConfig
from taxel.training.encoder.videos import TouchVideo


def halved(
    encoder: nn.Module, videos: Sequence[TouchVideo], config: EncoderConfig
) -> tuple[dict[str, Tensor], About]:
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
        trained=f"without labels, {config.epochs} epochs, {len(videos)} videos of {folders}",
    )
    return tensors, about
