"""Heads over a window's features: the grasp-transition paper's LSTM and Transformer.

A window is (n, k, 2 · features): k frames, oldest first, both sensors' features
side by side. A head gives one logit a window; its sigmoid is the probability of
"unstable". Parameter counts equal Keras' for the same layers. Knows nothing
about images, backbones or files.

Source: Zhao, Zheng and Chen, Sensors 2024, 24, 5080, section 4.2 and Table 1's note.

Background of our choices: docs/decisions/0013.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import torch
from torch import Tensor, nn

from taxel.errors import BadInput

SENSORS = 2
"""Cameras whose features stand side by side. Source: the paper, Figure 6."""
UNITS = 8
"""Of each LSTM layer. Source: the paper, Table 1's note."""
ATTENTION_HEADS = 4
"""Source: the paper, Table 1's note."""
KEY_SIZE = 32
"""Of each attention head. Source: the paper, Table 1's note."""
FEED_FORWARD = 32
"""Inner units; not in the paper: the size at which its parameter counts come out."""
NORM_EPS = 1e-6
"""Added to a variance. Source: our choice, as in Keras' own Transformer examples."""


class LstmHead(nn.Module):
    """LSTM layers, the last one's last output, and a dense sigmoid.

    PyTorch's LSTM has a second bias that Keras' has not: it stays zero, does not
    learn and is not counted.

    Args:
        features: Of one sensor's frame.
        layers: LSTM layers, one over the other.
        units: Of each layer.
    """

    def __init__(self, features: int, layers: int = 1, units: int = UNITS) -> None:
        super().__init__()
        self.lstm = nn.LSTM(SENSORS * features, units, layers, batch_first=True)
        self.last = nn.Linear(units, 1)
        for name, tensor in self.lstm.named_parameters():
            _start_lstm(name, tensor)
        _start_dense(self.last)

    def forward(self, windows: Tensor) -> Tensor:
        """Return logits, shape (n,), of windows (n, k, 2 · features), oldest frame first."""
        outputs, _ = self.lstm(windows)
        logits: Tensor = self.last(outputs[:, -1])
        return logits.squeeze(1)


class SelfAttention(nn.Module):
    """Keras' multi-head attention of a sequence with itself.

    Args:
        width: Of one step, in and out.
    """

    def __init__(self, width: int) -> None:
        super().__init__()
        inner = ATTENTION_HEADS * KEY_SIZE
        self.query = nn.Linear(width, inner)
        self.key = nn.Linear(width, inner)
        self.value = nn.Linear(width, inner)
        self.output = nn.Linear(inner, width)

    def forward(self, steps: Tensor) -> Tensor:
        """Return mixed steps of the same shape (n, k, width)."""
        query, key, value = (
            layer(steps).unflatten(2, (ATTENTION_HEADS, KEY_SIZE)).transpose(1, 2)
            for layer in (self.query, self.key, self.value)
        )
        scores = query @ key.transpose(2, 3) / math.sqrt(KEY_SIZE)
        mixed: Tensor = self.output((scores.softmax(dim=3) @ value).transpose(1, 2).flatten(2))
        return mixed


class TransformerHead(nn.Module):
    """Positions, one encoder layer, flatten, and a dense sigmoid.

    Args:
        features: Of one sensor's frame.
        frames: k, frames in a window; the dense layer sees all of them.
    """

    positions: Tensor

    def __init__(self, features: int, frames: int) -> None:
        super().__init__()
        width = SENSORS * features
        self.register_buffer("positions", sinusoids(frames, width), persistent=False)
        self.attention = SelfAttention(width)
        self.first_norm = nn.LayerNorm(width, eps=NORM_EPS)
        self.feed_forward = nn.Sequential(
            nn.Linear(width, FEED_FORWARD), nn.ReLU(), nn.Linear(FEED_FORWARD, width)
        )
        self.second_norm = nn.LayerNorm(width, eps=NORM_EPS)
        self.last = nn.Linear(frames * width, 1)
        for module in self.modules():
            if isinstance(module, nn.Linear):
                _start_dense(module)

    def forward(self, windows: Tensor) -> Tensor:
        """Return logits, shape (n,), of windows (n, k, 2 · features), oldest frame first."""
        steps = windows + self.positions
        steps = self.first_norm(steps + self.attention(steps))
        steps = self.second_norm(steps + self.feed_forward(steps))
        logits: Tensor = self.last(steps.flatten(1))
        return logits.squeeze(1)


def sinusoids(frames: int, width: int) -> Tensor:
    """Return positions, shape (frames, width): sines in even places, cosines in odd ones.

    Source: the paper, equations 9 and 10 (Vaswani et al., 2017).
    """
    even = torch.arange(0, width, 2, dtype=torch.float64)
    angles = torch.arange(frames, dtype=torch.float64)[:, None] / 10000 ** (even / width)
    both = torch.stack([angles.sin(), angles.cos()], dim=2)
    return both.flatten(1)[:, :width].float()


@dataclass(frozen=True, slots=True, kw_only=True)
class Head:
    """A head that a window's features are judged by."""

    summary: str
    """What it is, one line."""
    build: Callable[[int, int], nn.Module]
    """(features of one sensor's frame, frames k in a window) → module."""


def _build_lstm(features: int, _frames: int, *, layers: int) -> nn.Module:
    return LstmHead(features, layers)


HEADS: dict[str, Head] = {
    "lstm": Head(
        summary="one LSTM layer of 8 units, the paper's choice",
        build=partial(_build_lstm, layers=1),
    ),
    "lstm2": Head(summary="two LSTM layers of 8 units", build=partial(_build_lstm, layers=2)),
    "lstm4": Head(summary="four LSTM layers of 8 units", build=partial(_build_lstm, layers=4)),
    "transformer": Head(
        summary="one Transformer encoder layer: 4 heads of key size 32", build=TransformerHead
    ),
}
"""Name → head."""


def find_head(name: str) -> Head:
    """Return a head by name.

    Raises:
        BadInput: There is no head of this name.
    """
    if name not in HEADS:
        raise BadInput(
            f"one of the heads {', '.join(HEADS)}", repr(name), "see them with: taxel models"
        )
    return HEADS[name]


def _start_lstm(name: str, tensor: nn.Parameter) -> None:
    """Start as Keras does: Glorot, orthogonal, and a forget gate that remembers."""
    with torch.no_grad():
        if name.startswith("weight_ih"):
            # Glorot over Keras' kernel (inputs, 4 · units), which is this one's transpose.
            nn.init.xavier_uniform_(tensor)
        elif name.startswith("weight_hh"):
            nn.init.orthogonal_(tensor)
        else:
            tensor.zero_()
            if name.startswith("bias_ih"):
                units = len(tensor) // 4
                tensor[units : 2 * units] = 1.0
            else:
                tensor.requires_grad_(False)


def _start_dense(layer: nn.Linear) -> None:
    """Start as Keras does: Glorot, and biases of zero."""
    nn.init.xavier_uniform_(layer.weight)
    nn.init.zeros_(layer.bias)
