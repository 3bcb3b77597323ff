"""Try candidates on inner folds, cheapest and most informative first, and blend what is best.

Everything here sees training trials only: the caller hands over which those are. Knows nothing
about files, screens or test trials.

Source: docs/decisions/0039.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from taxel.decisions.joining import Joining
from taxel.errors import BadSplit
from taxel.models.kernel_features import KERNELS
from taxel.plain_text import number_of
from taxel.training.choose.base import Base
from taxel.training.choose.blending import (
    FEW_SHARPNESS,
    LEAST,
    doubted,
    fit_last,
    fit_sharpness,
    joined,
    losses,
    mix,
    softmax,
)
from taxel.training.choose.budget import Budget
from taxel.training.choose.candidates import Candidate, Sets, first_round, second_round
from taxel.training.choose.choice import Choice, Member, Standing
from taxel.training.choose.cores import working_threads
from taxel.training.choose.cuts import best_cut
from taxel.training.choose.fitting import fit_head, head_logits
from taxel.training.choose.inner_folds import (
    Held,
    groups_of,
    inner_folds,
    learned_from,
    tested_folds,
    with_few,
)
from taxel.training.choose.joining import fit_joining
from taxel.training.choose.kept_tries import KeptTries
from taxel.training.choose.kernels import compute_kernels
from taxel.training.choose.levels import level_to_follow
from taxel.training.choose.network_folds import NetworkFolds
from taxel.training.choose.part import Part, Tried, training_part
from taxel.training.choose.pieces import Pieces
from taxel.training.choose.preparations import Prepared

_FEWEST = 3
"""Candidates that are tried whatever the time: a discriminant, logistic regression, trees. Source:
our choice, 0039."""


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
    pieces: Pieces = field(default_factory=Pieces)
    """Times of pieces of blends, each measured once for all choices."""
    most_us: float = float("inf")
    """Microseconds that a window may take: what alone takes longer is not tried."""


def choose(
    base: Base, prepared: Sequence[Prepared], train: Sequence[int], held: Held, effort: Effort
) -> SearchResult:
    """Find what does best on the inner folds of some training trials.

    Args:
        base: The recordings.
        prepared: The ways to cut them.
        train: Indices of the trials that may be looked at.
        held: What the outer split holds out, and so the inner folds.
        effort: How long it may take, and how it is carried out.

    Raises:
        BadSplit: Fewer than two classes have two trials, or windows of them in any way to cut.
    """
    effort.budget.begin()
    held = with_few(base.trials, base.y, train, held)
    search = _Search(effort)
    parts = [_quick_enough(part, effort) for part in _judged_parts(base, prepared, train, held)]
    part: Part = parts[0]
    behind: tuple[str, ...] = ()
    follow = level_to_follow(base, train, held)
    if len(parts) > 1 or follow is not None:
        cuts = best_cut(parts, search, follow)
        part, behind = cuts.best, cuts.behind
        search.left_out += cuts.left_out
    sets = part.feature_sets()
    search.try_all(part, first_round(sets, part.steps), sets)
    tried = search.of(part)
    ranked = {
        family: [own.candidate.features
                 for own in sorted(tried, key=lambda t: t.loss)
                 if own.candidate.family == family and own.candidate.features != KERNELS]
        for family in ("discriminant", "linear", "trees")
    }  # fmt: skip
    linear = ranked["linear"] or list(sets)
    finer = second_round(ranked["discriminant"] or linear, linear, ranked["trees"] or linear)
    search.try_all(part, finer, sets)
    return SearchResult(base, part, tuple(search.all), tuple(search.left_out), sets, held, behind)


def _quick_enough(part: Part, effort: Effort) -> Part:
    """Return a part without the features that take longer than a window may."""
    quick, slow = effort.pieces.quick_sets(part.feature_sets(), part.prepared, effort.most_us)
    return replace(part, quick=quick, slow=slow) if slow else part


def _judged_parts(
    base: Base, prepared: Sequence[Prepared], train: Sequence[int], held: Held
) -> list[Part]:
    """Return the training part in each way to cut that leaves something to judge, as a high gate
    may not.
    """
    fold_of = inner_folds(base.trials, base.y, train, held)
    parts = [training_part(base, own, train, fold_of, ordered=held.ordered) for own in prepared]
    found = [part for part in parts if part.scored.any()]
    if not found:
        raise BadSplit(
            "windows in two training trials of two classes, to learn from and to choose on",
            f"none in {number_of(len(train), 'trial')}, however they are cut",
            "record more of them, or longer ones",
        )
    return found


class _Search:
    """What was tried so far, and the time that is left."""

    def __init__(self, effort: Effort) -> None:
        self._budget, self._seed = effort.budget, effort.seed
        self._kept, self._on_step = effort.kept, effort.on_step
        self.left_out: list[str] = []
        self.all: list[tuple[str, Part, Tried]] = []
        self._looked: dict[tuple[int, Candidate], tuple[Part, int, NDArray[np.float64], float]] = {}

    def spent(self) -> float:
        """Return the share of this choice's time that has passed."""
        return self._budget.spent()

    def of(self, part: Part) -> list[Tried]:
        """Return what was tried on one way to cut."""
        return [tried for _, own, tried in self.all if own is part]

    def look(
        self, part: Part, candidates: Sequence[Candidate], sets: Sets, fold: int
    ) -> list[Tried]:
        """Score candidates on one inner fold only; what was found there is used again."""
        test = (part.fold == fold) & part.scored
        train = learned_from(part.fold, fold, ordered=part.ordered)

        def score(candidate: Candidate) -> Tried:
            self._on_step(f"{candidate.name} · {part.name}")
            started = self._budget.clock()
            blocks = sets.get(candidate.features, ())
            logits = out_of_fold(part, candidate, blocks, train, test, self._seed)
            seconds = self._budget.clock() - started
            self._looked[id(part), candidate] = (part, fold, logits, seconds)
            return _tried(part, candidate, logits, test, seconds)

        with working_threads(self._budget.at_once) as pool:
            return list(pool.map(score, candidates))

    def try_all(
        self, part: Part, candidates: Sequence[Candidate], sets: Sets, *, must: bool = True
    ) -> None:
        """Score candidates on all inner folds, some at a time, if they were not and time allows.

        Args:
            part: The windows.
            candidates: The most promising first.
            sets: Feature sets and their blocks.
            must: Whether the first few are tried whatever the time.
        """
        done = {tried.candidate for tried in self.of(part)}
        new = [candidate for candidate in candidates if candidate not in done]
        first = _FEWEST - len(done) if must else 0
        with working_threads(self._budget.at_once) as pool:
            begun = [
                self._begin(pool, part, candidate, sets, must=place < first)
                for place, candidate in enumerate(new)
            ]
            found = [result() for result in begun]
        cut = part.name
        for candidate, tried in zip(new, found, strict=True):
            if tried is None:
                self.left_out.append(f"{candidate.name} · {cut}")
            else:
                self.all.append((cut, part, tried))

    def _begin(
        self, pool: ThreadPoolExecutor, part: Part, candidate: Candidate, sets: Sets, *, must: bool
    ) -> Callable[[], Tried | None]:
        """Hand a candidate to the threads; return what waits for its scores."""
        if candidate.family != "network":
            return pool.submit(self._try, part, candidate, sets, must=must).result
        logits, seconds = self._kept.find(part, candidate, ())
        if logits is not None:
            tried = _tried(part, candidate, logits, part.scored, seconds)
            return lambda: tried
        network = NetworkFolds(part, candidate, self._seed, self._budget, must=must)

        def run(fold: int) -> None:
            if fold == network.folds[0]:
                self._on_step(f"{candidate.name} · {part.name}")
            network.run(fold)

        jobs = [pool.submit(run, fold) for fold in network.folds]

        def result() -> Tried | None:
            for job in jobs:
                job.result()
            logits = network.logits()
            if logits is None:
                return None
            self._kept.keep(part, candidate, (), logits, network.seconds)
            return _tried(part, candidate, logits, part.scored, network.seconds)

        return result

    def _try(self, part: Part, candidate: Candidate, sets: Sets, *, must: bool) -> Tried | None:
        """Return a candidate's scores; None where the time would not do."""
        self._on_step(f"{candidate.name} · {part.name}")
        blocks = sets.get(candidate.features, ())
        logits, seconds = self._kept.find(part, candidate, blocks)
        if logits is None:
            logits, seconds = self._score(part, candidate, blocks, must=must)
            if logits is None:
                return None
            self._kept.keep(part, candidate, blocks, logits, seconds)
        return _tried(part, candidate, logits, part.scored, seconds)

    def _score(
        self, part: Part, candidate: Candidate, blocks: tuple[str, ...], *, must: bool
    ) -> tuple[NDArray[np.float64] | None, float]:
        """Return logits of the scored windows; None where the time would not do."""
        none = (part, -1, None, 0.0)
        _, fold, looked, before = self._looked.get((id(part), candidate), none)
        clock, started = self._budget.clock, self._budget.clock() - before
        numbers = tested_folds(part.fold, ordered=part.ordered)
        name = (candidate, part.name)
        if not must and not self._budget.starts(name):
            return None, 0.0
        logits = np.zeros((len(part.rows), part.classes))
        for done, number in enumerate(numbers):
            train = learned_from(part.fold, number, ordered=part.ordered)
            test = (part.fold == number) & part.scored
            if number == fold and looked is not None:
                logits[test] = looked
            elif test.any():
                logits[test] = out_of_fold(part, candidate, blocks, train, test, self._seed)
            spent = clock() - started
            left = spent / (done + 1) * (len(numbers) - done - 1)
            if not must and not self._budget.goes_on(spent, left):
                return None, spent
        self._budget.took(name, clock() - started)
        return logits[part.scored], clock() - started


def _tried(
    part: Part,
    candidate: Candidate,
    logits: NDArray[np.float64],
    own: NDArray[np.bool_],
    seconds: float,
) -> Tried:
    """Return a candidate's scores on some windows of a part.

    Args:
        part: The windows.
        candidate: Tried on them.
        logits: Of those windows, shape (own, classes).
        own: Which these are, shape (rows,).
        seconds: That it took.
    """
    y = part.y[own]
    trials = len(set(part.prepared.trial[part.windows[own]]))
    sharpness = fit_sharpness(logits, y, trials)
    found = softmax(sharpness * logits)
    loss, accuracy = losses(found, y).mean(), (found.argmax(axis=1) == y).mean()
    return Tried(candidate, found, sharpness, float(loss), float(accuracy), seconds)


def out_of_fold(
    part: Part,
    candidate: Candidate,
    blocks: tuple[str, ...],
    train: NDArray[np.bool_],
    test: NDArray[np.bool_],
    seed: int,
) -> NDArray[np.float64]:
    """Fit on some windows of a part and return logits of others, to test on."""
    own = part.prepared
    if blocks == (KERNELS,):
        kernels, features = own.fitted_features(part.windows[train], part.windows, seed)
        tested = features[test]
        if own.dataset.tested_level is not None:
            windows = own.dataset.tested(part.windows[test])
            padded = own.config.pad
            tested = compute_kernels(kernels, windows.values, windows.mask, padded=padded)
    else:
        features = own.features(blocks)[part.rows]
        tested = own.tested_features(blocks)[part.rows[test]]
    head = fit_head(candidate, features[train], part.y[train], part.classes, seed)
    return head_logits(head, tested)


@dataclass(frozen=True, slots=True)
class SearchResult:
    """Every candidate that was tried, from which a blend is chosen."""

    base: Base
    part: Part
    """The way to cut that was chosen."""
    board: tuple[tuple[str, Part, Tried], ...]
    left_out: tuple[str, ...]
    sets: Sets
    held: Held
    behind: tuple[str, ...] = ()
    """Ways to cut that were far behind on the first inner fold, in words."""

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
        blend = mix(probabilities, kinds, camps, freedom, y, groups)
        whole = np.log(np.maximum(joined(probabilities, blend), LEAST))
        last = fit_last(whole, y, len(set(trial)), later=self.held.ordered)
        inner = doubted(softmax(last * whole))
        if self.held.new is not None:
            last *= FEW_SHARPNESS  # and so what is joined, whose strength is fitted on `inner`
        final = doubted(softmax(last * whole))
        weight = {id(tried[i]): w for i, w in zip(blend.members, blend.weights, strict=True)}
        single = len(set(trial)) == len(trial)
        return Choice(
            target=self.base.target,
            window=part.prepared.config,
            members=tuple(self._member(tried[i], weight[id(tried[i])]) for i in blend.members),
            last=last,
            joining=Joining() if single else fit_joining(trial, inner, y),
            held=self.held.words,
            folds=len(tested_folds(part.fold, ordered=part.ordered)),
            why=f"of what keeps to the limits, {blend.why}" if without else blend.why,
            loss=float(losses(final, y).mean()),
            accuracy=float((final.argmax(axis=1) == y).mean()),
            leaderboard=self._leaderboard(weight),
            left_out=self.left_out,
            behind=self.behind,
            slow=part.slow,
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
