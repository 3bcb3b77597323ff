"""Numbers for a backbone that was trained on nothing.

What comes of them says RANDOM in every table. Knows nothing about files.

Background of our choices: docs/decisions/0013.
"""

from __future__ import annotations

import torch
from torch import nn

from taxel.models.backbones.catalogue import find_backbone

_PATCHES_PX = (1, 4, 8, 16)
"""Sizes of the patches in the noise that the last layer is set by. Source: our choice."""


def fill_randomly(module: nn.Module, backbone: str, seed: int) -> None:
    """Fill a backbone with random numbers, the same ones for the same seed.

    Convolutions and dense layers are drawn from a normal distribution with a variance
    of 1 ÷ inputs (LeCun et al., 1998); batch norms change nothing. The last layer is
    then set from images of noise, for without that a deep network's features vanish
    or overflow.

    Args:
        module: What `BACKBONES[backbone].build` made.
        backbone: Its name there, for the size of the images.
        seed: Of the numbers.
    """
    draw = torch.Generator().manual_seed(seed)
    for layer in module.modules():
        if isinstance(layer, nn.BatchNorm2d):
            layer.reset_parameters()
        elif isinstance(layer, nn.Conv2d | nn.Linear):
            nn.init.kaiming_normal_(layer.weight, nonlinearity="linear", generator=draw)
            if layer.bias is not None:
                nn.init.zeros_(layer.bias)
    row = find_backbone(backbone)
    _set_last(module, _noise(row.height_px, row.width_px, draw))


def _noise(height_px: int, width_px: int, draw: torch.Generator) -> torch.Tensor:
    """Return images (n, 3, h, w) of 0 to 255 with patches from fine to coarse."""
    each = []
    for patch in _PATCHES_PX:
        coarse = torch.rand(2, 3, height_px // patch, width_px // patch, generator=draw)
        contrast = torch.rand(2, 1, 1, 1, generator=draw)
        pixels = 255 * (0.5 + (coarse - 0.5) * contrast)
        each.append(nn.functional.interpolate(pixels, (height_px, width_px), mode="bilinear"))
    return torch.cat(each)


@torch.no_grad()
def _set_last(module: nn.Module, images: torch.Tensor) -> None:
    """Shift and scale the last layer so that its sums on these images are about normal."""
    last = [layer for layer in module.modules() if isinstance(layer, nn.Linear)][-1]
    seen: list[torch.Tensor] = []
    # What goes in, for the layer itself may end in a softmax.
    hook = last.register_forward_pre_hook(lambda _layer, inputs: seen.append(inputs[0]))
    training = module.training
    module.eval()(images)
    module.train(training)
    hook.remove()
    inputs = seen[0].mean(dim=(2, 3)) if seen[0].dim() == 4 else seen[0]
    sums = nn.functional.linear(inputs, last.weight)
    last.weight /= (sums - sums.mean(dim=0)).std()
    last.bias.copy_(-nn.functional.linear(inputs.mean(dim=0), last.weight))
