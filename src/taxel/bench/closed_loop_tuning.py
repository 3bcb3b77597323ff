"""Choose when a monitor's probability raises the grip: on training cups, by what it prevents.

Give it probabilities of cups that the model was *not* fitted on (out of fold, within the
training cups). Each threshold's alarms become commands, and the pours are played again
with them: what counts is whether the cup is saved, not how early a label was met. After the
first raise the pictures would differ from those that gave the probabilities; a policy's
later steps are therefore approximate here, and exact where it is judged. Knows nothing
about models, files or screens.

Source: docs/decisions/0017.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from taxel.actions.grip_policy import GripPolicy, GripPolicyConfig, PixelDifferenceConfig
from taxel.bench.closed_loop_scores import LoopCase, LoopScores, score_loops
from taxel.decisions.stability import StabilityConfig, StabilityMonitor
from taxel.jobs.running import side_by_side
from taxel.live.closed_loop import GripCommand, LoopConfig, LoopTrack, at_full_force, replay_loop
from taxel.sim.cups import PourRun
from taxel.sources.pour_sets import ARRIVAL_S

WARN = (0.1, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 0.98, 0.99)
"""Thresholds that are tried, 0…1."""
RAISE_S = (0.0, 0.05)
"""Debounces that are tried, seconds."""
PIXELS = (1.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0, 16.0, 20.0)
"""Thresholds on a difference of pixels that are tried, per cent of the brightness."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunProbabilities:
    """One training pour and the probabilities that a model which had not seen its cup gives."""

    run: PourRun
    time_s: NDArray[np.float64]
    """Shape (n,): of the newest frame of each window, seconds since the grasp."""
    probabilities: NDArray[np.floating]
    """Shape (n,): of instability, 0…1."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CurvePoint:
    """One threshold with its debounce, and what it does on the training pours."""

    stability: StabilityConfig
    scores: LoopScores


@dataclass(frozen=True, slots=True, kw_only=True)
class PixelPoint:
    """One threshold on a difference of pixels, and what it does on the training pours."""

    pixels: PixelDifferenceConfig
    scores: LoopScores


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopGoal:
    """Limits to keep. Source: our choice: half of what is promised, docs/decisions/0017."""

    lost_share: float = 0.025
    """Preventable drops that still happen, 0…1."""
    needless_share: float = 0.025
    """Pours that hold and are raised, 0…1."""


def tune_loop(
    tracks: Sequence[RunProbabilities],
    config: LoopConfig | None = None,
    policy: GripPolicyConfig | None = None,
    goal: LoopGoal | None = None,
    workers: int | None = None,
) -> tuple[StabilityConfig, list[CurvePoint]]:
    """Return the thresholds that come nearest to the goal, and the whole curve.

    Args:
        tracks: Training pours.
        config: What lies between cup and decision.
        policy: What follows the monitor.
        goal: The limits.
        workers: Processes side by side.
    """
    config, policy, goal = config or LoopConfig(), policy or GripPolicyConfig(), goal or LoopGoal()
    grid = [stability_at(warn, raise_s) for raise_s in RAISE_S for warn in WARN]
    jobs = [
        (track.run, [commands_of(track, settings, config, policy) for settings in grid], config)
        for track in tracks
    ]
    scores = _scores(jobs, workers)
    curve = [CurvePoint(stability=a, scores=b) for a, b in zip(grid, scores, strict=True)]
    point = choose(
        [point.scores for point in curve], goal, [point.stability.raise_s for point in curve]
    )
    return curve[point].stability, curve


def tune_pixels(
    tracks: Sequence[RunProbabilities],
    base: PixelDifferenceConfig | None = None,
    config: LoopConfig | None = None,
    goal: LoopGoal | None = None,
    workers: int | None = None,
) -> tuple[PixelDifferenceConfig, list[PixelPoint]]:
    """Return the threshold on a difference of pixels that comes nearest to the goal.

    Args:
        tracks: Training pours; their "probabilities" are differences, per cent.
        base: Debounce and force; the threshold is tuned.
        config: What lies between cup and decision.
        goal: The limits.
        workers: Processes side by side.
    """
    config, goal, base = config or LoopConfig(), goal or LoopGoal(), base or PixelDifferenceConfig()
    grid = [replace(base, threshold=threshold) for threshold in PIXELS]
    jobs = [
        (track.run, [_pixel_commands(track, settings, config) for settings in grid], config)
        for track in tracks
    ]
    scores = _scores(jobs, workers)
    curve = [PixelPoint(pixels=a, scores=b) for a, b in zip(grid, scores, strict=True)]
    return curve[choose([point.scores for point in curve], goal)].pixels, curve


def _scores(
    jobs: Sequence[tuple[PourRun, list[tuple[GripCommand, ...]], LoopConfig]], workers: int | None
) -> list[LoopScores]:
    """Return the scores of each alternative over all pours."""
    played = side_by_side(play, jobs, workers=workers)
    return [score_loops(cases) for cases in zip(*played, strict=True)]


def stability_at(warn: float, raise_s: float) -> StabilityConfig:
    """Return a monitor's thresholds: UNSTABLE half way from WARNING to certainty."""
    return replace(
        StabilityConfig(),
        warn=warn,
        clear=warn / 2,
        unstable=(1 + warn) / 2,
        raise_s=raise_s,
        frozen_s=float("inf"),
    )


def choose(
    scores: Sequence[LoopScores], goal: LoopGoal, family: Sequence[float] | None = None
) -> int:
    """Return which alternative exceeds the goal least; then, which errs least.

    Among equals the middle of the family with most of them: its neighbours on both sides do
    as well, so that cups never seen are least likely to fall off the plateau.

    Args:
        scores: Of each alternative, in order of its threshold within a family.
        goal: The limits.
        family: Which family each belongs to, such as its debounce; one by default.
    """

    def merit(scores: LoopScores) -> tuple[float, float]:
        lost = 1.0 - scores.prevented_share
        excess = max(lost - goal.lost_share, 0.0) / goal.lost_share
        excess += max(scores.needless_share - goal.needless_share, 0.0) / goal.needless_share
        return round(excess, 9), round(lost + scores.needless_share, 9)

    best = min(merit(score) for score in scores)
    equals = [place for place, score in enumerate(scores) if merit(score) == best]
    if family is not None:
        largest = Counter(family[place] for place in equals).most_common(1)[0][0]
        equals = [place for place in equals if family[place] == largest]
    return equals[(len(equals) - 1) // 2]


def play(
    run: PourRun, alternatives: Sequence[tuple[GripCommand, ...]], config: LoopConfig
) -> list[LoopCase]:
    """Return one training pour under each series of commands; equal ones are played once.

    What is not dropped without taxel needs no second play: there a raise counts, not what
    becomes of it, and the mean force is left as it was.
    """
    bare = replay_loop(run, config)
    full = at_full_force(run, config) if bare.dropped else bare
    known: dict[tuple[GripCommand, ...], LoopTrack] = {(): bare}
    for commands in alternatives:
        if commands not in known:
            known[commands] = (
                replay_loop(run, config, commands)
                if bare.dropped
                else replace(bare, commands=commands)
            )
    return [
        LoopCase(bare=thin(bare), full=thin(full), held=thin(known[commands]))
        for commands in alternatives
    ]


def commands_of(
    track: RunProbabilities,
    stability: StabilityConfig,
    config: LoopConfig,
    policy: GripPolicyConfig,
) -> tuple[GripCommand, ...]:
    """Return what the monitor and the policy would command."""
    monitor, grip = StabilityMonitor(stability), GripPolicy(track.run.force_n, policy)
    commands: list[GripCommand] = []
    force_n = grip.force_n
    for time_s, probability in zip(track.time_s.tolist(), track.probabilities, strict=True):
        now_n = grip.push(monitor.push(float(probability), time_s), time_s)
        if now_n != force_n:
            force_n = now_n
            given_s = time_s + ARRIVAL_S + config.inference_s
            commands.append(GripCommand(time_s=given_s, force_n=force_n))
    return tuple(commands)


def _pixel_commands(
    track: RunProbabilities, pixels: PixelDifferenceConfig, config: LoopConfig
) -> tuple[GripCommand, ...]:
    """Return what the comparison by pixels would command."""
    since_s: float | None = None
    for time_s, value in zip(track.time_s.tolist(), track.probabilities, strict=True):
        if not value > pixels.threshold:
            since_s = None
            continue
        since_s = time_s if since_s is None else since_s
        if time_s - since_s >= pixels.raise_s - 1e-9:
            given_s = time_s + ARRIVAL_S + config.inference_s
            return (GripCommand(time_s=given_s, force_n=pixels.most_n),)
    return ()


def thin(track: LoopTrack) -> LoopTrack:
    """Return a track of a few moments with the same scores: processes hand over thousands."""
    slip_s = track.slips_s()
    first = 0 if slip_s is None else int(np.searchsorted(track.time_s, slip_s))
    kept = sorted({0, first, int(np.argmax(track.truth[:, 0])), len(track.time_s) - 1})
    mean_n = np.full(len(kept), track.mean_force_n)
    return replace(
        track, time_s=track.time_s[kept], truth=track.truth[kept], force_n=mean_n, latencies_s=()
    )
