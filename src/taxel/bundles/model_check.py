"""Look through an ONNX model before anything runs it: known operators, no loops, no other files.

A model is read as the protocol buffer that it is, record by record, without the package onnx. Its
operators must be those that taxel's own exports use: none of them repeats or branches, so a
small file cannot ask for endless work. What they may still ask for is limited in
`model_trial`. Knows nothing about what the model predicts.

Source: onnx.proto of ONNX 1.21 (field numbers), protobuf's encoding guide.

Background of our choices: docs/decisions/0033.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from taxel.errors import BadBundle

OPERATORS = frozenset(
    """
    Abs Add And AveragePool BatchNormalization Cast CastLike Ceil Clip Concat Constant
    ConstantOfShape Conv CumSum DequantizeLinear Div Dropout DynamicQuantizeLinear Equal Erf Exp
    Expand Flatten Floor GRU Gather GatherElements GatherND Gelu Gemm GlobalAveragePool
    GlobalMaxPool Greater GreaterOrEqual HardSigmoid HardSwish Identity LSTM LayerNormalization
    LeakyRelu Less LessOrEqual Log LogSoftmax MatMul MatMulInteger Max MaxPool Mean Min Mod Mul
    Neg Not Or Pad Pow QuantizeLinear Range Reciprocal ReduceL2 ReduceMax ReduceMean ReduceMin
    ReduceProd ReduceSum Relu Reshape Resize Round Shape Sigmoid Sign Size Slice Softmax Softplus
    Split Sqrt Squeeze Sub Sum Tanh Tile TopK Transpose Unsqueeze Where Xor""".split()  # noqa: SIM905  # a list of 87 lines says no more
)
"""What taxel's networks, backbones and heads are exported to, and their plain relatives."""
_TREES, _TREES_DOMAIN = "TreeEnsembleRegressor", "ai.onnx.ml"
"""A forest: as fixed a calculation, each tree walked once from its root."""
_MOST_FIELDS = 400_000
"""Of a model; DenseNet-121, the longest here, has some 20,000. Source: our choice."""
_VARINT, _EIGHT, _BYTES, _FOUR = 0, 1, 2, 5
_OURS = ("", "ai.onnx")
Lists = Mapping[int, re.Pattern[bytes]]
"""Of an attribute with long lists: the byte that begins each entry → what a whole list matches."""
_NO_LISTS: Lists = {}
_LISTS: Lists = {
    0x40: re.compile(rb"(?:\x40[\x80-\xff]{0,3}[\x00-\x7f])*+"),
    0x3D: re.compile(rb"(?:\x3d[\x00-\xff]{4})*+"),
    0x4A: re.compile(rb"(?:\x4a\x04LEAF|\x4a\x0aBRANCH_LEQ)*+"),
}
"""A forest's: whole numbers below 2^28, numbers of 32 bits, kinds of nodes. ONNX Runtime 1.20 to
1.24 took a feature of a negative number from before its window."""

_MODEL = frozenset((1, 2, 3, 4, 5, 6, 7, 8, 14))
"""Without training_info (20) and functions (25)."""
_GRAPH = frozenset((1, 2, 5, 10, 11, 12, 13, 14, 16))
"""Without sparse_initializer (15)."""
_NODE = frozenset((1, 2, 3, 4, 5, 6, 7, 9))
_ATTRIBUTE = frozenset((1, 2, 3, 4, 5, 7, 8, 9, 10, 13, 20))
"""Without graphs (6, 11), types (14, 15), references (21) and sparse tensors (22, 23)."""
_TENSOR = frozenset((1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12))
"""Without external_data (13) and data_location (14), but where that says 0: here."""

Field = tuple[int, int, int, int]
"""Number, kind, and where the content starts and ends; of a varint the first is its value."""


def check_model(model: bytes) -> None:
    """Refuse a model that is more than a fixed calculation on its own numbers.

    Args:
        model: An ONNX file's bytes.

    Raises:
        BadBundle: It holds an operator that taxel's exports do not use, a loop or branch, data
            kept in another file, or is no ONNX model.
    """
    if model[4:8] == b"ORTM":
        raise _bad("one in ONNX Runtime's own format")
    _Walk(model).model()


class _Walk:
    """A model's bytes, and how many fields were read."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._left = _MOST_FIELDS

    def model(self) -> None:
        graphs = 0
        for number, kind, start, end in self._fields(0, len(self._data), _MODEL, "a model"):
            if number == 7:
                graphs += 1
                self._graph(*_inside(kind, start, end))
        if graphs != 1:
            raise _bad(f"{graphs} graphs")

    def _graph(self, start: int, end: int) -> None:
        for number, kind, first, last in self._fields(start, end, _GRAPH, "a graph"):
            if number == 1:
                self._node(*_inside(kind, first, last))
            elif number == 5:
                self._tensor(*_inside(kind, first, last))

    def _node(self, start: int, end: int) -> None:
        operators, domain, attributes = [], "", []
        for number, kind, first, last in self._fields(start, end, _NODE, "a node"):
            if number in (4, 5, 7):
                first, last = _inside(kind, first, last)
                text = self._data[first : min(last, first + 40)].decode("ascii", "replace")
                if number == 4:
                    operators.append(text)
                elif number == 7:
                    domain = text
                else:
                    attributes.append((first, last))
        trees = domain == _TREES_DOMAIN and operators == [_TREES]
        if not trees and domain not in _OURS:
            raise _bad(f"an operator of {domain!r}")
        if not trees and (len(operators) != 1 or operators[0] not in OPERATORS):
            raise _bad(f"the operator {' and '.join(map(repr, operators)) or 'without a name'}")
        for first, last in attributes:
            self._attribute(first, last, _LISTS if trees else _NO_LISTS)

    def _attribute(self, start: int, end: int, lists: Lists) -> None:
        known = _ATTRIBUTE - {7, 8, 9} if lists else _ATTRIBUTE
        for number, kind, first, last in self._fields(start, end, known, "an attribute", lists):
            if number in (5, 10):
                self._tensor(*_inside(kind, first, last))

    def _tensor(self, start: int, end: int) -> None:
        for number, kind, first, _ in self._fields(start, end, _TENSOR | {14}, "a tensor"):
            if number == 14 and (kind != _VARINT or first != 0):
                raise _bad("numbers kept in another file")

    def _fields(
        self, at: int, end: int, known: frozenset[int], what: str, lists: Lists = _NO_LISTS
    ) -> Iterator[Field]:
        """Yield the fields of a message, each of which must be known; lists are stepped over."""
        while at < end:
            self._left -= 1
            if self._left < 0:
                raise _bad(f"more than {_MOST_FIELDS:,} parts")
            entries = lists.get(self._data[at])
            if entries is not None:
                entry = entries.match(self._data, at, end)
                if entry is None or entry.end() == at:
                    raise _bad("a forest whose nodes have other numbers or kinds")
                at = entry.end()
                continue
            tag, at = self._varint(at, end)
            number, kind = tag >> 3, tag & 7
            if number not in known:
                raise _bad(f"{what} with the field {number}: another file, a loop or a branch")
            if kind == _VARINT:
                value, at = self._varint(at, end)
                yield number, kind, value, at
                continue
            if kind == _BYTES:
                length, at = self._varint(at, end)
            elif kind in (_EIGHT, _FOUR):
                length = 8 if kind == _EIGHT else 4
            else:
                raise _bad("no ONNX model")
            if length > end - at:
                raise _bad("no ONNX model, or one cut short")
            yield number, kind, at, at + length
            at += length

    def _varint(self, at: int, end: int) -> tuple[int, int]:
        value = 0
        for shift in range(0, 70, 7):
            if at >= end:
                break
            byte = self._data[at]
            at += 1
            value |= (byte & 0x7F) << shift
            if byte < 0x80:
                return value, at
        raise _bad("no ONNX model, or one cut short")


def _inside(kind: int, start: int, end: int) -> tuple[int, int]:
    if kind != _BYTES:
        raise _bad("no ONNX model")
    return start, end


def _bad(got: str) -> BadBundle:
    return BadBundle(
        "a model as taxel exports it, a fixed calculation on its own numbers", got,
        "write the bundle again with this version of taxel",
    )  # fmt: skip
