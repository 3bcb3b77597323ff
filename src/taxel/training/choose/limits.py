"""Train what was chosen so that its bundle keeps to its limits of size and time.

What costs too much is given up, and what is left is blended anew: where time lacks, the set of
features, kind of forest or network without which the rest is quick enough at the least loss. Done
in each outer fold as at the end, so that the outer score is of what is shipped. Knows nothing about
scores of test trials.

Source: docs/decisions/0039.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence, Set
from dataclasses import dataclass
from typing import Final

import numpy as np

from taxel.models.blend import Blend
from taxel.training.choose.blending import LEAST_NATS
from taxel.training.choose.candidates import Candidate
from taxel.training.choose.choice import Choice
from taxel.training.choose.costs import Cost, cost_of
from taxel.training.choose.fit_choice import Heads, copies, fit_choice
from taxel.training.choose.pieces import LARGE, Pieces
from taxel.training.choose.preparations import Prepared
from taxel.training.choose.search import SearchResult

MINUTES = 5.0
"""Default: to choose and train. Source: issue 16."""
MOST_MB, MOST_US = 20.0, 2000.0
"""Defaults: megabytes of a bundle, microseconds a window on one core. Source: issue 16."""
BARE: Final = 0.85
"""Share of a window's time that the bare model may take: the bundle's own checks and scaling, timed
later, take the rest. Source: our choice, docs/decisions/0039."""
WORTH_SAYING = 0.02
"""Loss of inner accuracy from where on it is said which limit caused it. Source: our choice,
docs/decisions/0039."""
_LEAST_PRICE, _LEAST_SAVED_US = 0.002, 1.0
"""Nats that giving anything up costs at least, and microseconds below which it saves nothing.
Source: our choice, docs/decisions/0039."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Limits of a search's time and of its bundle's size and speed."""

    minutes: float = MINUTES
    most_mb: float = MOST_MB
    """Of the exported model, packed."""
    most_us: float = MOST_US
    """Of one window on one core."""

    @property
    def bare_us(self) -> float:
        """Return what the bare model may take of it."""
        return BARE * self.most_us


USUAL_LIMITS = Limits()
"""Source: issue 16."""


@dataclass(frozen=True, slots=True)
class FittedBlend:
    """A trained blend within its limits."""

    choice: Choice
    blend: Blend
    given_up: tuple[str, ...]
    """What was left out for the limits, and what that cost in inner accuracy."""


def fit_within(
    search: SearchResult,
    train: Sequence[int],
    limits: Limits = USUAL_LIMITS,
    *,
    seed: int = 0,
    cost: Callable[[Blend, Prepared], Cost] | None = None,
    pieces: Pieces | None = None,
) -> FittedBlend:
    """Blend and train; leave out what makes the blend too large or too slow.

    Args:
        search: What was tried.
        train: Indices of the trials to learn from.
        limits: Megabytes and microseconds.
        seed: Of all that is random.
        cost: Measures a blend; `cost_of` unless given.
        pieces: Times of pieces of blends, if some are known.
    """
    measure, pieces = cost or cost_of, pieces or Pieces()
    prepared = search.part.prepared
    heads: Heads = {}
    without: set[Candidate] = set()
    given_up: list[str] = []
    whole = choice = search.choice()
    while True:
        # Networks take longest to train, and may yet be given up.
        blend = fit_choice(choice, search.base, prepared, train, seed, heads, draft=True)
        now = measure(blend, prepared)
        large = now.mb > limits.most_mb and len(choice.members) > 1
        units = _units(search, choice, without) if now.us > limits.bare_us else {}
        if not units and not large:
            fitted = {key: head for key, head in heads.items() if key[0].family != "network"}
            blend = fit_choice(choice, search.base, prepared, train, seed, fitted)
            return FittedBlend(choice, blend, tuple(given_up))
        if not units:
            heavy = _largest(choice, blend)
            without, names = without | {heavy}, [heavy.name]
            choice = search.choice(without)
        else:
            share = limits.bare_us / now.us
            without, choice, names = _quick_enough(
                search, choice, without, lambda own: pieces.us(own, prepared, heads), share
            )
        it = "it" if len(names) == 1 else "them"
        costly = whole.accuracy - choice.accuracy >= WORTH_SAYING
        given_up.append(
            f"{', '.join(names)}: {now.mb:.1f} MB and {now.us:.0f} µs with {it}; inner accuracy "
            f"{whole.accuracy:.4f} → {choice.accuracy:.4f}"
            + f"; a larger {'--max-us' if units else '--max-mb'} keeps {it}"
            * costly
        )


@dataclass(frozen=True, slots=True)
class _Saving:
    """One way to make a choice cheaper: a choice without some of its candidates."""

    name: str
    choice: Choice
    """Without it."""
    us: float
    """That the choice takes."""
    gone: int
    """How many candidates it takes away."""

    def rank(self, loss: float, us: float, enough: float) -> tuple[int, float, str]:
        """Return what is compared, the least being the best: by loss where this is enough; else by
        the loss that it costs for each microsecond that it saves; last what saves nothing, for
        another takes its place, by how few are left that could.

        Args:
            loss: Of what is chosen now.
            us: That it takes.
            enough: That it may take.
        """
        if self.us <= enough:
            return 0, self.choice.loss, self.name
        if us - self.us < _LEAST_SAVED_US:
            return 2, -self.gone, self.name
        return 1, (max(self.choice.loss - loss, 0.0) + _LEAST_PRICE) / (us - self.us), self.name


def _quick_enough(
    found: SearchResult,
    choice: Choice,
    without: Set[Candidate],
    us: Callable[[Choice], float],
    share: float,
) -> tuple[set[Candidate], Choice, list[str]]:
    """Give up one thing after another until about a share of the time is left.

    Of what would do at once, that which costs the least loss goes; else what costs least for the
    time that it saves. At least one thing goes. Of large windows, models on one set of features are
    taken instead where these alone are clearly better.

    Returns:
        What must not be chosen, what is chosen without it, and names of what went.
    """
    gone, names = set(without), list[str]()
    now = us(choice)
    enough = share * now
    while not names or now > enough:
        units = _units(found, choice, gone)
        if not units:
            break
        ways = []
        for name, unit in units.items():
            less = found.choice(gone | unit)
            ways.append(_Saving(name, less, us(less), len(unit)))
        best = min(ways, key=lambda way: way.rank(choice.loss, now, enough))
        gone |= units[best.name]
        names.append(best.name)
        choice, now = best.choice, best.us
    alone = _best_alone(found, without, us, enough) if found.part.values > LARGE else None
    if alone is not None and alone.choice.loss < choice.loss - LEAST_NATS:
        return _others(found, without, alone.name), alone.choice, [f"all but {alone.name}"]
    return gone, choice, names


def _best_alone(
    found: SearchResult, without: Set[Candidate], us: Callable[[Choice], float], enough: float
) -> _Saving | None:
    """Return the set of features that is best where all models on others go, and quick enough.

    What is given up one after another may end with a poor rest: large windows have several good
    sets that take half of the time each, and no two of them fit.
    """
    tried = {own.candidate for _, part, own in found.board if part is found.part} - without
    ways = []
    for seen in sorted({own.seen for own in tried if own.features}):
        others = _others(found, without, seen)
        choice = found.choice(others)
        way = _Saving(seen, choice, us(choice), len(others))
        if way.us <= enough:
            ways.append(way)
    return min(ways, key=lambda way: (way.choice.loss, way.name), default=None)


def _others(found: SearchResult, without: Set[Candidate], seen: str) -> set[Candidate]:
    """Return all candidates but those on a set of features, in words."""
    tried = {own.candidate for _, part, own in found.board if part is found.part}
    return {own for own in tried if own.seen != seen} | set(without)


def _units(
    found: SearchResult, choice: Choice, without: Set[Candidate]
) -> dict[str, set[Candidate]]:
    """Return what can be left out to save time, by name: all on a set of features, all forests of a
    kind, or a network; nothing without which no candidate would be left.
    """
    tried = {own.candidate for _, part, own in found.board if part is found.part} - without
    units: dict[str, set[Candidate]] = {}
    for member in choice.members:
        own = member.candidate
        if not member.blocks:
            units[own.name] = {own}
            continue
        alike = {other for other in tried if found.sets.get(other.features, ()) == member.blocks}
        units[f"every model on {own.seen}"] = alike
        if own.family == "trees":
            kind = {other for other in tried if other.kind == own.kind}
            units[f"every {own.kind_in_words}"] = kind
    return {name: unit for name, unit in units.items() if tried - unit}


def _largest(choice: Choice, blend: Blend) -> Candidate:
    """Return the member with most numbers."""
    sizes = [sum(t.numel() for t in head.state_dict().values()) for head in blend.heads]
    return copies(choice)[int(np.argmax(sizes))][0].candidate
