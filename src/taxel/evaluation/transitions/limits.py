"""What this machine can multiply at most: a large matrix product in the engine that runs networks.

A time on a shared machine says little by itself; beside it stands the share of this limit that
was reached, both measured in one run. Knows nothing about networks.

Background of our choices: docs/decisions/0056.
"""

from __future__ import annotations

from time import perf_counter

import numpy as np

from taxel.bundles.engine import Engine, EngineName, Precision, open_engine

SIDE = 1536
"""Rows and columns of the matrices. Source: our choice: 7.2 GFLOP, far beyond any cache."""
REPEATS = 3
"""Products; the quickest counts. Source: our choice."""


class ProductLimit:
    """A product of two square matrices of 32-bit floats, ready to be timed again and again.

    Args:
        engine: Which library multiplies.
        precision: Of the engine's numbers: f32 or bf16.
        threads: Threads of the engine.
    """

    def __init__(self, engine: EngineName, precision: Precision, threads: int) -> None:
        self._engine: Engine = open_engine(_product_model(), engine, precision, threads)
        self._values = np.random.default_rng(0).normal(size=(SIDE, SIDE)).astype(np.float32)
        self._engine.run(values=self._values)

    def gflops(self) -> float:
        """Return 10⁹ operations a second now; a multiplication and an addition are two."""
        best = np.inf
        for _ in range(REPEATS):
            started = perf_counter()
            self._engine.run(values=self._values)
            best = min(best, perf_counter() - started)
        return 2 * SIDE**3 / float(best) / 1e9


def _product_model() -> bytes:
    """Return an ONNX model: values (SIDE, SIDE) → their product with a constant matrix."""
    from onnx import TensorProto, helper, numpy_helper

    weights = np.random.default_rng(1).normal(size=(SIDE, SIDE)).astype(np.float32)
    square = [
        helper.make_tensor_value_info(name, TensorProto.FLOAT, (SIDE, SIDE))
        for name in ("values", "product")
    ]
    graph = helper.make_graph(
        [helper.make_node("MatMul", ["values", "weights"], ["product"])],
        "product",
        square[:1],
        square[1:],
        [numpy_helper.from_array(weights, "weights")],
    )
    model = helper.make_model(
        graph, opset_imports=[helper.make_opsetid("", _OPSET)], ir_version=_IR_VERSION
    )
    return bytes(model.SerializeToString())


_OPSET, _IR_VERSION = 18, 10
"""Of ONNX: what both engines of this project's oldest versions read. Source: onnx's table."""
