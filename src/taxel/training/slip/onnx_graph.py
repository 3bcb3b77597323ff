"""Heads that warn of slip as ONNX: trees as tables, weights as one product.

Knows nothing about how a head was trained.

Source: docs/decisions/0036.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray
from sklearn.ensemble import HistGradientBoostingClassifier, HistGradientBoostingRegressor

from taxel.gel.slip_signal import PAIR_FEATURES

_OPSET: Final = 18
SMALLEST_SHARE: Final = 1e-6
"""Of a unit: below, a logarithm is not taken."""
Trees: TypeAlias = HistGradientBoostingClassifier | HistGradientBoostingRegressor
_FEW: Final[dict[str, NDArray[Any]]] = {"zero": np.array([0]), "one": np.array([1])}
"""Constants that all trees share."""


def trees_model(model: Trees) -> bytes:
    """Return boosted trees as tables that are looked up level by level; their sum is the logit.

    ONNX has an operator for trees; a bundle holds plain ones only (docs/decisions/0033).

    Args:
        model: Trained.
    """
    nodes, constants = _trees(model, "logit")
    return slip_model(_begin() + nodes, constants | _FEW, model.n_features_in_)


def forecast_model(
    models: Sequence[Trees], less: float, factor: float, *, least: tuple[str, float]
) -> bytes:
    """Return the larger of several forecasts, each as tables: see `trees_model`.

    Args:
        models: Trained; each counts `less` less than the one before it.
        less: By how much.
        factor: The largest times this is the logit.
        least: A feature's name and a unit: no forecast is below the logarithm of that feature
            over that unit.
    """
    from onnx import helper

    name, unit = least
    nodes = [
        *_begin(),
        helper.make_node("Gather", ["rows", "least_column"], ["least_of"], axis=1),
        helper.make_node("Div", ["least_of", "least_unit"], ["least_share"]),
        helper.make_node("Max", ["least_share", "least_share_of_all"], ["least_positive"]),
        helper.make_node("Log", ["least_positive"], ["least"]),
    ]
    constants = _FEW | {
        "factor": np.array(factor),
        "least_column": np.array(PAIR_FEATURES.index(name), np.int64),
        "least_unit": np.array(unit), "least_share_of_all": np.array(SMALLEST_SHARE),
    }  # fmt: skip
    for place, model in enumerate(models):
        own, tables = _trees(model, f"forecast{place}", f"_{place}", -less * place)
        nodes += own
        constants |= tables
    forecasts = [f"forecast{place}" for place in range(len(models))]
    nodes += [
        helper.make_node("Max", ["least", *forecasts], ["largest"]),
        helper.make_node("Mul", ["largest", "factor"], ["logit"]),
    ]
    return slip_model(nodes, constants, models[0].n_features_in_)


def _begin() -> list[Any]:
    """Return the nodes that all trees need: one truth a row, so that places get its length."""
    from onnx import helper

    return [
        helper.make_node("Slice", ["rows", "zero", "one", "one"], ["first"]),
        helper.make_node("Equal", ["first", "first"], ["there"]),
    ]


def _trees(
    model: Trees, output: str, end: str = "", more: float = 0.0
) -> tuple[list[Any], dict[str, NDArray[Any]]]:
    """Return the nodes whose output is the sum of a model's trees, (n,), and their constants.

    Args:
        model: Trained.
        output: The sum's name.
        end: What the names of nodes and constants end with.
        more: Added to the sum.
    """
    from onnx import helper

    tables, depth = _tables(model)
    nodes = [helper.make_node("Where", ["there", f"root{end}", f"root{end}"], [f"place0{end}"])]
    for level in range(depth):
        nodes += _level(f"place{level}{end}", f"place{level + 1}{end}", end)
    nodes += [
        helper.make_node("Gather", [f"value{end}", f"place{depth}{end}"], [f"votes{end}"]),
        helper.make_node("ReduceSum", [f"votes{end}", "one"], [f"sum{end}"], keepdims=0),
        helper.make_node("Add", [f"sum{end}", f"baseline{end}"], [output]),
    ]
    baseline = float(np.ravel(model._baseline_prediction)[0]) + more
    constants = {f"{name}{end}": table for name, table in tables.items()}
    return nodes, constants | {f"baseline{end}": np.array(baseline)}


def _level(place: str, below: str, end: str) -> list[Any]:
    """Return the nodes that take each tree's place (n, trees) one node down."""
    from onnx import helper

    def node(operator: str, *inputs: str, output: str = "", **attributes: Any) -> str:
        output = output or f"{place}_{len(nodes)}"
        nodes.append(helper.make_node(operator, list(inputs), [output], **attributes))
        return output

    def of(table: str) -> str:
        return node("Gather", f"{table}{end}", place)

    nodes: list[Any] = []
    value = node("GatherElements", "rows", of("column"), axis=1)
    low = node("LessOrEqual", value, of("threshold"))  # false for NaN
    absent = node("Not", node("Equal", value, value))
    left = node("Or", low, node("And", absent, of("missing_left")))
    node("Where", left, of("left"), of("right"), output=below)
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
