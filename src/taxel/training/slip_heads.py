"""Heads that turn slip's features into how likely gross slip is to follow, and their ONNX.

Each learns from rows of `taxel.gel.slip_signal.PAIR_FEATURES` of whole training cups. Knows
nothing about images, thresholds or test cups.

Source: docs/decisions/0036.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal, Protocol

import numpy as np
from numpy.typing import NDArray
from sklearn.ensemble import HistGradientBoostingClassifier
from sklearn.linear_model import LogisticRegression

from taxel.errors import BadInput
from taxel.gel.slip_signal import PAIR_FEATURES, pair_features
from taxel.training.slip_cups import GROSS_UM, PourRows

Rows = NDArray[np.float32]
HeadName = Literal["logistic", "boosting"]
Goal = Literal["within 1 s", "ever", "within 0.5 s"]
"""What a row is labelled by: gross slip within a time, or at any time in this grasp."""

GOALS_S: Final[dict[Goal, float]] = {"within 1 s": 1.0, "within 0.5 s": 0.5, "ever": np.inf}
_AFTER_S: Final = 0.1
"""How long after the event rows are still learned from, seconds."""
_NEAR_S: Final = 0.8
"""Rows of this last stretch before an event count `_NEAR_TIMES`: there the warning is due."""
_NEAR_TIMES: Final = 3.0
_SETTLED_S: Final = 0.4
_THIN: Final = 3
"""Of a pour that holds every third row is learned from, and counts three times."""
_TREES, _LEAVES, _STEP = 140, 16, 0.06
_PENALTY_C: Final = 0.3
_OPSET: Final = 18


@dataclass(frozen=True, slots=True)
class PourFeatures:
    """One pour as a head sees it."""

    pour: PourRows
    rows: Rows
    """Shape (n, 66)."""
    at: NDArray[np.int64]
    """Shape (moments,): the row that each moment of the video sees."""

    @property
    def cup(self) -> int:
        """The cup's number."""
        return self.pour.run.cup.index

    def row_s(self) -> NDArray[np.float64]:
        """Return when each row begins to be seen, shape (n,), seconds."""
        first = np.searchsorted(self.at, np.arange(len(self.rows)))
        return np.asarray(self.pour.time_s[first])


def features_of(pour: PourRows) -> PourFeatures:
    """Return a pour's features, as a live monitor computes them."""
    rows, at = pair_features(
        [gel.taken_s for gel in pour.gels],
        [gel.object for gel in pour.gels],
        [gel.gel for gel in pour.gels],
        [gel.shown for gel in pour.gels],
    )
    return PourFeatures(pour, rows, at)


def learning_rows(
    pours: Sequence[PourFeatures], goal: Goal = "within 1 s"
) -> tuple[Rows, NDArray[np.intp], NDArray[np.float64]]:
    """Return rows to learn from, their labels and how much each counts.

    Args:
        pours: Of training cups.
        goal: What a row is labelled by.
    """
    rows, labels, weights = [], [], []
    for found in pours:
        time_s = found.row_s()
        event_s = found.pour.first_s(GROSS_UM)
        used = time_s >= _SETTLED_S
        label = np.zeros(len(time_s), np.intp)
        weight = np.ones(len(time_s))
        if event_s is None:
            used &= np.arange(len(time_s)) % _THIN == found.pour.run.seed % _THIN
            weight *= _THIN
        else:
            used &= (time_s <= event_s + _AFTER_S) & ~_unforeseeable(found, time_s, event_s)
            label[event_s - time_s <= GOALS_S[goal]] = 1
            weight[(event_s - time_s <= _NEAR_S) & (time_s <= event_s)] = _NEAR_TIMES
        rows.append(found.rows[used])
        labels.append(label[used])
        weights.append(weight[used])
    return np.concatenate(rows), np.concatenate(labels), np.concatenate(weights)


def _unforeseeable(
    found: PourFeatures, time_s: NDArray[np.float64], event_s: float
) -> NDArray[np.bool_]:
    """Return the rows before a push that makes the event: nothing in them shows it."""
    run = found.pour.run
    if run.bump_n <= 0 or event_s < run.bump_s:
        return np.zeros(len(time_s), np.bool_)
    return time_s < run.bump_s


class SlipHead(Protocol):
    """What learns from rows and gives probabilities."""

    def fit(self, rows: Rows, labels: NDArray[np.intp], weights: NDArray[np.float64]) -> None:
        """Learn from shape (n, 66), 0 or 1, and weights, shape (n,)."""
        ...

    def probability(self, rows: Rows) -> NDArray[np.float32]:
        """Return the probability that gross slip follows, shape (n,)."""
        ...

    def to_onnx(self) -> bytes:
        """Return a model: features (n, 1, 1, 66) → probability (n,)."""
        ...


def new_head(name: HeadName, seed: int = 0) -> SlipHead:
    """Return an untrained head.

    Raises:
        BadInput: There is none of that name.
    """
    if name == "logistic":
        return LogisticHead()
    if name == "boosting":
        return BoostingHead(seed)
    raise BadInput("a head among logistic, boosting", repr(name), "choose one of them")


class LogisticHead:
    """Logistic regression on each feature's signed square root."""

    def __init__(self) -> None:
        self._mean, self._scale = np.zeros(0), np.zeros(0)
        self._slope, self._level = np.zeros(0), 0.0

    def fit(self, rows: Rows, labels: NDArray[np.intp], weights: NDArray[np.float64]) -> None:
        root = _signed_root(rows).astype(np.float64)
        self._mean, self._scale = root.mean(axis=0), np.maximum(root.std(axis=0), 1e-6)
        model = LogisticRegression(C=_PENALTY_C, max_iter=400)
        model.fit((root - self._mean) / self._scale, labels, sample_weight=weights)
        self._slope, self._level = model.coef_[0], float(model.intercept_[0])

    def probability(self, rows: Rows) -> NDArray[np.float32]:
        logit = ((_signed_root(rows) - self._mean) / self._scale) @ self._slope + self._level
        return np.asarray(1 / (1 + np.exp(-logit)), np.float32)

    def to_onnx(self) -> bytes:
        from onnx import helper

        slope = self._slope / self._scale
        level = self._level - float(slope @ self._mean)
        nodes = [
            helper.make_node("Abs", ["rows"], ["size"]),
            helper.make_node("Sqrt", ["size"], ["root"]),
            helper.make_node("Sign", ["rows"], ["sign"]),
            helper.make_node("Mul", ["root", "sign"], ["signed"]),
            helper.make_node("MatMul", ["signed", "slope"], ["drive"]),
            helper.make_node("Add", ["drive", "level"], ["logit"]),
        ]
        return _model(nodes, {"slope": slope, "level": np.array([level])})


class BoostingHead:
    """Gradient-boosted trees.

    Args:
        seed: Of the binning's sample.
    """

    def __init__(self, seed: int = 0) -> None:
        self._model = HistGradientBoostingClassifier(
            learning_rate=_STEP, max_iter=_TREES, max_leaf_nodes=_LEAVES, min_samples_leaf=60,
            l2_regularization=1.0, early_stopping=False, random_state=seed,
        )  # fmt: skip

    def fit(self, rows: Rows, labels: NDArray[np.intp], weights: NDArray[np.float64]) -> None:
        self._model.fit(rows, labels, sample_weight=weights)

    def probability(self, rows: Rows) -> NDArray[np.float32]:
        return np.asarray(self._model.predict_proba(rows)[:, 1], np.float32)

    def to_onnx(self) -> bytes:
        """Return the trees as tables that are looked up level by level.

        ONNX has an operator for trees; a bundle holds plain ones only (docs/decisions/0033).
        """
        from onnx import helper

        tables, depth = _tables(self._model)
        nodes = [
            helper.make_node("Slice", ["rows", "zero", "one", "one"], ["first"]),
            helper.make_node("Equal", ["first", "first"], ["there"]),
            helper.make_node("Where", ["there", "root", "root"], ["place0"]),
        ]
        for level in range(depth):
            nodes += _level(f"place{level}", f"place{level + 1}")
        baseline = float(np.ravel(self._model._baseline_prediction)[0])
        nodes += [
            helper.make_node("Gather", ["value", f"place{depth}"], ["votes"]),
            helper.make_node("ReduceSum", ["votes", "one"], ["sum"], keepdims=0),
            helper.make_node("Add", ["sum", "baseline"], ["logit"]),
        ]
        constants = {"zero": np.array([0]), "one": np.array([1]), "baseline": np.array(baseline)}
        return _model(nodes, constants | tables)


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


def _tables(model: HistGradientBoostingClassifier) -> tuple[dict[str, NDArray[Any]], int]:
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
        columns: Weight of each feature, shape (66,).
    """
    from onnx import helper

    nodes = [
        helper.make_node("MatMul", ["rows", "columns"], ["sum"]),
        helper.make_node("Clip", ["sum", "none", "whole"], ["probability"]),
    ]
    constants = {"columns": columns, "none": np.array(0.0), "whole": np.array(1.0)}
    return _model(nodes, constants, sigmoid=False)


def _signed_root(rows: Rows) -> Rows:
    return np.asarray(np.sign(rows) * np.sqrt(np.abs(rows)), np.float32)


def _model(nodes: list[Any], constants: dict[str, NDArray[Any]], *, sigmoid: bool = True) -> bytes:
    """Return an ONNX model around nodes that turn `rows` (n, 66) into `logit` (n,)."""
    from onnx import TensorProto, helper, numpy_helper

    width = len(PAIR_FEATURES)
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
