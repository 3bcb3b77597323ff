"""Try candidates on inner folds, cheapest and most informative first, and blend what is best.

Everything here sees training trials only: the caller hands over which those are. Knows nothing
about files, screens or test trials.

Source: docs/decisions/0039.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field, replace
from threading import Lock

import numpy as np
from numpy.typing import NDArray

from taxel.decisions.joining import Joining
from taxel.training.choose.blending import (
    LEAST,
    fit_last,
    fit_sharpness,
    joined,
    losses,
    mix,
    softmax,
)
from taxel.training.choose.budget import Budget
from taxel.training.choose.candidates import (
    Candidate,
    feature_sets,
    first_round,
    second_round,
)
from taxel.training.choose.choice import Choice, Member, Standing
from taxel.training.choose.cores import shared_cores
from taxel.training.choose.fitting import fit_head, head_logits
from taxel.training.choose.inner_folds import (
    Held,
    groups_of,
    inner_folds,
    judged,
    learned_from,
    tested_folds,
)
from taxel.training.choose.joining import fit_joining, join, unit_classes
from taxel.training.choose.kept_tries import KeptTries
from taxel.training.choose.networks import predict_network
from taxel.training.choose.preparations import Base, Prepared

_FEWEST = 2
"""Candidates that are tried whatever the time. Source: our choice, 0039."""
_QUICK_WINDOWS = 1500
"""Windows on which ways to cut are compared. Source: our choice, 0039."""
BETTER_CUT, CUT_SLACK = 1.1, 0.01
"""A way to cut replaces a more natural one where the latter's loss is so many times its own and so
much more. Source: our choice, 0039."""
_PAIR = ("all", "both rows", "rows", "statistics")
"""The feature set on which ways to cut are compared: the first of these that there is."""


@dataclass(frozen=True, slots=True)
class Part:
    """The training part of one choice, in one way to cut."""

    prepared: Prepared
    rows: NDArray[np.intp]
    """Kept windows of training trials, as places in `Prepared.kept`."""
    fold: NDArray[np.intp]
    """Inner fold of each, shape (rows,)."""
    y: NDArray[np.intp]
    """Class of each, shape (rows,)."""
    scored: NDArray[np.bool_]
    """Which of them are scored: those that overlap no earlier one, shape (rows,)."""
    classes: int
    ordered: bool = False
    """Whether a fold is tested on what was learned from earlier folds alone."""

    @property
    def windows(self) -> NDArray[np.intp]:
        """Return the windows' places in the data set, shape (rows,)."""
        return self.prepared.kept[self.rows]

    @property
    def steps(self) -> int:
        """Return the rows of a window."""
        return int(self.prepared.dataset.windows.values.shape[1])

    def feature_sets(self) -> dict[str, tuple[str, ...]]:
        """Return the feature sets that windows of this size have."""
        windows = self.prepared.dataset.windows
        _, steps, channels = windows.values.shape
        return feature_sets(steps, channels, padded=bool(windows.padded))


@dataclass(frozen=True, slots=True)
class Tried:
    """A candidate with its predictions on inner folds."""

    candidate: Candidate
    probabilities: NDArray[np.float64]
    """Calibrated, of the scored windows, shape (scored, classes)."""
    sharpness: float
    loss: float
    accuracy: float
    seconds: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Effort:
    """How long choosing may take, and how it is carried out."""

    budget: Budget
    """A share of it a choice."""
    seed: int = 0
    """Of all that is random."""
    kept: KeptTries = field(default_factory=lambda: KeptTries(None, {}))
    """What an interrupted run had tried."""
    on_step: Callable[[str], None] = lambda _: None
    """Called with a line before each try."""


def choose(
    base: Base, prepared: Sequence[Prepared], train: Sequence[int], held: Held, effort: Effort
) -> Found:
    """Find what does best on the inner folds of some training trials.

    Args:
        base: The recordings.
        prepared: The ways to cut them.
        train: Indices of the trials that may be looked at.
        held: What the outer split holds out, and so the inner folds.
        effort: How long it may take, and how it is carried out.
    """
    effort.budget.begin()
    search = _Search(effort)
    fold_of = inner_folds(base.trials, base.y, train, held)
    parts = [training_part(base, own, train, fold_of, ordered=held.ordered) for own in prepared]
    part = search.best_cut(parts) if len(parts) > 1 else parts[0]
    sets = part.feature_sets()
    search.try_all(part, first_round(sets, part.steps), sets)
    tried = search.of(part)
    ranked = {
        family: [own.candidate.features
                 for own in sorted(tried, key=lambda t: t.loss) if own.candidate.family == family]
        for family in ("discriminant", "linear", "trees")
    }  # fmt: skip
    linear = ranked["linear"] or list(sets)
    finer = second_round(ranked["discriminant"] or linear, linear, ranked["trees"] or linear)
    search.try_all(part, finer, sets)
    return Found(base, part, tuple(search.all), tuple(search.left_out), sets, held)


class _Search:
    """What was tried so far, and the time that is left."""

    def __init__(self, effort: Effort) -> None:
        self._budget, self._seed = effort.budget, effort.seed
        self._kept, self._on_step = effort.kept, effort.on_step
        self.left_out: list[str] = []
        self.all: list[tuple[str, Part, Tried]] = []

    def of(self, part: Part) -> list[Tried]:
        """Return what was tried on one way to cut."""
        return [tried for _, own, tried in self.all if own is part]

    def best_cut(self, parts: list[Part]) -> Part:
        """Return the way to cut on which two quick models do best, in equal stretches of time.

        A trial that a way leaves without a window, as a high gate does, counts as guessed at there.
        """
        decided = [len(set(part.prepared.trial[part.windows])) for part in parts]
        found = []
        for whole, trials in zip(parts, decided, strict=True):
            part = _thinned(whole)
            sets = part.feature_sets()
            name = next(name for name in _PAIR if name in sets)
            pair = [Candidate("linear", "logistic", name, 0.03),
                    Candidate("trees", "extra-trees", name, 2)]  # fmt: skip
            self.try_all(part, pair, sets)
            share = trials / max(decided)
            guess = float(np.log(part.classes))
            found.append(share * _stretch_loss(part, self.of(part)) + (1.0 - share) * guess)
        enough = BETTER_CUT * min(found) + CUT_SLACK
        return next(part for part, loss in zip(parts, found, strict=True) if loss <= enough)

    def try_all(
        self, part: Part, candidates: Sequence[Candidate], sets: dict[str, tuple[str, ...]]
    ) -> None:
        """Score candidates on all inner folds, some at a time, if they were not and time allows.

        Networks draw from PyTorch's one generator, so that never two of them are at work.
        """
        done = {tried.candidate for tried in self.of(part)}
        new = [candidate for candidate in candidates if candidate not in done]
        must = len(done) < _FEWEST
        at_once = self._budget.at_once
        with _without_warnings(), shared_cores(at_once), ThreadPoolExecutor(at_once) as pool:
            one_network = Lock()
            jobs = [
                pool.submit(self._try, part, candidate, sets, one_network,
                            must=must and place < _FEWEST)
                for place, candidate in enumerate(new)
            ]  # fmt: skip
            found = [job.result() for job in jobs]
        cut = part.prepared.name
        for candidate, tried in zip(new, found, strict=True):
            if tried is None:
                self.left_out.append(f"{candidate.name} · {cut}")
            else:
                self.all.append((cut, part, tried))

    def _try(
        self,
        part: Part,
        candidate: Candidate,
        sets: dict[str, tuple[str, ...]],
        one_network: Lock,
        *,
        must: bool,
    ) -> Tried | None:
        """Return a candidate's scores; None where the time would not do."""
        self._on_step(f"{candidate.name} · {part.prepared.name}")
        blocks = sets.get(candidate.features, ())
        logits, seconds = self._kept.find(part, candidate, blocks)
        if logits is None:
            with one_network if candidate.family == "network" else nullcontext():
                logits, seconds = self._score(part, candidate, blocks, must=must)
            if logits is None:
                return None
            self._kept.keep(part, candidate, blocks, logits, seconds)
        y = part.y[part.scored]
        trials = len(set(part.prepared.trial[part.windows[part.scored]]))
        sharpness = fit_sharpness(logits, y, trials)
        found = softmax(sharpness * logits)
        loss, accuracy = losses(found, y).mean(), (found.argmax(axis=1) == y).mean()
        return Tried(candidate, found, sharpness, float(loss), float(accuracy), seconds)

    def _score(
        self, part: Part, candidate: Candidate, blocks: tuple[str, ...], *, must: bool
    ) -> tuple[NDArray[np.float64] | None, float]:
        """Return logits of the scored windows; None where the time would not do."""
        clock, started = self._budget.clock, self._budget.clock()
        numbers = tested_folds(part.fold, ordered=part.ordered)
        if not must and not self._budget.allows(0.0):
            return None, 0.0
        logits = np.zeros((len(part.rows), part.classes))
        for done, number in enumerate(numbers):
            train = learned_from(part.fold, number, ordered=part.ordered)
            test = (part.fold == number) & part.scored
            if test.any():
                logits[test] = out_of_fold(part, candidate, blocks, train, test, self._seed)
            spent = clock() - started
            left = spent / (done + 1) * (len(numbers) - done - 1)
            if not must and not self._budget.allows(left):
                return None, spent
        return logits[part.scored], clock() - started


@contextmanager
def _without_warnings() -> Iterator[None]:
    """Keep still about models that end before they converge: a hundred steps are enough for a
    regularised one. Set here, for filters belong to all threads.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


def training_part(
    base: Base,
    prepared: Prepared,
    train: Sequence[int],
    fold_of: NDArray[np.intp],
    *,
    ordered: bool,
) -> Part:
    """Return the kept windows of some trials, with their inner folds and classes."""
    fold = np.full(len(base.trials), -1, np.intp)
    fold[np.asarray(train, np.intp)] = fold_of
    own = fold[prepared.trial[prepared.kept]]
    rows = np.flatnonzero(own >= 0)
    windows = prepared.kept[rows]
    y = base.y[prepared.trial[windows]]
    scored = prepared.scored[windows] & judged(own[rows], y, ordered=ordered)
    classes = len(base.dataset.classes(base.target))
    return Part(prepared, rows, own[rows], y, scored, classes, ordered)


def _thinned(part: Part) -> Part:
    """Return every so many of a part's stretches as a whole, with all their windows."""
    every = -(-len(part.rows) // _QUICK_WINDOWS)
    if every < 2:
        return part
    own = part.prepared.stretch[part.windows] % every == 0
    return replace(
        part, rows=part.rows[own], fold=part.fold[own], y=part.y[own], scored=part.scored[own]
    )


def out_of_fold(
    part: Part,
    candidate: Candidate,
    blocks: tuple[str, ...],
    train: NDArray[np.bool_],
    test: NDArray[np.bool_],
    seed: int,
) -> NDArray[np.float64]:
    """Fit on some windows of a part and return logits of others."""
    if candidate.family == "network":
        return predict_network(part.prepared, part.windows[train], part.y[train],
                               part.windows[test], part.classes, candidate, seed)  # fmt: skip
    features = part.prepared.features(blocks)[part.rows]
    head = fit_head(candidate, features[train], part.y[train], part.classes, seed)
    return head_logits(head, features[test])


def _stretch_loss(part: Part, tried: list[Tried]) -> float:
    """Return the calibrated loss of two models' mean, its windows joined over equal stretches."""
    if not tried:
        return float("inf")
    windows, y = part.windows[part.scored], part.y[part.scored]
    mean = np.mean([attempt.probabilities for attempt in tried], axis=0)
    unit = part.prepared.stretch[windows]
    numbers, found = join(fit_joining(unit, mean, y), unit, mean)
    return float(losses(found, unit_classes(unit, y, numbers)).mean())


@dataclass(frozen=True, slots=True)
class Found:
    """All that was tried, from which a blend is made."""

    base: Base
    part: Part
    """The way to cut that was chosen."""
    board: tuple[tuple[str, Part, Tried], ...]
    left_out: tuple[str, ...]
    sets: dict[str, tuple[str, ...]]
    held: Held

    def choice(self, without: Collection[Candidate] = ()) -> Choice:
        """Return the blend that is best, without some candidates if their bundle is too large."""
        part = self.part
        tried = [attempt for _, own, attempt in self.board
                 if own is part and attempt.candidate not in without]  # fmt: skip
        y, windows = part.y[part.scored], part.windows[part.scored]
        trial = part.prepared.trial[windows]
        probabilities = [attempt.probabilities for attempt in tried]
        kinds = [attempt.candidate.kind for attempt in tried]
        camps = [own.candidate.camp for own in tried]
        freedom = [own.candidate.freedom(self.sets) for own in tried]
        groups = groups_of(self.base.trials, self.held)[trial]
        found = mix(probabilities, kinds, camps, freedom, y, groups)
        whole = np.log(np.maximum(joined(probabilities, found), LEAST))
        last = fit_last(whole, y, len(set(trial)), later=self.held.ordered)
        final = softmax(last * whole)
        weight = {id(tried[i]): w for i, w in zip(found.members, found.weights, strict=True)}
        single = len(set(trial)) == len(trial)
        return Choice(
            target=self.base.target,
            window=part.prepared.config,
            members=tuple(self._member(tried[i], weight[id(tried[i])]) for i in found.members),
            last=last,
            joining=Joining() if single else fit_joining(trial, final, y),
            held=self.held.words,
            folds=len(tested_folds(part.fold, ordered=part.ordered)),
            why=found.why,
            loss=float(losses(final, y).mean()),
            accuracy=float((final.argmax(axis=1) == y).mean()),
            leaderboard=self._leaderboard(weight),
            left_out=self.left_out,
        )

    def _member(self, tried: Tried, weight: float) -> Member:
        blocks = self.sets.get(tried.candidate.features, ())
        return Member(
            candidate=tried.candidate, blocks=blocks, weight=weight, sharpness=tried.sharpness
        )

    def _leaderboard(self, weight: dict[int, float]) -> tuple[Standing, ...]:
        rows = [
            Standing(name=attempt.candidate.name, windows=cut, loss=attempt.loss,
                     accuracy=attempt.accuracy, seconds=attempt.seconds,
                     weight=weight.get(id(attempt), 0.0))
            for cut, _, attempt in self.board
        ]  # fmt: skip
        return tuple(sorted(rows, key=lambda row: row.loss))
