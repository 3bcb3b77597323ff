"""What a grasp bundle still predicts over faults of its cameras: by moment, and by slip.

Each recording is watched frame by frame by the monitor that is given: the live path's own.
Knows nothing about how bundles are trained.
"""

from __future__ import annotations

import hashlib
import re
import zlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from taxel.bundles.grasp import GraspBundle, read_grasp_bundle
from taxel.decisions.stability import Stability, StabilityDecision
from taxel.errors import BadDataset, BadInput
from taxel.evaluation.early_warning.events import RunOutcome, StateTrack, judge
from taxel.evaluation.intervals import draw_clusters, percentile_interval
from taxel.evaluation.robustness.curve import CLEAN, FaultPoint, mildest_first
from taxel.evaluation.robustness.faults import refused_level
from taxel.evaluation.robustness.image_faults import IMAGE_FAULTS, find_image_fault
from taxel.evaluation.transitions.data import truth_moments
from taxel.jobs.running import side_by_side
from taxel.labels.rules import RULES
from taxel.labels.slip import label_truth
from taxel.recordings.reader import iterate_tactile
from taxel.signals import CameraInfo, Frame
from taxel.sim.pour.state import TRUTH_CHANNELS
from taxel.training.frames.labels import truth_of
from taxel.windows.camera_recordings import CameraRecording, read_camera_recording
from taxel.windows.pairs import FramePairer, FrameSet

ALARMS = (Stability.WARNING, Stability.UNSTABLE)
LATE_S = 0.3
"""An alarm so long after the bundle's rule became true still counts, seconds: most cups can then
still be saved. Source: docs/decisions/0017 and 0029."""
_SLIP_RULE = re.compile(r"slip > (\d+(?:\.\d+)?) um")


class MomentAnswer(Protocol):
    """One moment's answer."""

    @property
    def decision(self) -> StabilityDecision:
        """Stable, unstable or UNKNOWN."""
        ...

    @property
    def time_s(self) -> float:
        """Of the moment, seconds."""
        ...


class Monitor(Protocol):
    """What turns frames of one grasp into answers: `taxel.live.grasp_monitor.GraspMonitor`."""

    def see(self, frame: Frame) -> None:
        """Take one camera's frame as it comes."""
        ...

    def push(self, found: FrameSet) -> MomentAnswer:
        """Return the answer of a moment."""
        ...


Watcher = Callable[[GraspBundle, tuple[CameraInfo, ...]], Monitor]
"""What makes a monitor; a class or function of a module, so that a process can import it."""


@dataclass(frozen=True, slots=True)
class Watched:
    """What was decided on one recording."""

    cup: str
    """What is resampled: the cup, or the recording where none is named."""
    unstable: NDArray[np.bool_]
    """Shape (n,): truly unstable, at each moment since the first answer was possible."""
    states: NDArray[np.int8]
    """Shape (n,): numbers of `Stability`."""
    outcome: RunOutcome


def watch(
    bundle: GraspBundle,
    watcher: Watcher,
    pour: CameraRecording,
    fault: str = CLEAN,
    level: float = 0.0,
    seed: int = 0,
) -> Watched:
    """Return what a bundle predicts from one recording with one fault.

    Args:
        bundle: Features, head and thresholds.
        watcher: What makes a monitor.
        pour: A recording with the physics truth.
        fault: Name of a fault, or "none".
        level: In the fault's unit.
        seed: Of what the fault draws; the same draws at every level.

    Raises:
        BadBundle: The bundle was not made for such cameras.
        BadDataset: The recording has no truth.
    """
    frames: Iterable[Frame] = iterate_tactile(pour.path)
    if fault != CLEAN:
        words = [seed, zlib.crc32(fault.encode()), zlib.crc32(pour.name.encode())]
        frames = find_image_fault(fault).make(frames, level, np.random.default_rng(words))
    monitor = watcher(bundle, pour.cameras)
    pairer = FramePairer(len(pour.cameras))
    times, states = [], []
    for frame in frames:
        monitor.see(frame)
        found = pairer.push(frame)
        if found is None:
            continue
        answer = monitor.push(found)
        times.append(answer.time_s)
        states.append(int(answer.decision.state))
    if len(times) < 2:
        times, states = (
            [float(pour.time_s[0]), float(pour.time_s[-1])],
            [int(Stability.UNKNOWN)] * 2,
        )
    time_s, decided = np.array(times), np.array(states, np.int8)
    first = max(bundle.contract.settle_of(pour.cameras).stop, bundle.contract.frames)
    judged = time_s >= pour.time_s[min(first, len(pour) - 1)]
    true = truth_labels(pour, bundle.contract.rule)
    place = np.searchsorted(pour.time_s, time_s + 1e-6, side="right") - 1
    onset_s, _ = truth_moments(pour)
    event_s = float(pour.time_s[true.argmax()]) + LATE_S if true.any() else None
    outcome = judge(
        StateTrack(
            states=decided, time_s=time_s, onset_s=onset_s, event_s=event_s, groups=pour.groups
        )
    )
    return Watched(
        pour.groups.get("cup", pour.name),
        true[np.maximum(place, 0)][judged],
        decided[judged],
        outcome,
    )


def truth_labels(pour: CameraRecording, rule: str) -> NDArray[np.bool_]:
    """Return the moments that a bundle's rule calls unstable, shape (n,).

    Raises:
        BadDataset: The recording has no truth.
        BadInput: The rule looks at images: a fault would change what is right.
    """
    truth = truth_of(pour)
    own = _SLIP_RULE.fullmatch(rule)
    if own is not None:
        return np.asarray(truth[:, TRUTH_CHANNELS.index("slip")] > float(own[1]))
    if rule not in RULES or RULES[rule].needs != "truth":
        raise BadInput(
            "a bundle whose rule is gross slip (physics truth)", repr(rule),
            "train one with --rule gross-slip",
        )  # fmt: skip
    return label_truth(truth, rule).astype(bool)


def sweep_grasps(
    bundle_file: Path,
    watcher: Watcher,
    pours: Sequence[CameraRecording],
    plan: Mapping[str, Sequence[float]],
    *,
    seed: int = 0,
    workers: int | None = None,
    on_point: Callable[[FaultPoint], None] = lambda _: None,
) -> list[FaultPoint]:
    """Return the point without faults, then one a fault and level.

    Args:
        bundle_file: The grasp bundle.
        watcher: What makes a monitor.
        pours: Recordings with physics truth of cups that it was not trained on.
        plan: Fault → levels, as `plan_images` gives them.
        seed: Seed of everything that a fault draws.
        workers: As for `taxel.jobs.running.as_done`.
        on_point: Called with each point.

    Raises:
        BadInput: A fault is unknown.
        BadBundle, BadDataset: As `watch` says.
    """
    if not pours:
        raise BadDataset("recordings of tactile cameras", "none", "name others with --data")
    points: list[FaultPoint] = []
    levels = [(CLEAN, 0.0, "")]
    for name, own in plan.items():
        levels += [(name, level, find_image_fault(name).unit) for level in own]
    results: list[Watched] = []

    def add(watched: Watched) -> None:
        """Make a level's point once its last recording was watched."""
        results.append(watched)
        if len(results) % len(pours) == 0:
            own = results[-len(pours) :]
            points.append(grasp_point(own, *levels[len(points)]))
            on_point(points[-1])

    # One pool for all levels: to start its processes takes longer than to watch a pour.
    jobs = [
        (bundle_file.absolute(), watcher, pour.path.absolute(), pour.digest, name, level, seed)
        for name, level, _ in levels
        for pour in pours
    ]
    side_by_side(watch_one, jobs, add, workers)
    return points


def pours_digest(pours: Sequence[CameraRecording]) -> str:
    """Return the digest that a bundle trained on just these recordings holds."""
    return hashlib.sha256("".join(pour.digest for pour in pours).encode()).hexdigest()


def plan_images(
    faults: Sequence[str] = (), levels: Sequence[float] = ()
) -> dict[str, tuple[float, ...]]:
    """Return fault → levels, the mildest first; all faults, or each fault's own levels, unless
    given.

    Raises:
        BadInput: A fault is unknown, or a level outside its limits.
    """
    plan = {}
    for name in faults or tuple(IMAGE_FAULTS):
        fault = find_image_fault(name)
        low, high = fault.limits
        for level in levels:
            if not low <= level <= high:
                raise refused_level(f"levels of {name}", fault.limits, fault.unit, level)
        plan[name] = mildest_first(levels, fault.levels) or fault.levels
    return plan


def grasp_point(watched: Sequence[Watched], fault: str, level: float, unit: str) -> FaultPoint:
    """Return the point that watched recordings make; its interval resamples cups."""
    cups = sorted({watched_grasp.cup for watched_grasp in watched})
    counts = np.zeros((len(cups), 4))  # right and all, of unstable and of stable moments
    moments = answered = 0
    for watched_grasp in watched:
        known, unstable = watched_grasp.states != Stability.UNKNOWN, watched_grasp.unstable
        alarm = np.isin(watched_grasp.states, ALARMS)
        moments, answered = moments + len(known), answered + int(known.sum())
        counts[cups.index(watched_grasp.cup)] += [
            (alarm & unstable & known).sum(), (unstable & known).sum(),
            (~alarm & ~unstable & known).sum(), (~unstable & known).sum(),
        ]  # fmt: skip
    drawn = draw_clusters(len(cups))
    low, high = percentile_interval(_balanced(counts[drawn].sum(axis=1)))
    events = [watched_grasp.outcome for watched_grasp in watched if watched_grasp.outcome.event]
    holding = [
        watched_grasp.outcome for watched_grasp in watched if not watched_grasp.outcome.event
    ]
    minutes = sum(watched_grasp.judged_s for watched_grasp in holding) / 60
    return FaultPoint(
        fault=fault,
        level=level,
        unit=unit,
        accuracy=float(_balanced(counts.sum(axis=0)[None])[0]),
        low=low,
        high=high,
        answered=answered / moments if moments else float("nan"),
        windows=moments,
        grasps=float(np.mean([not event.missed for event in events])) if events else float("nan"),
        grasps_answered=float(
            np.mean(
                [(watched_grasp.states != Stability.UNKNOWN).any() for watched_grasp in watched]
            )
        ),
        outside=sum(watched_grasp.false_alarms for watched_grasp in holding) / minutes
        if minutes
        else float("nan"),
    )


def _balanced(counts: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return balanced accuracy of counts (…, 4); NaN where a side is missing."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(0.5 * (counts[..., 0] / counts[..., 1] + counts[..., 2] / counts[..., 3]))


def watch_one(
    file: Path, watcher: Watcher, path: Path, digest: str, fault: str, level: float, seed: int
) -> Watched:
    """Watch one recording at one level; a job for any worker."""
    return watch(
        _bundle(file, file.stat().st_mtime_ns), watcher, _pour(path, digest), fault, level, seed
    )


@lru_cache(maxsize=1)
def _bundle(file: Path, _changed_ns: int) -> GraspBundle:
    return read_grasp_bundle(file)


@lru_cache(maxsize=16)
def _pour(path: Path, digest: str) -> CameraRecording:
    pour = read_camera_recording(path)
    if pour.digest != digest:
        raise BadDataset(
            f"the same recording {path} for all workers", "another",
            "let all of them read the same folder, and leave it as it is meanwhile",
        )  # fmt: skip
    return pour
