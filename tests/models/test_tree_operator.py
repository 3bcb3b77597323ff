"""A forest that is exported as one operator says what a walk says; a bundle's check knows it."""

import struct

import numpy as np
import pytest
import torch
from torch import nn

from taxel.bundles.model_check import check_model
from taxel.bundles.writer import export_onnx
from taxel.errors import BadBundle
from taxel.models.heads import TreesHead
from taxel.models.onnx_session import WindowModel
from taxel.models.tree_operator import attributes
from taxel.training.choose.candidates import Candidate
from taxel.training.choose.fitting import fit_head

RNG = np.random.default_rng(0)
CHANNELS, CLASSES = 6, 3


class _Rows(nn.Module):
    """A forest on a window's only row."""

    def __init__(self, head: nn.Module) -> None:
        super().__init__()
        self.head = head

    def forward(self, values: torch.Tensor, mask: torch.Tensor) -> torch.Tensor:
        found: torch.Tensor = self.head(values[:, 0] * mask[:, :1])
        return found


@pytest.fixture(scope="module")
def rows() -> np.ndarray:
    return RNG.normal(size=(90, CHANNELS)).astype(np.float32)


@pytest.fixture(scope="module", params=["extra-trees", "random-forest"])
def head(request: pytest.FixtureRequest, rows: np.ndarray) -> TreesHead:
    y = np.digitize(rows[:, 0] + 0.3 * RNG.normal(size=len(rows)), [-0.5, 0.5])
    found = fit_head(Candidate("trees", request.param, "all", 2.0), rows, y, CLASSES, 0)
    assert isinstance(found, TreesHead)
    return found


@pytest.fixture(scope="module")
def model(head: TreesHead) -> bytes:
    return export_onnx(_Rows(head).eval(), 1, CHANNELS)


def test_the_operator_says_what_the_walk_says(head: TreesHead, model: bytes, rows: np.ndarray):
    """Of one window, of many, and at the thresholds themselves."""
    inner = head.left.numpy() != np.arange(len(head.left))
    at = rows.copy()
    at[:, head.column.numpy()[inner][: len(rows)]] = head.threshold.numpy()[inner][: len(rows)]
    run = WindowModel(model)
    for values in (rows[:, None], rows[:1, None], at[:, None]):
        mask = np.ones((len(values), 1), bool)
        with torch.inference_mode():
            wanted = head(torch.from_numpy(values[:, 0])).numpy()

        np.testing.assert_allclose(run(values, mask), wanted, atol=2e-5)


@pytest.mark.parametrize("kind", ["extra-trees", "random-forest"])
def test_trees_that_are_a_leaf_alone_answer_too(kind: str):
    """Of four rows most trees split nothing."""
    rows = RNG.normal(size=(4, CHANNELS)).astype(np.float32)
    head = fit_head(Candidate("trees", kind, "all", 2.0), rows, np.array([0, 1, 1, 1]), CLASSES, 0)
    assert isinstance(head, TreesHead)
    assert (head.left[head.root] == head.root).sum() > 50

    found = WindowModel(export_onnx(_Rows(head).eval(), 1, CHANNELS))

    with torch.inference_mode():
        wanted = head(torch.from_numpy(rows)).numpy()
    np.testing.assert_allclose(found(rows[:, None], np.ones((4, 1), bool)), wanted, atol=2e-5)


def test_a_bundles_check_knows_a_forest_and_no_other_operator_of_its_domain(model: bytes):
    assert b"TreeEnsembleRegressor" in model

    check_model(model)
    with pytest.raises(BadBundle, match=r"ai\.onnx\.ml"):
        check_model(model.replace(b"TreeEnsembleRegressor", b"TreeEnsembleClassifie"))


def entry(tag: int, number: int) -> bytes:
    """Return a field of an attribute: one whole number of a list."""
    found = bytearray([tag])
    number &= (1 << 64) - 1
    while number > 0x7F:
        found.append(number & 0x7F | 0x80)
        number >>= 7
    return bytes([*found, number])


def message(number: int, content: bytes) -> bytes:
    """Return a message as a field of another."""
    return entry(number << 3 | 2, len(content)) + content


def with_attribute(content: bytes) -> bytes:
    """Return a model whose one node is a forest with one attribute."""
    node = message(4, b"TreeEnsembleRegressor") + message(
        5, message(1, b"nodes_featureids") + content
    )
    return message(7, message(1, node + message(7, b"ai.onnx.ml")))


@pytest.mark.parametrize("number", [0, 1, 127, 128, 2**28 - 1])
def test_a_forests_lists_of_small_numbers_pass(number: int):
    check_model(with_attribute(entry(0x40, number) * 3 + b"\x3d" + struct.pack("<f", 0.5)))
    check_model(with_attribute(b"\x4a\x04LEAF\x4a\x0aBRANCH_LEQ"))


@pytest.mark.parametrize(
    "content",
    [
        entry(0x40, -5),
        entry(0x40, 3) + entry(0x40, 2**28),
        b"\xc0\x00" + entry(0x40, -5)[1:],  # the same field, its number written longer
        b"\x42\x0a" + entry(0x40, -5)[1:],  # the same list, packed
        b"\x3d\x00\x00",
        b"\x4a\x0bBRANCH_LEQ2",
    ],
    ids=["negative", "large", "longer", "packed", "cut", "kind"],
)
def test_a_forest_with_other_lists_is_refused(content: bytes):
    """ONNX Runtime 1.20 to 1.24 read a feature of a negative number from before the window."""
    with pytest.raises(BadBundle, match="a model as taxel exports it"):
        check_model(with_attribute(content))


def test_nodes_are_numbered_tree_by_tree_and_leaves_share_one(head: TreesHead):
    found = attributes({name: getattr(head, name).numpy() for name in head.names})

    trees = np.array(found["nodes_treeids_i"])
    assert sorted(set(trees)) == list(range(len(head.root)))
    firsts = [int(np.flatnonzero(trees == tree)[0]) for tree in range(len(head.root))]
    assert [found["nodes_nodeids_i"][first] for first in firsts] == [0] * len(firsts)
    leaves: dict[tuple[int, int], float] = {}
    for key, weight in zip(
        zip(found["target_treeids_i"], found["target_nodeids_i"], strict=True),
        found["target_weights_f"], strict=True,
    ):  # fmt: skip
        leaves[key] = leaves.get(key, 0.0) + weight
    assert len(leaves) == found["nodes_modes_s"].count("LEAF")
    np.testing.assert_allclose(list(leaves.values()), 1.0 / len(head.root), rtol=2e-3)
