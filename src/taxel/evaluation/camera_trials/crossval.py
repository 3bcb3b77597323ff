"""How well camera trials are recognised, beside what is trivial: a forest, length, first frame.

A label holds for a whole trial, whose length may predict it too: crops have a fixed length and
place, and controls that see only the length or the first frame are judged on the same sides.
Nothing is chosen on a test trial. Knows nothing about images, files or screens.

Background of our choices: docs/decisions/0041.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from taxel.evaluation.camera_trials.sides import TrialSplit
from taxel.evaluation.intervals import draw_rows, percentile_interval
from taxel.evaluation.rank_area import area
from taxel.evaluation.run_scores import reliability
from taxel.training.camera_trials.blend import (
    TrialBlend,
    fit_blend,
    forest,
    mean_of_crops,
    proba_of,
)
from taxel.training.camera_trials.features import TrialRows
from taxel.training.camera_trials.learning import Crops, Learning
from taxel.training.camera_trials.weights import log_loss
from taxel.windows.trial_crops import BAR as BAR_COLUMNS
from taxel.windows.trial_crops import THUMB, Layout, numbers_of

Rows = NDArray[np.float32]
Probabilities = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialSet:
    """Labelled camera trials, cut and looked at."""

    target: str
    classes: tuple[str, ...]
    y: NDArray[np.intp]
    """Shape (trials,): index into `classes`."""
    names: tuple[str, ...]
    groups: tuple[Mapping[str, str], ...]
    lengths: NDArray[np.intp]
    """Shape (trials,): frames."""
    cameras: int
    layout: Layout
    cut: TrialRows
    further: Crops | None = None
    """Crops that are only learned from."""

    @property
    def widths(self) -> dict[str, int]:
        """View → numbers a crop."""
        return {name: rows.shape[1] for name, rows in self.cut.rows.items()}

    @property
    def rows(self) -> Rows:
        """Shape (n, columns): all views side by side."""
        return np.concatenate(list(self.cut.rows.values()), axis=1)

    def learning(self, rows: Rows, group: str, further: Crops | None = None) -> Learning:
        """Return all crops with these rows; trials that lack the group stand alone."""
        values = [own.get(group, f"trial {i}") for i, own in enumerate(self.groups)]
        return Learning(rows, self.cut.trial, self.y, np.array(values), len(self.classes), further)


class TrialModel(Protocol):
    """What learns classes from crops."""

    def fit(self, learning: Learning) -> None:
        """Learn; nothing else is looked at."""
        ...

    def crops(self, rows: Rows) -> Probabilities:
        """Return shape (n, classes)."""
        ...

    def trials(self, rows: Rows, trial: NDArray[np.intp]) -> Probabilities:
        """Return shape (trials, classes)."""
        ...


class Plain:
    """A scikit-learn classifier; a trial has the mean of its crops' probabilities."""

    def __init__(self, model: Any) -> None:
        self._model, self._classes = model, 0

    def fit(self, learning: Learning) -> None:
        self._classes = learning.classes
        self._model.fit(learning.rows, learning.y[learning.trial])

    def crops(self, rows: Rows) -> Probabilities:
        return proba_of(self._model, rows, self._classes)

    def trials(self, rows: Rows, trial: NDArray[np.intp]) -> Probabilities:
        return mean_of_crops(self.crops(rows), trial)


class Majority:
    """Gives each class's share among what it learned from, whatever it is shown."""

    def __init__(self) -> None:
        self._shares = np.zeros(0)

    def fit(self, learning: Learning) -> None:
        self._shares = np.bincount(learning.y, minlength=learning.classes) / len(learning.y)

    def crops(self, rows: Rows) -> Probabilities:
        return np.tile(self._shares, (len(rows), 1))

    def trials(self, rows: Rows, trial: NDArray[np.intp]) -> Probabilities:
        return np.tile(self._shares, (int(trial.max()) + 1, 1))


class Blended:
    """The default recogniser, weighed anew by inner folds of each training side."""

    def __init__(
        self, cameras: int, widths: Mapping[str, int], seed: int, on_step: Callable[[str], None]
    ) -> None:
        self._make = cameras, widths, seed
        self._on_step = on_step
        self.blend: TrialBlend | None = None

    def fit(self, learning: Learning) -> None:
        cameras, widths, seed = self._make
        self.blend = fit_blend(learning, cameras, widths, seed, on_step=self._on_step)

    def crops(self, rows: Rows) -> Probabilities:
        assert self.blend is not None
        return self.blend.crops(rows)

    def trials(self, rows: Rows, trial: NDArray[np.intp]) -> Probabilities:
        assert self.blend is not None
        return self.blend.trials(rows, trial)


@dataclass(frozen=True, slots=True, kw_only=True)
class Contender:
    """A model and what it sees."""

    name: str
    rows: Callable[[TrialSet], Rows]
    model: Callable[[TrialSet, int, Callable[[str], None]], TrialModel]
    further: Callable[[TrialSet], Crops | None] = lambda _: None
    """Further crops that it learns from; none unless given."""
    leaks: str = ""
    """In what way it knows something else than what happens in the crop; empty for none."""


OURS: Final = Contender(
    name="taxel",
    rows=lambda trials: trials.rows,
    model=lambda trials, seed, step: Blended(trials.cameras, trials.widths, seed, step),
    further=lambda trials: trials.further,
)
BAR: Final = Contender(
    name="bar: random forest on grey differences",
    rows=lambda trials: trials.cut.rows["pixels"][
        :, numbers_of("pixels", BAR_COLUMNS, trials.cameras)
    ],
    model=lambda _, seed, __: Plain(forest(seed)),
)
_LENGTH: Final = Contender(
    name="control: the trial's length",
    rows=lambda trials: np.asarray(trials.lengths[trials.cut.trial], np.float32)[:, None],
    model=lambda _, seed, __: Plain(forest(seed)),
    leaks="sees no image",
)
_CROP_FRAME: Final = Contender(
    name="control: the crop's first frame, 8×6 grey",
    rows=lambda trials: thumbs(trials),
    model=lambda _, seed, __: Plain(forest(seed)),
    leaks="sees no movement; in a later crop something may have begun",
)
_FIRST_FRAME: Final = Contender(
    name="control: the trial's first frame, 8×6 grey",
    rows=lambda trials: thumbs(trials)[np.flatnonzero(trials.cut.place == 0)[trials.cut.trial]],
    model=lambda _, seed, __: Plain(forest(seed)),
    leaks="sees no movement",
)
MAJORITY: Final = Contender(
    name="control: the commonest class",
    rows=lambda trials: np.zeros((len(trials.cut.trial), 1), np.float32),
    model=lambda _, __, ___: Majority(),
    leaks="sees nothing",
)


def thumbs(trials: TrialSet) -> Rows:
    """Return each crop's first frame, shape (n, cameras · 48), 8×6 grey."""
    first = trials.cut.shown["stills"][:, 0, :, : THUMB[0] * THUMB[1]]
    return np.ascontiguousarray(first.reshape(len(first), -1))


def nothing_moves(trials: TrialSet) -> bool:
    """Return whether all frames of each crop are alike, so that the bar has nothing to see."""
    return not BAR.rows(trials).any()


def rival(trials: TrialSet, results: Sequence[TrialResult]) -> TrialResult:
    """Return what the recogniser is compared with: the bar, or a still where nothing moves.

    Args:
        trials: What was judged.
        results: As `contenders_for` orders them.
    """
    name = _FIRST_FRAME.name if nothing_moves(trials) else BAR.name
    return next((result for result in results if result.name == name), results[1])


def contenders_for(trials: TrialSet) -> tuple[Contender, ...]:
    """Return what is judged, ours and the bar first; a control that cannot differ is left out."""
    found = [OURS, BAR]
    if len(set(trials.lengths.tolist())) > 1:
        found.append(_LENGTH)
    if trials.layout.places > 1:
        found.append(_CROP_FRAME)
    return (*found, _FIRST_FRAME, MAJORITY)


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraTrialScores:
    """Scores of some tested trials; all but the loss are 0…1."""

    trials: int
    accuracy: float
    accuracy_interval: tuple[float, float]
    """95 %, whole groups resampled."""
    balanced: float
    """Mean of the classes' recalls."""
    auc: float
    """One class against the rest, mean over classes; NaN where a class is absent."""
    auc_interval: tuple[float, float]
    loss: float
    """Mean log-loss, nats."""
    calibration_error: float
    """Expected, over ten bins of confidence."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialResult:
    """How one contender does on trials that it has not learned from."""

    name: str
    leaks: str
    whole: CameraTrialScores
    """By trial, all its crops together."""
    places: tuple[CameraTrialScores, ...]
    """By one crop alone, in the order of `PLACES`; empty where there is one only."""
    probabilities: Probabilities
    """Shape (trials, classes); NaN where a trial was never tested."""


@dataclass(frozen=True, slots=True)
class Difference:
    """Ours less another contender's, on the same trials; intervals 95 %, groups resampled."""

    other: str
    accuracy: float
    accuracy_interval: tuple[float, float]
    auc: float
    auc_interval: tuple[float, float]
    loss: float
    loss_interval: tuple[float, float]


def judge_trials(
    trials: TrialSet,
    split: TrialSplit,
    seed: int,
    contenders: Sequence[Contender],
    on_step: Callable[[str], None] = lambda line: None,
) -> list[TrialResult]:
    """Judge contenders on each side's test trials.

    Args:
        trials: The trials.
        split: Which are learned from and which tested on.
        seed: Of the models and inner folds.
        contenders: What to judge.
        on_step: Called with a line before each fit.
    """
    return [_judge(trials, split, seed, contender, on_step) for contender in contenders]


def _judge(
    trials: TrialSet,
    split: TrialSplit,
    seed: int,
    contender: Contender,
    on_step: Callable[[str], None],
) -> TrialResult:
    learning = trials.learning(contender.rows(trials), split.group, contender.further(trials))
    crops = np.full((len(trials.cut.trial), learning.classes), np.nan)
    whole = np.full((len(trials.y), learning.classes), np.nan)
    for fold in split.folds:
        label = f"{contender.name}, {fold.name}"
        on_step(label)
        model = contender.model(trials, seed, lambda line, label=label: on_step(f"{label}, {line}"))  # type: ignore[misc]
        model.fit(learning.part(fold.train_rows))
        test = learning.part(fold.test_rows)
        crops[np.isin(trials.cut.trial, fold.test_rows)] = model.crops(test.rows)
        whole[fold.test_rows] = model.trials(test.rows, test.trial)
    tested = np.flatnonzero(np.isfinite(whole[:, 0]))
    groups, places = learning.groups, []
    if trials.layout.places > 1:
        for place in range(trials.layout.places):
            own = crops[trials.cut.place == place][tested]
            places.append(score_trials(trials.y[tested], own, groups[tested]))
    return TrialResult(
        name=contender.name,
        leaks=contender.leaks,
        whole=score_trials(trials.y[tested], whole[tested], groups[tested]),
        places=tuple(places),
        probabilities=whole,
    )


def score_trials(
    y: NDArray[np.intp], probabilities: Probabilities, groups: NDArray[np.str_], seed: int = 0
) -> CameraTrialScores:
    """Return scores of probabilities, shape (n, classes), against classes, shape (n,)."""
    right = probabilities.argmax(axis=1) == y
    drawn = draw_rows(groups, seed)
    bins = reliability(probabilities, right)
    return CameraTrialScores(
        trials=len(y),
        accuracy=float(right.mean()),
        accuracy_interval=percentile_interval([float(right[d].mean()) for d in drawn]),
        balanced=float(np.mean([right[y == kind].mean() for kind in np.unique(y)])),
        auc=area(y, probabilities),
        auc_interval=percentile_interval([area(y[d], probabilities[d]) for d in drawn]),
        loss=log_loss(probabilities, y),
        calibration_error=sum(b.windows * abs(b.confidence - b.accuracy) for b in bins) / len(y),
    )


def difference(
    trials: TrialSet, split: TrialSplit, ours: TrialResult, other: TrialResult, seed: int = 0
) -> Difference:
    """Return how much better ours is, on the trials that both were tested on."""
    both = np.isfinite(ours.probabilities[:, 0]) & np.isfinite(other.probabilities[:, 0])
    y, groups = trials.y[both], trials.learning(trials.rows, split.group).groups[both]
    mine, others = ours.probabilities[both], other.probabilities[both]
    drawn = draw_rows(groups, seed)

    def compared(
        measure: Callable[[NDArray[np.intp], Probabilities], float],
    ) -> tuple[float, tuple[float, float]]:
        found = [measure(y[d], mine[d]) - measure(y[d], others[d]) for d in drawn]
        return measure(y, mine) - measure(y, others), percentile_interval(found)

    accuracy, auc, loss = compared(_accuracy), compared(area), compared(_loss)
    return Difference(other.name, *accuracy, *auc, *loss)


def by_group(
    trials: TrialSet, split: TrialSplit, result: TrialResult
) -> dict[str, tuple[int, int]]:
    """Return each group's right and tested trials, fewest right first."""
    groups = trials.learning(trials.rows, split.group).groups
    tested = np.isfinite(result.probabilities[:, 0])
    right = tested & (result.probabilities.argmax(axis=1) == trials.y)
    counts = {
        str(name): (int(right[groups == name].sum()), int(tested[groups == name].sum()))
        for name in np.unique(groups[tested])
    }
    return dict(sorted(counts.items(), key=lambda item: item[1][0] / item[1][1]))


def _accuracy(y: NDArray[np.intp], probabilities: Probabilities) -> float:
    return float((probabilities.argmax(axis=1) == y).mean())


def _loss(y: NDArray[np.intp], probabilities: Probabilities) -> float:
    return log_loss(probabilities, y)
