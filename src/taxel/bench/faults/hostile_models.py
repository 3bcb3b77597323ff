"""Make ONNX models that ask for time, memory or the user's own files.

Knows nothing about bundles.

Raises:
    MissingExtra: On import, where the package onnx is not installed.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from taxel.errors import MissingExtra

try:
    import onnx
    from onnx import TensorProto, helper
except ImportError as error:
    raise MissingExtra("onnx", "train", "hostile models") from error


def model(nodes: list[onnx.NodeProto], initializers: Sequence[onnx.TensorProto] = ()) -> bytes:
    """Return a model that takes windows of any shape and gives "probabilities"."""
    values = helper.make_tensor_value_info("values", TensorProto.FLOAT, None)
    mask = helper.make_tensor_value_info("mask", TensorProto.BOOL, None)
    found = helper.make_tensor_value_info("probabilities", TensorProto.FLOAT, None)
    graph = helper.make_graph(nodes, "g", [values, mask], [found], list(initializers))
    made = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=8)
    return bytes(made.SerializeToString())


def endless_loop() -> bytes:
    """Return a model that counts to 2^62 of constants: ONNX Runtime does so while it opens it."""
    scalar = TensorProto.FLOAT
    body = helper.make_graph(
        [helper.make_node("Identity", ["go"], ["on"]), helper.make_node("Add", ["x", "x"], ["y"])],
        "body",
        [helper.make_tensor_value_info("i", TensorProto.INT64, []),
         helper.make_tensor_value_info("go", TensorProto.BOOL, []),
         helper.make_tensor_value_info("x", scalar, [])],
        [helper.make_tensor_value_info("on", TensorProto.BOOL, []),
         helper.make_tensor_value_info("y", scalar, [])],
    )  # fmt: skip
    constants = [
        helper.make_tensor("n", TensorProto.INT64, [], [2**62]),
        helper.make_tensor("yes", TensorProto.BOOL, [], [True]),
        helper.make_tensor("zero", scalar, [], [0.0]),
    ]
    loop = helper.make_node("Loop", ["n", "yes", "zero"], ["last"], body=body)
    return model([loop, helper.make_node("Add", ["values", "last"], ["probabilities"])], constants)


def wide_product() -> bytes:
    """Return a model of plain operators whose two columns of 4 MB span a table of 4 TB."""
    n = 2**16
    sides = [
        helper.make_tensor(name, TensorProto.FLOAT, shape, np.ones(n, np.float32).tobytes(), True)
        for name, shape in (("a", [n, 1]), ("b", [1, n]))
    ]
    nodes = [helper.make_node("Mul", ["a", "b"], ["c"]),
             helper.make_node("ReduceSum", ["c"], ["d"], keepdims=0),
             helper.make_node("Add", ["values", "d"], ["probabilities"])]  # fmt: skip
    return model(nodes, sides)


def long_work() -> bytes:
    """Return a model that multiplies one table by itself again and again, of constants only."""
    n, times = 700, 4000
    table = helper.make_tensor("t0", TensorProto.FLOAT, [n, n],
                               np.ones((n, n), np.float32).tobytes(), True)  # fmt: skip
    nodes = [helper.make_node("MatMul", [f"t{i}", "t0"], [f"t{i + 1}"]) for i in range(times)]
    nodes += [helper.make_node("ReduceSum", [f"t{times}"], ["d"], keepdims=0),
              helper.make_node("Add", ["values", "d"], ["probabilities"])]  # fmt: skip
    return model(nodes, [table])


def outside_data() -> bytes:
    """Return a model whose numbers are to be read from the user's own files."""
    tensor = TensorProto(name="w", data_type=TensorProto.FLOAT, dims=[4],
                         data_location=TensorProto.EXTERNAL)  # fmt: skip
    tensor.external_data.add(key="location", value="/etc/passwd")
    return model([helper.make_node("Add", ["values", "w"], ["probabilities"])], [tensor])
