"""The outer score of a choice: for each fold all is chosen anew on the training part alone.

The score is of the way to choose, not of one model: each outer fold may end up with other windows
and members. What is trained on all data afterwards is chosen the same way. Knows nothing about
screens or folders.

Source: Cawley and Talbot, "On over-fitting in model selection", JMLR 2010; docs/decisions/0039.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from torch import nn

from taxel.decisions.joining import Joining
from taxel.decisions.recognition import at_limit
from taxel.errors import BadSplit
from taxel.evaluation.bars import BARS, FEWEST_ROWS, bar_probabilities
from taxel.evaluation.baselines import shares, trivial_right
from taxel.evaluation.metrics import cross_entropy
from taxel.evaluation.outer_split import check_training_parts
from taxel.evaluation.run_scores import RunScores, baseline_warning, judge, least_of_all_right
from taxel.evaluation.splits import WHOLE_SPLITS, Split
from taxel.training.choose.base import Base
from taxel.training.choose.choice import Choice
from taxel.training.choose.costs import KnownCosts
from taxel.training.choose.fit_choice import fit_choice, predict_blend
from taxel.training.choose.inner_folds import Held, what_is_held
from taxel.training.choose.joining import join
from taxel.training.choose.limits import USUAL_LIMITS, FittedBlend, Limits, fit_within
from taxel.training.choose.preparations import Prepared
from taxel.training.choose.search import Effort, SearchResult, choose
from taxel.training.predictions import Predictions


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialScores:
    """A recogniser judged by trial, its windows joined."""

    accuracy: float
    loss: float
    trials: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Nested:
    """What a nested validation found."""

    split: str
    choices: tuple[Choice, ...]
    """One an outer fold."""
    predictions: Predictions
    scores: RunScores
    by_trial: TrialScores
    bars: dict[str, tuple[RunScores, TrialScores]]
    """Bar → its scores on the very same windows."""
    bars_s: float
    """Seconds that the bars took, beside the budget."""
    trivial: dict[str, float] = field(default_factory=dict)
    """Trivial baseline → accuracy on the very same windows, 0…1."""
    fixed: bool = False
    """Whether a choice that was made before was judged, and nothing chosen."""

    @property
    def warning(self) -> str | None:
        """A warning where the accuracy is not clearly above the trivial baselines; else None."""
        scores = self.scores
        interval = scores.intervals[scores.group]
        if scores.scores.accuracy == self.by_trial.accuracy == 1.0:  # resampled, it has no width
            least = least_of_all_right(self.by_trial.trials)
            interval = replace(interval, low=min(interval.low, least))
        return baseline_warning(
            "what was chosen", scores.scores, interval, scores.group, self.trivial
        )


@dataclass(frozen=True, slots=True)
class _Tested:
    """Test windows of one fold."""

    prepared: Prepared
    index: NDArray[np.intp]
    probabilities: NDArray[np.float64]
    joined: tuple[NDArray[np.intp], NDArray[np.float64]]

    def trivial_right(self, base: Base, train: Sequence[int]) -> Counter[tuple[str, str]]:
        """Return how many of these windows each trivial baseline's models name rightly."""
        own = self.prepared.plain
        learned = np.flatnonzero(np.isin(own.trial, np.asarray(train, np.intp)) & own.scored)
        return trivial_right(own.dataset, base.y[own.trial], [(learned, self.index)])


def check_choosing(
    base: Base,
    prepared: Sequence[Prepared],
    split: Split,
    effort: Effort,
    bars: Sequence[str] = (),
    limits: Limits = USUAL_LIMITS,
    known: tuple[SearchResult, FittedBlend] | None = None,
) -> Nested:
    """Choose, train and test in each fold of a split.

    Args:
        base: The recordings.
        prepared: The ways to cut them.
        split: Folds of whole trials, by the indices of `base.trials`.
        effort: Its budget is shared among the folds, a share each.
        bars: Names in `BARS`, which see the windows that were chosen.
        limits: What is judged keeps to the limits of what is shipped.
        known: What was tried, chosen and trained already on the training side of the only fold.

    Raises:
        BadSplit: A fold parts windows, not trials, or leaves too few trials to learn from; or no
            test trial gives a window.
    """
    check_training_parts(base, split)
    tested, choices = [], []
    costs = KnownCosts(limits.bare_us)
    bars_s = 0.0
    beside: dict[str, list[_Tested]] = {name: [] for name in bars}
    for fold in split.whole_trials("to choose on", WHOLE_SPLITS):
        train, test = sorted(fold.train), sorted(fold.test)

        def say(line: str, name: str = fold.name) -> None:
            effort.on_step(f"{name} · {line}")

        if known is not None:
            tried, fitted = known
        else:
            held = what_is_held(base.trials, base.y, train, test, split.key)
            own_effort = replace(effort, on_step=say)
            tried, fitted = _choose_and_fit(base, prepared, train, held, own_effort, limits, costs)
        choice, prepared_windows = fitted.choice, tried.part.prepared
        tested.append(_test(base, fitted.blend, choice, prepared_windows, test))
        index = tested[-1].index
        choices.append(choice)
        started = effort.budget.clock()
        for name in bars:
            if choice.window.steps >= FEWEST_ROWS.get(name, 1):
                say(name)
                plain = prepared_windows.plain
                beside[name].append(_bar(name, base, plain, train, index, effort.seed))
        spent = effort.budget.clock() - started
        effort.budget.add(spent)
        bars_s += spent
    return replace(
        _nested(base, split, tested, choices),
        bars={
            name: (judge(_predictions(base, split, own)), _by_trial(base, own))
            for name, own in beside.items() if len(own) == len(tested)
        },
        bars_s=bars_s,
    )  # fmt: skip


def _choose_and_fit(
    base: Base,
    prepared: Sequence[Prepared],
    train: list[int],
    held: Held,
    effort: Effort,
    limits: Limits,
    costs: KnownCosts,
) -> tuple[SearchResult, FittedBlend]:
    """Return what was tried on a fold's training part, and what was chosen, trained on it."""
    tried = choose(base, prepared, train, held, effort)
    effort.on_step("training what was chosen")
    with effort.budget.training():
        fitted = fit_within(
            tried, train, limits, seed=effort.seed, cost=costs, pieces=effort.pieces
        )
    return tried, fitted


def worse_than_judged(choice: Choice, nested: Nested | None) -> tuple[str, ...]:
    """Return a warning where what is saved had too little time to be what the score is of.

    Its inner folds learn from more data than those of the choices that were judged, so that they
    are no worse, but by chance.

    Args:
        choice: What is saved.
        nested: The score of other choices, on parts of the data.
    """
    if nested is None or not choice.left_out:
        return ()
    if any(judged.held != choice.held for judged in nested.choices):
        return ()  # other inner folds: of two sessions the judged ones learned from one alone
    least = min(judged.accuracy for judged in nested.choices)
    low = nested.scores.intervals[nested.scores.group].low
    if choice.accuracy >= min(least, low):
        return ()
    return (
        f"warning: the saved model is right for {choice.accuracy:.1%} of its inner folds' windows, "
        f"those that were judged above for {least:.1%} or more: its own search was cut short, and "
        "the accuracy above is not to be expected of it; --minutes allows more",
    )


def check_choice(
    base: Base,
    prepared: Prepared,
    choice: Choice,
    split: Split,
    seed: int = 0,
    on_step: Callable[[str], None] = lambda _: None,
) -> Nested:
    """Train and test a choice that was made before, in each fold of a split.

    Its score is nested only if these test trials had no part in that choice.

    Args:
        base: The recordings.
        prepared: Them, cut as the choice says.
        choice: Members, weights, temperatures.
        split: Folds of whole trials, by the indices of `base.trials`.
        seed: Of all that is random.
        on_step: Called with a line before each fold.

    Raises:
        BadSplit: A fold parts windows, not trials; or no test trial gives a window.
    """
    tested = []
    for fold in split.whole_trials("to judge on", WHOLE_SPLITS):
        on_step(f"{fold.name} · training as chosen before")
        blend = fit_choice(choice, base, prepared, sorted(fold.train), seed)
        tested.append(_test(base, blend, choice, prepared, sorted(fold.test)))
    return replace(_nested(base, split, tested, [choice] * len(tested)), fixed=True)


def _test(base: Base, blend: nn.Module, choice: Choice, own: Prepared, test: list[int]) -> _Tested:
    """Return predictions for a fold's test windows, of which a gate may leave none."""
    index = np.flatnonzero(np.isin(own.trial, test) & own.scored)
    found = predict_blend(blend, own, index, len(base.dataset.classes(base.target)))
    return _Tested(own, index, found, join(choice.joining, own.trial[index], found))


def _nested(
    base: Base, split: Split, tested: Sequence[_Tested], choices: Sequence[Choice]
) -> Nested:
    """Return the scores of all folds' test windows together, trivial baselines beside."""
    predictions = _predictions(base, split, tested)
    if not len(predictions):
        raise BadSplit("windows to test on", f"none in the test trials ({split.name})",
                       "hold out other trials, or record longer ones")  # fmt: skip
    right: Counter[tuple[str, str]] = Counter()
    for fold, own in zip(split.trial_folds, tested, strict=True):
        right.update(own.trivial_right(base, sorted(fold.train)))
    trivial = {"majority": float(np.bincount(predictions.y).max() / len(predictions))}
    return Nested(
        split=split.name,
        choices=tuple(choices),
        predictions=predictions,
        scores=judge(predictions),
        by_trial=_by_trial(base, tested),
        bars={},
        bars_s=0.0,
        trivial=trivial | shares(right, len(predictions)),
    )


def _bar(
    name: str, base: Base, own: Prepared, train: list[int], index: NDArray[np.intp], seed: int
) -> _Tested:
    """Fit a bar on the windows that were chosen, one after another as they are tested."""
    assert name in BARS
    learned = np.flatnonzero(np.isin(own.trial, train) & own.scored)
    values, mask = own.dataset.windows.values, own.dataset.windows.mask
    found = bar_probabilities(
        name,
        (values[learned], mask[learned], base.y[own.trial[learned]]),
        (values[index], mask[index]),
        len(base.dataset.classes(base.target)),
        seed,
    )
    return _Tested(own, index, found, _mean_logs(own.trial[index], found))


def _mean_logs(
    trial: NDArray[np.intp], found: NDArray[np.float64]
) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Join a bar's windows as `metrics.by_trial` does."""
    return join(Joining(), trial, found)


def _predictions(base: Base, split: Split, tested: Sequence[_Tested]) -> Predictions:
    trained = np.zeros((len(tested), len(base.trials)), np.intp)
    for number, (fold, own) in enumerate(zip(split.trial_folds, tested, strict=True)):
        counts = np.bincount(own.prepared.trial[own.prepared.scored], minlength=len(base.trials))
        learned = sorted(fold.train)
        trained[number, learned] = counts[learned]
    trial = np.concatenate([own.prepared.trial[own.index] for own in tested])
    return Predictions(
        split=split.name,
        classes=tuple(base.dataset.classes(base.target)),
        trials=base.trials,
        folds=tuple(fold.name for fold in split.folds),
        trained=trained,
        trial=trial,
        start_s=np.concatenate([own.prepared.dataset.windows.start_s[own.index] for own in tested]),
        fold=np.repeat(np.arange(len(tested)), [len(own.index) for own in tested]),
        y=base.y[trial],
        probabilities=np.concatenate([own.probabilities for own in tested]),
        at_limit=np.concatenate(
            [at_limit(own.prepared.dataset.windows)[own.index] for own in tested]
        ),
    )


def _by_trial(base: Base, tested: Sequence[_Tested]) -> TrialScores:
    y = np.concatenate([base.y[own.joined[0]] for own in tested])
    found = np.concatenate([own.joined[1] for own in tested])
    return TrialScores(
        accuracy=float((found.argmax(axis=1) == y).mean()),
        loss=cross_entropy(y, found),
        trials=len(y),
    )
