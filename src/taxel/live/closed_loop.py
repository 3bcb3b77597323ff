"""One simulated pour whose gripper follows what the cameras show, and the same pour without.

The real monitor sees the real frames one by one; what it decides reaches the gripper after
the time that frames take to arrive, a fixed time for inference, the bus and the gripper's own
lag. The run's seed fixes everything else, so that two loops differ by the grip alone. Adds no
maths of its own. Knows nothing about screens, files or training.

Source: docs/decisions/0017.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from taxel.actions.grip_policy import GripPolicy, PixelDifference
from taxel.frame_codec import decode_jpeg
from taxel.live.grasp_monitor import GraspMonitor
from taxel.sim.pour.cup_pour import Gel
from taxel.sim.pour.cups import PourRun
from taxel.sim.pour.grip_response import GrippedPour, GripResponseConfig
from taxel.sim.pour.state import TRUTH_CHANNELS
from taxel.sources.simulated.pour_sets import ARRIVAL_S, CAMERA_HZ, FINE
from taxel.sources.simulated.stepped_pour import SteppedPour
from taxel.windows.pairs import FramePairer, FrameSet

SLIP_UM = 100.0
"""Slip from which a raise is counted, micrometres: the rule "slip", docs/decisions/0013."""
HOLDS_UM = 300.0
"""A pour that slips no further, and is not dropped, holds: gross slip, docs/decisions/0013."""
SEEN_S = 0.06
"""How old the slip that a monitor measures is, seconds: image, arrival and the camera's clock."""
_SLIP, _DROPPED = TRUTH_CHANNELS.index("slip"), TRUTH_CHANNELS.index("dropped")


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopConfig:
    """What lies between the cup and the decision."""

    camera_hz: float = CAMERA_HZ
    """Images a second of each camera."""
    frame_hz: float = 60.0
    """Frames a second of the video: a moment each."""
    duration_s: float = 6.0
    """Of a pour, seconds."""
    inference_s: float = 0.020
    """From a set of frames in hand to the command given, seconds; a set that comes meanwhile
    is not held up. Source: our choice, above the measured 99 %, docs/decisions/0017."""
    response: GripResponseConfig = field(default_factory=GripResponseConfig)
    """The gripper's."""
    gel: Gel = 1
    """How the gels that the cameras see shear; the cup moves alike in both
    (docs/decisions/0037)."""


class GripRule(Protocol):
    """Turns sets of frames into the force to hold."""

    latencies_s: list[float]
    """What each decision took, decoding included, seconds."""

    @property
    def exhausted(self) -> bool:
        """True once nothing that comes can change the force."""
        ...

    def push(self, found: FrameSet) -> float:
        """Take in the newest frames; return the force to hold, newtons."""
        ...


class MonitoredGrip:
    """The grasp monitor and a policy that follows it.

    Args:
        monitor: Ready for this pour's cameras.
        policy: At this pour's starting force.
    """

    def __init__(self, monitor: GraspMonitor, policy: GripPolicy) -> None:
        self._monitor, self._policy = monitor, policy
        self.latencies_s: list[float] = []
        """What each decision took, decoding included, seconds."""

    @property
    def exhausted(self) -> bool:
        return self._policy.exhausted

    def push(self, found: FrameSet) -> float:
        answer = self._monitor.push(found)
        self.latencies_s.append(answer.latency_s)
        return self._policy.push(answer.decision, answer.time_s)


class PixelGrip:
    """A difference of pixels, for comparison."""

    def __init__(self, policy: PixelDifference) -> None:
        self._policy = policy
        self._shown: list[tuple[bytes, NDArray[np.uint8]]] = []
        self.latencies_s: list[float] = []
        """What each decision took, decoding included, seconds."""

    @property
    def exhausted(self) -> bool:
        return self._policy.exhausted

    def push(self, found: FrameSet) -> float:
        started = perf_counter()
        known = dict(self._shown)
        self._shown = [
            (jpeg, known[jpeg] if jpeg in known else decode_jpeg(jpeg, None))
            for jpeg in (frame.jpeg for frame in found.frames)
        ]
        force_n = self._policy.push([image for _, image in self._shown], found.time_s)
        self.latencies_s.append(perf_counter() - started)
        return force_n


@dataclass(frozen=True, slots=True, kw_only=True)
class GripCommand:
    """A grip force that was commanded, and when."""

    time_s: float
    """Since the grasp, seconds."""
    force_n: float
    """Grip force, newtons."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopTrack:
    """One pour as it went; it ends at its last moment or with the drop."""

    run: PourRun
    time_s: NDArray[np.float64]
    """Shape (n,), seconds since the grasp."""
    truth: NDArray[np.float64]
    """Shape (n, 8), columns as `TRUTH_CHANNELS`."""
    force_n: NDArray[np.float64]
    """Shape (n,): the gripper's force, newtons."""
    commands: tuple[GripCommand, ...]
    """Each change of the commanded force, oldest first."""
    latencies_s: tuple[float, ...] = ()
    """What each decision took in truth, seconds."""

    @property
    def dropped(self) -> bool:
        """True where the cup was lost."""
        return bool(self.truth[-1, _DROPPED] > 0)

    @property
    def slip_um(self) -> float:
        """Largest slip, micrometres."""
        return float(self.truth[:, _SLIP].max())

    @property
    def holds(self) -> bool:
        """True where the cup neither dropped nor slipped more than `HOLDS_UM`."""
        return not self.dropped and self.slip_um <= HOLDS_UM

    @property
    def raised_s(self) -> float | None:
        """When more than the starting force was first commanded, seconds; None: never."""
        return self.commands[0].time_s if self.commands else None

    @property
    def mean_force_n(self) -> float:
        """Mean force of the gripper while the cup was held, newtons."""
        return float(self.force_n.mean())

    def slips_s(self, above_um: float = SLIP_UM) -> float | None:
        """Return when it first slipped further than this, seconds; None: never."""
        beyond = self.truth[:, _SLIP] > above_um
        return float(self.time_s[int(np.argmax(beyond))]) if beyond.any() else None


def run_loop(pour: SteppedPour, grip: GripRule, config: LoopConfig) -> LoopTrack:
    """Let a grip watch a pour and hold it.

    Args:
        pour: At its beginning: see `open_pour`.
        grip: Fresh, for this pour.
        config: What lies between cup and decision.
    """
    pairer, notes = FramePairer(len(pour.cameras)), _Notes(pour.run)
    commanded_n = pour.run.force_n
    while not pour.ended and not notes.dropped:
        frames, samples = pour.step(look=not grip.exhausted)
        notes.add(samples.values[0], pour.force_n)
        for frame in frames:
            found = pairer.push(frame)
            force_n = commanded_n if found is None else grip.push(found)
            if force_n != commanded_n:
                commanded_n, after_s = force_n, ARRIVAL_S + config.inference_s
                pour.grip(force_n, after_s)
                notes.commands.append(GripCommand(time_s=pour.time_s + after_s, force_n=force_n))
    return notes.track(config, tuple(grip.latencies_s))


def open_pour(run: PourRun, config: LoopConfig) -> SteppedPour:
    """Return a pour at its beginning."""
    return SteppedPour(
        run, config.camera_hz, config.frame_hz, config.duration_s, config.response, gel=config.gel
    )


def replay_loop(
    run: PourRun,
    config: LoopConfig,
    commands: Sequence[GripCommand] = (),
    stop_pouring_s: float = float("inf"),
    ask: Callable[[float, float], float] | None = None,
) -> LoopTrack:
    """Return how a pour goes with given commands, without pictures.

    With those of a `LoopTrack` it gives that track again; with none, the pour without taxel.

    Args:
        run: What is tried.
        config: What lies between cup and decision.
        commands: Oldest first.
        stop_pouring_s: When the person stops, seconds since the grasp.
        ask: Called each frame with its time since the grasp, seconds, and the slip `SEEN_S`
            before, millimetres; returns the force to hold, newtons. Given late, as in `run_loop`.
    """
    commanded_n = run.force_n
    pour, notes, waiting = GrippedPour(run, config.response), _Notes(run), list(commands)
    for index in range(round(config.duration_s * config.frame_hz)):
        for _ in range(FINE if index else 0):
            pour.step(1.0 / (config.frame_hz * FINE))
        notes.add(pour.sim.state.astype(np.float32), pour.gripper.force_n)
        if notes.dropped:
            break
        time_s, next_s = index / config.frame_hz, (index + 1) / config.frame_hz
        while waiting and waiting[0].time_s < next_s:
            pour.gripper.command(waiting[0].force_n, max(waiting[0].time_s - time_s, 0.0))
            notes.commands.append(waiting.pop(0))
        if ask is not None:
            seen_mm = notes.slip_um(max(index - round(SEEN_S * config.frame_hz), 0)) / 1000
            force_n = ask(time_s, seen_mm)
            if force_n != commanded_n:
                commanded_n, after_s = force_n, ARRIVAL_S + config.inference_s
                pour.gripper.command(force_n, after_s)
                notes.commands.append(GripCommand(time_s=time_s + after_s, force_n=force_n))
        if time_s >= stop_pouring_s:
            pour.sim.pour(False)
    return notes.track(config)


def at_full_force(run: PourRun, config: LoopConfig) -> LoopTrack:
    """Return how a pour goes when it is held with the gripper's largest force throughout."""
    return replay_loop(replace(run, force_n=config.response.most_n), config)


class _Notes:
    """A pour's moments as they come."""

    def __init__(self, run: PourRun) -> None:
        self._run = run
        self._truth: list[NDArray[np.float32]] = []
        self._force_n: list[float] = []
        self.commands: list[GripCommand] = []

    @property
    def dropped(self) -> bool:
        return bool(self._truth and self._truth[-1][_DROPPED] > 0)

    def slip_um(self, index: int) -> float:
        """The slip at a moment that has been, micrometres."""
        return float(self._truth[index][_SLIP])

    def add(self, truth: NDArray[np.float32], force_n: float) -> None:
        self._truth.append(truth)
        self._force_n.append(force_n)

    def track(self, config: LoopConfig, latencies_s: tuple[float, ...] = ()) -> LoopTrack:
        return LoopTrack(
            run=self._run,
            time_s=np.arange(len(self._truth)) / config.frame_hz,
            truth=np.array(self._truth, np.float64),
            force_n=np.array(self._force_n),
            commands=tuple(self.commands),
            latencies_s=latencies_s,
        )
