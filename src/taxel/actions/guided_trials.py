"""Record one trial of two tactile cameras that hold something, once the grasp has settled.

The grasp paper's videos begin "from the time when the robot completes stable grasp" (section 3.2),
and its labels compare with the first frames: a gel that still moves then would make every later
frame unstable. So the pour waits until images have stood still, and the recording begins where
they did. Knows nothing about plans as a whole, keys or addresses.

Source of the limit: the rule by which frames are labelled (`taxel.labels.change`); waiting times
are our choice, docs/decisions/0043.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from taxel.actions.actuators import GripperActuator
from taxel.actions.gripper import Gripper, GripperStatus, Motion
from taxel.clock import Clock
from taxel.errors import BadInput, BadSource
from taxel.frame_codec import decode_jpeg
from taxel.labels.change import ChangeConfig, ChangeMeter
from taxel.recordings.manifest import Manifest
from taxel.recordings.trial_plan import PlannedTrial, refuse_made
from taxel.recordings.writer import Recorder
from taxel.signals import Frame, Samples
from taxel.sources.contract import Source

PATIENCE_S = 10.0
"""How long a grasp may take to settle, seconds of the source's time. Our choice."""
_SILENCE_S = 5.0
"""How long a camera may be silent while others deliver, seconds of the source's time; and, where
nothing comes at all, how long it is read. Our choice."""
_READ_S = 0.1
"""How long a read waits, seconds. Our choice."""
_LEAST_SHARE = 0.95
"""A source that ends before this share of a trial has not recorded it. Our choice."""
_GRIP_S = 5.0
"""How long a gripper may take to hold, seconds. Our choice."""
_GRIP_SETTLE_S = 0.5
"""How long a gripper's state must last before it counts, seconds: fingers begin to move and their
force comes a while after an order. Our choice; decision 16's fingers take 0.4 s from 15 to 50 N."""


class NotSettled(BadInput):
    """The images of a grasp go on changing."""


class NotHeld(BadInput):
    """The gripper has closed on nothing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedTrial:
    """What was recorded."""

    trial: PlannedTrial
    settled_after_s: float
    """From the first frame to the recording's beginning, seconds."""
    change: float
    """Largest change in the settled stretch, per cent of the brightness."""
    frames: int


@dataclass(slots=True)
class _Listening:
    """Reads a source; notices where it, or one of its cameras, falls silent."""

    source: Source
    newest_s: float = -np.inf
    """The newest moment of which anything was heard."""
    heard_s: dict[int, float] = field(default_factory=dict)
    """Camera → its newest frame's time; before its first, when the source was first heard."""
    silent: int = 0
    """Reads in a row that gave nothing."""

    def read(self) -> tuple[Samples, list[Frame]]:
        """Return what came.

        Raises:
            BadSource: Nothing for `_SILENCE_S`, of a camera or of all; or the source has ended.
        """
        samples, frames = self.source.read(_READ_S), self.source.frames()
        times = [frame.fitted_s for frame in frames]
        if len(samples):
            times.append(float(samples.fitted_s.max()))
        self.silent = 0 if times else self.silent + 1
        if self.silent * _READ_S > _SILENCE_S or (self.source.ended and not times):
            raise BadSource(
                "cameras that go on delivering",
                "the end of the source" if self.source.ended else f"nothing for {_SILENCE_S:g} s",
                "check the cables and record the trial again",
            )
        self._hear(times, frames)
        return samples, frames

    def _hear(self, times: list[float], frames: list[Frame]) -> None:
        """Note who was heard.

        Raises:
            BadSource: A camera has been silent for too long.
        """
        self.newest_s = max([self.newest_s, *times])
        for number in range(len(self.source.cameras) if times else 0):
            self.heard_s.setdefault(number, min(times))
        for frame in frames:
            self.heard_s[frame.camera] = max(self.heard_s[frame.camera], frame.fitted_s)
        for number, heard_s in self.heard_s.items():
            if self.newest_s - heard_s > _SILENCE_S:
                raise BadSource(
                    "cameras that all go on delivering",
                    f"nothing from the {self.source.cameras[number].name} camera for "
                    f"{_SILENCE_S:g} s",
                    "check its cable and record the trial again",
                )


@dataclass(slots=True)
class _Settling:
    """What came since the images last began to be watched."""

    source: Source
    config: ChangeConfig
    frames: list[Frame] = field(default_factory=list)
    samples: list[Samples] = field(default_factory=list)
    meters: list[ChangeMeter] = field(default_factory=list)
    worst: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.begin()

    def begin(self) -> None:
        """Watch anew."""
        self.frames, self.samples, self.worst = [], [], {}
        slices = [self.config.settled(camera.rate_hz) for camera in self.source.cameras]
        self.meters = [ChangeMeter(part, self.config.block_px) for part in slices]

    def take(self, frame: Frame) -> None:
        """Take in a frame; a camera's change is known once its settled stretch is over."""
        camera, meter = self.source.cameras[frame.camera], self.meters[frame.camera]
        self.frames.append(frame)
        if meter.complete:
            return
        values = meter.push(decode_jpeg(frame.jpeg, camera))
        if len(values):
            part = self.config.settled(camera.rate_hz)
            self.worst[camera.name] = float(values[part].max())

    @property
    def known(self) -> bool:
        """True once every camera has said how much its images changed."""
        return len(self.worst) == len(self.meters)

    def slow(self) -> BadSource:
        """Return the refusal of a camera whose change is still not known."""
        name = next(cam.name for cam in self.source.cameras if cam.name not in self.worst)
        return BadSource(
            f"enough frames within {PATIENCE_S:g} s to see whether the grasp is still",
            f"too few of the {name} camera", "check its cable and record the trial again",
        )  # fmt: skip

    def words(self) -> str:
        """Return which camera changed most, in words."""
        name = max(self.worst, key=lambda key: self.worst[key])
        return (
            f"not settled: the {name} camera's image changed by {self.worst[name]:.1f} % "
            f"(at most {self.config.least_change:g} %)"
        )


def record_trial(
    source: Source,
    trial: PlannedTrial,
    path: Path,
    seconds: float,
    say: Callable[[str], None] = lambda _: None,
    stopped: Callable[[], bool] = lambda: False,
    config: ChangeConfig | None = None,
) -> RecordedTrial | None:
    """Wait until the grasp has settled, then record; None where a person asked for the end.

    Args:
        source: The cameras, open; the grasp is made.
        trial: Its labels and groups go into the recording.
        path: The recording to be.
        seconds: How long to record, of the source's time.
        say: Shows a line: why it waits, and when the pour may begin.
        stopped: True once a person asks for the end; nothing is kept.
        config: What counts as a change.

    Raises:
        NotSettled: Images went on changing for `PATIENCE_S`.
        BadInput: Another program has made this recording meanwhile.
        BadSource: The source has no cameras, fell silent or ended.
        RecordingFailed: The disk refused.
    """
    refuse_made(path)
    if not source.cameras:
        raise BadSource(
            "tactile cameras for a plan of grasps", "none", "record an array without --plan"
        )
    settling, listening = _Settling(source, config or ChangeConfig()), _Listening(source)
    after_s = _settle(listening, settling, say, stopped)
    if after_s is None:
        return None
    say(f"settled: pour now, {seconds:g} s are recorded")
    start_s = settling.frames[0].fitted_s
    manifest = Manifest.started_now(
        source.info, dict(trial.labels), dict(trial.groups), now_s=settling.frames[-1].arrival_s,
        cameras=source.cameras,
    )  # fmt: skip
    recorder = Recorder(path, manifest, overwrite=True)
    try:
        frames = _record(listening, settling, recorder, start_s + seconds, stopped)
    except BaseException:
        recorder.discard()
        raise
    if frames is None:
        recorder.discard()
        return None
    recorder.close("cleanly")
    return RecordedTrial(
        trial=trial, settled_after_s=after_s, change=max(settling.worst.values()), frames=frames
    )


def _settle(
    listening: _Listening,
    settling: _Settling,
    say: Callable[[str], None],
    stopped: Callable[[], bool],
) -> float | None:
    """Watch until the images have stood still; return seconds since the first frame."""
    first_s, begun_s = np.inf, np.inf
    while not stopped():
        samples, frames = listening.read()
        if listening.newest_s > -np.inf:  # the first read may give nothing
            begun_s = min(begun_s, listening.newest_s)
        if len(samples):
            settling.samples.append(samples)
        for frame in frames:
            first_s = min(first_s, frame.fitted_s)
            settling.take(frame)
        if not settling.known:
            if listening.newest_s - begun_s > PATIENCE_S:
                raise settling.slow()
            continue
        if max(settling.worst.values()) <= settling.config.least_change:
            return float(settling.frames[0].fitted_s - first_s)
        say(settling.words())
        if settling.frames[-1].fitted_s - first_s > PATIENCE_S:
            raise NotSettled(
                f"a grasp that is still before the pour, for {PATIENCE_S:g} s at most",
                settling.words(), "grasp again, and hold the cup still",
            )  # fmt: skip
        settling.begin()
        begun_s = np.inf
    return None


def _record(
    listening: _Listening,
    settling: _Settling,
    recorder: Recorder,
    end_s: float,
    stopped: Callable[[], bool],
) -> int | None:
    """Write what came while it settled and what comes; return frames, None where it was ended."""
    source, count, newest_s = listening.source, 0, -np.inf
    waiting = set(range(len(source.cameras)))
    begin_s = settling.frames[0].fitted_s
    samples, frames = Samples.join(settling.samples) if settling.samples else None, settling.frames
    while True:
        if samples is not None and len(samples):
            inside = (samples.fitted_s >= begin_s) & (samples.fitted_s < end_s)
            recorder.write(samples[inside])
        for frame in frames:
            newest_s = max(newest_s, frame.fitted_s)
            if frame.fitted_s < end_s:
                recorder.frame(frame)
                count += 1
            else:
                waiting.discard(frame.camera)
        for mark in source.marks():
            # A source that is open from trial to trial may still give the one before.
            if begin_s <= mark.end_s and mark.start_s < end_s:
                recorder.mark(mark)
        if stopped():
            return None
        if not waiting or source.ended:
            break
        samples, frames = listening.read()
    if waiting and newest_s - begin_s < _LEAST_SHARE * (end_s - begin_s):
        raise BadSource(
            f"{end_s - begin_s:g} s of frames", f"the end after {newest_s - begin_s:.2f} s",
            "record the trial again",
        )  # fmt: skip
    return count


def set_grip(gripper: GripperActuator, trial: PlannedTrial, clock: Clock) -> float:
    """Close the gripper with the trial's force and wait until it holds; return newtons.

    Args:
        gripper: Connected.
        trial: Its group force_n says how hard.
        clock: Waited on.

    Raises:
        NotHeld: It closed on nothing, or lost what it held.
        BadInput: The plan names no force, or the gripper does not answer or cannot hold.
    """
    text = trial.groups.get("force_n", "")
    try:
        force_n = float(text)
    except ValueError as error:
        raise BadInput(
            "a column group:force_n, newtons, for the gripper", repr(text), "mend the plan"
        ) from error
    assert gripper.force is not None
    if not gripper.force.least_n <= force_n <= gripper.force.max_n:
        raise BadInput(
            f"a force of {gripper.force.least_n:g} to {gripper.force.max_n:g} N",
            f"{force_n:g} N in the plan", "mend the plan, or the gripper's address",
        )  # fmt: skip
    pct = gripper.force.pct(force_n)
    status = _grip(gripper.gripper, pct, clock)
    if status is None:
        status = gripper.gripper.status()
        got = status.motion.value
        if not _same(status.force_pct, pct):
            got = f"a force set to {gripper.force.newtons(status.force_pct):g} N"
        raise BadInput(
            f"a gripper that holds with {force_n:g} N within {_GRIP_S:g} s", status.fault or got,
            "look at the gripper and its cable, then run the same command again",
        )  # fmt: skip
    if status.motion is not Motion.CAUGHT:
        got = "dropped it" if status.motion is Motion.DROPPED else "closed on nothing"
        raise NotHeld(
            "an object between the gripper's fingers", f"a gripper that {got}",
            "open the gripper, put the object between its fingers and grasp again",
        )  # fmt: skip
    return force_n


def _grip(gripper: Gripper, pct: float, clock: Clock) -> GripperStatus | None:
    """Close with a force; return the status that has lasted, None where none did in time.

    Only what was read after the order counts, and only where the gripper has taken the force.
    """
    asked_s = clock.now_s()
    since_s, motion = math.inf, Motion.MOVING
    gripper.grip(pct, asked_s + _GRIP_S)
    while clock.now_s() < asked_s + _GRIP_S:
        status = gripper.status()
        fresh = status.ok and status.read_s > asked_s
        if not (fresh and _same(status.force_pct, pct)) or status.motion is Motion.MOVING:
            since_s = math.inf
        elif since_s == math.inf or status.motion is not motion:
            since_s, motion = status.read_s, status.motion
        elif status.read_s - since_s >= _GRIP_SETTLE_S:
            return status
        clock.sleep(0.02)
    return None


def _same(set_pct: float, asked_pct: float) -> bool:
    """True where a set force is what was asked; some grippers take whole percent only."""
    whole = math.floor(asked_pct + 1e-9)
    return any(abs(set_pct - pct) < 1e-6 for pct in (asked_pct, whole))
