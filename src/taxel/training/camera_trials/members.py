"""The models of which a blend of camera trials is made, and what each of them sees.

Knows nothing about images, folds or weights.

Source: docs/decisions/0041.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from sklearn.ensemble import ExtraTreesClassifier, RandomForestClassifier

from taxel.jobs.running import cores_here, width
from taxel.training.camera_trials.rank_sums import Logistic, Steady
from taxel.training.kept_warnings import warnings_kept
from taxel.windows.trial_crops import CHANGES, numbers_of

TREES: Final = 400
"""Of a forest that is kept. Source: our choice, decision 41."""
PLAIN: Final = ("picture", "miniature")
PART_OF_PLAIN: Final = 0.5
"""Kinds that see plain colours of single images of a crop, and what each of them counts beside
other kinds, before any trial is seen, where images change within a crop: both together as much as
one. Source: our choice, decision 41."""
SHARE_SEEN: Final = 0.3
MOST_SEEN: Final = 400
"""Share of the columns, and most of them, among which extremely randomised trees look for a split:
a few of a thousand are mostly those that say nothing. Source: our choice, decision 41."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialMember:
    """One model of the blend, and the views and columns it is given."""

    name: str
    views: Mapping[str, tuple[str, ...]]
    """View → its columns; all of them where none is named."""
    make: Callable[[int, int, int], Any]
    """Seed, number of trees and number of columns → a scikit-learn classifier."""
    prior: float = 1.0
    """How much of its kind's weight it has before any trial is seen, above 0."""
    mirrored: bool = False
    """Whether it learns from mirror images of the crops too; it is never asked about them."""
    further: bool = False
    """Whether it learns from further crops too, of which movement alone is kept: those between the
    places, and each camera alone."""

    shifted: bool = False
    """Whether it may learn from shifted copies of the crops too; inner folds decide."""

    @property
    def words(self) -> str:
        """Its name, and whether it learned from shifted copies."""
        return f"{self.name}{' with shifted copies' * self.shifted}"

    @property
    def kind(self) -> str:
        """What it sees: movement only, coarse changes of stills only, one of the plain picture, the
        miniature, the network and the touch encoder only, or look, all else.
        """
        if set(self.views) <= {"pixels", "slip"}:
            return "movement"
        if self.views == {"stills": CHANGES}:
            return "changes"
        (first, *others) = self.views
        alone = ("picture", "miniature", "network", "touch")
        return first if first in alone and not others else "look"

    def part(self, changing: bool) -> float:
        """Return what its kind counts before any trial is seen.

        Args:
            changing: Whether images change within a crop, as those of single images do not.
        """
        return PART_OF_PLAIN if changing and self.kind in PLAIN else 1.0

    def columns(self, cameras: int, widths: Mapping[str, int]) -> NDArray[np.intp]:
        """Return which columns of all views, side by side in their order, it sees."""
        starts = dict(zip(widths, np.cumsum([0, *widths.values()])[:-1], strict=True))
        each = [
            starts[view] + (numbers_of(view, names, cameras) if names else np.arange(widths[view]))
            for view, names in self.views.items()
        ]
        return np.asarray(np.concatenate(each), np.intp)


def learned(model: Any, rows: NDArray[np.float32], y: NDArray[np.intp]) -> Any:
    """Return a model that has learned from rows, shape (n, columns), and their classes, shape (n,).

    A forest's trees are grown side by side where an engine is in use; they are the same on any
    number of cores, and so are its answers: afterwards it is asked on one, for sums over threads
    would end in other digits each time.
    """
    if not isinstance(model, RandomForestClassifier | ExtraTreesClassifier):
        return model.fit(rows, y)
    model.n_jobs = min(width(), cores_here())
    with warnings_kept():
        model.fit(rows, y)
    model.n_jobs = 1
    return model


def forest(seed: int, trees: int | None = None) -> RandomForestClassifier:
    """Return a random forest, the bar's kind, of `TREES` trees unless given."""
    return RandomForestClassifier(trees or TREES, min_samples_leaf=2, random_state=seed, n_jobs=1)


def extra(seed: int, trees: int, width: int) -> ExtraTreesClassifier:
    """Return extremely randomised trees that look at enough of `width` columns for each split."""
    seen = max(math.isqrt(width), round(min(SHARE_SEEN * width, MOST_SEEN)))
    return ExtraTreesClassifier(
        trees, max_features=max(1, seen), min_samples_leaf=2, random_state=seed, n_jobs=1
    )


DIFFERENCES: Final = ("step", "since", "lagged")
SLIP_PARTS: Final = (
    "slip_mm", "slip_rate_mm_s", "gel", "slip_over_gel", "slip_rate_8", "gel_rate_8",
    "slip_rate_4", "gel_rate_4", "slip_turn", "readiness_8",
)  # fmt: skip
"""What members see of the slip signal. Source: our choice, before any score, decision 41."""
EVERYTHING: Final[Mapping[str, tuple[str, ...]]] = {"pixels": (), "slip": (), "stills": ()}
MEMBERS: Final[tuple[TrialMember, ...]] = (
    TrialMember(
        name="forest on differences", views={"pixels": DIFFERENCES},
        make=lambda seed, trees, width: forest(seed, trees), prior=1.5, further=True,
    ),
    TrialMember(
        name="logistic on differences", views={"pixels": DIFFERENCES},
        make=lambda seed, trees, width: Logistic(0.1), further=True,
    ),
    TrialMember(
        name="discriminant on differences and slip",
        views={"pixels": DIFFERENCES, "slip": SLIP_PARTS},
        make=lambda seed, trees, width: Steady(0.5), further=True,
    ),
    TrialMember(
        name="extra-trees on changes", views={"stills": CHANGES}, make=extra, mirrored=True
    ),
    TrialMember(
        name="extra-trees on everything", views=EVERYTHING, make=extra, mirrored=True,
        shifted=True,
    ),
    TrialMember(name="extra-trees on stills", views={"stills": ()}, make=extra, shifted=True),
    TrialMember(
        name="discriminant on everything", views=EVERYTHING,
        make=lambda seed, trees, width: Steady(0.5), mirrored=True, shifted=True,
    ),
    TrialMember(
        name="extra-trees on the picture", views={"picture": ()}, make=extra, shifted=True
    ),
    TrialMember(
        name="discriminant on the picture", views={"picture": ()},
        make=lambda seed, trees, width: Steady(0.5), shifted=True,
    ),
    TrialMember(
        name="extra-trees on the miniature", views={"miniature": ()}, make=extra, shifted=True
    ),
    TrialMember(
        name="discriminant on the miniature", views={"miniature": ()},
        make=lambda seed, trees, width: Steady(0.5), shifted=True,
    ),
    TrialMember(
        name="discriminant on the image network", views={"network": ()},
        make=lambda seed, trees, width: Steady(0.5),
    ),
    TrialMember(
        name="logistic on the touch encoder", views={"touch": ()},
        make=lambda seed, trees, width: Logistic(0.001),
    ),
)  # fmt: skip
"""What is blended. The forest, as the bar is, counts more: on objects apart it is often best.
Source: docs/decisions/0041, also for each C and the share of shrinking."""
