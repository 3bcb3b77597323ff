"""Heads that warn of slip as ONNX: trees as tables, weights as one product.

Knows nothing about how a head was trained.

Source: docs/decisions/0036.
"""

from __future__ import annotations

from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray
from sklearn.ensemble import HistGradientBoostingClassifier, HistGradientBoostingRegressor

from taxel.gel.slip_signal import PAIR_FEATURES

_OPSET: Final = 18
SMALLEST_SHARE: Final = 1e-6
"""Of a unit: below, a logarithm is not taken."""
Trees: TypeAlias = HistGradientBoostingClassifier | HistGradientBoostingRegressor


def trees_model(
    model: Trees, factor: float = 1.0, *, least: tuple[str, float] | None = None
) -> bytes:
    """Return boosted trees as tables that are looked up level by level.

    ONNX has an operator for trees; a bundle holds plain ones only (docs/decisions/0033).

    Args:
        model: Trained.
        factor: Their sum times this is the logit.
        least: A feature's name and a unit: the sum is never below the logarithm of that feature
            over that unit.
    """
    from onnx import helper

    tables, depth = _tables(model)
    nodes = [
        helper.make_node("Slice", ["rows", "zero", "one", "one"], ["first"]),
        helper.make_node("Equal", ["first", "first"], ["there"]),
        helper.make_node("Where", ["there", "root", "root"], ["place0"]),
    ]
    for level in range(depth):
        nodes += _level(f"place{level}", f"place{level + 1}")
    baseline = float(np.ravel(model._baseline_prediction)[0])
    nodes += [
        helper.make_node("Gather", ["value", f"place{depth}"], ["votes"]),
        helper.make_node("ReduceSum", ["votes", "one"], ["sum"], keepdims=0),
        helper.make_node("Add", ["sum", "baseline"], ["learned"]),
    ]
    constants = {
        "zero": np.array([0]), "one": np.array([1]), "baseline": np.array(baseline),
        "factor": np.array(factor),
    }  # fmt: skip
    total = "learned"
    if least is not None:
        total = "total"
        name, unit = least
        nodes += [
            helper.make_node("Gather", ["rows", "least_column"], ["least_of"], axis=1),
            helper.make_node("Div", ["least_of", "least_unit"], ["least_share"]),
            helper.make_node("Max", ["least_share", "least_share_of_all"], ["least_positive"]),
            helper.make_node("Log", ["least_positive"], ["least"]),
            helper.make_node("Max", ["learned", "least"], [total]),
        ]
        constants |= {
            "least_column": np.array(PAIR_FEATURES.index(name), np.int64),
            "least_unit": np.array(unit), "least_share_of_all": np.array(SMALLEST_SHARE),
        }  # fmt: skip
    nodes.append(helper.make_node("Mul", [total, "factor"], ["logit"]))
    return slip_model(nodes, constants | tables, model.n_features_in_)


def _level(place: str, below: str) -> list[Any]:
    """Return the nodes that take each tree's place (n, trees) one node down."""
    from onnx import helper

    def node(operator: str, *inputs: str, output: str = "", **attributes: Any) -> str:
        output = output or f"{place}_{len(nodes)}"
        nodes.append(helper.make_node(operator, list(inputs), [output], **attributes))
        return output

    nodes: list[Any] = []
    column = node("Gather", "column", place)
    value = node("GatherElements", "rows", column, axis=1)
    low = node("LessOrEqual", value, node("Gather", "threshold", place))  # false for NaN
    absent = node("Not", node("Equal", value, value))
    left = node("Or", low, node("And", absent, node("Gather", "missing_left", place)))
    node("Where", left, node("Gather", "left", place), node("Gather", "right", place), output=below)
    return nodes


def _tables(model: Trees) -> tuple[dict[str, NDArray[Any]], int]:
    """Return scikit-learn's trees as flat tables, and how deep they are; a leaf points to itself.

    Thresholds are rounded towards minus infinity to 32 bits, so that a 32-bit feature goes the
    way that it went in training.
    """
    every = [predictor.nodes for (predictor,) in model._predictors]
    starts = np.cumsum([0, *(len(nodes) for nodes in every[:-1])])
    nodes = np.concatenate(every)
    start = np.repeat(starts, [len(table) for table in every])
    leaf, own = nodes["is_leaf"].astype(bool), np.arange(len(nodes))
    thresholds = [0.0 if end else _down(float(limit))
                  for end, limit in zip(leaf, nodes["num_threshold"], strict=True)]  # fmt: skip
    tables: dict[str, NDArray[Any]] = {
        "column": np.where(leaf, 0, nodes["feature_idx"]).astype(np.int64),
        "threshold": np.array(thresholds, np.float32),
        "left": np.where(leaf, own, nodes["left"] + start).astype(np.int64),
        "right": np.where(leaf, own, nodes["right"] + start).astype(np.int64),
        "missing_left": nodes["missing_go_to_left"].astype(bool),
        "value": np.where(leaf, nodes["value"], 0.0),
        "root": starts.astype(np.int64)[None],
    }
    return tables, int(nodes["depth"].max())


def _down(threshold: float) -> float:
    rounded = np.float32(threshold)
    if float(rounded) > threshold:
        rounded = np.nextafter(rounded, np.float32(-np.inf))
    return float(rounded)


def linear_model(columns: NDArray[np.float64]) -> bytes:
    """Return a model that weighs features and cuts the sum to 0…1: no learning in it.

    Args:
        columns: Weight of each feature, shape (features,).
    """
    from onnx import helper

    nodes = [
        helper.make_node("MatMul", ["rows", "columns"], ["sum"]),
        helper.make_node("Clip", ["sum", "none", "whole"], ["probability"]),
    ]
    constants = {"columns": columns, "none": np.array(0.0), "whole": np.array(1.0)}
    return slip_model(nodes, constants, len(columns), sigmoid=False)


def slip_model(
    nodes: list[Any], constants: dict[str, NDArray[Any]], width: int, *, sigmoid: bool = True
) -> bytes:
    """Return an ONNX model: features (n, 1, 1, width) → probability (n,).

    Args:
        nodes: They turn `rows` (n, width) into `logit` (n,), or into `probability`.
        constants: What they use by name; numbers are stored as 32 bits.
        width: Features: 66, or with those of the rim 74.
        sigmoid: False where the nodes give `probability` themselves.
    """
    from onnx import TensorProto, helper, numpy_helper

    frame = [
        helper.make_node("Reshape", ["features", "table"], ["rows"]),
        *nodes,
        *([helper.make_node("Sigmoid", ["logit"], ["probability"])] if sigmoid else []),
    ]
    values = {"table": np.array([-1, width], np.int64)} | {
        name: value if value.dtype in (np.int64, np.bool_) else value.astype(np.float32)
        for name, value in constants.items()
    }
    graph = helper.make_graph(
        frame, "slip",
        [helper.make_tensor_value_info("features", TensorProto.FLOAT, ["n", 1, 1, width])],
        [helper.make_tensor_value_info("probability", TensorProto.FLOAT, ["n"])],
        [numpy_helper.from_array(value, name) for name, value in values.items()],
    )  # fmt: skip
    opsets = [helper.make_opsetid("", _OPSET)]
    return bytes(helper.make_model(graph, opset_imports=opsets, ir_version=8).SerializeToString())
