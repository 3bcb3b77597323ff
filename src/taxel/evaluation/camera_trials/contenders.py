"""What is judged on camera trials: the default recogniser, bars to exceed, trivial controls.

Bars are simple methods: two see change between frames, two how the frames look. A trial's length
may predict its label, and so may its first frame: controls see only these. Knows nothing about
sides of a split or scores.

Background of our choices: docs/decisions/0041.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray
from sklearn.neighbors import KNeighborsClassifier

from taxel.evaluation.camera_trials.trial_set import Rows, TrialSet, thumbs_of
from taxel.training.camera_trials.blend import TrialBlend, fit_blend, mean_of_crops, proba_of
from taxel.training.camera_trials.learning import Extras, Learning
from taxel.training.camera_trials.members import forest, learned
from taxel.windows.trial_crops import BAR as BAR_COLUMNS
from taxel.windows.trial_crops import THUMB, numbers_of
from taxel.windows.trial_picture import means_by_cell

Probabilities = NDArray[np.float64]
NEIGHBOURS: Final = 5
"""Source: scikit-learn's default."""


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
        learned(self._model, learning.rows, learning.y[learning.trial])

    def crops(self, rows: Rows) -> Probabilities:
        return proba_of(self._model, rows, self._classes)

    def trials(self, rows: Rows, trial: NDArray[np.intp]) -> Probabilities:
        return mean_of_crops(self.crops(rows), trial)


class Nearest:
    """The nearest learned crops vote, and each class that was learned has a share of one more vote.

    Rows are not standardised: all are grey levels, and cells that hardly change would count most.
    """

    def __init__(self) -> None:
        self._model, self._prior = KNeighborsClassifier(NEIGHBOURS), np.zeros(0)

    def fit(self, learning: Learning) -> None:
        votes = min(NEIGHBOURS, len(learning.rows))
        self._model = KNeighborsClassifier(votes).fit(learning.rows, learning.y[learning.trial])
        learned = np.bincount(learning.y, minlength=learning.classes) > 0
        self._prior = learned / learned.sum()

    def crops(self, rows: Rows) -> Probabilities:
        votes = self._model.n_neighbors
        shares = proba_of(self._model, rows, len(self._prior))
        return np.asarray((votes * shares + self._prior) / (votes + 1), np.float64)

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
    extras: Callable[[TrialSet], Extras] = lambda _: Extras()
    """What it also learns from; nothing unless given."""
    leaks: str = ""
    """In what way it knows something else than what happens in the crop; empty for none."""


OURS: Final = Contender(
    name="taxel",
    rows=lambda trials: trials.rows,
    model=lambda trials, seed, step: Blended(trials.cameras, trials.widths, seed, step),
    extras=lambda trials: trials.extras,
)
BAR: Final = Contender(
    name="bar: random forest on grey differences",
    rows=lambda trials: trials.cut.rows["pixels"][
        :, numbers_of("pixels", BAR_COLUMNS, trials.cameras)
    ],
    model=lambda _, seed, __: Plain(forest(seed)),
)
CHANGES_BAR: Final = Contender(
    name="bar: random forest on 8×6 changes",
    rows=lambda trials: changes(trials),
    model=lambda _, seed, __: Plain(forest(seed)),
)
PICTURE_BAR: Final = Contender(
    name="bar: random forest on 8×8 colours",
    rows=lambda trials: colours(trials),
    model=lambda _, seed, __: Plain(forest(seed)),
)
NEAREST_BAR: Final = Contender(
    name="bar: five nearest neighbours in 8×8 colours",
    rows=lambda trials: colours(trials),
    model=lambda _, __, ___: Nearest(),
)
_LENGTH: Final = Contender(
    name="control: the trial's length",
    rows=lambda trials: np.asarray(trials.lengths[trials.cut.trial], np.float32)[:, None],
    model=lambda _, seed, __: Plain(forest(seed)),
    leaks="sees no image",
)
_CROP_FRAME: Final = Contender(
    name="control: the crop's first frame, 8×6 grey",
    rows=lambda trials: thumbs_of(trials.cut),
    model=lambda _, seed, __: Plain(forest(seed)),
    leaks="sees no movement; in a later crop something may have begun",
)
FIRST_FRAME: Final = Contender(
    name="control: the trial's first frame, 8×6 grey",
    rows=lambda trials: trials.first[trials.cut.trial],
    model=lambda _, seed, __: Plain(forest(seed)),
    leaks="sees no movement",
)
MAJORITY: Final = Contender(
    name="control: the commonest class",
    rows=lambda trials: np.zeros((len(trials.cut.trial), 1), np.float32),
    model=lambda _, __, ___: Majority(),
    leaks="sees nothing",
)


def changes(trials: TrialSet) -> Rows:
    """Return how each crop's middle and last frame differ from its first, 8×6 grey, with sign.

    Returns:
        Shape (n, 2 · cameras · 48).
    """
    looks = trials.cut.shown["stills"][..., : THUMB[0] * THUMB[1]]
    return np.ascontiguousarray((looks[:, 1:] - looks[:, :1]).reshape(len(looks), -1))


def colours(trials: TrialSet) -> Rows:
    """Return how each crop's first, middle and last frame look, means of colour in 8×8 cells.

    Of a crop of a single image there is one frame only.

    Returns:
        Shape (n, frames · cameras · 192), grey levels, 0…255.
    """
    means = means_by_cell(trials.cut.shown["picture"])
    kept = means[:, :1] if trials.layout.crop == 1 else means
    return np.ascontiguousarray(kept.reshape(len(kept), -1))


def nothing_moves(trials: TrialSet) -> bool:
    """Return whether all frames of each crop are alike: forests on change have nothing to see."""
    return not BAR.rows(trials).any()


def contenders_for(trials: TrialSet) -> tuple[Contender, ...]:
    """Return what is judged, ours and the bars first.

    Forests on change are left out where nothing moves, and so are controls that cannot differ.
    """
    found = [OURS, *(() if nothing_moves(trials) else (BAR, CHANGES_BAR))]
    found += [PICTURE_BAR, NEAREST_BAR]
    if len(set(trials.lengths.tolist())) > 1:
        found.append(_LENGTH)
    if trials.layout.places > 1:
        found.append(_CROP_FRAME)
    return (*found, FIRST_FRAME, MAJORITY)
