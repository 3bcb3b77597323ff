"""The touch encoder with its pretraining tasks, and the loss.

Four tasks at once. The difference of two images' features predicts, linearly, how each place moved
and brightened. The absolute values of that difference predict, linearly, how much (in simulation
also how far the object slipped). The features of one image predict what it looks like. All features
stay spread and uncorrelated (VICReg). Knows nothing about files.

Source: variance and covariance terms as in Bardes, Ponce and LeCun, "VICReg", ICLR 2022; the rest
is ours, docs/decisions/0058.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional

from taxel.models.backbones.touch import FEATURES, TouchEncoder
from taxel.training.encoder.change import SIZES

LOOK_PLACES = (6, 8)
"""Rows and columns of the small colour image that the features of one image predict."""
_SPREAD, _APART = 1.0, 0.04
"""Weights of variance and covariance. Source: VICReg's 25 : 1."""


@dataclass(frozen=True, slots=True)
class Targets:
    """What a step predicts, all in floating numbers."""

    flow: Tensor
    """Shape (pairs, 96)."""
    grey: Tensor
    """Shape (pairs, 192)."""
    size: Tensor
    """Shape (pairs, 24)."""
    slip: Tensor
    """Shape (pairs,); NaN where unknown."""


class Pretext(nn.Module):
    """The encoder and its prediction layers, which are discarded after pretraining.

    Args:
        bf16: The encoder runs in 16 bits (bfloat16), the layers behind it in 32.
    """

    def __init__(self, *, bf16: bool = False) -> None:
        super().__init__()
        self._bf16 = bf16
        self.encoder = TouchEncoder()
        flow, grey, size = SIZES
        self.signed = nn.Linear(FEATURES, flow + grey, bias=False)
        self.size = nn.Linear(FEATURES, size + 1)
        self.look = nn.Linear(FEATURES, 3 * LOOK_PLACES[0] * LOOK_PLACES[1])

    def forward(self, first: Tensor, second: Tensor, targets: Targets) -> Tensor:
        """Return the loss of pairs of images.

        Args:
            first: Shape (pairs, 3, 120, 160), 0 to 255.
            second: As above.
            targets: What is to be predicted.
        """
        images = torch.cat([first, second])
        with torch.autocast("cpu", torch.bfloat16, enabled=self._bf16):
            features = self.encoder(images)
        features = features.float()
        one, two = features.chunk(2)
        apart = two - one
        signed = functional.smooth_l1_loss(
            self.signed(apart), torch.cat([targets.flow, targets.grey], dim=1)
        )
        sizes = self.size(apart.abs())
        size = functional.smooth_l1_loss(sizes[:, :-1], targets.size)
        known = ~targets.slip.isnan()
        slip = functional.smooth_l1_loss(sizes[known, -1], targets.slip[known])
        slip = slip if bool(known.any()) else torch.zeros(())
        look = functional.smooth_l1_loss(self.look(features), look_of(images))
        loss: Tensor = 4 * signed + size + slip + look + regularity(features)
        return loss


def look_of(images: Tensor) -> Tensor:
    """Return small colour images, shape (n, 3 · 6 · 8), scaled as the encoder's input is."""
    return functional.adaptive_avg_pool2d((images - 127.5) / 63.75, LOOK_PLACES).flatten(1)


def regularity(features: Tensor) -> Tensor:
    """Return VICReg's variance and covariance terms of features (n, columns), weighed."""
    middle = features - features.mean(dim=0)
    spread = (1 - (middle.square().mean(dim=0) + 1e-4).sqrt()).clamp_min(0).mean()
    covariance = middle.T @ middle / (len(features) - 1)
    off = covariance - torch.diag(covariance.diagonal())
    return _SPREAD * spread + _APART * off.square().sum() / features.shape[1]
