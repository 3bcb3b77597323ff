"""Heads that turn slip's features into how likely gross slip is to follow, and their ONNX.

Each learns from rows of whole training cups, whose first columns are
`taxel.gel.slip_signal.PAIR_FEATURES`. Knows
nothing about images, thresholds or test cups.

Source: docs/decisions/0036.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal, Protocol

import numpy as np
from numpy.typing import NDArray
from sklearn.ensemble import HistGradientBoostingClassifier, HistGradientBoostingRegressor
from sklearn.linear_model import LogisticRegression

from taxel.errors import BadInput
from taxel.gel.slip_signal import PAIR_FEATURES, pair_features
from taxel.sim.pour.cup_pour import Gel
from taxel.training.slip.cups import GROSS_UM, PourRows, is_learned_from
from taxel.training.slip.onnx_graph import SMALLEST_SHARE, forecast_model, slip_model, trees_model

Rows = NDArray[np.float32]
HeadName = Literal["forecast", "boosting", "logistic"]
Goal = Literal[
    "slip in 0.5 s", "slip in 0.75 s", "slip in 0.5 or 1 s", "within 1 s", "ever", "within 0.5 s"
]
"""What a row is labelled by: the largest slip until one or two times later, or whether gross slip
comes within a time, or at any time in this grasp."""

SLIPS_S: Final[dict[Goal, tuple[float, ...]]] = {
    "slip in 0.5 s": (0.5,), "slip in 0.75 s": (0.75,), "slip in 0.5 or 1 s": (0.5, 1.0),
}  # fmt: skip
"""Goals of a forecast → how far ahead it looks, seconds."""
WITHIN_S: Final[dict[Goal, float]] = {"within 1 s": 1.0, "within 0.5 s": 0.5, "ever": np.inf}
"""Goals of yes or no → how far ahead, seconds."""
USUAL_GOALS: Final[dict[HeadName, Goal]] = {
    "forecast": "slip in 0.5 or 1 s", "boosting": "within 1 s", "logistic": "within 1 s",
}  # fmt: skip
"""What each head learns unless another goal is asked for. Source: docs/decisions/0036."""
FURTHER_LESS: Final = 0.65
"""By how much the logarithm of a second forecast, further ahead, is lowered before the larger of
both counts. Source: training cups, docs/decisions/0036."""
LAYERS_LESS: Final = 0.03
"""By how much the logarithm of slip is lowered in labels of gels that shear as layers, where both
versions are learned from: one threshold then suits either. Source: training cups,
docs/decisions/0037."""
_AFTER_S: Final = 0.1
"""How long after the event rows are still learned from, seconds."""
_NEAR_S: Final = 0.8
"""Rows of this last stretch before an event count `_NEAR_TIMES`: there the warning is due."""
_NEAR_TIMES: Final = 3.0
_SETTLED_S: Final = 0.4
_THIN: Final = 3
"""Of a pour that holds every third row is learned from, and counts three times."""
_BOOSTING: Final[dict[str, Any]] = {
    "learning_rate": 0.06, "max_iter": 140, "max_leaf_nodes": 16, "min_samples_leaf": 60,
    "l2_regularization": 1.0, "early_stopping": False,
}  # fmt: skip
"""Of both kinds of trees. Source: docs/decisions/0036."""
_PENALTY_C: Final = 0.3
_FORECAST_UM: Final = (20.0, 1000.0)
"""Range of slip that a forecast resolves, micrometres: below is noise, above all is lost."""
_STEEPNESS: Final = 4.0
"""By how much a forecast's logit grows as the slip grows e-fold. Source: our choice: 0.6 mm, twice
gross slip, gives 0.94."""
_SLIP_MM: Final = "slip_mean"
"""The slip that is there, mean of both gels, millimetres."""
_SURE_MM: Final = GROSS_UM / 1000
"""Slip that is there from which on gross slip is forecast whatever the trees say, millimetres.
Source: our choice, docs/decisions/0036: a threshold of 0.82 then answers to 0.44 mm."""


@dataclass(frozen=True, slots=True)
class PourFeatures:
    """One pour as a head sees it."""

    pour: PourRows
    rows: Rows
    """Shape (n, 66), with `RIM_FEATURES` (n, 74), with `RING_FEATURES` too (n, 92)."""
    at: NDArray[np.int64]
    """Shape (moments,): the row that each moment of the video sees."""
    gel: Gel = 1
    """How the gels shear: 1, as rigid pieces; 2, as elastic layers."""

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
) -> tuple[Rows, NDArray[Any], NDArray[np.float64]]:
    """Return rows to learn from, their labels and how much each counts.

    Args:
        pours: Of training cups; those that are not learned from are left out. Where gels of both
            versions are among them, a forecast's labels are lowered by `LAYERS_LESS` on layers.
        goal: What a row is labelled by.

    Returns:
        Shapes (n, columns), (n,) and (n,). A label is 0 or 1; of the goals "slip in …" labels have
        shape (n, times): the natural logarithm of the largest slip until then over gross slip.
    """
    rows, labels, weights = [], [], []
    both = goal in SLIPS_S and len({found.gel for found in pours}) > 1
    for found in pours:
        if not is_learned_from(found.pour):
            continue
        time_s = found.row_s()
        event_s = found.pour.first_s(GROSS_UM)
        used = time_s >= _SETTLED_S
        weight = np.ones(len(time_s))
        if event_s is None:
            used &= np.arange(len(time_s)) % _THIN == found.pour.run.seed % _THIN
            weight *= _THIN
        else:
            used &= time_s <= event_s + _AFTER_S
            weight[(event_s - time_s <= _NEAR_S) & (time_s <= event_s)] = _NEAR_TIMES
        rows.append(found.rows[used])
        lowered = LAYERS_LESS if both and found.gel == 2 else 0
        labels.append(_labels(found.pour, time_s, goal)[used] - lowered)
        weights.append(weight[used])
    return np.concatenate(rows), np.concatenate(labels), np.concatenate(weights)


def _labels(pour: PourRows, time_s: NDArray[np.float64], goal: Goal) -> NDArray[Any]:
    """Return the label of each row, shape (n,), or of a forecast (n, times)."""
    if goal in SLIPS_S:
        lowest, highest = _FORECAST_UM
        slip = np.clip(np.where(pour.dropped, highest, pour.slip_um), lowest, highest)
        later = np.searchsorted(pour.time_s, time_s[:, None] + SLIPS_S[goal])
        largest = np.maximum.accumulate(slip)[np.minimum(later, len(slip) - 1)]
        return np.asarray(np.log(largest / GROSS_UM))
    event_s = pour.first_s(GROSS_UM)
    due_s = np.inf if event_s is None else event_s
    return (due_s - time_s <= WITHIN_S[goal]).astype(np.intp) * (event_s is not None)


class SlipHead(Protocol):
    """What learns from rows and gives probabilities."""

    def fit(self, rows: Rows, labels: NDArray[Any], weights: NDArray[np.float64]) -> None:
        """Learn from shape (n, columns), `learning_rows`'s labels, and weights, shape (n,)."""
        ...

    def probability(self, rows: Rows) -> NDArray[np.float32]:
        """Return the probability that gross slip follows, shape (n,).

        Columns after those that were learned from are not looked at.
        """
        ...

    def to_onnx(self) -> bytes:
        """Return a model: features (n, 1, 1, columns) → probability (n,)."""
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
    if name == "forecast":
        return ForecastHead(seed)
    raise BadInput("a head among forecast, boosting, logistic", repr(name), "choose one of them")


class LogisticHead:
    """Logistic regression on each feature's signed square root."""

    def __init__(self) -> None:
        self._mean, self._scale = np.zeros(0), np.zeros(0)
        self._slope, self._level = np.zeros(0), 0.0

    def fit(self, rows: Rows, labels: NDArray[Any], weights: NDArray[np.float64]) -> None:
        root = _signed_root(rows).astype(np.float64)
        self._mean, self._scale = root.mean(axis=0), np.maximum(root.std(axis=0), 1e-6)
        model = LogisticRegression(C=_PENALTY_C, max_iter=400)
        model.fit((root - self._mean) / self._scale, labels, sample_weight=weights)
        self._slope, self._level = model.coef_[0], float(model.intercept_[0])

    def probability(self, rows: Rows) -> NDArray[np.float32]:
        rows = rows[:, : len(self._slope)]
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
        return slip_model(nodes, {"slope": slope, "level": np.array([level])}, len(slope))


class BoostingHead:
    """Gradient-boosted trees.

    Args:
        seed: Of the binning's sample.
    """

    def __init__(self, seed: int = 0) -> None:
        self._model = HistGradientBoostingClassifier(**_BOOSTING, random_state=seed)

    def fit(self, rows: Rows, labels: NDArray[Any], weights: NDArray[np.float64]) -> None:
        self._model.fit(rows, labels, sample_weight=weights)

    def probability(self, rows: Rows) -> NDArray[np.float32]:
        known = rows[:, : self._model.n_features_in_]
        return np.asarray(self._model.predict_proba(known)[:, 1], np.float32)

    def to_onnx(self) -> bytes:
        return trees_model(self._model)


class ForecastHead:
    """Gradient-boosted trees that forecast how far the object will have slipped a little later.

    How far says more than whether: a grasp that slides 0.28 mm and holds is no counterexample to
    one that slides 0.32 mm. What it gives is no probability but a score of 0…1, which is one half
    where gross slip, 0.3 mm, is forecast.

    Where two times are learned, the larger forecast counts, that of the later time lowered by
    `FURTHER_LESS`: half a second ahead few slips are missed, a second ahead some are seen sooner.

    Slip that is there (mean of both gels) raises the score whatever is forecast. The trees learn
    from cups, which turn as they slip, and forecast nothing of an object that slides out straight.

    Args:
        seed: Of the binning's sample.
    """

    def __init__(self, seed: int = 0) -> None:
        self._seed = seed
        self._models: list[HistGradientBoostingRegressor] = []

    def fit(self, rows: Rows, labels: NDArray[Any], weights: NDArray[np.float64]) -> None:
        self._models = []
        for label in labels.T:
            model = HistGradientBoostingRegressor(**_BOOSTING, random_state=self._seed)
            self._models.append(model.fit(rows, label, sample_weight=weights))

    def slip_um(self, rows: Rows) -> NDArray[np.float64]:
        """Return the slip that is forecast, micrometres, shape (n,)."""
        return np.asarray(GROSS_UM * np.exp(self._forecast(rows)), np.float64)

    def probability(self, rows: Rows) -> NDArray[np.float32]:
        """Return the score, shape (n,)."""
        return np.asarray(1 / (1 + np.exp(-_STEEPNESS * self._forecast(rows))), np.float32)

    def to_onnx(self) -> bytes:
        return forecast_model(self._models, FURTHER_LESS, _STEEPNESS, least=(_SLIP_MM, _SURE_MM))

    def _forecast(self, rows: Rows) -> NDArray[np.float64]:
        """Return the logarithm of the forecast over gross slip, shape (n,)."""
        share = rows[:, PAIR_FEATURES.index(_SLIP_MM)] / _SURE_MM
        forecast = np.log(np.maximum(share, SMALLEST_SHARE))
        for place, model in enumerate(self._models):
            known = rows[:, : model.n_features_in_]
            forecast = np.maximum(forecast, model.predict(known) - FURTHER_LESS * place)
        return np.asarray(forecast, np.float64)


def _signed_root(rows: Rows) -> Rows:
    return np.asarray(np.sign(rows) * np.sqrt(np.abs(rows)), np.float32)
