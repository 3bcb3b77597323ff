"""Count a network's numbers as Keras counts them.

Knows nothing about which networks there are.
"""

from __future__ import annotations

from torch import nn

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
