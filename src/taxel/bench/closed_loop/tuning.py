"""Choose when a monitor's score raises the grip: on training cups, by what it prevents.

Give it scores of cups that the model was *not* fitted on (out of fold, within the training
cups). Each threshold's alarms go to the policy, and the pours are played again with what it
commands: what counts is whether the cup is saved, not how early a label was met. After the
first raise the images would differ from those that gave the scores, so an alarm stands as it
would have without the raise, and the policy's next steps follow the slip of the pour as
played. Exact is where it is judged. Knows nothing about models, files or screens.

Source: docs/decisions/0017.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import beta

from taxel.actions.grip_policy import GripPolicy, GripPolicyConfig, PixelDifferenceConfig
from taxel.bench.closed_loop.scores import (
    NEEDLESS,
    PERSON_PREVENTED,
    PERSON_S,
    PREVENTED,
    LoopCase,
    LoopScores,
    score_loops,
)
from taxel.decisions.stability import StabilityConfig, StabilityDecision, StabilityMonitor
from taxel.gel.slip_signal import Slip
from taxel.jobs.running import side_by_side
from taxel.live.closed_loop import GripCommand, LoopConfig, LoopTrack, at_full_force, replay_loop
from taxel.sim.pour.cups import PourRun
from taxel.sources.simulated.pour_sets import ARRIVAL_S

WARN = (0.1, 0.3, 0.5, 0.7, 0.8, 0.85, 0.9, 0.92, 0.94, 0.96, 0.98, 0.99)
"""Thresholds that are tried, 0…1."""
RAISE_S = (0.0, 0.05)
"""Debounces that are tried, seconds."""
PIXELS = (1.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0, 16.0, 20.0)
"""Thresholds on a difference of pixels that are tried, per cent of the brightness."""
NOISE_MM = 0.008
"""What measured slip is off by (RMS), millimetres. Source: docs/decisions/0036."""
_LEAST_LOG = -700.0
"""Below this all chances are alike."""
_NO_SLIP = Slip(
    distance_mm=0.0, rate_mm_s=0.0, compliance=0.0, distance_sd_mm=NOISE_MM, rate_sd_mm_s=0.0,
    compliance_sd=0.0, seen=True,
)  # fmt: skip


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
    person: LoopScores
    """Nothing is raised; the person stops pouring `PERSON_S` after the alarm."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PixelPoint:
    """One threshold on a difference of pixels, and what it does on the training pours."""

    pixels: PixelDifferenceConfig
    scores: LoopScores


def tune_loop(
    tracks: Sequence[RunProbabilities],
    config: LoopConfig | None = None,
    workers: int | None = None,
) -> tuple[StabilityConfig, list[CurvePoint]]:
    """Return the thresholds that most likely keep all promises, and the whole curve.

    Args:
        tracks: Training pours.
        config: What lies between cup and decision.
        workers: Processes side by side.
    """
    config, policy = config or LoopConfig(), GripPolicyConfig()
    grid = [stability_at(warn, raise_s) for raise_s in RAISE_S for warn in WARN]
    played = side_by_side(
        play_alarms, [(track, grid, config, policy) for track in tracks], workers=workers
    )
    curve = [
        CurvePoint(
            stability=stability,
            scores=score_loops([cases[place][0] for cases in played]),
            person=score_loops([cases[place][1] for cases in played]),
        )
        for place, stability in enumerate(grid)
    ]
    point = choose(
        [point.scores for point in curve],
        [point.person for point in curve],
        [point.stability.raise_s for point in curve],
    )
    return curve[point].stability, curve


def tune_pixels(
    tracks: Sequence[RunProbabilities],
) -> tuple[PixelDifferenceConfig, list[PixelPoint]]:
    """Return the threshold on a difference of pixels that most likely keeps the promises.

    Args:
        tracks: Training pours; their "probabilities" are differences, per cent.
    """
    config = LoopConfig()
    grid = [replace(PixelDifferenceConfig(), threshold=threshold) for threshold in PIXELS]
    jobs = [
        (track.run, [_pixel_commands(track, settings, config) for settings in grid], config)
        for track in tracks
    ]
    played = side_by_side(play, jobs)
    scores = [score_loops(cases) for cases in zip(*played, strict=True)]
    curve = [PixelPoint(pixels=a, scores=b) for a, b in zip(grid, scores, strict=True)]
    return curve[choose([point.scores for point in curve])].pixels, curve


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
    scores: Sequence[LoopScores],
    persons: Sequence[LoopScores] | None = None,
    family: Sequence[float] | None = None,
) -> int:
    """Return which alternative most likely keeps all promises; then, which errs least.

    Each share's chance to be within its goal is that of a beta distribution over what was
    counted (Jeffreys' prior); the chances are multiplied. Among equals the middle of the family
    with most of them: its neighbours on both sides do as well, so that cups never seen are least
    likely to fall off the plateau.

    Args:
        scores: Of each alternative, in order of its threshold within a family.
        persons: Of each, with a person who stops pouring in place of the grip; not promised
            unless given.
        family: Which family each belongs to, such as its debounce; the same for all by default.
    """

    def merit(place: int) -> tuple[float, float]:
        own = scores[place]
        chance = _at_least(PREVENTED, own.prevented, own.preventable)
        chance += _at_least(1 - NEEDLESS, own.holds - own.needless, own.holds)
        if persons is not None:
            person = persons[place]
            chance += _at_least(PERSON_PREVENTED, person.prevented, person.preventable)
        return -round(chance, 9), round(1.0 - own.prevented_share + own.needless_share, 9)

    merits = [merit(place) for place in range(len(scores))]
    equals = [place for place, found in enumerate(merits) if found == min(merits)]
    if family is not None:
        largest = Counter(family[place] for place in equals).most_common(1)[0][0]
        equals = [place for place in equals if family[place] == largest]
    return equals[(len(equals) - 1) // 2]


def _at_least(goal: float, hits: int, total: int) -> float:
    """Return the logarithm of the chance that a share is at least its goal."""
    return max(float(beta.logsf(goal, hits + 0.5, total - hits + 0.5)), _LEAST_LOG)


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


def play_alarms(
    track: RunProbabilities,
    grid: Sequence[StabilityConfig],
    config: LoopConfig,
    policy: GripPolicyConfig,
) -> list[tuple[LoopCase, LoopCase]]:
    """Return one training pour under each monitor: with the policy, and with a person instead.

    As in `play`, what is not dropped without taxel is not played again.
    """
    bare = replay_loop(track.run, config)
    full = at_full_force(track.run, config) if bare.dropped else bare
    runs_by_alarms: dict[tuple[bool, ...], tuple[LoopTrack, LoopTrack]] = {}
    results = []
    for stability in grid:
        decisions = _decisions(track, stability)
        alarms = tuple(decision.alarm for decision in decisions)
        if not any(alarms):
            runs_by_alarms[alarms] = bare, bare
        elif alarms not in runs_by_alarms and bare.dropped:
            held_run = _held(track, decisions, config, policy)
            stop_s = (held_run.raised_s or np.inf) + PERSON_S
            runs_by_alarms[alarms] = held_run, replay_loop(track.run, config, stop_pouring_s=stop_s)
        elif alarms not in runs_by_alarms:
            first_s = float(track.time_s[alarms.index(True)]) + ARRIVAL_S + config.inference_s
            command = GripCommand(time_s=first_s, force_n=policy.most_n)
            runs_by_alarms[alarms] = replace(bare, commands=(command,)), bare
        results.append(runs_by_alarms[alarms])
    return [
        (
            LoopCase(bare=thin(bare), full=thin(full), held=thin(held)),
            LoopCase(bare=thin(bare), full=thin(full), held=thin(person)),
        )
        for held, person in results
    ]


def _decisions(track: RunProbabilities, stability: StabilityConfig) -> list[StabilityDecision]:
    monitor = StabilityMonitor(stability)
    return [
        monitor.push(float(probability), time_s)
        for time_s, probability in zip(track.time_s.tolist(), track.probabilities, strict=True)
    ]


def _held(
    track: RunProbabilities,
    decisions: Sequence[StabilityDecision],
    config: LoopConfig,
    policy: GripPolicyConfig,
) -> LoopTrack:
    """Return the pour with the grip that a policy commands on these decisions."""
    grip, random = GripPolicy(track.run.force_n, policy), np.random.default_rng(track.run.seed)

    def ask(time_s: float, seen_mm: float) -> float:
        place = int(np.searchsorted(track.time_s, time_s + 1e-6)) - 1
        if place < 0:
            return grip.force_n
        slip = replace(_NO_SLIP, distance_mm=seen_mm + random.normal(0.0, NOISE_MM))
        return grip.push(replace(decisions[place], slip=slip), time_s)

    return replay_loop(track.run, config, ask=ask)


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
