"""What an audit says of copies: on both sides of a split, on one side, or anywhere in the data.

Knows which trials are copies of each other; knows nothing about how that was found.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from taxel.evaluation.audit.both_sides import Partners, commonest, looked_up
from taxel.evaluation.audit.case import Case
from taxel.evaluation.audit.copies import ENOUGH, Pairs, rows_in_common
from taxel.evaluation.audit.evidence import SURE, sign_p, trial_folds
from taxel.evaluation.audit.finding import LITTLE, Finding
from taxel.evaluation.audit.sides import Sides
from taxel.evaluation.audit.touch_set import LEAST_ROWS, Pieces, TouchSet
from taxel.labels.trials import OBJECTS, SESSIONS
from taxel.plain_text import number_of, several

COPIES_UNKNOWN = Finding(
    kind="duplicates", verdict="not checked",
    message="Values change in so few steps that copies cannot be distinguished from chance.",
    mend="record finer steps, longer trials or more channels",
)  # fmt: skip

_NO_SHARE = 1e-6
"""A share nearer to 0 or 1 is none or all: hides rounding."""


@dataclass(frozen=True, slots=True)
class Alike:
    """Which of some pairs are copies beyond doubt, and what the others are called."""

    sure: Collection[tuple[int, int]]
    words: str
    """What the others are, such as "are alike turned round"."""


@dataclass(frozen=True, slots=True)
class _CopiesOnSides:
    """Where a split puts the copies of the trials that it tests."""

    partners: list[Partners]
    """For each fold and each of its test pieces: the training pieces of trials that are copies of
    the piece's trial."""
    crossing: dict[int, int]
    """Tested trials of which a copy is in training → the class that those copies have."""
    parted: set[tuple[int, int]]
    """The pairs of which one trial is tested and the other in training."""
    twice: set[int]
    """Tested trials of which a copy is in the same test part."""
    tested: int
    """All tested trials."""


def shared_copies(
    case: Case,
    kind: str,
    pairs: Pairs,
    what: str,
    unseen: str = "",
    *,
    streams: bool = False,
    alike: Alike | None = None,
) -> Finding:
    """Return the finding on copies: across sides, on one side only, or anywhere.

    Across the sides they are a leak; where they are alike, but not surely copies, what knowing
    their label gains decides. On one side nothing of a test trial is known in training, so that
    they are a note. Without a split they are a hazard where a group that the recordings name keeps
    all copies together, and a leak where none does.

    Args:
        case: The audit.
        kind: Its name.
        pairs: Trials that are copies of each other, each pair with how alike it is, 0…1.
        what: What they are, such as "hold the same rows".
        unseen: A sentence on what was not compared; empty where all was.
        streams: They are windows of one stream that overlap, none of which is to be dropped.
        alike: Which of them are copies beyond doubt; None for all.
    """
    touch = case.touch
    thinned = max(touch.every.values(), default=1)
    if thinned > 1:
        unseen = f"One row of {thinned} is seen where files are large. {unseen}".rstrip()
    if not pairs:
        return _no_copies(kind, what, unseen)
    copies_of = _copies_of(pairs)
    split = case if case.sides is not None else _split_by_trials(case)
    copies = _on_sides(split, copies_of)
    parted = copies.parted if case.sides is not None else set(pairs)
    doubtful = alike is not None and parted.isdisjoint(alike.sure)
    if alike is not None and doubtful:
        what = alike.words
    odd = len(_odd(touch, pairs))
    if odd:
        what += f" ({odd} of {number_of(len(pairs), 'pair')} with two different labels)"
    in_rows = streams or (kind == "duplicates" and max(map(len, touch.rows)) >= LEAST_ROWS)
    examples = _examples(touch, pairs, "of the rows in common" if in_rows else "alike", parted)
    if case.sides is not None and not copies.crossing:
        return _one_side_note(kind, f"{number_of(len(pairs), 'pair')} of trials {what}",
                              copies.twice, streams, examples, odd)  # fmt: skip
    key = joining_group(touch, pairs)
    joins = "" if key is None else f"whole {several(key)}"
    alone, usual, count, total = looked_up(split, copies.partners)
    if case.sides is not None:
        at_most = count / total
        share = "shares" if len(copies.crossing) == 1 else "share"
        message = f"{len(copies.crossing)} of {number_of(copies.tested, 'tested trial')} {share} " \
                  f"this with a training trial: trials {what}. It can change the accuracy by " \
                  f"{at_most:.3f} at most."  # fmt: skip
    else:
        at_most = len(copies_of) / len(touch)
        some = f"a split that does not hold out {joins}" if joins else "a split of trials"
        message = f"{number_of(len(pairs), 'pair')} of trials ({len(copies_of)} of {len(touch)} " \
                  f"trials) {what}: {some} puts them on both sides."  # fmt: skip
    found = Finding(
        kind=kind, verdict="hazard" if case.sides is None and joins else "leak", message=message,
        mend=_mend(joins, streams, odd, len(pairs)), alone=alone, majority=usual,
        examples=examples, at_most=at_most,
    )  # fmt: skip
    return _by_gain(found, _gains(split, copies, copies_of)) if doubtful else found


def shared_rows(case: Case, pairs: Pairs) -> Finding:
    """Return the finding on trials that hold the same rows, or part of them.

    Args:
        case: The audit.
        pairs: Trials that share a fifth of their changing runs of rows or more.
    """
    if not pairs:
        return shared_copies(
            case, "duplicates", {}, "share a fifth or more of the rows that change"
        )
    shares = rows_in_common(case.touch, pairs)
    part = [_percent(share, 0) for share in sorted(shares.values()) if share < 1.0]
    if not part:
        return shared_copies(case, "duplicates", shares, "hold the same rows")
    share = f"{' % to '.join(dict.fromkeys((part[0], part[-1])))} % of the shorter one's"
    words = f"hold the same rows, {len(part)} of {len(pairs)} pairs only in part, {share}"
    if len(part) == len(pairs):
        words = f"hold in part the same rows, {share}"
    found = shared_copies(case, "duplicates", shares, words)
    return replace(found, mend=f"find out how rows of one trial came into another; {found.mend}")


def _percent(share: float, decimals: int) -> str:
    """Return a share, 0…1, in per cent; of one that is neither none nor all never 0 or 100."""
    text = f"{100 * share:.{decimals}f}"
    if 0.0 < float(text) < 100.0 or not _NO_SHARE < share < 1.0 - _NO_SHARE:
        return text
    return f"{min(max(100 * share, 0.1), 99.9):.1f}"


def _gains(case: Case, copies: _CopiesOnSides, copies_of: Mapping[int, set[int]]) -> list[int]:
    """Return what knowing copies' labels gains on the commonest class, one entry for each set of
    trials that are alike: how many tested trials more are right.

    Trials that are alike among themselves are right or wrong together: they count as one case.
    """
    y, usual = case.touch.y, commonest(case)
    gains: dict[int, int] = defaultdict(int)
    first: dict[int, int] = {}
    for start in copies_of:
        waiting = [start]
        while waiting:
            trial = waiting.pop()
            if trial not in first:
                first[trial] = start
                waiting += copies_of[trial]
    for trial, named in copies.crossing.items():
        gains[first[trial]] += int(named == y[trial]) - int(usual == y[trial])
    return list(gains.values())


def _by_gain(found: Finding, gains: Sequence[int]) -> Finding:
    """Return the finding on trials that are alike, but not surely copies, by what they gain.

    It stays as it is where knowing their labels gains more than chance (a sign test over sets of
    trials that are alike). It is a hazard where sets are too few for such a test, unless they
    lose something; and a note where they can change next to nothing, or where enough of them gain
    nothing.
    """
    better, worse = sum(gain > 0 for gain in gains), sum(gain < 0 for gain in gains)
    much = found.at_most is None or found.at_most >= LITTLE
    if much and sign_p(better, worse) < SURE:
        return found
    if much and better >= worse and sign_p(len(gains), 0) >= SURE:
        return replace(
            found, verdict="hazard",
            message=f"{found.message} They are too few to show whether that gives the label away: "
                    "if they were copied it is a leak, if one touch was repeated it is none.",
        )  # fmt: skip
    return replace(
        found, verdict="note",
        message=f"{found.message} Knowing their labels gains "
        + ("no more than chance." if much else "next to nothing."),
        mend=f"if they were copied, {found.mend}; if one touch was repeated, say so",
    )  # fmt: skip


def _no_copies(kind: str, what: str, unseen: str) -> Finding:
    if unseen:
        return Finding(kind=kind, verdict="not checked",
                       message=f"{unseen} Among those no two trials {what}.",
                       mend="audit fewer trials at a time")  # fmt: skip
    return Finding(kind=kind, verdict="clear", message=f"No two trials {what}.")


def _copies_of(pairs: Pairs) -> dict[int, set[int]]:
    """Return for each trial of a pair the trials that it is paired with."""
    found: dict[int, set[int]] = {}
    for a, b in pairs:
        found.setdefault(a, set()).add(b)
        found.setdefault(b, set()).add(a)
    return found


def _on_sides(case: Case, copies_of: Mapping[int, set[int]]) -> _CopiesOnSides:
    """Return where the split of a case puts the copies of each tested trial."""
    assert case.sides is not None
    trial = case.pieces.trial
    y, partners = case.touch.y, list[Partners]()
    crossing, parted = dict[int, int](), set[tuple[int, int]]()
    twice, tested = set[int](), set[int]()
    for train, test in case.sides.folds:
        in_test = set(trial[test].tolist())
        in_training = {t: train[np.isin(trial[train], list(copies_of.get(t, ())))]
                       for t in in_test}  # fmt: skip
        partners.append([in_training[t] for t in trial[test].tolist()])
        for own, pieces in in_training.items():
            if len(pieces):
                crossing[own] = int(np.bincount(y[trial[pieces]]).argmax())
                parted |= {(min(own, other), max(own, other)) for other in trial[pieces].tolist()}
        twice |= {t for t in in_test if copies_of.get(t, set()) & in_test}
        tested |= in_test
    return _CopiesOnSides(partners, crossing, parted, twice, len(tested))


def _one_side_note(
    kind: str, what: str, twice: set[int], streams: bool, examples: tuple[str, ...], odd: int
) -> Finding:
    """Return the note on copies of which the split puts none on both sides."""
    where = "all of them in training"
    if twice:
        counts = "counts" if len(twice) == 1 else "count"
        where = f"{number_of(len(twice), 'tested trial')} {counts} more than once"
    mend = "say so" if streams or not twice else "keep one of each, or say so"
    if odd:
        mend = f"{_NEITHER}; for the others {mend}"
    return Finding(
        kind=kind, verdict="note", examples=examples,
        message=f"{what}, each on one side of the split: nothing of a test trial is in its "
                f"training part; {where}.",
        mend=mend,
    )  # fmt: skip


_NEITHER = "leave out both trials of a pair with two different labels, unless the right label " \
           "can be looked up"  # fmt: skip


def _mend(joins: str, streams: bool, odd: int, pairs: int) -> str:
    """Return what to do about copies on both sides.

    Args:
        joins: The groups that can be held out whole and keep all copies together; empty for none.
        streams: They are windows of one stream, none of which is to be dropped.
        odd: Pairs with two different labels, of which nobody knows which is right.
        pairs: All pairs.
    """
    if streams and joins:
        return f"hold out {joins}"
    if streams:
        return "hold out whole streams: name what the trials were cut from as a group of the " \
               "import (such as group:stream)"  # fmt: skip
    keep = f"{_NEITHER}; of the others keep one of each" if odd else "keep one of each"
    if odd == pairs:
        keep = f"{_NEITHER}; then keep that one"
    if joins:
        return f"{keep}, or hold out {joins}, which keep them together"
    if odd == pairs:
        return keep
    return f"{keep}, or give all copies of a trial to the side of their original"


def _split_by_trials(case: Case) -> Case:
    """Return the case with a split of single trials, each of them one piece."""
    n = len(case.touch)
    whole = Pieces(
        trial=np.arange(n), first=np.zeros(n, np.intp),
        stop=np.array([len(rows) for rows in case.touch.rows], np.intp), view=np.full(n, ""),
        label_s=np.full(n, np.nan),
    )  # fmt: skip
    sides = Sides(name="single trials", claimed=(),
                  folds=tuple(trial_folds(case.touch.y, None, case.seed)))  # fmt: skip
    return replace(case, pieces=whole, sides=sides)


def joining_group(touch: TouchSet, pairs: Pairs) -> str | None:
    """Return a group that can be held out whole and keeps all pairs together; None if none does.

    One that says when or by whom comes first, then objects, then the others; of several the one
    with most values, which is least likely to join them by chance. Each class has at least two
    values of it.
    """
    y, classes = touch.y, range(len(touch.classes))
    others = sorted({key for trial in touch.trials for key in trial.groups} - {"trial"})
    for keys in (SESSIONS, OBJECTS, [k for k in others if k not in (*SESSIONS, *OBJECTS)]):
        found: dict[str, int] = {}
        for key in touch.keys(tuple(keys)):
            own = touch.group(key)
            assert own is not None
            apart = all(len(set(own[y == c])) > 1 for c in classes)
            if apart and all(own[a] == own[b] for a, b in pairs):
                found[key] = len(set(own))
        if found:
            return max(found, key=found.__getitem__)
    return None


def _odd(touch: TouchSet, pairs: Pairs) -> list[tuple[int, int]]:
    """Return pairs with two different labels, most alike first: one of the labels is wrong."""
    odd = [pair for pair in pairs if touch.y[pair[0]] != touch.y[pair[1]]]
    return sorted(odd, key=lambda pair: -pairs[pair])


def _foremost(
    touch: TouchSet, pairs: Pairs, parted: Collection[tuple[int, int]]
) -> list[tuple[int, int]]:
    """Return the pairs to name: all with two different labels, or else the most alike.

    Of those that are alike only ones that the split parts, if it parts any.
    """
    odd = sorted(_odd(touch, pairs), key=lambda pair: pair not in parted)
    rest = [pair for pair in pairs if pair not in odd and (pair in parted or not parted)]
    rest.sort(key=lambda pair: (-pairs[pair], pair))
    return [*odd, *rest[: max(0, 3 - len(odd))]]


def _named(touch: TouchSet, pairs: Pairs) -> list[str]:
    """Return what trials are called, with the label of those that a pair labels otherwise."""
    odd = {trial for pair in _odd(touch, pairs) for trial in pair}
    return [
        trial.groups["trial"] + (f" [{trial.labels[touch.target]}]" if number in odd else "")
        for number, trial in enumerate(touch.trials)
    ]


def _examples(
    touch: TouchSet, pairs: Pairs, alike: str, parted: Collection[tuple[int, int]] = ()
) -> tuple[str, ...]:
    """Return the pairs to name, each with how much of it is alike."""
    names = _named(touch, pairs)
    return tuple(
        f"{names[a]} and {names[b]} ({_percent(pairs[a, b], 1)} % {alike}"
        + (", on one side)" if parted and (a, b) not in parted else ")")
        for a, b in _foremost(touch, pairs, parted)
    )


def repeated(touch: TouchSet, pairs: Pairs) -> Finding:
    """Return the finding on trials that are alike but for noise of their own."""
    short = any(len(touch.rows[trial]) < ENOUGH for pair in pairs for trial in pair)
    doubt = f" In trials of fewer than {ENOUGH} rows noise cannot be distinguished from touch, " \
            "so this is not decided." if short else ""  # fmt: skip
    return Finding(
        kind="near-duplicates", verdict="note",
        message=f"{number_of(len(pairs), 'pair')} of trials are alike but for noise: a machine's "
                f"repeats of one touch, or copies with noise added.{doubt}",
        mend=(f"{_NEITHER}; " if _odd(touch, pairs) else "")
        + "if they are copies, keep one of each; if repeats, say so, and hold out whole objects",
        examples=_examples(touch, pairs, "alike"),
    )  # fmt: skip
