"""How early a warning comes before gross slip, and how often it is false: by cup, never seen.

A head is trained on whole cups, the monitor's thresholds are tuned on probabilities of
training cups that the head had not seen (an inner split by cup), and the states of test cups
are judged. Trivial probabilities go through the same monitor. Knows nothing about screens.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from taxel.decisions.stability import StabilityConfig, states
from taxel.errors import BadDataset
from taxel.evaluation.early_warning.events import (
    EventScores,
    RunOutcome,
    StateTrack,
    by_group,
    judge,
    summarise,
)
from taxel.evaluation.early_warning.tuning_stability import ProbabilityTrack, Tuned, tune
from taxel.evaluation.splits import TrialFold
from taxel.evaluation.transitions.data import (
    CameraSet,
    Judged,
    judge_fold,
    truth_moments,
)
from taxel.evaluation.transitions.tables import WindowScores, score_windows
from taxel.training.frames.features import FrameFeatures
from taxel.training.frames.heads import HeadConfig, TrainedHead
from taxel.windows.sequence import label_windows

INNER_FOLDS = 4
"""Groups of training cups for tuning. Source: our choice, docs/decisions/0013."""
BY = ("force_n", "position", "kind")
"""What the events are also split by."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WarningResult:
    """What a monitor does on cups that neither head nor thresholds have seen."""

    name: str
    windows: WindowScores
    """Windows against the rule's labels."""
    tuned: tuple[Tuned, ...]
    """Thresholds, one for each time that they were tuned."""
    events: EventScores
    by: dict[str, dict[str, EventScores]]
    """Group key → value → events."""
    outcomes: tuple[RunOutcome, ...]
    probabilities: tuple[NDArray[np.float32], ...]
    """One a test pour, at each frame from the k-th on."""
    tests: tuple[int, ...]
    """Which pours those are."""


def warn_on_unseen_cups(
    data: CameraSet,
    features: Sequence[FrameFeatures],
    config: HeadConfig,
    folds: Sequence[TrialFold],
    *,
    name: str,
    on_step: Callable[[str], None] = lambda _: None,
) -> tuple[WarningResult, TrainedHead]:
    """Train, tune and judge, fold by fold; return the last fold's head too.

    Args:
        data: Pours with labels of the rule to learn.
        features: Of the pours, in their order.
        config: How a head is trained.
        folds: Which cups are learned from and which are judged.
        name: What to call it in a table.
        on_step: Called with a line before each training.

    Raises:
        BadDataset: A fold has fewer than two cups to learn from.
        ValueError: There are no folds.
    """
    judged, tuned, trained = [], [], None
    for fold in folds:
        on_step(f"{name}: tuning without cup {fold.name}")
        tuned.append(_tune_head(data, features, config, fold))
        on_step(f"{name}: cup {fold.name}")
        judged_fold, trained = judge_fold(features, data.labels, fold, config)
        judged.append(judged_fold)
    if trained is None:
        raise ValueError("needed at least one fold")
    return _result(data, judged, tuned, config.frames, name), trained


def warn_trivially(
    data: CameraSet,
    column: Callable[[int], NDArray[np.float64]],
    folds: Sequence[TrialFold],
    *,
    name: str,
    frames: int,
) -> WarningResult:
    """Judge a number a frame as if it were a probability, thresholds tuned in the same way.

    Args:
        data: Pours with labels of the rule.
        column: Pour's index → shape (n,); larger is less stable. Ranks among the training
            pours' values are the probabilities.
        folds: Which cups are tuned on and which are judged.
        name: What to call it in a table.
        frames: k, so that the same windows are judged.
    """
    judged, tuned = [], []
    for fold in folds:
        known = np.sort(np.concatenate([column(i) for i in fold.train_rows]))

        def rank(index: int, known: NDArray[np.float64] = known) -> NDArray[np.float32]:
            place = np.searchsorted(known, column(index)[frames - 1 :]) / len(known)
            judged = np.where(data.pours[index].whole(frames), place.clip(0.001, 0.999), np.nan)
            return judged.astype(np.float32)

        long = [i for i in fold.train_rows if len(data.pours[i]) >= frames]
        tracks = [_track(data, i, rank(i), frames) for i in long]
        tuned.append(tune(tracks, base=_base()))
        labels = tuple(label_windows(data.labels[i], frames) for i in fold.test_rows)
        judged.append(Judged(fold, tuple(rank(i) for i in fold.test_rows), labels))
    return _result(data, judged, tuned, frames, name)


def _tune_head(
    data: CameraSet,
    features: Sequence[FrameFeatures],
    config: HeadConfig,
    fold: TrialFold,
) -> Tuned:
    """Tune on the fold's training cups, each judged by a head that had not seen it."""
    cups = data.cups()[fold.train_rows]
    names = sorted(set(cups.tolist()))
    if len(names) < 2:
        raise BadDataset(
            "at least two of the group cup to learn from", f"{len(names)}", "record more"
        )
    judged = []
    for part in np.array_split(np.array(names), min(INNER_FOLDS, len(names))):
        held = np.isin(cups, part)
        inner = TrialFold.of("+".join(part), fold.train_rows[~held], fold.train_rows[held])
        judged.append(judge_fold(features, data.labels, inner, config)[0])
    return tune(monitor_tracks(data, judged, config.frames), base=_base())


def monitor_tracks(
    data: CameraSet, judged: Sequence[Judged], frames: int
) -> list[ProbabilityTrack]:
    """Return the judged pours' probabilities with what truly happened, for tuning.

    Pours shorter than a window have none and are left out.
    """
    return [
        _track(data, int(index), found, frames)
        for scored in judged
        for index, found in zip(scored.fold.test_rows, scored.probabilities, strict=True)
        if len(found)
    ]


def _track(
    data: CameraSet, index: int, probabilities: NDArray[np.float32], frames: int
) -> ProbabilityTrack:
    pour = data.pours[index]
    onset_s, event_s = truth_moments(pour)
    return ProbabilityTrack(
        probabilities=probabilities,
        time_s=pour.time_s[frames - 1 :],
        onset_s=onset_s,
        event_s=event_s,
        groups=pour.groups,
    )


def _base() -> StabilityConfig:
    """Return the monitor without its frozen check: repeated frames give equal probabilities."""
    return replace(StabilityConfig(), frozen_s=float("inf"))


def _result(
    data: CameraSet, judged: Sequence[Judged], tuned: Sequence[Tuned], frames: int, name: str
) -> WarningResult:
    outcomes, probabilities, tests = [], [], []
    for scored, choice in zip(judged, tuned, strict=True):
        for index, found in zip(scored.fold.test_rows, scored.probabilities, strict=True):
            if not len(found):
                continue
            track = _track(data, int(index), found, frames)
            decided = states(track.probabilities, track.time_s, choice.config)
            outcomes.append(
                judge(
                    StateTrack(
                        states=decided,
                        time_s=track.time_s,
                        onset_s=track.onset_s,
                        event_s=track.event_s,
                        groups=track.groups,
                    )
                )
            )
            probabilities.append(found)
            tests.append(int(index))
    return WarningResult(
        name=name,
        windows=score_windows(judged),
        tuned=tuple(tuned),
        events=summarise(outcomes),
        by={key: by_group(outcomes, key) for key in BY if all(key in o.groups for o in outcomes)},
        outcomes=tuple(outcomes),
        probabilities=tuple(probabilities),
        tests=tuple(tests),
    )


def split_by_folder(train: CameraSet, test: CameraSet) -> tuple[CameraSet, list[TrialFold]]:
    """Join a set to learn from and a set to be judged on, which share no cup.

    Raises:
        BadDataset: They share one.
    """
    shared = set(train.cups().tolist()) & set(test.cups().tolist())
    if shared:
        raise BadDataset(
            "a test set without a cup of the training set",
            f"cup {', '.join(sorted(shared))} in both",
            "simulate other cups with --first-cup, or record others",
        )
    count = len(train.pours)
    both = CameraSet(
        pours=train.pours + test.pours,
        rule=train.rule,
        labels=train.labels + test.labels,
        signals=train.signals + test.signals,
    )
    fold = TrialFold.of("test", np.arange(count), np.arange(count, count + len(test.pours)))
    return both, [fold]
