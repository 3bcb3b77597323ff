"""From recordings to the recogniser that is used: nested score, choice on all data, its bundle.

Knows nothing about screens.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter, sleep

import numpy as np

from taxel.bundles.contract import Contract
from taxel.bundles.reader import read_bundle
from taxel.bundles.writer import write_bundle
from taxel.decisions.joining import Joining
from taxel.errors import BadInput
from taxel.evaluation.nested import Nested, check_choice, check_choosing, worse_than_judged
from taxel.evaluation.outer_split import USUAL, OuterSplit, check_training_parts
from taxel.evaluation.shared_values import objects_on_both
from taxel.evaluation.splits import WHOLE_SPLITS, Split
from taxel.labels.joined import parts_of
from taxel.models.blend import EXPERT, Blend
from taxel.models.touch_blocks import is_of_grids
from taxel.training.choose.base import Base, load_base
from taxel.training.choose.budget import Budget
from taxel.training.choose.choice import Choice
from taxel.training.choose.costs import quietest_us
from taxel.training.choose.fit_choice import fit_choice
from taxel.training.choose.inner_folds import Held, what_is_held, with_all
from taxel.training.choose.kept_tries import KeptTries
from taxel.training.choose.levels import level_note
from taxel.training.choose.limits import USUAL_LIMITS, FittedBlend, Limits, fit_within
from taxel.training.choose.preparations import Prepared, live_note, prepare, prepare_all
from taxel.training.choose.search import Effort, SearchResult, choose
from taxel.training.environment import Provenance, code_digest, environment
from taxel.training.loop import TrainConfig
from taxel.training.run import Run, contract_of
from taxel.training.unknown import check_enough, fit_unknown
from taxel.windows.dataset import Dataset
from taxel.windows.scaling import Scaling
from taxel.windows.windower import Windows

PLANNED = 0.93
"""Share of the minutes that is planned for; the rest is for measuring the bundle. Source: our
choice, docs/decisions/0039."""
_ALL, _PART = "all data", "the training part"
"""What is chosen on, in words."""
_PARITY_WINDOWS = 500
_AGAIN, _AGAIN_AFTER_S = 3, 1.0
"""How often a time above the limit is measured again, and after how long. Source: our choice,
docs/decisions/0039."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """A training by search: the recordings, the label, and the split that judges it."""

    data: Path
    """A folder of recordings."""
    target: str
    """The label to predict."""
    channels: tuple[str, ...] | None = None
    """Those to use; all unless given."""
    split: OuterSplit = USUAL
    """Makes the outer folds; the coarsest groups are held out unless given."""
    test: Path | None = None
    """Another folder, to test on only; then the outer fold is that."""
    check: bool = True
    """Whether the way of choosing is judged on the outer folds."""
    bars: Sequence[str] = ()
    """Bars to judge beside it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """A bundle's cost."""

    mb: float
    us: float
    """Of one window on one core: the quietest tenth of the quietest of four stretches; of up to
    sixteen where it was above its limit."""
    parity: float
    """Largest difference of a probability, live from offline."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Expert:
    """A trained recogniser, with what it is worth and why it was chosen."""

    run: Run
    choice: Choice
    nested: Nested | None
    measured: Measured
    repeated: bool = False
    """Whether the choice was made before, by another run."""
    given_up: tuple[str, ...] = ()
    """Members that did not fit in the limits, and what leaving them out cost."""
    notes: tuple[str, ...] = ()
    tries_kept: int = 0
    seconds: float = 0.0
    """All that it took, without the bars."""


def train_expert(
    task: Task,
    limits: Limits = USUAL_LIMITS,
    *,
    like: Choice | None = None,
    reject_novel: float | None = None,
    seed: int = 0,
    tries: Path | None = None,
    on_step: Callable[[str], None] = lambda _: None,
) -> Expert:
    """Choose, judge, train and measure.

    Args:
        task: What is to be predicted, and how that is judged.
        limits: Minutes, megabytes, microseconds.
        like: Repeat this choice, and choose nothing; judged on the same folds.
        reject_novel: Share of known touch that may be rejected as novel, 0…1; none is unless given.
        seed: Of all that is random.
        tries: A folder for what was tried, so that an interrupted run goes on.
        on_step: Called with a line before each step.

    Raises:
        BadDataset: The recordings do not make such a data set.
        BadSplit: They cannot be split so.
    """
    on_step("reading")
    started = perf_counter()
    base, folds = read_and_part(task, like)
    learned = _learned_from(base, folds, task.split)
    if reject_novel is not None:  # refused now, not after minutes
        parts = parts_of(task.target, (trial.labels for trial in base.dataset.trials))
        check_enough(len(learned), len(parts), reject_novel)
    if like is not None:
        on_step("cutting as chosen before")
        cut = _cut_as(base, like)
        expert = _repeat(base, cut, like, learned, reject_novel, seed, on_step)
        if task.check:
            score = check_choice(base, cut, like, folds, seed, on_step)
            expert = _with_score(expert, score)
        expert = replace(expert, notes=(*expert.notes, *_split_notes(base, folds, task.split)))
        return replace(expert, seconds=perf_counter() - started)
    stored_tries = KeptTries(
        tries, {"code": code_digest(), "software": environment(), "seed": seed}
    )
    prepared = prepare_all(base)
    planned = PLANNED * 60.0 * limits.minutes - (perf_counter() - started)
    checked = len(folds.folds) * task.check
    same = checked == 1 and _trains_on(folds, learned)
    budget = Budget(max(0.0, planned), 1 if same else checked + 1)
    effort = Effort(
        budget=budget, seed=seed, kept=stored_tries, on_step=on_step, most_us=limits.bare_us
    )
    on_step(f"choosing on {_PART if same else _ALL}")
    search = choose(base, prepared, learned, _held(base, folds, learned), effort)

    def fitted_on(which: str) -> FittedBlend:
        on_step(f"training what was chosen on {which}")
        return fit_within(search, learned, limits, seed=seed, pieces=effort.pieces)

    fitted = fitted_on(_PART) if same else None
    nested = None
    if task.check:
        known = None if fitted is None else (search, fitted)
        nested = check_choosing(base, prepared, folds, effort, task.bars, limits, known)
    fitted = fitted or fitted_on(_ALL)
    expert = _within(search, fitted, learned, nested, limits, reject_novel, seed)
    expert = replace(expert, notes=(*expert.notes, *_split_notes(base, folds, task.split)))
    stored_tries.forget()
    bars_s = 0.0 if nested is None else nested.bars_s
    return replace(expert, tries_kept=stored_tries.used, seconds=perf_counter() - started - bars_s)


def read_and_part(task: Task, like: Choice | None = None) -> tuple[Base, Split]:
    """Return the recordings of a training by search, and its outer folds.

    Args:
        task: What is to be predicted, and how that is judged.
        like: A choice that is repeated, if one is.

    Raises:
        BadDataset: The recordings do not make such a data set.
        BadSplit: They cannot be split so, not into whole trials, or a search would have too little
            to choose on.
    """
    channels = task.channels if like is None else like.window.channels
    base = load_base(task.data, task.target, channels, task.test)
    folds = task.split.of(base)
    folds.whole_trials("to hold some out", WHOLE_SPLITS)
    if like is None and (task.check or task.split.leaves_unseen):
        check_training_parts(base, folds, task.split)
    learned = _learned_from(base, folds, task.split)
    return replace(base, unseen=frozenset(range(len(base.trials))).difference(learned)), folds


def _split_notes(base: Base, folds: Split, split: OuterSplit) -> tuple[str, ...]:
    """Return notes on how the folds were made, and on a table's objects on both sides."""
    if split.given.table is None:
        return folds.notes
    return (*folds.notes, *objects_on_both(base.trials, base.y, folds))


def _learned_from(base: Base, folds: Split, split: OuterSplit) -> list[int]:
    """Return the trials that the recogniser learns from in the end."""
    if split.leaves_unseen and len(folds.trial_folds) == 1:
        return sorted(folds.trial_folds[0].train)
    return base.own


def _trains_on(split: Split, trials: Sequence[int]) -> bool:
    """Return whether the training side of a split's only fold is these trials."""
    (fold,) = split.trial_folds
    return fold.train == set(trials)


def _held(base: Base, split: Split, learned: Sequence[int]) -> Held:
    """Return what a split's first fold holds out, as it can be where all is learned from."""
    fold = split.trial_folds[0]
    held = what_is_held(base.trials, base.y, sorted(fold.train), sorted(fold.test), split.key)
    return with_all(base.trials, sorted(fold.train), learned, held)


def _within(
    found: SearchResult,
    fitted: FittedBlend,
    own: Sequence[int],
    nested: Nested | None,
    limits: Limits,
    reject_novel: float | None,
    seed: int,
) -> Expert:
    """Return what was trained on all data, with its costs."""
    base = found.base
    learned = learned_windows(base, found.part.prepared, own)
    run = _run_of(base, learned, fitted.blend, fitted.choice.joining, nested, reject_novel, seed)
    measured = measure(run, learned.windows[:_PARITY_WINDOWS], limits.most_us)
    over = _over(measured, limits, len(fitted.choice.members))
    return Expert(
        run=run, choice=fitted.choice, nested=nested, measured=measured,
        given_up=fitted.given_up,
        notes=(*base.notes, *learned.notes, *live_note(base, learned.config),
               *level_note(learned.config), *over, *worse_than_judged(fitted.choice, nested)),
    )  # fmt: skip


def _over(measured: Measured, limits: Limits, members: int) -> tuple[str, ...]:
    """Return warnings on a bundle that is over its limits of time or size."""
    over = []
    if measured.us > limits.most_us:
        over.append(
            f"a window takes {measured.us:.0f} µs, more than --max-us {limits.most_us:g}: "
            "measure again on a machine with nothing else to do, or raise the limit"
        )
    if measured.mb > limits.most_mb:
        over.append(
            f"the bundle has {measured.mb:.1f} MB, more than --max-mb {limits.most_mb:g}"
            f"{', with a single model' if members == 1 else ''}: raise the limit, or import fewer "
            "channels"
        )
    return tuple(over)


def _repeat(
    base: Base,
    prepared: Prepared,
    like: Choice,
    own: Sequence[int],
    reject_novel: float | None,
    seed: int,
    on_step: Callable[[str], None],
) -> Expert:
    on_step("training on all data as chosen before")
    blend = fit_choice(like, base, prepared, own, seed)
    learned = learned_windows(base, prepared, own)
    run = _run_of(base, learned, blend, like.joining, None, reject_novel, seed)
    measured = measure(run, learned.windows[:_PARITY_WINDOWS])
    return Expert(run=run, choice=like, nested=None, measured=measured,
                  notes=(*base.notes, *prepared.dataset.notes,
                         *live_note(base, prepared.config)),
                  repeated=True)  # fmt: skip


def _cut_as(base: Base, like: Choice) -> Prepared:
    if like.target != base.target:
        raise BadInput(f"a choice for the label {base.target!r}", repr(like.target),
                       f"say --target {like.target}")  # fmt: skip
    prepared = prepare(base, like.window, like.window.steps)
    if not prepared.grids and any(is_of_grids(own) for m in like.members for own in m.blocks):
        raise BadInput("channels in a grid, such as r1c1, r1c2, …, for the choice sees images",
                       "none by their names", "train without --like")  # fmt: skip
    return prepared


def _with_score(expert: Expert, nested: Nested) -> Expert:
    """Return a training beside the score of what was trained."""
    accuracy = {nested.split: nested.scores.scores.accuracy}
    contract = replace(expert.run.contract, accuracy=accuracy)
    run = replace(
        expert.run, contract=contract, predictions=nested.predictions, trivial=nested.trivial
    )
    return replace(expert, run=run, nested=nested)


def learned_windows(base: Base, prepared: Prepared, trials: Sequence[int]) -> Dataset:
    """Return the windows that are learned from, one after another as they are live.

    What is held out for good, in a table of folds or another folder, must not count as learned: it
    gives no window, and no recording is known by its values. Its classes and trials stay.

    Args:
        base: The recordings.
        prepared: Them, cut.
        trials: Indices of the trials to learn from.
    """
    names = {base.trials[index].recording for index in trials}
    whole = prepared.dataset
    rows = np.flatnonzero(prepared.scored & np.isin(prepared.trial, np.asarray(trials, np.intp)))
    return replace(
        whole,
        windows=whole.windows[rows],
        trial=whole.trial[rows],
        config=prepared.config,
        fingerprints={name: own for name, own in whole.fingerprints.items() if name in names},
    )


def _unscaled(dataset: Dataset) -> Scaling:
    channels = len(dataset.sensor.channels)
    return Scaling(
        kind="none", offset=np.zeros(channels, np.float32), factor=np.ones(channels, np.float32)
    )


def _run_of(
    base: Base,
    learned: Dataset,
    blend: Blend,
    joining: Joining,
    nested: Nested | None,
    reject_novel: float | None,
    seed: int,
) -> Run:
    """Return a trained blend as a run."""
    unscaled = _unscaled(learned)
    accuracy = {} if nested is None else {nested.split: nested.scores.scores.accuracy}
    unknown = None
    if reject_novel is not None:
        unknown = fit_unknown(learned, base.target, unscaled, reject_novel)
    contract = replace(
        contract_of(learned, base.target, EXPERT, (blend,), unscaled, accuracy),
        joining=joining,
        unknown=unknown,
        parameters=sum(table.numel() for table in blend.state_dict().values()),
    )
    return Run(
        networks=(blend,),
        contract=contract,
        train=TrainConfig(seed=seed),
        history=(),
        data=str(base.path),
        predictions=None if nested is None else nested.predictions,
        trivial={} if nested is None else nested.trivial,
        made=Provenance.now(),
    )


def measure(run: Run, windows: Windows, most_us: float = math.inf) -> Measured:
    """Write the bundle aside, open it, and measure what a window costs on one core.

    Args:
        run: What was trained.
        windows: To run it on.
        most_us: A time above it is measured again: what else a machine does can only lengthen it.
    """
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        path = Path(scratch) / "bundle.taxel"
        contract: Contract = write_bundle(
            path, run.networks, run.contract, windows.values, windows.mask
        )
        bundle = read_bundle(path)
        us = quietest_us(bundle.probabilities, windows.values, windows.mask)
        for _ in range(_AGAIN):
            if us > most_us:
                sleep(_AGAIN_AFTER_S)
                us = min(us, quietest_us(bundle.probabilities, windows.values, windows.mask))
        size = path.stat().st_size
    assert contract.parity is not None
    return Measured(mb=size / 1e6, us=us, parity=contract.parity)
