"""What a bundle is worth on recordings: its own windows, decisions and votes, as live.

UNKNOWN is no answer and counts as wrong, but where the truth is a class that the bundle never
learned: there it is the right one. Knows nothing about screens or training frameworks.

Background of our choices: docs/decisions/0040.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from math import inf
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.bundles.contract import Contract, fingerprint_of
from taxel.bundles.reader import Bundle
from taxel.decisions.recognition import (
    UNKNOWN,
    Decision,
    GraspVote,
    Quality,
    RecogniseConfig,
    decide,
)
from taxel.decisions.still_channels import (
    CHANCE_ONCE,
    LOWER_GAIN,
    changed_words,
    looked_at,
    ranges_of,
)
from taxel.decisions.value_scale import OTHER_SCALE, scale_words
from taxel.evaluation.fold_table import FoldTable, read_fold_table
from taxel.evaluation.metrics import accuracy_interval, cross_entropy
from taxel.evaluation.part_scores import Parts, score_parts
from taxel.evaluation.run_scores import reliability
from taxel.evaluation.shared_values import name_by_unseen
from taxel.evaluation.table_split import idle_note, rows_in_no_trial, trials_to_score
from taxel.labels.class_order import in_order
from taxel.labels.trials import coarsest_group, lone_group
from taxel.plain_text import number_of
from taxel.recordings.reader import list_recordings
from taxel.windows.dataset import LABEL_THEM, Dataset, load_dataset, only_labelled
from taxel.windows.windower import Windows

_BATCH = 256
"""Windows that the model is given at once. Source: our choice."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BundleScores:
    """A bundle on a folder of recordings."""

    target: str
    classes: tuple[str, ...]
    """What the bundle can answer, in its order."""
    split: str | None
    """The table of folds whose test part alone was scored; None where all recordings were."""
    windows: int
    trials: int
    accuracy: float
    """Share of windows predicted correctly, 0…1; UNKNOWN counts as wrong, and as correct where the
    bundle does not know the class."""
    interval: tuple[float, float]
    """95 % CI of it, bootstrapped over `interval_group`; NaN with one of them."""
    interval_group: str
    interval_groups: int
    """How many of them there are."""
    lone: str | None
    """The group of which all trials share one value, such as the session; None without one."""
    majority: float
    """Share of the commonest class among the windows, 0…1."""
    unknown: float
    """Share of windows answered UNKNOWN, 0…1."""
    unknown_because: Mapping[str, int]
    """Why → windows; figures in the reasons left out."""
    answered_accuracy: float
    """Share predicted correctly of the windows that were answered, 0…1; NaN where none was."""
    filled: float
    """Share of windows with short gaps that were filled in, 0…1."""
    trial_accuracy: float
    """Share of trials predicted correctly by the vote of all their windows, 0…1."""
    trial_majority: float
    trial_unknown: float
    loss: float
    """Mean cross-entropy of the windows of learned classes, nats; NaN where there is none."""
    calibration_error: float
    """Expected calibration error of the same windows, 0…1."""
    parts: Parts
    """By class and by group."""
    confusion: Mapping[str, Mapping[str, int]]
    """True class → answer → windows."""
    learned_from: tuple[str, ...]
    """Recordings here whose very values the bundle learned from: their score is no test."""
    learned_is_known: bool
    """False for an older bundle, which does not say what it learned from."""
    notes: tuple[str, ...]


def score_bundle(bundle: Bundle, folder: Path, folds: Path | None = None) -> BundleScores:
    """Score a bundle on all labelled recordings of a folder, or on one.

    Args:
        bundle: An open bundle of an array recogniser.
        folder: Recordings with the bundle's label.
        folds: A table of folds with one test part: only its trials are scored.

    Raises:
        BadBundle: The recordings are of another array.
        BadDataset: There is no window, or no trial has the label.
        BadTable: The table cannot be read, has several folds, or names what is not there.
        BadSplit: It puts a trial on both sides, or there is nothing to test.
    """
    contract = bundle.contract
    table = None if folds is None else read_fold_table(folds, to_score=True)
    window = replace(contract.window, reference=None)
    dataset = load_dataset(folder, window, unusable=True, usual=contract.followed_from)
    contract.check_sensor(dataset.sensor)
    if table is not None:
        dataset = _test_part(dataset, table, folder, contract.learned)
    dataset = only_labelled(dataset, contract.target, folder, f"{LABEL_THEM}; or score others")
    decisions = _decisions(bundle, dataset.windows, RecogniseConfig())
    return _scores(bundle, dataset, decisions, None if table is None else table.split)


def _test_part(
    dataset: Dataset, table: FoldTable, folder: Path, learned: Collection[str]
) -> Dataset:
    """Return the trials that a table tests, with notes of what was left out."""
    known = {file.name.removesuffix(".mcap") for file in list_recordings(folder)}
    idle = rows_in_no_trial(table, dataset)
    tested = trials_to_score(table, dataset.trials, known)
    part = dataset.only_trials(tested)
    left = [trial for i, trial in enumerate(dataset.trials) if i not in tested]
    notes = []
    if left:
        every, are = number_of(len(dataset.trials), "trial"), "is" if len(left) == 1 else "are"
        notes.append(f"{len(left)} of {every} {are} not in the test part of "
                     f"{table.name}: left out")  # fmt: skip
    notes += idle_note(table, [row for row in idle if row.side in ("test", "unused")])
    both = {trial.recording for trial in left} & {
        name for name, own in part.fingerprints.items() if fingerprint_of(own) in learned
    }
    if both:
        notes.append(f"{len(both)} of the tested recordings hold other trials too: a bundle stores "
                     "which recordings it was trained on, and not which of their trials",
                     )  # fmt: skip
    return replace(part, notes=(*part.notes, *notes))


def _decisions(bundle: Bundle, windows: Windows, config: RecogniseConfig) -> list[Decision]:
    """Return the bundle's decision on each window, as live."""
    found: list[Decision] = []
    for first in range(0, len(windows), _BATCH):
        part = windows[first : first + _BATCH]
        probabilities = bundle.probabilities(part.values, part.mask)
        scaled = bundle.contract.scaling.apply(part.values, part.mask)
        for i in range(len(part)):
            novelty = None
            if bundle.novelty_test is not None and part.mask[i].any():
                novelty = bundle.novelty_test.of_window(scaled[i][part.mask[i]])
            found.append(
                decide(
                    probabilities[i], Quality.of(part, i, bundle.contract.motion),
                    bundle.contract.classes, config, novelty, bundle.novelty_test,
                )
            )  # fmt: skip
    return found


def _scores(
    bundle: Bundle, dataset: Dataset, decisions: list[Decision], split: str | None
) -> BundleScores:
    contract, trial = bundle.contract, dataset.trial
    truth = np.array([trial.labels[contract.target] for trial in dataset.trials])
    right_answer = np.where(np.isin(truth, contract.classes), truth, UNKNOWN)
    answers = np.array([decision.label for decision in decisions])
    right = answers == right_answer[trial]
    votes = _votes(bundle, dataset, decisions)
    numbers = np.arange(len(dataset.trials))
    unknown = answers == UNKNOWN
    drawn = name_by_unseen(split or "", dataset.trials, [contract.learned_groups])
    key = coarsest_group(dataset.trials, drawn)
    loss, error = _calibration(contract.classes, truth[trial], decisions)
    names = {fingerprint_of(own): name for name, own in dataset.fingerprints.items()}
    return BundleScores(
        target=contract.target,
        classes=contract.classes,
        split=split,
        windows=len(dataset),
        trials=len(dataset.trials),
        accuracy=float(right.mean()),
        interval=accuracy_interval(right, dataset.group(key)[trial]),
        interval_group=key,
        interval_groups=len(np.unique(dataset.group(key)[trial])),
        lone=lone_group(dataset.trials, drawn),
        majority=_commonest(truth[trial]),
        unknown=float(unknown.mean()),
        unknown_because=_reasons(decisions),
        answered_accuracy=float(right[~unknown].mean()) if (~unknown).any() else float("nan"),
        filled=float((dataset.windows.filled > 0).mean()),
        trial_accuracy=float((votes == right_answer).mean()),
        trial_majority=_commonest(truth),
        trial_unknown=float((votes == UNKNOWN).mean()),
        loss=loss,
        calibration_error=error,
        parts=score_parts(dataset.trials, contract.target, trial, right, numbers,
                          votes == right_answer),
        confusion=_confusion(truth[trial], answers),
        learned_from=tuple(sorted(names[own] for own in contract.learned if own in names)),
        learned_is_known=bool(contract.learned),
        notes=(*dataset.notes, *_still_notes(contract, dataset), *_scale_note(contract, dataset)),
    )  # fmt: skip


def _still_notes(contract: Contract, dataset: Dataset) -> list[str]:
    """Return a note of each channel that never changes here, though it did in training."""
    motion, windows = contract.motion, dataset.windows
    if motion is None:
        return []
    ranges = ranges_of(windows.values, windows.mask)
    count = motion.moving(LOWER_GAIN * ranges[looked_at(windows, dataset.trial)]).sum()
    never = motion.unchanged(ranges).all(axis=0) & (motion.needed(CHANCE_ONCE) <= count)
    return [
        f"channel {contract.channels[index]} never changes in these recordings; "
        f"{changed_words(1.0 - float(motion.still[index]))}"
        for index in np.flatnonzero(never)
    ]


def _scale_note(contract: Contract, dataset: Dataset) -> list[str]:
    """Return a note if values change so much more, or less, than in training that a unit is wrong.

    That is so where half of the channels do, by the median of their ranges within windows.
    """
    motion, windows = contract.motion, dataset.windows
    if motion is None:
        return []
    known = motion.usual > 0
    ranges = ranges_of(windows.values, windows.mask)[:, known]
    share = float(np.median(np.median(ranges, axis=0) / motion.usual[known]))
    if share == 0.0 or 1.0 / OTHER_SCALE <= share <= OTHER_SCALE:
        return []
    return [scale_words(share, contract.units[0])]


def _votes(bundle: Bundle, dataset: Dataset, decisions: list[Decision]) -> NDArray[np.str_]:
    """Return what all windows of each trial say together, shape (trials,)."""
    found = []
    for index in range(len(dataset.trials)):
        vote = GraspVote(bundle.contract.classes, inf, bundle.novelty_test, bundle.contract.joining)
        answer = UNKNOWN
        for i in np.flatnonzero(dataset.trial == index):
            answer, _ = vote.add(decisions[i])
        found.append(answer)
    return np.array(found)


def _calibration(
    classes: tuple[str, ...], truth: NDArray[np.str_], decisions: list[Decision]
) -> tuple[float, float]:
    """Return loss and calibration error of the windows whose class was learned."""
    number = {name: i for i, name in enumerate(classes)}
    pairs = [(number[name], decision.probabilities)
             for name, decision in zip(truth, decisions, strict=True)
             if name in number and np.isfinite(decision.probabilities).all()]  # fmt: skip
    if not pairs:
        return float("nan"), float("nan")
    y = np.array([own for own, _ in pairs], np.intp)
    probabilities = np.stack([own for _, own in pairs]).astype(np.float64)
    bins = reliability(probabilities, probabilities.argmax(axis=1) == y)
    error = sum(bin_.windows * abs(bin_.confidence - bin_.accuracy) for bin_ in bins) / len(y)
    return cross_entropy(y, probabilities), float(error)


def _reasons(decisions: list[Decision]) -> dict[str, int]:
    """Return why windows are UNKNOWN, most frequent first; by kind, without their figures."""
    kinds = {"confidence": "low confidence", "novel": "novel touch"}
    found: dict[str, int] = {}
    for decision in decisions:
        if decision.reason:
            first = decision.reason.split()[0]
            default = "values missing, stale or NaN" if "%" in decision.reason else decision.reason
            name = kinds.get(first, default)
            found[name] = found.get(name, 0) + 1
    return dict(sorted(found.items(), key=lambda pair: -pair[1]))


def _confusion(truth: NDArray[np.str_], answers: NDArray[np.str_]) -> dict[str, dict[str, int]]:
    return {
        str(name): {str(answer): int(((truth == name) & (answers == answer)).sum())
                    for answer in in_order(answers[truth == name].tolist())}
        for name in in_order(truth.tolist())
    }  # fmt: skip


def _commonest(truth: NDArray[np.str_]) -> float:
    _, count = np.unique(truth, return_counts=True)
    return float(count.max() / count.sum())
