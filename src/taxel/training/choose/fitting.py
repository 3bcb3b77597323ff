"""Fit a candidate's head on features: scikit-learn or PyTorch in, plain tensors out.

What comes back is what is exported and runs live, so that an inner score is a score of that
very thing, size limit included. Knows nothing about windows, folds or files.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from taxel.models.forest import floor32
from taxel.models.heads import FARTHEST, LinearHead, PerceptronHead, TreesHead
from taxel.training.choose.candidates import Candidate
from taxel.training.discriminant import fit_discriminant

TREES = 150
"""Trees of a forest. Source: our choice, docs/decisions/0039: 400 are no better within 0.2 points
and do not fit in 2 ms."""
DEEPEST = 20
MOST_TREE_BYTES = 6_000_000
"""Of one forest's tables before packing: three fit in a bundle. Source: as above."""
SHARE_SEEN, MOST_SEEN = 0.3, 400
"""Share of all features, and most of them, among which extremely randomised trees look for a split,
by entropy: a few of a thousand are mostly those that say nothing. Source: as above."""
FEWEST_SEEN = 3
"""Features among which trees of both kinds look at least: of two channels both. Source: as
above."""
HIDDEN, MEMBERS, EPOCHS, BATCH, RATE = 64, 4, 30, 200, 1e-3
"""Of a perceptron: scikit-learn's usual batch and step size. Source: as above."""
_TAILS = (0.5, 99.5)
"""Percentiles to which features are cut before their mean and deviation are taken."""
WINSORISED = 1.0
"""Deviations at which a winsorised discriminant cuts each feature. Source: our choice, 0039."""

Features = NDArray[np.float32]
Classes = NDArray[np.intp]


def fit_head(
    candidate: Candidate, features: Features, y: Classes, classes: int, seed: int = 0
) -> nn.Module:
    """Return a fitted head.

    Args:
        candidate: Which model and setting.
        features: Shape (n, features), of training windows only.
        y: Class numbers, shape (n,).
        classes: How many there are; some may be missing in `y`.
        seed: Of trees and weights.
    """
    return FITS[candidate.model](features, y, classes, candidate.strength, seed)


def head_logits(head: nn.Module, features: Features, batch: int = 512) -> NDArray[np.float64]:
    """Return logits of features, shape (n, classes)."""
    with torch.inference_mode():
        parts = [head(torch.from_numpy(features[i : i + batch])).double().numpy()
                 for i in range(0, len(features), batch)]  # fmt: skip
    return np.concatenate(parts)


def _logistic(x: Features, y: Classes, classes: int, strength: float, seed: int) -> nn.Module:
    """Multinomial logistic regression; `strength` is scikit-learn's C."""
    from sklearn.linear_model import LogisticRegression

    offset, factor, scaled = _standardised(x)
    model = LogisticRegression(C=strength, max_iter=100, tol=1e-3)
    model.fit(scaled, y)
    weight, bias = model.coef_, model.intercept_
    if len(weight) == 1:
        weight, bias = np.vstack([-weight, weight]) / 2, np.r_[-bias, bias] / 2
    return _linear(offset, factor, weight, bias, model.classes_, classes)


def _discriminant(x: Features, y: Classes, classes: int, strength: float, seed: int) -> nn.Module:
    """Linear discriminant with a within-class covariance shrunk by `strength`, 0…1."""
    offset, factor, scaled = _standardised(x)
    found = fit_discriminant(scaled.astype(np.float64), y, strength)
    return _linear(offset, factor, found.weight, found.bias, found.classes, classes)


def _winsorised(x: Features, y: Classes, classes: int, strength: float, seed: int) -> nn.Module:
    """The same on features cut at `WINSORISED` deviations: none says more by being further away.

    A head cuts at `FARTHEST`, so that the factor is larger and the weights are smaller by as much.
    """
    larger = np.float32(FARTHEST / WINSORISED)
    offset, factor, scaled = _standardised(x)
    cut = np.clip(scaled, -WINSORISED, WINSORISED).astype(np.float64)
    found = fit_discriminant(cut, y, strength)
    weight = found.weight / larger
    return _linear(offset, factor * larger, weight, found.bias, found.classes, classes)


def _linear(
    offset: Features, factor: Features, weight: Any, bias: Any, known: Any, classes: int
) -> nn.Module:
    """Return a head whose logits of classes that were not there are far below the others."""
    whole = np.zeros((classes, len(offset)), np.float32)
    start = np.full(classes, -20.0, np.float32)
    whole[known], start[known] = weight, bias
    return LinearHead(
        offset=torch.from_numpy(offset), factor=torch.from_numpy(factor),
        weight=torch.from_numpy(np.ascontiguousarray(whole.T)), bias=torch.from_numpy(start),
    )  # fmt: skip


def _extra_trees(x: Features, y: Classes, classes: int, leaf: float, seed: int) -> nn.Module:
    """Extremely randomised trees; `leaf` is the least number of windows in a leaf."""
    from sklearn.ensemble import ExtraTreesClassifier

    seen = max(_usually_seen(x), round(min(SHARE_SEEN * x.shape[1], MOST_SEEN)))
    build = partial(ExtraTreesClassifier, criterion="entropy", max_features=seen)
    return _forest(build, x, y, classes, leaf, seed)


def _random_forest(x: Features, y: Classes, classes: int, leaf: float, seed: int) -> nn.Module:
    from sklearn.ensemble import RandomForestClassifier

    build = partial(RandomForestClassifier, max_features=_usually_seen(x))
    return _forest(build, x, y, classes, leaf, seed)


def _usually_seen(x: Features) -> int:
    """Return the root of the number of features, as is usual, but no fewer than `FEWEST_SEEN`."""
    width = int(x.shape[1])
    return max(math.isqrt(width), min(FEWEST_SEEN, width))


def _forest(build: Any, x: Features, y: Classes, classes: int, leaf: float, seed: int) -> nn.Module:
    """Grow a forest; with larger leaves where it would take more than its share of a bundle."""
    least = int(leaf)
    while True:
        forest = build(
            TREES, min_samples_leaf=least, max_depth=DEEPEST, random_state=seed, n_jobs=1
        )
        forest.fit(x, y)
        nodes = sum(tree.tree_.node_count for tree in forest.estimators_)
        if nodes * (20 + classes) <= MOST_TREE_BYTES:
            return _head_of_forest(forest, classes)
        least = max(least + 1, round(1.5 * least))


def _head_of_forest(forest: Any, classes: int) -> nn.Module:
    nodes = []
    for estimator in forest.estimators_:
        tree = estimator.tree_
        share = np.zeros((tree.node_count, classes))
        share[:, np.asarray(forest.classes_)] = tree.value[:, 0]
        share /= share.sum(axis=1, keepdims=True)
        nodes.append(_Tree(tree.children_left, tree.children_right, tree.feature,
                           floor32(tree.threshold), share, int(tree.max_depth)))  # fmt: skip
    return _trees_head(nodes)


class _Tree:
    """One tree's nodes; a leaf's children are -1."""

    def __init__(self, left: Any, right: Any, column: Any, threshold: Any, value: Any, depth: int):
        self.left, self.right, self.column = left, right, column
        self.threshold, self.value, self.depth = threshold, value, depth


def _trees_head(trees: list[_Tree]) -> nn.Module:
    """Return all trees as flat tables; a leaf points to itself."""
    parts: dict[str, list[NDArray[Any]]] = {
        name: [] for name in ("column", "threshold", "left", "right", "leaf", "value", "root")
    }
    offset = leaves = 0
    for tree in trees:
        own = np.arange(len(tree.left))
        leaf = tree.left < 0
        parts["column"].append(np.where(leaf, 0, tree.column).astype(np.int32))
        parts["threshold"].append(np.where(leaf, 0, tree.threshold).astype(np.float32))
        parts["left"].append((np.where(leaf, own, tree.left) + offset).astype(np.int32))
        parts["right"].append((np.where(leaf, own, tree.right) + offset).astype(np.int32))
        number = np.zeros(len(own), np.int32)
        number[leaf] = leaves + np.arange(leaf.sum())
        parts["leaf"].append(number)
        parts["value"].append(tree.value[leaf].astype(np.float16))
        parts["root"].append(np.array([offset], np.int32))
        offset, leaves = offset + len(own), leaves + int(leaf.sum())
    tables = {name: torch.from_numpy(np.concatenate(part)) for name, part in parts.items()}
    depth = max(tree.depth for tree in trees)
    return TreesHead(**tables, depth=torch.tensor([depth]))


def _perceptron(x: Features, y: Classes, classes: int, strength: float, seed: int) -> nn.Module:
    """Perceptrons of one hidden layer, Adam; `strength` is the penalty of scikit-learn's alpha."""
    offset, factor, scaled = _standardised(x)
    generator = torch.Generator().manual_seed(seed)
    data = torch.from_numpy(scaled)
    truth = torch.from_numpy(y.astype(np.int64))
    hidden = HIDDEN
    weight = _random((MEMBERS, data.shape[1], hidden), data.shape[1] + hidden, generator)
    out = _random((MEMBERS, hidden, classes), hidden + classes, generator)
    bias, out_bias = torch.zeros(MEMBERS, 1, hidden), torch.zeros(MEMBERS, 1, classes)
    weights = [part.requires_grad_() for part in (weight, bias, out, out_bias)]
    groups: list[dict[str, Any]] = [
        {"params": weights[0::2], "weight_decay": strength / BATCH},
        {"params": weights[1::2]},
    ]
    optimiser = torch.optim.Adam(groups, lr=RATE)
    batches = max(1, -(-len(y) // BATCH))
    epochs = max(EPOCHS, -(-_LEAST_UPDATES // batches))
    for _ in range(epochs):
        order = torch.randperm(len(y), generator=generator)
        for part in order.tensor_split(batches):
            layer = torch.relu(data[part].unsqueeze(0) @ weights[0] + weights[1])
            logits = layer @ weights[2] + weights[3]
            loss = functional.cross_entropy(logits.flatten(0, 1), truth[part].repeat(MEMBERS))
            optimiser.zero_grad(set_to_none=True)
            (loss * MEMBERS).backward()  # type: ignore[no-untyped-call]
            optimiser.step()
    tables = [part.detach() for part in weights]
    return PerceptronHead(
        offset=torch.from_numpy(offset), factor=torch.from_numpy(factor), weight=tables[0],
        bias=tables[1], out=tables[2], out_bias=tables[3],
    )  # fmt: skip


_LEAST_UPDATES = 300
"""Steps of a perceptron on few windows. Source: our choice, 0039."""


def _random(shape: tuple[int, ...], fan: int, generator: torch.Generator) -> Tensor:
    """Return first weights after Glorot and Bengio, AISTATS 2010."""
    spread = float((6.0 / fan) ** 0.5)
    return (torch.rand(shape, generator=generator) * 2.0 - 1.0) * spread


def _standardised(x: Features) -> tuple[Features, Features, Features]:
    """Return offset, factor, and features standardised and cut as a head will do."""
    low, high = np.percentile(x, _TAILS, axis=0)
    cut = np.clip(x, low, high).astype(np.float64)
    offset, deviation = cut.mean(axis=0), cut.std(axis=0)
    still = deviation <= 1e-6 * (np.abs(offset) + 1e-6)
    factor = np.where(still, 0.0, 1.0 / np.where(still, 1.0, deviation))
    offset, factor = offset.astype(np.float32), factor.astype(np.float32)
    return offset, factor, np.clip((x - offset) * factor, -FARTHEST, FARTHEST)


FITS: dict[str, Callable[[Features, Classes, int, float, int], nn.Module]] = {
    "logistic": _logistic,
    "discriminant": _discriminant,
    "winsorised-discriminant": _winsorised,
    "extra-trees": _extra_trees,
    "random-forest": _random_forest,
    "perceptron": _perceptron,
}
"""Model → (features, classes, number of classes, strength, seed) → head."""
