"""Two runs on the same test windows: is one better, and for how many sessions can that be said?

Windows of one session are alike, so that a test over windows finds differences where there are
none. The test over whole groups is the one to believe. Knows nothing about folders or screens.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest

from taxel.errors import BadInput
from taxel.evaluation.intervals import ratio_interval
from taxel.labels.trials import Trial, coarsest_group, lone_group
from taxel.plain_text import noun_of, number_of, several
from taxel.training.predictions import Predictions
from taxel.training.run import Run

LEVEL = 0.05
"""A difference is claimed below this p. Source: convention."""
_EXACT_GROUPS = 16
"""Up to so many groups all 2^n sign changes are gone through."""
_DRAWN = 50_000
"""Sign changes drawn where there are more groups. Source: our choice, docs/decisions/0025."""
_SLACK_S = 1e-6
"""Windows whose starts differ by less are the same, seconds: hides float rounding."""


@dataclass(frozen=True, slots=True)
class GroupPair:
    """Both runs on the windows of one group."""

    name: str
    windows: int
    first: float
    """Accuracy of the first run, 0…1."""
    second: float
    """Accuracy of the second run, 0…1."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Paired:
    """The comparison of two runs on the same test windows."""

    target: str
    split: str
    group: str
    """The group that is taken as a whole."""
    coarsest: str
    """The coarsest group there is, which a claim should be made over."""
    lone: str | None
    """The group of which one value only was tested, such as the session; None where there is no
    such group."""
    windows: int
    first: float
    """Accuracy of the first run, 0…1."""
    second: float
    """Accuracy of the second run, 0…1."""
    difference: float
    """Second minus first, −1…1."""
    interval: tuple[float, float]
    """95 % of the difference, whole groups resampled; NaN where there is one only."""
    only_first: int
    """Windows that only the first run predicts correctly."""
    only_second: int
    """Windows that only the second run predicts correctly."""
    p_windows: float
    """McNemar's exact test over windows; too sure where windows of a group are alike."""
    p_groups: float
    """Sign-flip permutation test over groups; the one to believe."""
    smallest_p: float
    """The least that `p_groups` could be with so many groups."""
    groups: tuple[GroupPair, ...]
    notes: tuple[str, ...] = ()
    """What was left out of the windows, and why."""

    @property
    def verdict(self) -> str:
        """What may be claimed, in plain words."""
        return self.say("the first run", "the second run")

    def say(self, first: str, second: str) -> str:
        """Return what may be claimed in plain words, with the runs' names."""
        return _verdict(self, first, second)


def compare_runs(first: Run, second: Run, group: str | None = None) -> Paired:
    """Return the paired tests of two runs.

    Args:
        first: A run with predictions.
        second: Another, on the same recordings, target, split and folds.
        group: The group that is taken as a whole; the session, else the file, else the
            recording, else the trial, unless given.

    Raises:
        BadInput: A run has no predictions, or the two were not tested alike.
    """
    return compare_predictions(*predictions_of_both(first, second), first.contract.target, group)


def compare_predictions(
    ours: Predictions, theirs: Predictions, target: str, group: str | None = None
) -> Paired:
    """Return the paired tests of two sets of predictions of the same windows.

    Args:
        ours: What the first said.
        theirs: What the second said.
        target: What they predicted.
        group: The group that is taken as a whole; see `compare_runs`.

    Raises:
        BadInput: The two were not tested alike.
    """
    ours, theirs = _alike(ours, theirs)
    coarsest = coarsest_of(ours)
    key = group or coarsest
    _refuse_regrouped(ours, theirs, {key, coarsest, coarsest_of(theirs)})
    names, index = np.unique(ours.group(key), return_inverse=True)
    right, other = ours.correct, theirs.correct
    count = np.bincount(index)
    wins = np.bincount(index, weights=right), np.bincount(index, weights=other)
    changed = (wins[1] - wins[0]).astype(np.float64)
    only_first, only_second = int((right & ~other).sum()), int((other & ~right).sum())
    return Paired(
        target=target,
        split=ours.split,
        group=key,
        coarsest=coarsest,
        lone=lone_group(tested_of(ours), ours.split),
        windows=len(ours),
        first=float(right.mean()),
        second=float(other.mean()),
        difference=float(changed.sum() / len(ours)),
        interval=ratio_interval(changed, count),
        only_first=only_first,
        only_second=only_second,
        p_windows=mcnemar(only_first, only_second),
        p_groups=sign_flip(changed),
        smallest_p=smallest_p(len(names)),
        groups=tuple(
            GroupPair(str(name), int(n), float(a / n), float(b / n))
            for name, n, a, b in zip(names, count, *wins, strict=True)
        ),
    )


def mcnemar(only_first: int, only_second: int) -> float:
    """Return the exact two-sided p of McNemar's test; 1 where the two never differ."""
    both = only_first + only_second
    return float(binomtest(only_first, both, 0.5).pvalue) if both else 1.0


def sign_flip(changed: NDArray[np.float64], seed: int = 0) -> float:
    """Return the two-sided p of a sign-flip permutation test.

    If neither run were better, each group's difference could as well have had the other
    sign. All 2^n signs are gone through; with many groups, signs are drawn, and the changes
    that were found count as one more draw, so that p is never too small.

    Args:
        changed: Windows gained (or lost) in each group, shape (groups,).
        seed: Seed of drawn signs.

    Source: Phipson & Smyth, Stat. Appl. Genet. Mol. Biol. 9 (2010) 39, for drawn signs.
    """
    n, found = len(changed), abs(float(changed.sum()))
    if n <= _EXACT_GROUPS:
        bits = np.arange(2**n)[:, None] >> np.arange(n) & 1
        sums = (1 - 2 * bits) @ changed
        return float((np.abs(sums) >= found - 1e-9).mean())
    signs = np.random.default_rng(seed).choice([-1.0, 1.0], (_DRAWN, n))
    as_large = int((np.abs(signs @ changed) >= found - 1e-9).sum())
    return (as_large + 1) / (_DRAWN + 1)


def smallest_p(groups: int) -> float:
    """Return the smallest p that `sign_flip` can give for so many groups; 6 are needed for 0.05.

    Where signs are drawn, that is one draw's share, however many groups there are.
    """
    return min(1.0, 2.0 ** (1 - groups)) if groups <= _EXACT_GROUPS else 1 / (_DRAWN + 1)


def coarsest_of(predictions: Predictions) -> str:
    """Return the group to draw as a whole: the coarsest, or what the split holds out."""
    return coarsest_group(tested_of(predictions), predictions.split)


def tested_of(predictions: Predictions) -> list[Trial]:
    """Return the trials that were tested."""
    return [predictions.trials[index] for index in np.unique(predictions.trial)]


def predictions_of_both(first: Run, second: Run) -> tuple[Predictions, Predictions]:
    """Return both runs' predictions, once they are found to be of the same recordings.

    Raises:
        BadInput: They are of others, or one has none.
    """
    one, two = first.predictions, second.predictions
    if one is None or two is None:
        raise BadInput(
            "two runs with test predictions",
            f"none in the {'first' if one is None else 'second'}",
            "train again without --no-check; of an adapted run name the version that was trained",
        )
    _refuse_others({
        "recordings": (first.contract.data_digest[:12], second.contract.data_digest[:12]),
        "target": (first.contract.target, second.contract.target),
    })  # fmt: skip
    return one, two


def _refuse_others(settings: Mapping[str, tuple[str, str]]) -> None:
    for what, (ours, theirs) in settings.items():
        if ours != theirs:
            raise BadInput(
                f"two runs of the same {what}", f"{ours} and {theirs}",
                f"train one of them again with the {what} of the other",
            )  # fmt: skip


def _alike(one: Predictions, two: Predictions) -> tuple[Predictions, Predictions]:
    """Return both predictions in one order, once they are found to be comparable."""
    _refuse_others({
        "classes": (", ".join(one.classes), ", ".join(two.classes)),
        "split": (one.split, two.split),
    })  # fmt: skip
    one, two = _ordered(one), _ordered(two)
    places = [[p.trials[t].recording for t in p.trial] for p in (one, two)]
    if places[0] != places[1] or not np.allclose(one.start_s, two.start_s, rtol=0, atol=_SLACK_S):
        raise BadInput(
            "two runs with the same test windows",
            f"{len(one)} and {len(two)} that do not all start together",
            "train both with the same --recipe and --window",
        )
    _refuse_changed("labels", "class", one.y != two.y)  # folds may follow from them
    folds = [[p.folds[f] for f in p.fold] for p in (one, two)]
    if folds[0] != folds[1]:
        raise BadInput(
            "two runs with the same folds", "windows that were predicted in different folds",
            "train both with the same --seed and --fold-count, or with one table of --folds",
        )  # fmt: skip
    return one, two


def _refuse_regrouped(one: Predictions, two: Predictions, keys: Collection[str]) -> None:
    """Refuse groups that were corrected between two runs, where the tests depend on them."""
    for key in sorted(keys):
        ours, theirs = ([p.trials[t].groups.get(key) for t in p.trial] for p in (one, two))
        changed = [own != other for own, other in zip(ours, theirs, strict=True)]
        _refuse_changed(several(key), key, np.array(changed))


def _refuse_changed(what: str, kind: str, changed: NDArray[np.bool_]) -> None:
    if changed.any():
        raise BadInput(
            f"two runs with the same {what}",
            f"{int(changed.sum())} of {len(changed)} windows with another {kind} in the second",
            "train both on one import",
        )


def _ordered(found: Predictions) -> Predictions:
    """Return the same predictions in the order of recordings and time."""
    names = np.array([found.trials[trial].recording for trial in found.trial])
    order = np.lexsort((found.start_s, names))
    return Predictions(
        split=found.split,
        classes=found.classes,
        trials=found.trials,
        folds=found.folds,
        trained=found.trained,
        trial=found.trial[order],
        start_s=found.start_s[order],
        fold=found.fold[order],
        y=found.y[order],
        probabilities=found.probabilities[order],
    )


def _verdict(paired: Paired, first: str, second: str) -> str:
    n, points = len(paired.groups), 100 * paired.difference
    groups = number_of(n, paired.group)
    sentences = []
    if not paired.only_first and not paired.only_second:
        sentences.append("The two runs are right and wrong on the very same windows.")
    elif n < 2:
        sentences.append(
            f"No difference can be claimed: all windows are of one {noun_of(paired.group)}, which "
            "says nothing of another."
        )
    elif paired.p_groups < LEVEL:
        better = second if points > 0 else first
        better = better[0].upper() + better[1:] if better.startswith("the ") else better
        low, high = (100 * bound for bound in paired.interval)
        sentences.append(
            f"{better} is better by {abs(points):.1f} points over {groups} (second minus first, "
            f"95 %: {low:+.1f} to {high:+.1f}), p {_p(paired.p_groups)}."
        )
    elif paired.smallest_p >= LEVEL:
        sentences.append(
            f"No difference can be claimed with {groups}: the smallest possible p is "
            f"{paired.smallest_p:.2g}. Record more of them."
        )
    else:
        sentences.append(
            f"No difference can be claimed: p {_p(paired.p_groups)} over {groups} (the smallest "
            f"possible is {paired.smallest_p:.2g})."
        )
    if paired.p_groups >= LEVEL and paired.p_windows < LEVEL:
        sentences.append(
            f"The test over windows alone says p {_p(paired.p_windows)}, but windows of one "
            f"{noun_of(paired.group)} are alike: it promises too much."
        )
    if paired.group != paired.coarsest:
        sentences.append(
            f"{several(noun_of(paired.group).capitalize())} of one {noun_of(paired.coarsest)} are "
            "alike too: it promises much."
        )
    if paired.lone not in (None, paired.group):
        sentences.append(
            f"Only one {noun_of(paired.lone)} was tested: this says nothing about other "
            f"{several(paired.lone)}."
        )
    if "leaks" in paired.split:
        sentences.append("The split leaks: whatever is better here need not be on new recordings.")
    return " ".join(sentences)


def _p(value: float) -> str:
    return "below 0.0001" if value < 1e-4 else f"= {value:.2g}"
