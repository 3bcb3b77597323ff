"""Count a network's numbers as Keras counts them, and its operations.

Knows nothing about which networks there are.
"""

from __future__ import annotations

import torch
from torch import nn
from torch.utils.flop_counter import FlopCounterMode

_NOT_IN_KERAS = ("num_batches_tracked", "bias_hh")
"""A counter of PyTorch's batch norm, and the second LSTM bias, which stays zero here."""


def keras_parameters(module: nn.Module) -> int:
    """Return a module's numbers as `keras.Model.count_params` gives them.

    Weights, and also batch norms' moving means and variances and a
    normalisation layer's statistics, which do not learn by gradient.
    """
    return sum(
        tensor.numel()
        for name, tensor in module.state_dict().items()
        if not any(word in name for word in _NOT_IN_KERAS)
    )


def count_flops(module: nn.Module, height_px: int, width_px: int) -> int:
    """Return operations for one image, a multiplication and an addition being two.

    Args:
        module: A backbone; one on PyTorch's meta device costs no time.
        height_px: Of the image, pixels.
        width_px: As above.
    """
    device = next(module.parameters()).device
    with FlopCounterMode(display=False) as counter, torch.no_grad():
        module.eval()(torch.zeros(1, 3, height_px, width_px, device=device))
    return int(counter.get_total_flops())
