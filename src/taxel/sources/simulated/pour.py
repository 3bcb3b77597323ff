"""`sim://cup-pour`: two simulated tactile cameras that hold cup after cup, as a live source.

Its gripper obeys: `grip` commands a force, which works as late and as gradually as a real
gripper's would, and the next pictures show it. Knows nothing about files, models or who
commands.

Background of our choices: docs/decisions/0031.
"""

from __future__ import annotations

import contextlib
import os
import threading
from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import count
from typing import Any, get_args

import numpy as np

from taxel.clock import Clock, SystemClock
from taxel.errors import BadSource
from taxel.signals import PAUSE, CameraInfo, Frame, Mark
from taxel.sim.pour.cup_pour import CupPourConfig, Gel
from taxel.sim.pour.cups import MOVING_KINDS, Kind, Position, PourRun, draw_cup
from taxel.sim.pour.scene_draws import draw_grasp
from taxel.sources.paced_source import PacedSource
from taxel.sources.pacing import FrameStream, Pacer, Stretch, read_speed
from taxel.sources.simulated.pour_sets import CAMERA_HZ, describe_run, mark_of, sensor_info
from taxel.sources.simulated.stepped_pour import SteppedPour

PAUSE_S = 0.5
"""Between one grasp's end and the next's beginning. Source: our choice."""
MOST_LOST = 1
"""Images in a row that a well camera loses. Source: 1 repeated image among 100,433 frames of 300
real GelSight videos, none twice in a row; docs/decisions/0031."""
_BACKGROUND = 10
"""Niceness of the thread that makes the next cup's gels."""
_FRAME_HZ = 60.0
_FIRST_CUP = 1000
"""Cups of the live source unless one is named: none that a data set holds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PourChoice:
    """What an address may ask."""

    cup: int | None = None
    """One cup again and again; a new one each time unless given."""
    position: Position | None = None
    force_n: float | None = None
    kind: Kind | None = None
    runs: int | None = None
    """How many grasps; endless unless given."""
    seed: int = 0
    camera_hz: float = CAMERA_HZ
    duration_s: float = 6.0
    """Of a grasp, seconds."""
    most_lost: int = MOST_LOST
    """Images in a row that a camera may lose. More is a simulated fault: the cameras then repeat
    an image for as long as a frozen one, and are said to be."""
    gel: Gel = 1
    """How the gels shear: 1 as rigid pieces, 2 as elastic layers."""
    approach: bool = False
    """Each grasp begins with open jaws about a cup that stands on a table."""

    @property
    def scene(self) -> bool:
        """True where there is more to see than a grasp that is held."""
        return self.approach or self.kind in MOVING_KINDS


class SimPour(PacedSource):
    """Cups that are filled, one grasp after another; a mark ends each.

    Options are the fields of `PourChoice`, and `speed`.

    Args:
        options: As in the address.
        clock: The clock to wait on.

    Raises:
        BadSource: An option is unknown or of the wrong kind.
    """

    def __init__(self, options: dict[str, str], clock: Clock) -> None:
        options = dict(options)
        speed = read_speed(options)
        self._choice = parse_choice(options)
        self._samples: deque[Stretch] = deque()
        self._frames: deque[Frame] = deque()
        self._pour: SteppedPour | None = None
        self._number = -1
        # Only where time passes meanwhile is there anything to report while the next cup is made.
        self._meanwhile = speed != float("inf") and isinstance(clock, SystemClock)
        # The next cup's gels are made while this one is held: that takes most of a second, and
        # between two cups there is only half of one. What is waited for, such as the first cup,
        # stands back for nobody: on a busy machine that took ten times as long.
        self._maker = ThreadPoolExecutor(
            1, "taxel next cup", _stand_back if self._meanwhile else None
        )
        self._made: Future[tuple[PourRun, SteppedPour]] = Future()
        self._made.set_result(self._make(0))
        self._left = 0
        """Moments of this grasp that are not simulated yet."""
        self._events = self._simulate()
        self._cameras: tuple[CameraInfo, ...] = ()
        self._more()
        info = sensor_info(_FRAME_HZ, self._choice.gel, self._choice.scene)
        pacer = Pacer(
            self._stretches(), len(info.channels), clock, speed,
            FrameStream(self._all_frames(), len(self._cameras),
                        lambda: bool(self._frames) or self._waits_for_nothing()),
            stretch_ready=lambda: bool(self._samples) or self._waits_for_nothing(),
        )  # fmt: skip
        super().__init__(
            info, self._cameras, pacer, lambda: self._maker.shutdown(cancel_futures=True)
        )

    @property
    def commanded_n(self) -> float:
        """The force that the gripper obeys now, newtons; at a grasp's start that grasp's own."""
        assert self._pour is not None  # opened with its first moment
        return self._pour.commanded_n

    def grip(self, force_n: float) -> None:
        """Command a grip force of the grasp whose frames were given last.

        One moment is simulated ahead of those given, so a command works one frame later at
        the earliest. It ends with its grasp: the next one begins with its own force.

        Args:
            force_n: Newtons, cut to the gripper's limits.

        Raises:
            BadInput: The force is no number.
        """
        moments = round(self._choice.duration_s * _FRAME_HZ)
        given = max(self._pacer.frames_given - 1, 0) // (moments * len(self._cameras))
        if self._pour is not None and given == self._number:
            self._pour.grip(force_n)

    def _make(self, number: int) -> tuple[PourRun, SteppedPour]:
        """Return a grasp that is ready to begin."""
        choice, run = self._choice, draw_choice(self._choice, number)
        pour = SteppedPour(
            run,
            choice.camera_hz,
            _FRAME_HZ,
            choice.duration_s,
            most_lost=choice.most_lost,
            gel=choice.gel,
        )
        pour.prepare()
        return run, pour

    def _waits_for_nothing(self) -> bool:
        """True where the next moment can be simulated at once.

        The end of a grasp is marked while the next cup is still made, however busy the machine is.
        As fast as possible, and on a clock that somebody moves, it is waited for instead.
        """
        return self._left > 0 or self._made.done() or not self._meanwhile

    def _stretches(self) -> Iterator[Stretch]:
        while self._samples or self._more():
            if self._samples:
                yield self._samples.popleft()

    def _all_frames(self) -> Iterator[Frame]:
        while self._frames or self._more():
            if self._frames:
                yield self._frames.popleft()

    def _more(self) -> bool:
        """Simulate the next moment; False at the end of the last grasp."""
        found = next(self._events, None)
        if found is None:
            return False
        frames, stretch = found
        self._frames += frames
        self._samples.append(stretch)
        return True

    def _simulate(self) -> Iterator[tuple[list[Frame], Stretch]]:
        choice = self._choice
        for number in count() if choice.runs is None else range(choice.runs):
            run, pour = self._made.result()
            if choice.runs is None or number + 1 < choice.runs:
                self._made = self._maker.submit(self._make, number + 1)
            self._pour, self._number = pour, number
            self._cameras = self._cameras or tuple(map(_pausing, pour.cameras))
            start_s = number * (choice.duration_s + PAUSE_S)
            for left in reversed(range(pour.moments)):
                frames, samples = pour.step()
                self._left = left
                moved = [
                    replace(
                        frame,
                        fitted_s=frame.fitted_s + start_s,
                        arrival_s=frame.arrival_s + start_s,
                        device_s=frame.device_s + start_s,
                    )
                    for frame in frames
                ]
                time_s = samples.fitted_s + start_s
                later = replace(samples, fitted_s=time_s, arrival_s=time_s, device_s=time_s)
                marks: list[Mark] = []
                if not left:
                    track = pour.track()
                    mark = mark_of(run, track, describe_run(run, track))
                    begin_s, end_s = mark.start_s + start_s, mark.end_s + start_s
                    marks = [replace(mark, start_s=begin_s, end_s=end_s)]
                yield moved, (later, marks)


def _pausing(camera: CameraInfo) -> CameraInfo:
    """Return a camera that says how long it sends nothing after a grasp."""
    return replace(camera, details={**camera.details, PAUSE: f"{PAUSE_S:g}"})


def _stand_back() -> None:
    """Let this thread wait for all others, where the system has a priority for each thread."""
    with contextlib.suppress(OSError, AttributeError):
        # In real time, as a station's sources are where that is permitted, niceness means nothing.
        if os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK != os.SCHED_OTHER:
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    with contextlib.suppress(OSError, AttributeError):
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), _BACKGROUND)


def draw_choice(choice: PourChoice, number: int) -> PourRun:
    """Return the run of one grasp of a live source."""
    random = np.random.default_rng([17, choice.seed, number])
    config = CupPourConfig()
    cup = _FIRST_CUP + number if choice.cup is None else choice.cup
    position = config.positions[int(random.integers(len(config.positions)))]
    force_n = config.forces_n[int(random.integers(len(config.forces_n)))]
    return draw_grasp(
        choice.seed,
        draw_cup(choice.seed, cup),
        choice.position or position,
        choice.force_n or force_n,
        choice.kind or "pour",
        number,
        choice.approach,
    )


def parse_choice(options: dict[str, str]) -> PourChoice:
    """Return what an address asks for.

    Raises:
        BadSource: An option is unknown, of the wrong kind or outside its limits.
    """
    names = {kind.replace(" ", "-"): kind for kind in get_args(Kind)}
    kinds = {"kind": names, "position": {name: name for name in get_args(Position)}}
    limits = {
        "cup": (0, 10**6), "force_n": (1, 200), "runs": (1, 10**6), "seed": (0, 10**9),
        "camera_hz": (1, 60), "duration_s": (1, 600), "most_lost": (0, 10**6),
        "gel": (1, 2),
    }  # fmt: skip
    chosen: dict[str, Any] = {}
    for key, text in options.items():
        if key in kinds:
            value: object = kinds[key].get(text)
            if value is None:
                raise _bad(key, f"one of {', '.join(kinds[key])}", text)
        elif key == "approach":
            if text not in ("yes", "no"):
                raise _bad(key, "yes or no", text)
            value = text == "yes"
        elif key in limits:
            low, high = limits[key]
            whole = key in ("cup", "runs", "seed", "most_lost", "gel")
            try:
                value = int(text) if whole else float(text)
            except ValueError as error:
                raise _bad(key, "a whole number" if whole else "a number", text) from error
            if not low <= value <= high:
                raise _bad(key, f"a number within {low} and {high}", text)
        else:
            known = ", ".join([*limits, *kinds, "approach", "speed"])
            raise BadSource(
                f"options of sim://cup-pour among {known}", repr(key), "mend the address"
            )
        chosen[key] = value
    choice = PourChoice(**chosen)
    if choice.approach and choice.gel == 2:
        raise _bad("gel", "1 with an approach", "2")
    return choice


def _bad(key: str, needed: str, got: str) -> BadSource:
    return BadSource(f"{key} of sim://cup-pour as {needed}", repr(got), "mend the address")
