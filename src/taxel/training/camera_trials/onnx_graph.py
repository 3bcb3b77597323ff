"""A blend of forests and logistic regressions as one ONNX model, of plain operators only.

Forests become tables that are looked up level by level, so that a bundle needs nothing but what
`taxel.bundles.model_check` allows. Knows nothing about images, trials or files.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

from taxel.models.forest import tables_of
from taxel.training.camera_trials.blend import TrialBlend
from taxel.training.camera_trials.novelty import Novelty
from taxel.training.camera_trials.rank_sums import Logistic, Steady
from taxel.training.camera_trials.ranked import Ranked
from taxel.training.camera_trials.squeezed import REACH, Squeezed

_OPSET: Final = 18


def blend_to_onnx(blend: TrialBlend, columns: int) -> bytes:
    """Return a model: rows (n, columns) → (n, classes + 1): mean probabilities, then novelty."""
    graph = _Graph()
    parts = []
    for model, own, weight in zip(blend.fitted, blend.columns, blend.weights, strict=True):
        seen = graph.add("Gather", "rows", graph.const(own.astype(np.int32)), axis=1)
        if isinstance(model, Logistic | Steady):
            output = _logistic(graph, seen, model)
        else:
            output = _forest(graph, seen, model, blend.classes)
        parts.append(graph.add("Mul", output, graph.const(np.float32(weight))))
    mean = parts[0] if len(parts) == 1 else graph.add("Sum", *parts)
    graph.add("Concat", mean, _novelty(graph, blend.novelty), axis=1, output="told")
    made = helper.make_graph(
        graph.nodes, "trials",
        [helper.make_tensor_value_info("rows", TensorProto.FLOAT, ["n", columns])],
        [helper.make_tensor_value_info("told", TensorProto.FLOAT, ["n", blend.classes + 1])],
        graph.constants,
    )  # fmt: skip
    model = helper.make_model(made, opset_imports=[helper.make_opsetid("", _OPSET)], ir_version=8)
    return bytes(model.SerializeToString())


class _Graph:
    """Nodes and constants as they are added, each with a name of its own."""

    def __init__(self) -> None:
        self.nodes: list[Any] = []
        self.constants: list[Any] = []

    def const(self, value: NDArray[Any] | np.generic) -> str:
        name = f"c{len(self.constants)}"
        self.constants.append(numpy_helper.from_array(np.asarray(value), name))
        return name

    def add(self, operator: str, *inputs: str, output: str = "", **attributes: Any) -> str:
        name = output or f"v{len(self.nodes)}"
        self.nodes.append(helper.make_node(operator, list(inputs), [name], **attributes))
        return name


def _forest(graph: _Graph, seen: str, trees: Any, classes: int) -> str:
    """Add a forest; return its mean probabilities, (n, classes)."""
    tables = tables_of(trees, classes)
    column, left, right = (
        graph.const(tables[name].astype(np.int32)) for name in ("column", "left", "right")
    )
    threshold, leaf = graph.const(tables["threshold"]), graph.const(tables["leaf"])
    first = graph.add("Slice", seen, *(graph.const(np.array([at])) for at in (0, 1, 1)))
    none = graph.add("Mul", first, graph.const(np.float32(0)))
    start = graph.add("Cast", none, to=TensorProto.INT32)
    place = graph.add("Add", start, graph.const(tables["root"].astype(np.int32)[None]))
    for _ in range(int(tables["depth"][0])):
        value = graph.add("GatherElements", seen, graph.add("Gather", column, place), axis=1)
        below = graph.add("LessOrEqual", value, graph.add("Gather", threshold, place))
        sides = [graph.add("Gather", side, place) for side in (left, right)]
        place = graph.add("Where", below, *sides)
    found = graph.add("Gather", leaf, place)
    return graph.add("ReduceMean", found, graph.const(np.array([1])), keepdims=0)


def _logistic(graph: _Graph, seen: str, model: Logistic | Steady) -> str:
    """Add a sum of ranks; return its probabilities, (n, classes)."""
    slopes, levels = (part.astype(np.float32) for part in model.slopes)
    assert model.ranked is not None
    ranks = _ranked(graph, seen, model.ranked)
    drive = graph.add("MatMul", ranks, graph.const(np.ascontiguousarray(slopes.T)))
    drive = graph.add("Add", drive, graph.const(levels))
    if len(slopes) > 1:
        return graph.add("Softmax", drive, axis=1)
    second = graph.add("Sigmoid", drive)
    first = graph.add("Sub", graph.const(np.float32(1)), second)
    return graph.add("Concat", first, second, axis=1)


def _ranked(graph: _Graph, rows: str, ranked: Ranked) -> str:
    """Add columns' ranks, (n, columns)."""
    middle = graph.add("Unsqueeze", rows, graph.const(np.array([1])))
    past = graph.add("Sub", middle, graph.const(ranked.starts[None]))
    part = graph.add("Div", past, graph.const(ranked.widths[None]))
    cut = graph.add("Clip", part, *(graph.const(np.float32(end)) for end in (0, 1)))
    risen = graph.add("Mul", cut, graph.const(ranked.rises[None]))
    summed = graph.add("ReduceSum", risen, graph.const(np.array([1])), keepdims=0)
    return graph.add("Add", summed, graph.const(np.float32(ranked.lowest)))


def _squeezed(graph: _Graph, rows: str, squeezed: Squeezed) -> str:
    ratio = graph.add("Div", graph.add("Abs", rows), graph.const(squeezed.size))
    log = graph.add("Log", graph.add("Add", ratio, graph.const(np.float32(1))))
    signed = graph.add("Mul", log, graph.add("Sign", rows))
    moved = graph.add("Sub", signed, graph.const(squeezed.mean))
    scaled = graph.add("Mul", moved, graph.const(squeezed.scale))
    return graph.add("Clip", scaled, *(graph.const(np.float32(s * REACH)) for s in (-1, 1)))


def _novelty(graph: _Graph, novelty: Novelty) -> str:
    """Add the mean distance to the nearest learned crops, (n, 1)."""
    seen = graph.add("Gather", "rows", graph.const(novelty.columns.astype(np.int32)), axis=1)
    alike = _squeezed(graph, seen, novelty.squeezed)
    at = graph.add("MatMul", alike, graph.const(novelty.directions))
    apart = graph.add(
        "Sub", graph.add("Unsqueeze", at, graph.const(np.array([1]))),
        graph.const(novelty.learned[None]),
    )  # fmt: skip
    far = graph.add(
        "ReduceSum", graph.add("Mul", apart, apart), graph.const(np.array([2])), keepdims=0
    )
    count = graph.const(np.array([novelty.nearest]))
    nearest = f"v{len(graph.nodes)}"
    graph.nodes.append(
        helper.make_node("TopK", [far, count], [nearest, f"{nearest}_at"], axis=1, largest=0)
    )
    return graph.add(
        "ReduceMean", graph.add("Sqrt", nearest), graph.const(np.array([1])), keepdims=1
    )
