"""Learn a slip warning from training cups: out of fold, so that a threshold can be promised.

Knows nothing about images, test cups, files or screens.

Source: docs/decisions/0036.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from taxel import __version__
from taxel.bundles.grasp import SLIP_COLUMNS, GraspContract, write_grasp_bundle
from taxel.evaluation.early_warning.slip_warnings import (
    Promise,
    WarningTrack,
    alarm_config,
    keep_promise,
)
from taxel.gel.slip_signal import PAIR_FEATURES
from taxel.sim.pour.cups import Kind
from taxel.training.slip.cups import (
    FRAME_HZ,
    GROSS_UM,
    NOISE_CUPS,
    TRAINING_CUPS,
    PourRows,
    keep_runs,
    noise_runs,
    training_runs,
    true_pours,
)
from taxel.training.slip.heads import (
    USUAL_GOALS,
    Goal,
    HeadName,
    PourFeatures,
    SlipHead,
    learning_rows,
    new_head,
)
from taxel.training.slip.onnx_graph import linear_model
from taxel.training.slip.pose_noise import PoseNoise, add_noise, fit_noises
from taxel.training.slip.rim_features import rim_features
from taxel.windows.rest import SETTLE

FOLDS: Final = 4
"""Groups of training cups that are held out in turn. Source: our choice, docs/decisions/0013."""
AHEAD_S: Final = 0.6
"""By how much the rule without learning looks ahead, seconds. Source: decision 36."""
ONSET_UM: Final = 20.0
"""Slip from which a warning is justified: the rule "micro-slip", docs/decisions/0013."""
LEARNED_CUPS: Final = len(TRAINING_CUPS)
"""Training cups that a warning learns from unless fewer are asked for."""
PER_MIN: Final = 0.3
"""False alarms a minute that a learned head promises. Source: our choice, decision 36."""
PROMISED_KINDS: Final[tuple[Kind, ...]] = ("pour", "still")
"""Pours on which false alarms are promised: the paper's. Pushes slide fast and then hold, so that
a promise over them too would silence the rest; the other kinds give fewer than these."""
LATER_UM: Final = {"1 mm": 1000.0}
LEARNED_ON: Final = "simulated poses, docs/decisions/0036"
"""What bundles say of their data."""
_RULE: Final = tuple(PAIR_FEATURES.index(name) for name in ("slip_mean", "slip_rate_8_mean"))
_CHECKED: Final = 64
Drive = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class LearntWarning:
    """A head on all training cups, and the threshold that keeps the promise."""

    head: SlipHead
    promise: Promise
    tracks: tuple[WarningTrack, ...]
    """Training pours, out of fold."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadyWarning:
    """A warning as it is written."""

    model: bytes
    """ONNX: features (n, 1, 1, columns) → probability (n,)."""
    threshold: float
    """From which on it warns, 0…1."""
    check: NDArray[np.float32]
    """Features to try the bundle with, shape (n, columns); the rule's, (n, 66)."""
    expected: NDArray[np.float32]
    """What is given for them, shape (n,)."""


def training_features(
    folder: Path, cups: int = LEARNED_CUPS, on_step: Callable[[str], None] = lambda _: None
) -> list[PourFeatures]:
    """Return training pours as images would give them.

    Args:
        folder: Where poses are kept; what is not there is simulated, ten minutes of one core for
            all cups.
        cups: How many of `TRAINING_CUPS`.
        on_step: Called with a line before each cup.

    Raises:
        RecordingFailed: The disk refused.
    """
    seen: list[PourRows] = []
    exact: list[PourRows] = []
    for cup in NOISE_CUPS:
        on_step(f"images of training cup {cup}")
        runs = noise_runs(cup)
        seen += keep_runs(folder / f"{cup}-noise.npz", runs)
        exact += keep_runs(folder / f"{cup}-noise-true.npz", runs, true_pours)
    noise = fit_noises(seen, exact)
    features: list[PourFeatures] = []
    for cup in TRAINING_CUPS[:cups]:
        on_step(f"poses of training cup {cup}")
        runs = training_runs(cup)
        features += _noisy_features(
            keep_runs(folder / f"{cup}-training.npz", runs, true_pours), noise
        )
    return features


def _noisy_features(pours: Sequence[PourRows], noise: PoseNoise) -> list[PourFeatures]:
    """Return the features of pours whose exact poses are known, as images would give them."""
    return rim_features(
        [add_noise(pour, noise, np.random.default_rng([0, pour.run.seed])) for pour in pours]
    )


def rule_drive(features: PourFeatures) -> Drive:
    """Return the slip that is due in `AHEAD_S` at each moment, mm, shape (moments,).

    The mean over the gels: both hold the same object, and their noise is their own.
    """
    slip, rate = (features.rows[:, column] for column in _RULE)
    return np.maximum(slip + AHEAD_S * rate, 0.0)[features.at].astype(np.float64)


def head_drive(head: SlipHead, features: PourFeatures) -> Drive:
    """Return the probability at each moment, shape (moments,)."""
    return head.probability(features.rows)[features.at].astype(np.float64)


def track_of(features: PourFeatures, drive: Drive) -> WarningTrack:
    """Return what is judged of a pour."""
    pour = features.pour
    event_s = pour.first_s(GROSS_UM)
    return WarningTrack(
        drive=drive,
        time_s=pour.time_s,
        onset_s=None if event_s is None else pour.first_s(ONSET_UM),
        event_s=event_s,
        later_s={name: pour.first_s(um) for name, um in LATER_UM.items()} | {"drop": pour.drop_s},
        largest_um=float(pour.slip_um.max()),
        groups={
            "cup": str(pour.run.cup.index),
            "force_n": f"{pour.run.force_n:g}",
            "position": pour.run.position,
            "kind": pour.run.kind,
            "gel": str(features.gel),
        },
    )


def promised(tracks: Sequence[WarningTrack]) -> list[WarningTrack]:
    """Return the pours on which false alarms are promised."""
    return [track for track in tracks if track.groups["kind"] in PROMISED_KINDS]


def keep_promises(
    tracks: Sequence[WarningTrack], per_min: float, layers_per_min: float | None = None
) -> Promise:
    """Return the promise over `PROMISED_KINDS`; of two gels' promises that of the higher threshold.

    Nobody knows how a real gel shears, so false alarms stay within the promise on either version.

    Args:
        tracks: Training pours, each driven by a head that had not seen its cup.
        per_min: False alarms a minute that are promised.
        layers_per_min: The same on gels that shear; `per_min` unless given.

    Raises:
        BadInput: No pour holds, or the promise is below 0.
    """
    judged = promised(tracks)
    asked = {"1": per_min, "2": per_min if layers_per_min is None else layers_per_min}
    found = [
        keep_promise([track for track in judged if track.groups["gel"] == gel], asked[gel])
        for gel in sorted({track.groups["gel"] for track in judged})
    ]
    if not found:
        return keep_promise(judged, per_min)
    return max(found, key=lambda promise: promise.threshold)


def out_of_fold(
    pours: Sequence[PourFeatures],
    head: HeadName,
    goal: Goal | None = None,
    *,
    seed: int = 0,
    on_step: Callable[[str], None] = lambda _: None,
) -> list[WarningTrack]:
    """Return training pours, each driven by a head that had not seen its cup."""
    cups = np.array([found.cup for found in pours])
    drives: dict[int, Drive] = {}
    for part in np.array_split(np.unique(cups), FOLDS):
        on_step(f"{head}, without cups {part[0]} to {part[-1]}")
        held = np.isin(cups, part)
        fitted = fit_head(
            [found for found, out in zip(pours, held, strict=True) if not out], head, goal, seed
        )
        for index in np.flatnonzero(held):
            drives[int(index)] = head_drive(fitted, pours[index])
    return [track_of(found, drives[index]) for index, found in enumerate(pours)]


def fit_head(
    pours: Sequence[PourFeatures], head: HeadName, goal: Goal | None = None, seed: int = 0
) -> SlipHead:
    """Return a head that has learned from all of these pours."""
    fitted = new_head(head, seed)
    fitted.fit(*learning_rows(pours, goal or USUAL_GOALS[head]))
    return fitted


def learn_warning(
    pours: Sequence[PourFeatures],
    head: HeadName,
    per_min: float,
    layers_per_min: float | None = None,
    *,
    goal: Goal | None = None,
    seed: int = 0,
    on_step: Callable[[str], None] = lambda _: None,
) -> LearntWarning:
    """Learn a head on all training cups and the threshold that keeps a promise.

    Args:
        pours: Of training cups.
        head: Which kind.
        per_min: False alarms a minute that are promised.
        layers_per_min: The same on gels that shear; `per_min` unless given.
        goal: What a row is labelled by; the head's usual goal unless given.
        seed: Of learning.
        on_step: Called with a line before each training.
    """
    tracks = out_of_fold(pours, head, goal, seed=seed, on_step=on_step)
    promise = keep_promises(tracks, per_min, layers_per_min)
    on_step(f"{head}, all training cups")
    fitted = fit_head(pours, head, goal, seed)
    return LearntWarning(head=fitted, promise=promise, tracks=tuple(tracks))


def make_warning(
    pours: Sequence[PourFeatures],
    head: HeadName | Literal["rule"],
    per_min: float,
    layers_per_min: float | None = None,
    *,
    goal: Goal | None = None,
    seed: int = 0,
    on_step: Callable[[str], None] = lambda _: None,
) -> tuple[ReadyWarning, Promise, Sequence[WarningTrack]]:
    """Learn a warning that keeps a promise, or set the threshold of the rule that learns nothing.

    Args:
        pours: Of training cups.
        head: Which kind.
        per_min: False alarms a minute that are promised.
        layers_per_min: The same on gels that shear; `per_min` unless given.
        goal: What a row is labelled by; the head's usual goal unless given.
        seed: Of learning.
        on_step: Called with a line before each training.

    Returns:
        The warning, its promise, and training pours: out of fold, or driven by the rule.
    """
    check = pours[0].rows[:_CHECKED]
    if head == "rule":
        check = check[:, : len(PAIR_FEATURES)]
        tracks = rule_tracks(pours)
        promise = keep_promises(tracks, per_min, layers_per_min)
        limit_mm = promise.threshold
        expected = rule_probability(check, limit_mm)
        ready = ReadyWarning(
            model=rule_model(limit_mm), threshold=0.5, check=check, expected=expected
        )
        return ready, promise, tracks
    learnt = learn_warning(
        pours, head, per_min, layers_per_min, goal=goal, seed=seed, on_step=on_step
    )
    ready = ReadyWarning(
        model=learnt.head.to_onnx(), threshold=learnt.promise.threshold,
        check=check, expected=learnt.head.probability(check),
    )  # fmt: skip
    return ready, learnt.promise, learnt.tracks


def rule_tracks(pours: Sequence[PourFeatures]) -> list[WarningTrack]:
    """Return pours driven by the rule that learns nothing."""
    return [track_of(found, rule_drive(found)) for found in pours]


def write_warning(
    path: Path,
    name: str,
    warning: ReadyWarning,
    measured: Mapping[str, float],
    learned_on: str = LEARNED_ON,
) -> float:
    """Write a bundle that warns of slip; return the largest difference that was found.

    Args:
        path: The file.
        name: The head's.
        warning: What it holds.
        measured: What was measured on training cups held out; what is no number is left out.
        learned_on: What it learned from, in words.

    Raises:
        BadBundle: The model gives other probabilities.
        RecordingFailed: The disk refused.
    """
    width = warning.check.shape[1]
    contract = GraspContract(
        features=next(name for name, columns in SLIP_COLUMNS.items() if columns == width),
        weights="",
        head=name,
        frames=1,
        tare="none",
        settle=(SETTLE.start, SETTLE.stop),
        cameras=2,
        width=320,
        height=240,
        rate_hz=FRAME_HZ,
        rule="gross-slip",
        offset=((0.0,) * width,),
        factor=((1.0,) * width,),
        stability=replace(alarm_config(warning.threshold), unstable=(1.0 + warning.threshold) / 2),
        parameters=0,
        data_digest=learned_on,
        measured={key: value for key, value in measured.items() if np.isfinite(value)},
        software=f"taxel {__version__}",
    )
    return write_grasp_bundle(
        path, contract, warning.model, None, warning.check[:, None, None], warning.expected
    )


def rule_probability(rows: NDArray[np.float32], threshold_mm: float) -> NDArray[np.float32]:
    """Return what `rule_model` gives for rows, shape (n,)."""
    drive = rows[:, _RULE[0]] + AHEAD_S * rows[:, _RULE[1]]
    return np.asarray(np.clip(drive / (2 * threshold_mm), 0, 1), np.float32)


def rule_model(threshold_mm: float) -> bytes:
    """Return the rule without learning as ONNX: one half where it stands at its threshold."""
    column = np.zeros(len(PAIR_FEATURES))
    column[list(_RULE)] = np.array([1.0, AHEAD_S]) / (2 * threshold_mm)
    return linear_model(column)
