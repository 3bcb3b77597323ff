"""Recorded touch under test, and a recogniser's predictions: as live, before anything is cut.

The same grid, gate, windows, validity and decisions as live: windows with input that cannot be
used, and what a bundle's own test calls unlike the learned, are UNKNOWN. A session is brought to
the recogniser's level by its own reference touches, or followed. Knows nothing about faults.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import inf
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.bundles.contract import Contract
from taxel.bundles.reader import Bundle
from taxel.decisions.recognition import UNKNOWN, GraspVote, Quality, RecogniseConfig, decide
from taxel.decisions.unknown import NoveltyTest
from taxel.errors import BadDataset
from taxel.evaluation.robustness.curve import SessionAnswers
from taxel.labels.joined import joined_label
from taxel.labels.trials import Trial, order_in_time, trials_of
from taxel.plain_text import number_of
from taxel.recordings.manifest import Manifest
from taxel.recordings.reader import list_recordings, read_recording
from taxel.signals import Mark, Samples, SensorInfo
from taxel.training.fitting import Job, TrainingSet, fit_model, training_windows
from taxel.training.recipes import Recipe
from taxel.training.run import contract_of
from taxel.windows.dataset import load_dataset
from taxel.windows.level_follow import followed_factors, parse_level_follow
from taxel.windows.reference import (
    ReferenceTouches,
    parse_reference,
    to_usual,
    touch_level,
)
from taxel.windows.stretches import owners_of
from taxel.windows.windower import Windows, cut_windows

ANSWER_ALL = RecogniseConfig(least_confidence=0.0)
"""No answer is UNKNOWN for its confidence, so that curves of any number of classes compare.
Source: our choice, docs/decisions/0029."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Recorded:
    """One recording of an array, with its touches."""

    samples: Samples
    sensor: SensorInfo
    trials: tuple[Trial, ...]

    @property
    def sessions(self) -> NDArray[np.str_]:
        """Each touch's session, shape (touches,); the recording where none is named."""
        groups = [trial.groups for trial in self.trials]
        return np.array([group.get("session", group["recording"]) for group in groups])


@dataclass(frozen=True, slots=True)
class Model:
    """Whatever turns windows into probabilities, with what it needs and gives."""

    contract: Contract
    probabilities: Callable[
        [NDArray[np.float32], NDArray[np.bool_]], NDArray[np.float32] | NDArray[np.float64]
    ]
    """(unscaled windows (n, steps, channels), mask (n, steps)) → (n, classes)."""


def bundle_model(bundle: Bundle) -> Model:
    """Return a bundle as what is judged."""
    return Model(bundle.contract, bundle.probabilities)


def train_model(path: Path, recipe: Recipe) -> Model:
    """Train a recipe on all recordings of a folder.

    Raises:
        BadDataset: The recordings do not make such a data set.
    """
    dataset = load_dataset(path, recipe.window, target=recipe.target)
    training = TrainingSet.of(training_windows(path, dataset, recipe), recipe.target)
    fitted = fit_model(training, Job.of(recipe), steps=recipe.window.steps)
    target, networks = recipe.target, fitted.networks
    contract = contract_of(dataset, target, recipe.model, networks, fitted.scaling, {})
    return Model(contract, fitted.probabilities)


def read_touches(path: Path) -> tuple[list[Recorded], str]:
    """Return a folder's recordings, and the digest that a data set of them has.

    Raises:
        BadRecording: One is damaged.
        BadDataset: None holds scans.
    """
    found, digest = [], hashlib.sha256()
    for file in list_recordings(path):
        recording = read_recording(file)
        digest.update(recording.samples.values.tobytes())
        if len(recording.samples):
            found.append(recorded(file, recording.manifest, recording.samples, recording.marks))
    if not found:
        raise BadDataset("recordings of an array", f"none with scans in {path}", "name others")
    return found, digest.hexdigest()


def recorded(file: Path, manifest: Manifest, samples: Samples, marks: list[Mark]) -> Recorded:
    """Return one recording under test."""
    first_s, last_s = float(samples.fitted_s[0]), float(samples.fitted_s[-1])
    trials = trials_of(file, manifest, marks, first_s, last_s)
    return Recorded(samples=samples, sensor=manifest.sensor, trials=tuple(trials))


def judge(
    model: Model, touches: Sequence[Recorded], config: RecogniseConfig = ANSWER_ALL
) -> SessionAnswers:
    """Return what a model predicts from recordings.

    Reference touches of a bundle that needs them set each session's level and are not judged.
    Touches of a kind that the model does not know are left out.

    Args:
        model: What predicts.
        touches: The recordings.
        config: When an answer may be given.

    Raises:
        BadBundle: The model was not made for such an array.
        BadDataset: A touch lacks the target, no touch is of a known kind, or a session has
            too few reference touches.
    """
    contract = model.contract
    number = {name: index for index, name in enumerate(contract.classes)}
    sessions: dict[str, list[_Cut]] = {}
    outside, seconds = 0, 0.0
    for touch, windows, owner in _cut(contract, touches):
        outside += int((owner < 0).sum())
        times_s = touch.samples.fitted_s
        seconds += float(times_s[-1] - times_s[0]) if len(times_s) else 0.0
        names = touch.sessions
        for name in np.unique(names):
            own = names == name
            cut = _Cut(windows, np.where(own[owner], owner, -1), touch.trials, own)
            sessions.setdefault(str(name), []).append(cut)
    test = NoveltyTest(contract.unknown) if contract.unknown is not None else None
    parts, grasps = [], []
    offset = 0
    for name, cuts in sessions.items():
        factor, used = _level(contract, name, cuts)
        for cut, reference in zip(cuts, used, strict=True):
            labels = [_label(trial, contract.target) for trial in cut.trials]
            y = np.array([number.get(label, -1) for label in labels], np.intp)
            y[reference] = -1
            y[~cut.own] = -1
            judged = (cut.owner >= 0) & (y[cut.owner] >= 0)
            trial = cut.owner[judged] + offset
            answers = _answers(model, cut.windows[judged], trial, factor, config, test)
            parts.append((y[cut.owner[judged]], *answers[:2], trial, np.full(len(trial), name),
                          answers[2]))  # fmt: skip
            grasps += [name] * int((y >= 0).sum())
            offset += len(cut.trials)
    if not grasps:
        raise BadDataset(
            f"touches of a {contract.target} that the bundle knows: {', '.join(contract.classes)}",
            "none beside reference touches", "choose recordings of those",
        )  # fmt: skip
    y, probabilities, answered, trial, session, known = (
        np.concatenate(arrays) for arrays in zip(*parts, strict=True)
    )
    return SessionAnswers(
        y, probabilities, answered, trial, session, np.array(grasps), outside, seconds / 60, known
    )  # fmt: skip


@dataclass(frozen=True, slots=True)
class _Cut:
    windows: Windows
    owner: NDArray[np.intp]
    """Shape (n,): each window's touch where that is of this session, else -1."""
    trials: tuple[Trial, ...]
    own: NDArray[np.bool_]
    """Shape (touches,): which of them are of this session."""


def _cut(
    contract: Contract, touches: Sequence[Recorded]
) -> list[tuple[Recorded, Windows, NDArray[np.intp]]]:
    """Return each recording with its windows and each window's touch, -1 outside of touches.

    Where levels are followed, windows are scaled as by `load_dataset` for a bundle: by the touches
    before them in their session.
    """
    found = []
    for touch in touches:
        contract.check_sensor(touch.sensor)
        windows = cut_windows(touch.samples, contract.window, touch.sensor)
        found.append((touch, windows, owners_of(windows, touch.trials)))
    text = contract.window.level_follow
    if text is None:
        return found
    trials = [trial for touch in touches for trial in touch.trials]
    first = np.cumsum([0, *(len(touch.trials) for touch in touches)])
    inside = [owner >= 0 for _, _, owner in found]
    factor = followed_factors(
        Windows.join([windows[own] for (_, windows, _), own in zip(found, inside, strict=True)]),
        np.concatenate([owner[own] + start for (_, _, owner), own, start
                        in zip(found, inside, first[:-1], strict=True)]),
        trials, parse_level_follow(text), contract.followed_from,
    ).tested  # fmt: skip
    return [
        (touch, replace(windows, values=windows.values * factor[owner + start, None, :]), owner)
        for (touch, windows, owner), start in zip(found, first[:-1], strict=True)
    ]


def _answers(
    model: Model,
    windows: Windows,
    trial: NDArray[np.intp],
    factor: NDArray[np.float32] | None,
    config: RecogniseConfig,
    test: NoveltyTest | None,
) -> tuple[NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_]]:
    """Return probabilities of each window, whether it and whether its whole touch is answered."""
    classes = model.contract.classes
    probabilities = np.zeros((len(windows), len(classes)))
    answered = np.zeros(len(windows), bool)
    whole: dict[int, bool] = {}
    if factor is not None and len(windows):
        values = (windows.values * factor).astype(np.float32)
        raw = model.probabilities(values, windows.mask)
        probabilities = np.asarray(raw, np.float64)
        rows = None if test is None else model.contract.scaling.apply(values, windows.mask)
        votes = {
            touch: GraspVote(classes, inf, test, model.contract.joining) for touch in trial.tolist()
        }
        for i, touch in enumerate(trial.tolist()):
            novelty = None
            if test is not None and rows is not None and windows.mask[i].any():
                novelty = test.of_window(rows[i][windows.mask[i]])
            quality = Quality.of(windows, i, model.contract.motion)
            decision = decide(raw[i], quality, classes, config, novelty, test)
            answered[i] = decision.label != UNKNOWN
            whole[touch] = votes[touch].add(decision)[0] != UNKNOWN
    known = np.array([whole.get(touch, False) for touch in trial.tolist()], bool)
    return np.nan_to_num(probabilities), answered, known


def _level(
    contract: Contract, session: str, cuts: Sequence[_Cut]
) -> tuple[NDArray[np.float32] | None, list[list[int]]]:
    """Return what a session's values are multiplied by, and by which touches.

    None where its reference touches give no window that can be used: nothing can be predicted then.
    """
    unused: list[list[int]] = [[] for _ in cuts]
    if contract.reference is None or contract.window.reference is None:
        return np.ones(1, np.float32), unused
    touches = parse_reference(contract.window.reference)
    first = _first_touches(cuts, touches)
    if len(first) < touches.count:
        raise BadDataset(
            f"{number_of(touches.count, 'touch')} of {touches.key}={touches.value} in each session",
            f"{len(first)} in {session}", "record them, or use a bundle that needs none",
        )  # fmt: skip
    values, mask = [], []
    for place, index in first:
        unused[place].append(index)
        cut = cuts[place]
        own = (cut.owner == index) & cut.windows.ready
        values.append(cut.windows.values[own])
        mask.append(cut.windows.mask[own])
    joined = np.concatenate(values)
    if not len(joined):
        return None, unused
    return to_usual(touch_level(joined, np.concatenate(mask)), contract.reference.level), unused


def _first_touches(cuts: Sequence[_Cut], touches: ReferenceTouches) -> list[tuple[int, int]]:
    """Return (recording, touch) of a session's first touches of the known object.

    As `windows.reference` takes them: in the order of time.
    """
    found = [
        (order_in_time(trial), place, index)
        for place, cut in enumerate(cuts)
        for index, trial in enumerate(cut.trials)
        if cut.own[index] and touches.matches(trial)
    ]
    return [(place, index) for _, place, index in sorted(found)[: touches.count]]


def _label(trial: Trial, target: str) -> str:
    """Return a touch's value of the target, or of the labels that it joins by "+"."""
    if (value := joined_label(trial.labels, target)) is None:
        raise BadDataset(
            f"the label {target!r} on every touch",
            f"{trial.groups['trial']} with {', '.join(trial.labels) or 'none'}",
            "label the recording, or choose another bundle",
        )
    return value
