"""Read the thesis's image network out of a bundle's ONNX model, and run it in floating point.

The graph is walked node by node: what is not a convolution, a ReLU, a pooling or a dense layer
in the order of `taxel.models.cnn2d` is refused, whatever its names say. Knows nothing about
8-bit numbers, C or recordings.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.bundles.model_check import check_model
from taxel.errors import BadBundle, MissingExtra
from taxel.plain_text import number_of

Floats = NDArray[np.float32]

_ORDER = (
    "Conv", "Relu", "MaxPool", "Conv", "Relu", "MaxPool", "Flatten",
    "Gemm", "Relu", "Gemm", "Softmax",
)  # fmt: skip
_UNROLLED = 8
"""The C loops take this many products at a time: filters and units come in such steps."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ImageNetwork:
    """Two convolutions of 3×3 with pooling by 2 (rounded up), two dense layers; all float32."""

    rows: int
    columns: int
    first: tuple[Floats, Floats]
    """Weights (filters, 3, 3, 1) and biases (filters,)."""
    second: tuple[Floats, Floats]
    """Weights (filters, 3, 3, filters of the first) and biases (filters,)."""
    hidden: tuple[Floats, Floats]
    """Weights (units, rows · columns · filters), inputs in the order of rows, columns, filters,
    and biases (units,)."""
    last: tuple[Floats, Floats]
    """Weights (classes, units) and biases (classes,)."""

    @property
    def products(self) -> int:
        """Multiplications a window, without those by the zeros around an image."""
        total = 0
        for (rows, columns), (weights, _) in zip(self.sizes, (self.first, self.second),
                                                 strict=False):  # fmt: skip
            total += (3 * rows - 2) * (3 * columns - 2) * weights.shape[0] * weights.shape[3]
        return total + self.hidden[0].size + self.last[0].size

    @property
    def sizes(self) -> tuple[tuple[int, int], ...]:
        """Rows and columns of the image, after the first pooling and after the second."""
        found = [(self.rows, self.columns)]
        for _ in range(2):
            rows, columns = found[-1]
            found.append((-(-rows // 2), -(-columns // 2)))
        return tuple(found)


def read_network(model: bytes, rows: int, columns: int) -> ImageNetwork:
    """Return the network that an ONNX model holds.

    Args:
        model: An ONNX file's bytes, as `taxel.bundles.writer` makes them.
        rows: Rows of its image.
        columns: Columns of its image.

    Raises:
        BadBundle: It is another network, or several that vote.
        MissingExtra: The package onnx is not installed.
    """
    try:
        import onnx
        from onnx import numpy_helper
    except ModuleNotFoundError as error:
        raise MissingExtra("onnx", "train", "a network in C") from error
    check_model(model)
    graph = onnx.load_from_string(model).graph
    nodes = [node for node in graph.node if node.op_type not in ("Constant", "Unsqueeze")]
    if tuple(node.op_type for node in nodes) != _ORDER or not _one_line(nodes):
        raise _another(
            f"{number_of(len(nodes), 'layer')}: {', '.join(node.op_type for node in nodes)[:120]}"
        )
    try:
        known = {tensor.name: np.asarray(numpy_helper.to_array(tensor), np.float32)
                 for tensor in graph.initializer}  # fmt: skip
        conv, dense = ([node for node in nodes if node.op_type == kind] for kind in
                       ("Conv", "Gemm"))  # fmt: skip
        for node in nodes:
            _check_settings(node.op_type, _settings(node, onnx.helper.get_attribute_value))
        pairs = [(known[node.input[1]], known[node.input[2]]) for node in (*conv, *dense)]
    except (KeyError, IndexError) as error:
        raise _another("a layer whose weights are not stored in it") from error
    except (TypeError, ValueError) as error:
        raise _another(f"weights that cannot be read ({error})") from error
    if [weights.ndim for weights, _ in pairs] != [4, 4, 2, 2]:
        raise _another(f"weights of {[weights.ndim for weights, _ in pairs]} axes")
    return _assembled(pairs, rows, columns)


def _assembled(pairs: list[tuple[Floats, Floats]], rows: int, columns: int) -> ImageNetwork:
    """Return the network with each layer's weights in the order in which the board reads them."""
    first, second, hidden, last = pairs
    network = ImageNetwork(
        rows=rows,
        columns=columns,
        first=(_channels_last(first[0]), first[1]),
        second=(_channels_last(second[0]), second[1]),
        hidden=hidden,
        last=last,
    )
    (_, _, size) = network.sizes
    shapes = [weights.shape for weights, _ in pairs]
    one, two, units = shapes[0][0], shapes[1][0], shapes[2][0]
    wanted = [(one, 1, 3, 3), (two, one, 3, 3), (units, two * size[0] * size[1]),
              (shapes[3][0], units)]  # fmt: skip
    if shapes != wanted or one % _UNROLLED or two % _UNROLLED or units % _UNROLLED:
        raise _another(f"layers of the shapes {shapes}")
    # PyTorch flattens filters first, the board's image has them last.
    planes = hidden[0].reshape(units, two, *size)
    flat = np.ascontiguousarray(np.moveaxis(planes, 1, 3).reshape(units, -1))
    return ImageNetwork(
        rows=rows, columns=columns, first=network.first, second=network.second,
        hidden=(flat, hidden[1]), last=last,
    )  # fmt: skip


def _channels_last(weights: Floats) -> Floats:
    return np.ascontiguousarray(np.moveaxis(weights, 1, 3))


def _one_line(nodes: list[Any]) -> bool:
    """Return whether each node takes what the one before gives."""
    return all(b.input[0] == a.output[0] for a, b in pairwise(nodes))


def _settings(node: Any, value: Any) -> dict[str, Any]:
    return {attribute.name: value(attribute) for attribute in node.attribute}


_WANTED: dict[str, dict[str, Any]] = {
    "Conv": {"dilations": [1, 1], "group": 1, "kernel_shape": [3, 3], "pads": [1, 1, 1, 1],
             "strides": [1, 1]},
    "MaxPool": {"kernel_shape": [2, 2], "strides": [2, 2], "pads": [0, 0, 0, 0], "ceil_mode": 1},
    "Gemm": {"transB": 1, "alpha": 1.0, "beta": 1.0},
    "Flatten": {"axis": 1},
    "Softmax": {"axis": 1},
}  # fmt: skip


def _check_settings(kind: str, found: dict[str, Any]) -> None:
    for name, wanted in _WANTED.get(kind, {}).items():
        if found.get(name) != wanted:
            raise _another(f"a {kind} with {name} = {found.get(name)}")


def _another(got: str) -> BadBundle:
    return BadBundle(
        "one network of the model cnn2d for a board", got,
        "train one with: taxel train --model cnn2d",
    )  # fmt: skip


def run_float(network: ImageNetwork, images: Floats) -> list[Floats]:
    """Return each layer's result for scaled images: two pooled images, hidden units, logits.

    Args:
        network: What to run.
        images: Shape (n, rows, columns), scaled.

    Returns:
        Shapes (n, rows, columns, filters) twice, (n, units) and (n, classes).
    """
    first_layer = _pooled(_convolved(images[..., None], *network.first))
    two = _pooled(_convolved(first_layer, *network.second))
    hidden = np.maximum(two.reshape(len(two), -1) @ network.hidden[0].T + network.hidden[1], 0)
    return [first_layer, two, hidden, hidden @ network.last[0].T + network.last[1]]


def _convolved(images: Floats, weights: Floats, biases: Floats) -> Floats:
    flat = patches(images) @ weights.reshape(len(weights), -1).T
    return np.asarray(np.maximum(flat + biases, 0))


def _pooled(images: Floats) -> Floats:
    return np.asarray(pooled(images, 0))


def patches(images: NDArray[Any]) -> NDArray[Any]:
    """Return each pixel's 3×3 surroundings, zeros outside, shape (n, rows, columns, 9 · filters).

    Args:
        images: Shape (n, rows, columns, filters).
    """
    n, rows, columns, _ = images.shape
    wide = np.pad(images, ((0, 0), (1, 1), (1, 1), (0, 0)))
    parts = [wide[:, r : r + rows, c : c + columns] for r in range(3) for c in range(3)]
    return np.asarray(np.concatenate(parts, axis=3).reshape(n, rows, columns, -1))


def pooled(images: NDArray[Any], least: int) -> NDArray[Any]:
    """Return the largest of each 2×2 pixels, shape (n, ⌈rows / 2⌉, ⌈columns / 2⌉, filters).

    Args:
        images: Shape (n, rows, columns, filters).
        least: Fills what is missing at an odd side.
    """
    n, rows, columns, filters = images.shape
    even = np.pad(images, ((0, 0), (0, rows % 2), (0, columns % 2), (0, 0)), constant_values=least)
    tall, wide = even.shape[1] // 2, even.shape[2] // 2
    found: NDArray[Any] = even.reshape(n, tall, 2, wide, 2, filters).max(axis=(2, 4))
    return found
