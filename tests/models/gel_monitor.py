"""A grasp monitor on gel features whose head is a rule that can be read; no training framework."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.bundles.grasp import GraspContract, write_grasp_bundle
from taxel.decisions.stability import StabilityConfig
from taxel.gel.slip_features import SLIP_FEATURES
from taxel.windows.rest import SETTLE

FRAMES = 4
_PLACE = SLIP_FEATURES.index("slip_spread")
_PX, _STEEPNESS = 1.5, 4.0


def write_gel_monitor(path: Path, frames: int = FRAMES) -> None:
    """Write a bundle that calls a grasp unstable once an imprint has parted from its gel.

    Args:
        path: The file.
        frames: k: it looks at the last of so many, and waits for them all.
    """
    width = len(SLIP_FEATURES)
    zeros, ones = (tuple((value,) * width for _ in range(2)) for value in (0.0, 1.0))
    contract = GraspContract(
        features="gel", weights="", head="rule", frames=frames, tare="change",
        settle=(SETTLE.start, SETTLE.stop), cameras=2, width=320, height=240, rate_hz=60.0,
        rule="slip_spread > 1.5 px", offset=zeros, factor=ones, stability=StabilityConfig(),
        parameters=0, data_digest="", measured={}, software="test",
    )  # fmt: skip
    size = (5, frames, 2, width)
    windows = np.random.default_rng(0).normal(_PX, 1.0, size=size).astype(np.float32)
    write_grasp_bundle(path, contract, _model(frames, width), None, windows, _probability(windows))


def _probability(windows: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return what the head gives, shape (n,): the camera that shows more counts."""
    logit = (windows[:, -1, :, _PLACE].max(axis=1) - _PX) * _STEEPNESS
    return np.asarray(1 / (1 + np.exp(-logit)), np.float32)


def _model(frames: int, width: int) -> bytes:
    """Return the head as ONNX: features (n, frames, 2, width) → probability (n,)."""
    from onnx import TensorProto, helper, numpy_helper

    constants = {
        "last": np.array(frames - 1), "place": np.array(_PLACE), "cameras": np.array([1]),
        "px": np.float32(_PX), "steepness": np.float32(_STEEPNESS),
    }  # fmt: skip
    nodes = [
        helper.make_node("Gather", ["features", "last"], ["now"], axis=1),
        helper.make_node("Gather", ["now", "place"], ["each"], axis=2),
        helper.make_node("ReduceMax", ["each", "cameras"], ["most"], keepdims=0),
        helper.make_node("Sub", ["most", "px"], ["over"]),
        helper.make_node("Mul", ["over", "steepness"], ["logit"]),
        helper.make_node("Sigmoid", ["logit"], ["probability"]),
    ]
    shape = ["n", frames, 2, width]
    graph = helper.make_graph(
        nodes, "gel",
        [helper.make_tensor_value_info("features", TensorProto.FLOAT, shape)],
        [helper.make_tensor_value_info("probability", TensorProto.FLOAT, ["n"])],
        [numpy_helper.from_array(np.asarray(value), name) for name, value in constants.items()],
    )  # fmt: skip
    opsets = [helper.make_opsetid("", 18)]
    return bytes(helper.make_model(graph, opset_imports=opsets, ir_version=8).SerializeToString())
