"""Trials that are copies of others: the same values, nearly the same, or mirrored.

Copies share runs of rows, whatever place they start at. Near copies are rescaled, offset or
have noise added: their course is far more alike than that of any honest neighbour, or they share
their noise at another place. Mirrored
ones are so after time, sign or image is turned round. Knows nothing about labels' meaning.

Background of our choices: docs/decisions/0023.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from itertools import combinations, pairwise

import numpy as np
from numpy.typing import NDArray

from taxel.evaluation.audit.affine import small_steps, up_to_rounding
from taxel.evaluation.audit.noise import MANY, shared_noise
from taxel.evaluation.audit.touch_set import TouchSet

RUN = 6
"""Rows in a run that two trials must share. Our choice, docs/decisions/0023."""
SHARED = 0.2
"""Share of a trial's runs that make it a copy. Our choice, decision 23."""
BINS = 48
"""Moments to which a trial is averaged before courses are compared."""
ALIKE = 0.995
"""Least correlation of near copies."""
RATIO = 0.03
"""A near copy's distance over that of the tenth nearest trial, at most: honest neighbours have
others about as near. Our choice, decision 23."""
SAME_NOISE = 0.7
"""Correlation of second differences from which two alike trials share their noise: copies with 5 %
of noise added reach 0.8 and more, a machine's repeats with 1 % of noise 0.6. Our choice, decision
23."""
ENOUGH = 24
"""Rows from which second differences show noise; of shorter trials they are mostly the course of
the touch itself. Source: our choice, docs/decisions/0023."""
_TENTH = 10
_FAINT = 0.2
"""Size of a trial's change over the median one, below which it has no course. Our choice."""
_ROWS_AT_ONCE = 16384
"""Rows that are put beside each other at once: 20 MB of 300 channels."""
_ENDS = 2
"""Moments at either end that are left out."""

Pairs = dict[tuple[int, int], float]
"""Pairs of trials (lower number first) → how alike they are, 0…1."""


def same_rows(
    touch: TouchSet, wanted: Callable[[int, int], bool] = lambda _a, _b: True
) -> Pairs | None:
    """Return pairs of different trials that share runs of rows; 1 is all of the shorter one's.

    Coarse values meet by chance: many pairs then share a little and few share much, and longer
    runs are asked for until that is no longer so, up to what nine trials of ten have: None where
    that is not enough to distinguish copies from chance. Only pairs that are wanted count.
    """
    return _same_numbers(touch, row_numbers(touch.rows), wanted)


def _same_numbers(
    touch: TouchSet, numbers: list[NDArray[np.uint64]], wanted: Callable[[int, int], bool]
) -> Pairs | None:
    """Return what `same_rows` does, given one number for each row of each trial."""
    longest = int(np.percentile([len(own) for own in numbers], 10))
    run = min(RUN, longest)
    while True:
        found, plenty = _shared_runs(touch, numbers, run, longest)
        every = {pair: share for pair, share in found.items() if wanted(*pair)}
        alike = {pair: share for pair, share in every.items() if share >= SHARED}
        if plenty and 4 * len(alike) >= 3 * len(every):
            return alike
        if run == longest:
            return None
        run = min(2 * run, longest)


def rows_in_common(touch: TouchSet, pairs: Pairs) -> Pairs:
    """Return how many rows of the shorter trial of each pair the other holds, too, 0…1.

    A row counts within six rows in order that both hold, wherever they start.
    """
    numbers = row_numbers(touch.rows)
    whole = [hash(own.tobytes()) for own in numbers]

    def share(a: int, b: int) -> float:
        if whole[a] == whole[b]:  # as in a trial that was copied a thousand times
            return 1.0
        short, long = sorted((numbers[a], numbers[b]), key=len)
        run = min(RUN, len(short))
        found = np.isin(runs_of(short, run), runs_of(long, run))
        return float((np.convolve(found, np.ones(run)) > 0).mean())

    return {pair: share(*pair) for pair in pairs}


def rows_backwards(touch: TouchSet) -> Pairs:
    """Return pairs of trials of which one, run backwards, shares runs of rows with the other."""
    n = len(touch)
    both = replace(touch, trials=2 * touch.trials, rows=2 * touch.rows)
    numbers = row_numbers(touch.rows)
    numbers += [own[::-1] for own in numbers]
    return {(min(a, b - n), max(a, b - n)): share for (a, b), share in
            (_same_numbers(both, numbers, lambda a, b: a < n <= b) or {}).items()}  # fmt: skip


def _shared_runs(
    touch: TouchSet, numbers: list[NDArray[np.uint64]], run: int, longest: int
) -> tuple[Pairs, bool]:
    """Return pairs of trials that share any run of so many rows → share of the shorter one's.

    And whether half of the trials have several such runs: where values are coarse or held for many
    rows, few runs say something.
    """
    each = [np.unique(changing_runs(own, run)) for own in numbers]
    sizes = [len(own) for own in each]
    owner = np.repeat(np.arange(len(each)), sizes)
    every = np.concatenate(each)
    order = np.argsort(every, kind="stable")
    ends = np.append(np.flatnonzero(np.diff(every[order])) + 1, len(every))
    starts = np.append(0, ends[:-1])
    # What stands in many trials is rest, not a copy.
    several = np.flatnonzero((ends - starts > 1) & (ends - starts <= _TENTH))
    shared: dict[tuple[int, int], int] = defaultdict(int)
    for place in several:
        holders = owner[order[starts[place] : ends[place]]]
        for pair in combinations(holders.tolist(), 2):
            shared[pair] += 1
    whole: dict[bytes, list[int]] = defaultdict(list)
    for trial, own in enumerate(each):
        if len(own):
            whole[own.tobytes()].append(trial)
    for same in whole.values():  # a trial that was copied often is no rest
        shared |= dict.fromkeys(combinations(same, 2), sizes[same[0]])
    return {
        (a, b): count / min(sizes[a], sizes[b])
        for (a, b), count in shared.items()
        if not overlap(touch, a, b)
    }, bool(np.median(sizes) >= min(RUN, longest - run + 1))


def near_copies(touch: TouchSet, known: Pairs) -> tuple[Pairs, Pairs, Pairs]:
    """Return near copies, trials as alike but with noise of their own, and copies turned round.

    The second may be repeats of one touch by a machine, or copies with more noise than they had.

    Args:
        touch: The trials.
        known: Pairs not to name again.
    """
    index = np.unique(np.linspace(0, len(touch) - 1, min(len(touch), MANY)).round().astype(int))
    courses = _courses(touch, index)
    plain = _signatures(courses)
    straight = _outliers(plain, plain, plain, touch, index, known)
    turned: Pairs = {}
    for turn in _turns(touch):
        other = _signatures(turn(courses))
        for pair, alike in _outliers(plain, other, plain, touch, index, known | straight).items():
            turned[pair] = max(alike, turned.get(pair, 0.0))
    steps = small_steps(touch.rows) if straight else np.zeros(0)
    near = {pair: alike for pair, alike in straight.items()
            if _same_noise(touch.rows[pair[0]], touch.rows[pair[1]], steps)}  # fmt: skip
    shifted, backwards = shared_noise(touch.rows)
    for found, more in ((near, shifted), (turned, backwards), (turned, rows_backwards(touch))):
        fresh = more.keys() - known.keys() - near.keys() - found.keys()
        found |= {pair: more[pair] for pair in sorted(fresh) if not overlap(touch, *pair)}
    return near, {pair: straight[pair] for pair in straight.keys() - near.keys()}, turned


def exact_copies(touch: TouchSet, pairs: Pairs) -> set[tuple[int, int]]:
    """Return the pairs of which one is the other, scaled and offset by channel, up to rounding.

    As it is, turned round, or run backwards. The others are alike, by noise that was added to a
    copy or because a touch was repeated.
    """
    if not pairs:
        return set()
    steps = small_steps(touch.rows)
    turns = [lambda rows: rows, *_turns(touch)]

    def exact(a: int, b: int) -> bool:
        first, other = touch.rows[a], touch.rows[b]
        return len(first) == len(other) and any(
            up_to_rounding(turn(own[None])[0], beside, steps)
            for own, beside in ((first, other), (other, first)) for turn in turns
        )  # fmt: skip

    found = {pair for pair in pairs if exact(*pair)}
    if pairs.keys() - found:
        found |= pairs.keys() & rows_backwards(touch).keys()
    return found


def _same_noise(
    first: NDArray[np.float32], other: NDArray[np.float32], steps: NDArray[np.float64]
) -> bool:
    """Return whether two trials share what changes from row to row, too.

    Short trials, and those whose rows lie on a straight line, show no noise: they do only where
    the second is the first scaled and offset, up to rounding.

    Args:
        first: Shape (rows, channels).
        other: Shape (rows, channels); rows beyond the shorter trial's are left out.
        steps: The resolution of each channel, shape (channels,).
    """
    n = min(len(first), len(other))
    fine = [np.diff(rows[:n].astype(np.float64), n=2, axis=0) for rows in (first, other)]
    spread = [np.linalg.norm(rows, axis=0) for rows in fine]
    alive = (spread[0] > 0) & (spread[1] > 0)
    if n < ENOUGH or not alive.any():
        return len(first) == len(other) and up_to_rounding(first, other, steps)
    of_channel = (fine[0] * fine[1]).sum(axis=0)[alive] / (spread[0] * spread[1])[alive]
    return float(of_channel.mean()) >= SAME_NOISE


def row_numbers(trials: Sequence[NDArray[np.float32]]) -> list[NDArray[np.uint64]]:
    """Return one number for each row of each trial: equal rows have equal ones.

    Args:
        trials: Each shape (rows, channels).

    Returns:
        Each shape (rows,).
    """
    ends = np.cumsum([len(rows) for rows in trials])
    channels = trials[0].shape[1]
    found = np.zeros(ends[-1], np.uint64)
    rng = np.random.default_rng(0)
    drawn = np.asarray(rng.integers(1, 2**63, channels, dtype=np.uint64))
    parts = np.searchsorted(ends, np.arange(0, ends[-1], _ROWS_AT_ONCE))
    for first, stop in pairwise([*dict.fromkeys(parts.tolist()), len(trials)]):
        rows = np.concatenate(trials[first:stop])
        own = found[ends[stop - 1] - len(rows) : ends[stop - 1]]
        with np.errstate(over="ignore"):
            for number, factor in enumerate(drawn | np.uint64(1)):
                bits = np.ascontiguousarray(rows[:, number]).view(np.uint32).astype(np.uint64)
                mixed = (bits ^ (bits >> np.uint64(7))) * factor
                own ^= mixed * (mixed >> np.uint64(29) | np.uint64(1))
    return np.split(found, ends[:-1])


def changing_runs(of_row: NDArray[np.uint64], run: int = RUN) -> NDArray[np.uint64]:
    """Return one number for each run of rows that says something, shape (m,).

    A trial that is shorter than the shortest runs is one by itself.

    Args:
        of_row: One number for each row, shape (rows,).
        run: Rows in a run.
    """
    if len(of_row) < run > RUN:
        return np.zeros(0, np.uint64)
    run = min(run, len(of_row))
    found = runs_of(of_row, run)
    fresh = np.concatenate([[False], of_row[1:] != of_row[:-1]])
    changes = np.convolve(fresh, np.ones(run), "valid") - fresh[: len(found)]
    return np.asarray(found[changes >= min(run - 1, (RUN + 1) // 2)], np.uint64)


def runs_of(of_row: NDArray[np.uint64], run: int) -> NDArray[np.uint64]:
    """Return one number for each run of so many rows, shape (rows − run + 1,)."""
    found = np.zeros(max(0, len(of_row) - run + 1), np.uint64)
    with np.errstate(over="ignore"):
        for k in range(run):
            found = found * np.uint64(0x9E3779B97F4A7C15) + of_row[k : k + len(found)]
    return found


def _courses(touch: TouchSet, index: NDArray[np.intp]) -> NDArray[np.float64]:
    """Return trials averaged to equally many moments, shape (n, bins, channels)."""
    bins = min(BINS, int(np.median([len(rows) for rows in touch.rows])))
    found = np.zeros((len(index), bins, touch.rows[0].shape[1]))
    for place, trial in enumerate(index):
        rows = touch.rows[trial].astype(np.float64)
        edges = np.linspace(0, len(rows), bins + 1)
        first = np.minimum(np.floor(edges[:-1]).astype(int), len(rows) - 1)
        stop = np.maximum(np.ceil(edges[1:]).astype(int), first + 1)
        sums = np.concatenate([np.zeros((1, rows.shape[1])), rows.cumsum(axis=0)])
        found[place] = (sums[stop] - sums[first]) / (stop - first)[:, None]
    return found


def _signatures(courses: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return what changes within trials, without offset and gain, shape (n, d), each of length 1.

    A trial in which hardly anything changes has no course of its own: zeros.
    """
    if courses.shape[1] > 4 * _ENDS:  # a jump at an end is the first frame's affair
        courses = courses[:, _ENDS:-_ENDS]
    spread = courses.std(axis=(0, 1))
    own = (courses - courses.mean(axis=1, keepdims=True)) / np.where(spread > 0, spread, 1.0)
    flat = own.reshape(len(own), -1)
    size = np.linalg.norm(flat, axis=1, keepdims=True)
    faint = size < _FAINT * np.median(size)
    return np.asarray(np.where(faint, 0.0, flat / np.where(size > 0, size, 1.0)), np.float32)


def _outliers(
    own: NDArray[np.float32],
    other: NDArray[np.float32],
    plain: NDArray[np.float32],
    touch: TouchSet,
    index: NDArray[np.intp],
    known: Pairs,
) -> Pairs:
    """Return pairs far nearer than the tenth nearest of the plain courses."""
    found: Pairs = {}
    tenth = min(_TENTH, max(1, len(own) // 3))
    usable = np.linalg.norm(plain, axis=1) > 0
    for start in range(0, len(own), 256):
        block = own[start : start + 256] @ other.T
        usual = own[start : start + 256] @ plain.T
        for place, (row, honest) in enumerate(zip(block, usual, strict=True), start):
            row[place] = honest[place] = -1.0
            if not usable[place]:
                continue
            limit = 1.0 - np.partition(honest, -tenth)[-tenth]
            for near in np.flatnonzero((row >= ALIKE) & (1.0 - row <= RATIO * limit)):
                a, b = sorted((int(index[place]), int(index[near])))
                if (a, b) not in known and not overlap(touch, a, b):
                    found[a, b] = float(row[near])
    return found


def _turns(touch: TouchSet) -> list[Callable[[NDArray[np.float64]], NDArray[np.float64]]]:
    """Return the ways in which a copy may be turned round; none is a plain copy again."""
    turns: list[Callable[[NDArray[np.float64]], NDArray[np.float64]]] = [
        lambda c: c[:, ::-1], lambda c: -c, lambda c: c[:, :, ::-1],
    ]  # fmt: skip
    if touch.squares is None:
        channels = touch.rows[0].shape[1]
        turns += [partial(np.roll, shift=k, axis=2) for k in range(1, min(channels, 13))]
        return turns
    high, wide = touch.squares
    cameras = len(touch.views) // (high * wide)

    def images(c: NDArray[np.float64]) -> NDArray[np.float64]:
        return c.reshape(*c.shape[:2], cameras, high, wide)

    return [
        lambda c: c[:, ::-1],
        lambda c: images(c)[..., ::-1].reshape(c.shape),
        lambda c: images(c)[..., ::-1, :].reshape(c.shape),
        lambda c: images(c)[..., ::-1, ::-1].reshape(c.shape),
        lambda c: images(c)[:, :, ::-1].reshape(c.shape),
    ]


def overlap(touch: TouchSet, a: int, b: int) -> bool:
    """Return whether two trials are overlapping stretches of one recording."""
    own, other = touch.trials[a], touch.trials[b]
    same = own.recording == other.recording
    return same and own.start_s < other.end_s and other.start_s < own.end_s
