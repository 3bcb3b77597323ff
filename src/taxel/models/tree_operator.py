"""A forest as the one operator that ONNX has for it, instead of a walk of plain look-ups.

ONNX Runtime walks a tree in a loop of its own: five forests of 150 trees took 0.33 ms for one
window, a step of all trees at a time by look-ups 1.4 ms, and are exported in 0.6 s, not in 6.4.
Knows nothing about how a forest was grown or what it says.

Source: TreeEnsembleRegressor of ai.onnx.ml 3; docs/decisions/0039.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

OPSETS: Final = {"ai.onnx.ml": 3}
"""What an export that may hold a forest names beside ONNX's own operators."""

Tables = Mapping[str, NDArray[Any]]
"""A forest's tables by name, as `taxel.models.heads.TreesHead` holds them."""


def exported_shares(features: Tensor, tables: Tables) -> Tensor:
    """Return the node that answers with a forest's mean shares of the classes, (n, classes).

    Only for an export: its numbers are all 0.

    Args:
        features: What the trees see, shape (n, features), float32.
        tables: The forest's.
    """
    found: Tensor = _Ensemble.apply(features, tables)  # type: ignore[no-untyped-call]
    return found


class _Ensemble(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, features: Tensor, tables: Tables) -> Tensor:
        return features.new_zeros(features.shape[0], tables["value"].shape[1])

    @staticmethod
    def symbolic(graph: Any, features: Any, tables: Tables) -> Any:
        node = graph.op("ai.onnx.ml::TreeEnsembleRegressor", features, **attributes(tables))
        return node.setType(features.type().with_sizes([None, tables["value"].shape[1]]))


def attributes(tables: Tables) -> dict[str, Any]:
    """Return the operator's attributes, each ending in its type as PyTorch's exporter wants it.

    Args:
        tables: Nodes of all trees behind one another; a leaf points to itself.
    """
    root, left = tables["root"], tables["left"]
    node = np.arange(len(left))
    tree = np.searchsorted(root, node, side="right") - 1
    start = root[tree]
    leaf = left == node
    share = tables["value"].astype(np.float32)[tables["leaf"][leaf]] / np.float32(len(root))
    at, target = np.nonzero(share)  # most leaves know few classes
    return {
        "n_targets_i": int(tables["value"].shape[1]),
        "aggregate_function_s": "SUM",
        "post_transform_s": "NONE",
        "nodes_treeids_i": tree.tolist(),
        "nodes_nodeids_i": (node - start).tolist(),
        "nodes_featureids_i": tables["column"].tolist(),
        "nodes_values_f": tables["threshold"].tolist(),
        "nodes_modes_s": np.where(leaf, "LEAF", "BRANCH_LEQ").tolist(),
        "nodes_truenodeids_i": np.where(leaf, 0, left - start).tolist(),
        "nodes_falsenodeids_i": np.where(leaf, 0, tables["right"] - start).tolist(),
        "target_treeids_i": tree[leaf][at].tolist(),
        "target_nodeids_i": (node - start)[leaf][at].tolist(),
        "target_ids_i": target.tolist(),
        "target_weights_f": share[at, target].tolist(),
    }
