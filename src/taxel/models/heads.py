"""From features to logits: linear, trees or a small perceptron, as tensors that export.

Fitted elsewhere (`taxel.training.choose.fitting`), here they are tables that are saved, exported
and run live as any network. Each `forward` takes features (n, features) and returns logits
(n, classes). Knows nothing about how features are made.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import torch
from torch import Tensor, nn

from taxel.models.tree_operator import exported_shares

LEAST_SHARE = 0.002
"""Added to each class's share of a forest's votes, so that none is impossible. Source: our
choice, docs/decisions/0039."""
FARTHEST = 4.0
"""Standardised features are cut here, deviations: a broken value must not decide alone. Source:
as above."""


class _Tables(nn.Module):
    """Buffers whose sizes are known only to the weights."""

    names: tuple[str, ...] = ()

    def __init__(self, **tables: Tensor) -> None:
        super().__init__()
        for name in self.names:
            self.register_buffer(name, tables.get(name, torch.zeros(1)))

    def _load_from_state_dict(self, state_dict: Any, prefix: str, *rest: Any) -> None:
        for name in self.names:
            if prefix + name in state_dict:
                setattr(self, name, torch.empty_like(state_dict[prefix + name]))
        super()._load_from_state_dict(state_dict, prefix, *rest)


class LinearHead(_Tables):
    """Standardised, cut features times weights."""

    names = ("offset", "factor", "weight", "bias")
    offset: Tensor
    factor: Tensor
    weight: Tensor
    bias: Tensor

    def forward(self, features: Tensor) -> Tensor:
        """Return logits, shape (n, classes)."""
        scaled = (features.float() - self.offset) * self.factor
        return scaled.clamp(-FARTHEST, FARTHEST) @ self.weight + self.bias


class PerceptronHead(_Tables):
    """Several perceptrons of one hidden layer; the mean of their logits."""

    names = ("offset", "factor", "weight", "bias", "out", "out_bias")
    offset: Tensor
    factor: Tensor
    weight: Tensor
    """Shape (members, features, hidden)."""
    bias: Tensor
    out: Tensor
    """Shape (members, hidden, classes)."""
    out_bias: Tensor

    def forward(self, features: Tensor) -> Tensor:
        """Return logits, shape (n, classes)."""
        scaled = ((features.float() - self.offset) * self.factor).clamp(-FARTHEST, FARTHEST)
        hidden = torch.relu(scaled.unsqueeze(0) @ self.weight + self.bias)
        return (hidden @ self.out + self.out_bias).mean(dim=0)


class TreesHead(_Tables):
    """A forest by look-up: a walk of `depth` steps in all trees at once."""

    names = ("column", "threshold", "left", "right", "leaf", "value", "root", "depth")
    column: Tensor
    """Node → feature, int32."""
    threshold: Tensor
    left: Tensor
    """Node → node if feature ≤ threshold; a leaf points to itself."""
    right: Tensor
    leaf: Tensor
    """Node → row of `value`; 0 where it is no leaf."""
    value: Tensor
    """Shape (leaves, classes), float16: shares of the classes."""
    root: Tensor
    depth: Tensor

    def forward(self, features: Tensor) -> Tensor:
        """Return logits, shape (n, classes)."""
        return walk((self,), (features,))[0]

    def operator(self, features: Tensor) -> Tensor:
        """Return logits of an export, shape (n, classes): one operator in place of a walk."""
        tables = {name: getattr(self, name).numpy() for name in self.names}
        return torch.log(exported_shares(features.float(), tables) + LEAST_SHARE)


def walk(forests: Sequence[TreesHead], features: Sequence[Tensor]) -> list[Tensor]:
    """Walk forests side by side: a step of all trees takes hardly longer than one of a few.

    In an export each forest is an operator.

    Args:
        forests: At least one.
        features: What each sees, shape (n, its features).

    Returns:
        Each forest's logits, shape (n, classes), as of a walk by itself.
    """
    if torch.onnx.is_in_onnx_export():
        return [own.operator(seen) for own, seen in zip(forests, features, strict=True)]
    column, after, leaf, root = [], [], [], []
    columns = nodes = leaves = 0
    for forest, own in zip(forests, features, strict=True):
        column.append(forest.column + columns)
        after.append(torch.stack([forest.right, forest.left], dim=1) + nodes)
        root.append(forest.root + nodes)
        leaf.append(forest.leaf + leaves)
        columns, nodes = columns + own.shape[1], nodes + forest.left.shape[0]
        leaves += forest.value.shape[0]
    joined_features = torch.cat([own.float() for own in features], dim=1)
    column_of, next_of = torch.cat(column).long(), torch.cat(after).flatten().long()
    threshold, value = (torch.cat([getattr(f, n) for f in forests]) for n in ("threshold", "value"))
    place = torch.cat(root).long().unsqueeze(0) + torch.zeros_like(joined_features[:, :1]).long()
    # A leaf points to itself, so that shallow trees wait for deep ones.
    for _ in range(max(int(forest.depth) for forest in forests)):
        goes_left = torch.gather(joined_features, 1, column_of[place]) <= threshold[place]
        place = next_of[2 * place + goes_left]
    found = value[torch.cat(leaf)[place].long()].float()
    trees = [forest.root.shape[0] for forest in forests]
    shares = torch.split(found, trees, dim=1)
    return [torch.log(own.mean(dim=1) + LEAST_SHARE) for own in shares]


HEADS: dict[str, type[_Tables]] = {
    "linear": LinearHead,
    "perceptron": PerceptronHead,
    "trees": TreesHead,
}
"""Kind → head."""
