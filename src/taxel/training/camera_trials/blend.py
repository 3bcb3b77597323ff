"""A recogniser of camera trials: several models on several views, weighed by inner folds.

Forests, sums of ranks and discriminants see grey differences, flow, the slip signal, stills, a
plain picture or what an image network sees; the weight of each comes from trials of groups that it
was not fitted on, as does the mean's sharpness. Knows nothing about images, files or outer folds.

Source: docs/decisions/0041.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from sklearn.ensemble import ExtraTreesClassifier, RandomForestClassifier

from taxel.training.camera_trials.inner_folds import HeldOut, Parts, held_out_parts
from taxel.training.camera_trials.learning import Crops, Learning, Rows
from taxel.training.camera_trials.member_weights import (
    log_loss,
    sharpen,
    sharpened,
    trusted,
    weigh,
    weigh_places,
)
from taxel.training.camera_trials.novelty import (
    Novelty,
    held_out_novelty,
    novelty_columns,
    novelty_threshold,
)
from taxel.training.camera_trials.rank_sums import Logistic, Steady
from taxel.windows.trial_crops import numbers_of
from taxel.windows.trial_mirrors import Mirror, mirrors

TREES: Final = 400
INNER_TREES: Final = 150
"""Of a forest that is kept, and of one on an inner fold. Source: our choice, decision 41."""
SHARE_SEEN: Final = 0.3
MOST_SEEN: Final = 400
"""Share of the columns, and most of them, among which extremely randomised trees look for a split:
a few of a thousand are mostly those that say nothing. Source: our choice, decision 41."""
MOST_NUMBERS: Final = 18_000_000
"""Of all forests that are kept, four a node and one a class: beyond it they have fewer trees, so
that a bundle with an image network of 7 MB stays within some 20 MB. Source: 16 bytes a node of 22
classes, packed; decision 41."""
LEAST_WEIGHT: Final = 0.04
"""A member below it is left out. Source: our choice."""


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
        """What it sees: movement only, one of the plain picture, the network and the touch encoder
        only, or look, all else.
        """
        if set(self.views) <= {"pixels", "slip"}:
            return "movement"
        (first, *others) = self.views
        return first if first in ("picture", "network", "touch") and not others else "look"

    def columns(self, cameras: int, widths: Mapping[str, int]) -> NDArray[np.intp]:
        """Return which columns of all views, side by side in their order, it sees."""
        starts = dict(zip(widths, np.cumsum([0, *widths.values()])[:-1], strict=True))
        each = [
            starts[view] + (numbers_of(view, names, cameras) if names else np.arange(widths[view]))
            for view, names in self.views.items()
        ]
        return np.asarray(np.concatenate(each), np.intp)


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


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialBlend:
    """Fitted members with their weights."""

    members: tuple[TrialMember, ...]
    fitted: tuple[Any, ...]
    columns: tuple[NDArray[np.intp], ...]
    weights: NDArray[np.float64]
    """Shape (members,), summing to 1."""
    places: NDArray[np.float64]
    """Shape (places,), summing to 1: what each of a trial's crops counts in its mean."""
    sharpness: float
    """Power to which a trial's mean probabilities are raised."""
    classes: int
    inner: Mapping[str, float]
    """Member → log-loss on inner folds; "blend" too. Empty where nothing could be held out."""
    novelty: Novelty
    threshold: float
    """A trial whose mean novelty is above it is unlike what was learned."""

    def crops(self, rows: Rows) -> NDArray[np.float64]:
        """Return the members' weighted mean, shape (n, classes), of crops."""
        each = [
            weight * proba_of(model, rows[:, columns], self.classes)
            for model, columns, weight in zip(self.fitted, self.columns, self.weights, strict=True)
        ]
        return np.asarray(np.sum(each, axis=0), np.float64)

    def trials(self, rows: Rows, trial: NDArray[np.intp]) -> NDArray[np.float64]:
        """Return shape (trials, classes), of whole trials."""
        each = by_place(self.crops(rows), trial)
        return sharpened(np.einsum("tpc,p->tc", each, self.places), self.sharpness)


def fit_blend(
    learning: Learning,
    cameras: int,
    widths: Mapping[str, int],
    seed: int,
    members: Sequence[TrialMember] = MEMBERS,
    on_step: Callable[[str], None] = lambda line: None,
) -> TrialBlend:
    """Fit members, weigh them by inner folds over groups, and set when a trial is unknown.

    Args:
        learning: What to learn from; nothing else is looked at.
        cameras: How many there are.
        widths: View → numbers a crop, in the order in which they stand in `learning.rows`.
        seed: Of folds and members.
        members: What to blend; those whose views are not there are left out.
        on_step: Called with a line before each fit.
    """
    seen = [member for member in members if set(member.views) <= set(widths)]
    members = [way for member in seen for way in _ways(member, learning)]
    columns = [member.columns(cameras, widths) for member in members]
    images = mirrors(widths, cameras)
    novel = novelty_columns(widths)
    held = held_out_parts(learning.y, learning.groups, learning.order, seed)
    held_out, trial = _held_out(learning, members, columns, images, seed, held, on_step)
    novelty = _novelty_held_out(learning, held.parts, novel)
    y = learning.y[trial]
    mean = held_out.mean(axis=1)
    losses = [log_loss(mean[:, i], y) if len(y) else 0.0 for i in range(len(members))]
    better = _better(members, losses)
    held_out, losses = held_out[:, :, better], [losses[i] for i in better]
    members, columns = [members[i] for i in better], [columns[i] for i in better]
    prior = np.array([member.prior for member in members])
    weights = prior / prior.sum()
    each_place, held_out = held_out, held_out.mean(axis=1)
    places = np.full(each_place.shape[1], 1 / each_place.shape[1])
    sharpness, inner = 1.0, {}
    if len(y):
        kinds = np.array([member.kind for member in members])
        groups = len(set(learning.groups[trial].tolist()))
        weights = weigh(held_out, y, trusted(held_out, y, groups, prior, kinds))
        weights[weights < min(LEAST_WEIGHT, weights.max())] = 0.0
        weights /= weights.sum()
        by_places = np.asarray(np.einsum("tpmc,m->tpc", each_place, weights), np.float64)
        if len(places) > 1:
            places = weigh_places(by_places, y, groups)
        mixed = np.asarray(np.einsum("tpc,p->tc", by_places, places), np.float64)
        if held.as_to_come:
            sharpness = sharpen(mixed, y)
        inner = {member.name: loss for member, loss in zip(members, losses, strict=True)}
        inner["blend"] = log_loss(sharpened(mixed, sharpness), y)
    kept = np.flatnonzero(weights)
    on_step("all trials")
    fitted = tuple(_fit(members[i], learning, columns[i], images, seed, TREES) for i in kept)
    _thin_out(fitted, learning.classes)
    return TrialBlend(
        members=tuple(members[i] for i in kept),
        fitted=fitted,
        columns=tuple(columns[i] for i in kept),
        weights=weights[kept],
        places=places,
        sharpness=sharpness,
        classes=learning.classes,
        inner=inner,
        novelty=Novelty.of(learning.rows, novel),
        threshold=novelty_threshold(novelty[np.isfinite(novelty)]),
    )


def _ways(member: TrialMember, learning: Learning) -> tuple[TrialMember, ...]:
    """Return a member with shifted copies and without, where it may learn from them."""
    if not member.shifted or learning.extras.moved is None:
        return (replace(member, shifted=False),)
    return member, replace(member, shifted=False)


def _better(members: Sequence[TrialMember], losses: Sequence[float]) -> list[int]:
    """Return which of the members remain: of two ways of each the one with the lower log-loss, the
    first where they are level.
    """
    best: dict[str, int] = {}
    for place, member in enumerate(members):
        if member.name not in best or losses[place] < losses[best[member.name]]:
            best[member.name] = place
    return list(best.values())


def _fit(
    member: TrialMember,
    learning: Learning,
    columns: NDArray[np.intp],
    images: Sequence[Mirror],
    seed: int,
    trees: int,
) -> Any:
    """Return a member that has learned from crops, and from their mirror images and shifted copies
    if it does.
    """
    crops = [Crops(learning.rows, learning.trial)]
    if member.further and learning.extras.further is not None:
        crops.append(learning.extras.further)
    seen = [own.rows[:, columns] for own in crops]
    trial = [own.trial for own in crops]
    for image in images if member.mirrored else ():
        seen += [image.apply(own.rows, columns) for own in crops]
        trial += [own.trial for own in crops]
    if member.shifted and learning.extras.moved is not None:
        moved = learning.extras.moved
        seen.append(moved.copies(learning.rows, columns))
        trial.append(learning.trial[moved.crop])
    model = member.make(seed, trees, len(columns))
    return model.fit(np.concatenate(seen), learning.y[np.concatenate(trial)])


def _thin_out(fitted: Sequence[Any], classes: int) -> None:
    """Leave of each forest the first trees only, alike in share, if all have too many numbers."""
    most = MOST_NUMBERS // (classes + 4)
    forests = [model for model in fitted if hasattr(model, "estimators_")]
    nodes = sum(tree.tree_.node_count for model in forests for tree in model.estimators_)
    if nodes <= most:
        return
    for model in forests:
        model.n_estimators = max(1, len(model.estimators_) * most // nodes)
        model.estimators_ = model.estimators_[: model.n_estimators]


def _held_out(
    learning: Learning,
    members: Sequence[TrialMember],
    columns: Sequence[NDArray[np.intp]],
    images: Sequence[Mirror],
    seed: int,
    held: HeldOut,
    on_step: Callable[[str], None],
) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Return members' predictions for held-out trials, shape (n, places, members, classes), and
    which trial each is for, shape (n,): once as it is, and again as its shifted copy where single
    trials are held out and there are copies to ask about.
    """
    places = len(learning.trial) // len(learning.y)
    shape = places, len(members), learning.classes
    found, trials = [np.empty((0, *shape))], [np.empty(0, np.intp)]
    for number, (train, test) in enumerate(held.parts, start=1):
        own, other = learning.part(train), learning.part(test)
        asked = [Crops(other.rows, other.trial)]
        if held.single and (copies := other.extras.asked) is not None:
            rows = copies.copies(other.rows, np.arange(other.rows.shape[1]))
            asked.append(Crops(rows, other.trial[copies.crop]))
        on_step(f"inner fold {number}")
        probabilities = np.empty((len(asked), len(test), *shape))
        for index, member in enumerate(members):
            model = _fit(member, own, columns[index], images, seed, INNER_TREES)
            for place, crops in enumerate(asked):
                each = proba_of(model, crops.rows[:, columns[index]], learning.classes)
                probabilities[place, :, :, index] = by_place(each, crops.trial)
        found += list(probabilities)
        trials += [test] * len(asked)
    return np.concatenate(found), np.concatenate(trials)


def _novelty_held_out(
    learning: Learning, parts: Parts, columns: NDArray[np.intp]
) -> NDArray[np.float64]:
    """Return the novelty of held-out trials, shape (trials,); NaN for those that no fold tests."""
    novelty = np.full(len(learning.y), np.nan)
    for train, test in parts:
        own, other = learning.part(train), learning.part(test)
        novelty[test] = held_out_novelty(own.rows, other.rows, other.trial, columns)
    return novelty


def proba_of(model: Any, rows: Rows, classes: int) -> NDArray[np.float64]:
    """Return shape (n, classes), 0 for classes that a model has never seen."""
    found = np.zeros((len(rows), classes))
    found[:, np.asarray(model.classes_, np.intp)] = model.predict_proba(rows)
    return found


def by_place(crops: NDArray[np.float64], trial: NDArray[np.intp]) -> NDArray[np.float64]:
    """Return crops, shape (n, columns), as (trials, places, columns): each trial has as many."""
    order = np.argsort(trial, kind="stable")
    return crops[order].reshape(int(trial.max()) + 1, -1, crops.shape[1])


def mean_of_crops(crops: NDArray[np.float64], trial: NDArray[np.intp]) -> NDArray[np.float64]:
    """Return each trial's mean, shape (trials, columns), of its crops, shape (n, columns)."""
    count = np.bincount(trial)
    sums = [np.bincount(trial, weights=column) for column in crops.T]
    return np.asarray(np.stack(sums, axis=1) / count[:, None], np.float64)
