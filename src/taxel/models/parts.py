"""Joined classes, such as shape and material at once, scored as sums of their parts' scores.

Nine joined classes of three shapes and three materials share six sets of weights: a cylinder
of glass teaches what glass is to a sphere of glass. Trained so, the last layer is an ordinary one
afterwards (docs/decisions/0030). Knows nothing about training.
"""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn.utils import parametrize


class _Sums(nn.Module):
    """Keeps weights in the span of the parts: the nearest sum of parts, by least squares."""

    def __init__(self, parts: NDArray[np.intp]) -> None:
        super().__init__()
        has = np.concatenate([column[:, None] == np.unique(column) for column in parts.T], axis=1)
        nearest = has @ np.linalg.pinv(has.astype(float))
        self.register_buffer("nearest", torch.from_numpy(nearest).float(), persistent=False)

    def forward(self, whole: Tensor) -> Tensor:
        sums: Tensor = self.get_buffer("nearest") @ whole
        return sums


def share_parts(network: nn.Module, parts: NDArray[np.intp]) -> None:
    """Let a network's last linear layer score each class as the sum of its parts, in place.

    A network without such a layer, `last`, stays as it is, and so does one of single labels.

    Args:
        network: forward(values, mask) → logits.
        parts: Each class's number in each part, shape (classes, parts).
    """
    last = getattr(network, "last", None)
    if isinstance(last, nn.Linear) and parts.shape[1] > 1:
        for name in ("weight", "bias"):
            parametrize.register_parametrization(last, name, _Sums(parts))


def settle_parts(network: nn.Module) -> None:
    """Turn the last layer that `share_parts` changed into an ordinary one of the same scores."""
    last = getattr(network, "last", None)
    if isinstance(last, nn.Module) and parametrize.is_parametrized(last):
        for name in ("weight", "bias"):
            parametrize.remove_parametrizations(last, name)
