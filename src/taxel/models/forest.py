"""Extremely randomised trees on each channel's course, as a network of plain look-ups.

For short sequences of few trials (a hundred grasps of twenty steps), where
trees beat small networks. Fitted by scikit-learn, then written as tensors, so
that it is saved, exported and run live as any other network
(docs/decisions/0011). Knows nothing about files.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from taxel.models.tiny_values import enlarged, enlarging

TREES = 1000
"""Source: docs/decisions/0011; 200 are two trials in a hundred worse."""
DROPPED_ROWS = (2, 1)
"""Training copies leave out up to this many rows at the start and at the end: a grasp may
be cut sooner or later than those seen. Source: 0011."""
FEWEST_ROWS = 4
"""Copies shorter than this are not made."""
_TABLES = ("column", "threshold", "left", "right", "leaf", "root")


class CourseForest(nn.Module):
    """Last, largest, least and mean of each channel, classified by trees.

    Args:
        steps: Rows in a window; not used, windows of any length fit.
        channels: Channels of the array.
        classes: How many classes to tell apart.
    """

    column: Tensor
    threshold: Tensor
    left: Tensor
    right: Tensor
    leaf: Tensor
    root: Tensor
    depth: Tensor

    def __init__(self, steps: int, channels: int, classes: int) -> None:
        super().__init__()
        self._classes = classes
        self.register_buffer("column", torch.zeros(1, dtype=torch.int64))
        self.register_buffer("threshold", torch.zeros(1))
        self.register_buffer("left", torch.zeros(1, dtype=torch.int64))
        self.register_buffer("right", torch.zeros(1, dtype=torch.int64))
        self.register_buffer("leaf", torch.full((1, classes), 1.0 / classes))
        self.register_buffer("root", torch.zeros(1, dtype=torch.int64))
        self.register_buffer("depth", torch.zeros(1, dtype=torch.int64))

    def grow(
        self, values: NDArray[np.float32], mask: NDArray[np.bool_], y: NDArray[np.intp], seed: int
    ) -> None:
        """Fit the trees.

        Args:
            values: Training windows, shape (n, steps, channels); 0 where padded.
            mask: Shape (n, steps).
            y: Class numbers, shape (n,).
            seed: Seed of the trees.
        """
        from sklearn.ensemble import ExtraTreesClassifier

        copies, copy_mask, copy_y = cut_copies(values, mask, y)
        features = self._course(torch.from_numpy(copies), torch.from_numpy(copy_mask))
        trees: Any = ExtraTreesClassifier(TREES, random_state=seed, n_jobs=1)
        factors = enlarging(features.numpy())
        trees.fit(enlarged(features.numpy(), factors), copy_y)
        tables = tables_of(trees, self._classes)
        tables["threshold"] = floor32(tables["threshold"] / factors[tables["column"]])
        for name, table in tables.items():
            setattr(self, name, torch.from_numpy(table))

    def forward(self, values: Tensor, mask: Tensor) -> Tensor:
        """Return logarithms of the trees' mean probabilities, shape (n, classes).

        Args:
            values: Shape (n, steps, channels); 0 where padded.
            mask: Shape (n, steps), False where a row is padding.
        """
        features = self._course(values, mask)
        place = self.root.unsqueeze(0) + torch.zeros_like(features[:, :1]).long()
        for _ in range(int(self.depth)):
            value = torch.gather(features, 1, self.column[place])
            place = torch.where(value <= self.threshold[place], self.left[place], self.right[place])
        return torch.log(self.leaf[place].mean(dim=1).clamp(min=1e-7))

    def _load_from_state_dict(self, state_dict: Any, prefix: str, *rest: Any) -> None:
        """Take tables of any size: how many nodes there are is known only to the weights."""
        for name in (*_TABLES, "depth"):
            if prefix + name in state_dict:
                setattr(self, name, torch.empty_like(state_dict[prefix + name]))
        super()._load_from_state_dict(state_dict, prefix, *rest)

    def _course(self, values: Tensor, mask: Tensor) -> Tensor:
        """Return last, largest, least and mean of each channel, shape (n, 4 · channels)."""
        present = mask.unsqueeze(2).to(values.dtype)
        after = torch.cat([present[:, 1:], torch.zeros_like(present[:, :1])], dim=1)
        last = (values * (present - after).clamp(min=0)).sum(dim=1)
        absent = 1e9 * (1.0 - present)
        mean = (values * present).sum(dim=1) / present.sum(dim=1).clamp(min=1)
        largest = (values * present - absent).amax(dim=1)
        least = (values * present + absent).amin(dim=1)
        return torch.cat([last, largest, least, mean], dim=1)


def cut_copies(
    values: NDArray[np.float32], mask: NDArray[np.bool_], y: NDArray[np.intp]
) -> tuple[NDArray[np.float32], NDArray[np.bool_], NDArray[np.intp]]:
    """Return the windows and copies that start later or end sooner, tared again.

    Args:
        values: Shape (n, steps, channels).
        mask: Shape (n, steps).
        y: Shape (n,).
    """
    copies, masks, classes = [], [], []
    steps = values.shape[1]
    for index in range(len(values)):
        rows = values[index, mask[index]]
        for start in range(DROPPED_ROWS[0] + 1):
            for end in range(DROPPED_ROWS[1] + 1):
                kept = rows[start : len(rows) - end]
                if len(kept) < FEWEST_ROWS and (start or end):
                    continue
                copy = np.zeros_like(values[index])
                copy[: len(kept)] = kept - kept[0] if start else kept
                copies.append(copy)
                masks.append(np.arange(steps) < len(kept))
                classes.append(y[index])
    return np.array(copies), np.array(masks), np.array(classes, np.intp)


def tables_of(trees: Any, classes: int) -> dict[str, NDArray[Any]]:
    """Return all trees as flat tables; a leaf points to itself.

    Args:
        trees: A fitted forest of scikit-learn's.
        classes: How many classes there are; those it has not seen have probability 0.
    """
    parts: dict[str, list[NDArray[Any]]] = {name: [] for name in _TABLES}
    offset = depth = 0
    for estimator in trees.estimators_:
        tree = estimator.tree_
        own = np.arange(tree.node_count)
        leaf = tree.children_left < 0
        share = np.zeros((tree.node_count, classes), np.float32)
        share[:, np.asarray(trees.classes_)] = tree.value[:, 0]
        parts["column"].append(np.where(leaf, 0, tree.feature).astype(np.int64))
        parts["threshold"].append(floor32(tree.threshold))
        parts["left"].append((np.where(leaf, own, tree.children_left) + offset).astype(np.int64))
        parts["right"].append((np.where(leaf, own, tree.children_right) + offset).astype(np.int64))
        parts["leaf"].append(share / share.sum(axis=1, keepdims=True))
        parts["root"].append(np.array([offset], np.int64))
        offset += tree.node_count
        depth = max(depth, int(tree.max_depth))
    tables = {name: np.concatenate(part) for name, part in parts.items()}
    return {**tables, "depth": np.array([depth], np.int64)}


def floor32(values: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return the largest float32 not above each value: x ≤ t stays true for the same x.

    Args:
        values: Of any shape.
    """
    with np.errstate(over="ignore"):
        near = values.astype(np.float32)
    return np.where(near > values, np.nextafter(near, np.float32(-np.inf)), near).astype(np.float32)
