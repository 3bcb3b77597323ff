"""A recogniser of camera trials: several models on several views, weighed by inner folds.

Forests, sums of ranks and discriminants see grey differences, flow, the slip signal, stills, a
plain picture or what an image network sees; the weight of each comes from trials of groups that it
was not fitted on, as does the mean's sharpness. Knows nothing about images, files or outer folds.

Source: docs/decisions/0041.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

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
from taxel.training.camera_trials.members import MEMBERS, TREES, TrialMember, learned
from taxel.training.camera_trials.novelty import (
    Novelty,
    held_out_novelty,
    novelty_columns,
    novelty_threshold,
)
from taxel.windows.trial_mirrors import Mirror, mirrors

INNER_TREES: Final = 150
CHOICE_TREES: Final = 50
"""Of a forest on an inner fold, and of one there that only helps to choose how trials are cut.
Source: our choice, decision 41."""
MOST_NUMBERS: Final = 18_000_000
"""Of all forests that are kept, four a node and one a class: beyond it they have fewer trees, so
that a bundle with an image network of 7 MB stays within some 20 MB. Source: 16 bytes a node of 22
classes, packed; decision 41."""
LEAST_WEIGHT: Final = 0.04
"""A member below it is left out. Source: our choice."""


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


@dataclass(frozen=True, slots=True, kw_only=True)
class _Weighed:
    """What inner folds say of members that may be blended."""

    members: tuple[TrialMember, ...]
    columns: tuple[NDArray[np.intp], ...]
    weights: NDArray[np.float64]
    places: NDArray[np.float64]
    sharpness: float
    inner: Mapping[str, float]
    losses: NDArray[np.float64]
    """Shape (trials,): the blend's log-loss on each trial held out, nats; NaN for the others."""


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
    images, novel = mirrors(widths, cameras), novelty_columns(widths)
    held = held_out_parts(learning.y, learning.groups, learning.order, seed)
    found = _weighed(learning, (cameras, widths), seed, members, held, on_step)
    novelty = _novelty_held_out(learning, held.parts, novel)
    kept = np.flatnonzero(found.weights)
    on_step("all trials")
    fitted = tuple(
        _fit(found.members[i], learning, found.columns[i], images, seed, TREES) for i in kept
    )
    _thin_out(fitted, learning.classes)
    return TrialBlend(
        members=tuple(found.members[i] for i in kept),
        fitted=fitted,
        columns=tuple(found.columns[i] for i in kept),
        weights=found.weights[kept],
        places=found.places,
        sharpness=found.sharpness,
        classes=learning.classes,
        inner=found.inner,
        novelty=Novelty.of(learning.rows, novel),
        threshold=novelty_threshold(novelty[np.isfinite(novelty)]),
    )


def inner_losses(
    learning: Learning,
    cameras: int,
    widths: Mapping[str, int],
    seed: int,
    on_step: Callable[[str], None] = lambda line: None,
) -> NDArray[np.float64]:
    """Return what a blend of smaller forests would lose on trials of inner folds.

    Args:
        learning: As in `fit_blend`.
        cameras: Likewise.
        widths: Likewise.
        seed: Likewise.
        on_step: Called with a line before each fit.

    Returns:
        Shape (trials,): log-losses, nats; NaN for trials that no inner fold holds out.
    """
    held = held_out_parts(learning.y, learning.groups, learning.order, seed)
    members = tuple(_quick(member) for member in MEMBERS)
    return _weighed(learning, (cameras, widths), seed, members, held, on_step).losses


def _quick(member: TrialMember) -> TrialMember:
    """Return a member with `CHOICE_TREES` trees at most."""
    return replace(
        member,
        make=lambda seed, trees, width: member.make(seed, min(trees, CHOICE_TREES), width),
    )


def _weighed(
    learning: Learning,
    seen: tuple[int, Mapping[str, int]],
    seed: int,
    members: Sequence[TrialMember],
    held: HeldOut,
    on_step: Callable[[str], None],
) -> _Weighed:
    """Return members and crops as inner folds weigh them.

    Args:
        learning: What to learn from.
        seen: Number of cameras; view → numbers a crop.
        seed: Of members.
        members: What may be blended.
        held: The inner folds.
        on_step: Called with a line before each fit.
    """
    cameras, widths = seen
    ways = [way for own in members if set(own.views) <= set(widths)
            for way in _ways(own, learning)]  # fmt: skip
    columns = [way.columns(cameras, widths) for way in ways]
    images = mirrors(widths, cameras)
    held_out, trial = _held_out(learning, ways, columns, images, seed, held, on_step)
    y = learning.y[trial]
    mean = held_out.mean(axis=1)
    loss = [log_loss(mean[:, i], y) if len(y) else 0.0 for i in range(len(ways))]
    better = _better(ways, loss)
    ways, columns = [ways[i] for i in better], [columns[i] for i in better]
    prior = np.array([way.prior for way in ways])
    weights = prior / prior.sum()
    places = np.full(held_out.shape[1], 1 / held_out.shape[1])
    sharpness, inner, losses = 1.0, {}, np.full(len(learning.y), np.nan)
    if len(y):
        each_place = held_out[:, :, better]
        kinds = np.array([way.kind for way in ways])
        groups = len(set(learning.groups[trial].tolist()))
        mean = each_place.mean(axis=1)
        changing = _changing(learning, widths)
        parts = np.array([way.part(changing) for way in ways])
        weights = weigh(mean, y, trusted(mean, y, groups, prior, kinds, parts))
        weights[weights < min(LEAST_WEIGHT, weights.max())] = 0.0
        weights /= weights.sum()
        by_places = np.asarray(np.einsum("tpmc,m->tpc", each_place, weights), np.float64)
        if len(places) > 1:
            places = weigh_places(by_places, y, groups)
        mixed = np.asarray(np.einsum("tpc,p->tc", by_places, places), np.float64)
        if held.as_to_come:
            sharpness = sharpen(mixed, y)
        inner = {way.name: loss[i] for way, i in zip(ways, better, strict=True)}
        inner["blend"] = log_loss(sharpened(mixed, sharpness), y)
        losses = _by_trial(sharpened(mixed, sharpness), y, trial, len(learning.y))
    return _Weighed(
        members=tuple(ways), columns=tuple(columns), weights=weights, places=places,
        sharpness=sharpness, inner=inner, losses=losses,
    )  # fmt: skip


def _changing(learning: Learning, widths: Mapping[str, int]) -> bool:
    """Return whether images change within a crop: whether there is any grey difference."""
    if "pixels" not in widths:
        return False
    first = sum(widths[view] for view in list(widths)[: list(widths).index("pixels")])
    return bool(learning.rows[:, first : first + widths["pixels"]].any())


def _by_trial(
    held: NDArray[np.float64], y: NDArray[np.intp], trial: NDArray[np.intp], trials: int
) -> NDArray[np.float64]:
    """Return each trial's mean log-loss, shape (trials,), NaN where it was never held out."""
    each = [log_loss(own[None], of[None]) for own, of in zip(held, y, strict=True)]
    asked = np.bincount(trial, minlength=trials)
    sums = np.bincount(trial, weights=each, minlength=trials)
    return np.where(asked, sums / np.maximum(asked, 1), np.nan)


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
    return learned(model, np.concatenate(seen), learning.y[np.concatenate(trial)])


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
