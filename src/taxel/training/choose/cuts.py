"""Compare ways to cut recordings into windows with two quick models, in equal stretches of time.

The most natural way stands first. A later one is looked at on one inner fold, and compared on all
of them only where it is not far behind there. Knows nothing about how models are fitted.

Source: docs/decisions/0039.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from taxel.training.choose.blending import by_chance, losses
from taxel.training.choose.candidates import Candidate, Sets
from taxel.training.choose.inner_folds import tested_folds
from taxel.training.choose.joining import fit_joining, join, unit_classes
from taxel.training.choose.part import Part, Tried

_QUICK_WINDOWS = 1500
"""Windows on which ways to cut are compared. Source: our choice, 0039."""
BETTER_CUT, CUT_SLACK = 1.1, 0.01
"""A way to cut replaces a more natural one where the latter's loss is so many times its own and so
much more, and more than chance over trials. Source: our choice, 0039."""
FAR_BEHIND, FAR_NATS = 2.0, 0.1
"""A way whose loss on the first inner fold is so many times the best one's there, and so much more,
is not compared further. Source: our choice, 0039."""
MOST_ON_CUTS = 0.5
"""Share of a choice's time after which no further way is compared. Source: our choice, 0039."""
_PAIR = ("all", "both rows", "rows", "statistics")
"""The feature set on which ways to cut are compared: the first of these that there is."""


class Tries(Protocol):
    """What tries candidates, and keeps the time."""

    def spent(self) -> float:
        """Return the share of this choice's time that has passed."""

    def look(
        self, part: Part, candidates: Sequence[Candidate], sets: Sets, fold: int
    ) -> list[Tried]:
        """Score candidates on one inner fold only."""

    def try_all(
        self, part: Part, candidates: Sequence[Candidate], sets: Sets, *, must: bool
    ) -> None:
        """Score candidates on all inner folds; where they must be, whatever the time."""

    def of(self, part: Part) -> list[Tried]:
        """Return what was scored on all inner folds of a part."""


@dataclass(frozen=True, slots=True)
class Cuts:
    """The best way to cut recordings into windows, and the ways that were given up."""

    best: Part
    behind: tuple[str, ...] = ()
    """Ways that were far behind on the first inner fold."""
    left_out: tuple[str, ...] = ()
    """What was not tried, for the time was up."""


def best_cut(parts: Sequence[Part], tries: Tries, follow: str | None = None) -> Cuts:
    """Return the way to cut on which two quick models do best, in equal stretches of time.

    A trial that a way leaves without a window, as a high gate does, counts as guessed at there.

    Args:
        parts: The most natural way first.
        tries: Scores candidates.
        follow: Whose levels may be followed, as `WindowConfig.level_follow` has it: the best way is
            compared with itself so, whatever the time, and replaced as by another way.
    """
    decided = [len(set(part.prepared.trial[part.windows])) for part in parts]
    ways = [
        _Cutting(whole, _thinned(whole), trials / max(decided))
        for whole, trials in zip(parts, decided, strict=True)
    ]
    compared: list[_Cutting] = []
    behind: list[str] = []
    left_out: list[str] = []
    for way in ways:
        sets = way.part.feature_sets()
        pair = _quick_pair(sets)
        name = way.part.name
        if compared and tries.spent() > MOST_ON_CUTS:
            left_out += [f"{candidate.name} · {name}" for candidate in pair]
            continue
        if compared and _is_far_behind(way, min(compared, key=lambda w: w.loss), pair, tries):
            behind.append(way.part.prepared.name)
            continue
        tries.try_all(way.part, pair, sets, must=not compared)
        tried = tries.of(way.part)
        if compared and len(tried) < len(pair):
            continue
        way.score(tried)
        compared.append(way)
    best = _most_natural(compared)
    if follow is not None:
        levels = best.followed(follow)
        sets = levels.part.feature_sets()
        tries.try_all(levels.part, _quick_pair(sets), sets, must=True)
        levels.score(tries.of(levels.part))
        best = _most_natural([best, levels])
    return Cuts(best.whole, tuple(behind), tuple(left_out))


@dataclass(slots=True)
class _Cutting:
    """One way to cut recordings into windows, and its loss so far."""

    whole: Part
    part: Part
    """Some of the windows of `whole`, so that trying it is quick."""
    share: float
    """Trials of which this way makes windows, as a share of those of the best way, 0…1."""
    loss: float = float("inf")
    """Of the quick models on inner folds, nats; infinite until it was tried."""
    by_trial: dict[int, float] = field(default_factory=dict)
    """The same for each trial that it decides."""

    def score(self, tried: Sequence[Tried]) -> None:
        """Note what the quick models give."""
        trial, loss = _stretch_losses(self.part, tried, self.part.scored)
        self.loss = self.with_guesses(float(loss.mean()))
        self.by_trial = {int(i): float(loss[trial == i].mean()) for i in np.unique(trial)}

    def followed(self, text: str) -> _Cutting:
        """Return the same windows with levels that follow."""
        levels = self.whole.prepared.followed(text)
        return _Cutting(
            replace(self.whole, prepared=levels), replace(self.part, prepared=levels), self.share
        )

    def with_guesses(self, loss: float) -> float:
        """Return a loss of the decided trials, nats, with the others guessed at."""
        return self.share * loss + (1.0 - self.share) * float(np.log(self.part.classes))


def _most_natural(ways: Sequence[_Cutting]) -> _Cutting:
    """Return the first way that no other is clearly and surely better than."""
    least = min(ways, key=lambda way: way.loss)
    enough = BETTER_CUT * least.loss + CUT_SLACK
    return next(way for way in ways if way.loss <= enough or not _is_surely_worse(way, least))


def _quick_pair(sets: Sets) -> list[Candidate]:
    name = next((name for name in _PAIR if name in sets), next(iter(sets)))
    return [
        Candidate("linear", "logistic", name, 0.03),
        Candidate("trees", "extra-trees", name, 2),
    ]


def _is_surely_worse(way: _Cutting, best: _Cutting) -> bool:
    """Return whether a way is behind another by more than chance over trials: of few trials, one
    that a way happens to get right can make it a tenth better. A trial without a window counts as
    guessed at.
    """
    guessed = float(np.log(way.part.classes))
    trials = sorted(way.by_trial.keys() | best.by_trial.keys())
    gain = np.array([way.by_trial.get(i, guessed) - best.by_trial.get(i, guessed) for i in trials])
    return bool(gain.mean() > by_chance(gain, np.arange(len(gain))))


def _is_far_behind(way: _Cutting, best: _Cutting, pair: list[Candidate], tries: Tries) -> bool:
    """Return whether a way's first inner fold rules it out beside the best way so far."""
    for fold in tested_folds(way.part.fold, ordered=way.part.ordered):
        own = way.part.scored & (way.part.fold == fold)
        other = best.part.scored & (best.part.fold == fold)
        if own.any() and other.any():
            break
    else:
        return False
    seen = tries.look(way.part, pair, way.part.feature_sets(), fold)
    loss = way.with_guesses(_stretch_loss(way.part, seen, own))
    inside = other[best.part.scored]
    there = [
        replace(tried, probabilities=tried.probabilities[inside]) for tried in tries.of(best.part)
    ]
    least = best.with_guesses(_stretch_loss(best.part, there, other))
    return loss > FAR_BEHIND * least + FAR_NATS


def _thinned(part: Part) -> Part:
    """Return every so many stretches of each class in each inner fold, with all their windows.

    Counted over all trials, classes that were recorded in turn would be left out as a whole.
    """
    every = -(-len(part.rows) // _QUICK_WINDOWS)
    if every < 2:
        return part
    stretch = part.prepared.stretch[part.windows]
    numbers, first = np.unique(stretch, return_index=True)
    cell = part.fold[first] * part.classes + part.y[first]
    own = np.isin(stretch, np.concatenate([numbers[cell == c][::every] for c in np.unique(cell)]))
    return replace(
        part, rows=part.rows[own], fold=part.fold[own], y=part.y[own], scored=part.scored[own],
        every=every,
    )  # fmt: skip


def _stretch_loss(part: Part, tried: Sequence[Tried], own: NDArray[np.bool_]) -> float:
    """Return the calibrated loss of two models' mean, its windows joined over equal stretches.

    Args:
        part: The way to cut.
        tried: With probabilities of those windows.
        own: Which windows of the part these are, shape (rows,).
    """
    return float(_stretch_losses(part, tried, own)[1].mean()) if tried else float("inf")


def _stretch_losses(
    part: Part, tried: Sequence[Tried], own: NDArray[np.bool_]
) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Return each stretch's trial and its loss, shape (stretches,) each; see `_stretch_loss`."""
    windows, y = part.windows[own], part.y[own]
    mean = np.mean([attempt.probabilities for attempt in tried], axis=0)
    unit = part.prepared.stretch[windows]
    numbers, found = join(fit_joining(unit, mean, y), unit, mean)
    first = windows[np.unique(unit, return_index=True)[1]]
    return part.prepared.trial[first], losses(found, unit_classes(unit, y, numbers))
