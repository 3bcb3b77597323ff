"""Record one grasp of the hand: fingers, pads and motor currents, labelled as planned.

A grasp is a recording of its own with one mark, from shortly before the first finger touched
until the fingers were open. Nothing is kept of a grasp that touched nothing or was stopped.
Knows nothing about plans as a whole, screens or addresses.

Background of our choices: docs/decisions/0043.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from taxel.actions.grasp_cycle import CycleConfig, GraspCycle
from taxel.actions.hand_driver import TICK_S, HandDriver
from taxel.errors import BadSource
from taxel.recordings.manifest import Manifest
from taxel.recordings.trial_plan import PlannedTrial, refuse_made
from taxel.recordings.writer import Recorder
from taxel.signals import Mark, Samples, SensorInfo
from taxel.sources.contract import Source

BEFORE_S = 0.2
"""The mark begins so long before the first motor was off, seconds: pads are touched before the
board has seen the current. Our choice, docs/decisions/0043."""
_SILENCE_S = 2.0
"""A source that delivers nothing for so long is given up, seconds. Our choice."""
_LONGEST_S = 60.0
"""A grasp that takes longer is given up, seconds. Our choice."""
CURRENTS = "currents"
"""Folder beside the recordings for those of the motors."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CollectedGrasp:
    """The outcome of a planned grasp."""

    trial: PlannedTrial
    touched: tuple[int, ...]
    """Fingers that met the object, from 1; none where nothing was kept."""
    seconds: float
    """From the approach to the open hand, seconds."""
    scans: int
    largest_ma: int
    """Largest motor current, milliamperes."""


@dataclass(slots=True)
class _Currents:
    """Readings of the motors, kept for a recording of their own."""

    time_s: list[float] = field(default_factory=list)
    values: list[tuple[int, ...]] = field(default_factory=list)

    def add(self, readings: list[tuple[float, tuple[int, ...]]]) -> None:
        for read_s, currents_ma in readings:
            if not self.time_s or read_s > self.time_s[-1]:
                self.time_s.append(read_s)
                self.values.append(currents_ma)


def collect_grasp(
    source: Source,
    driver: HandDriver,
    trial: PlannedTrial,
    folder: Path,
    config: CycleConfig,
    stopped: Callable[[], bool] = lambda: False,
) -> CollectedGrasp:
    """Let the hand grasp once and record it; nothing is kept where no finger touched anything.

    Args:
        source: The pads, open.
        driver: The hand, armed.
        trial: Labels, groups and the recording's name.
        folder: Where it goes; the motors' currents into currents/ beside it.
        config: How the hand grasps.
        stopped: True once a person asks for the end: the fingers rest and nothing is kept.

    Raises:
        HandStopped: The hand was stopped in between.
        BadInput: Another program has made this recording meanwhile.
        BadSource: The source fell silent.
        RecordingFailed: The disk refused.
    """
    refuse_made(folder / trial.file_name)
    _read_for(source, driver, 0.0)  # what came before belongs to no grasp
    now_s = driver.clock.now_s()
    manifest = Manifest.started_now(
        source.info, dict(trial.labels), dict(trial.groups), now_s=now_s, cameras=source.cameras
    )
    cycle, currents = GraspCycle(config), _Currents()
    recorder = Recorder(folder / trial.file_name, manifest, overwrite=True)
    try:
        scans = _run(source, driver, cycle, recorder, currents, stopped)
        grasp_counts = bool(cycle.touched) and cycle.done
        if grasp_counts:  # currents first: a grasp whose file is there counts as done
            start_s = min(cycle.touched.values()) - BEFORE_S
            recorder.mark(Mark(start_s=start_s, end_s=cycle.ended_s, labels={}))
            write_currents(
                folder / CURRENTS / trial.file_name, currents.time_s, currents.values,
                manifest.wall_anchor_ns,
            )  # fmt: skip
    except BaseException:
        recorder.discard()
        raise
    if grasp_counts:
        recorder.close("cleanly")
    else:
        recorder.discard()
    return CollectedGrasp(
        trial=trial,
        touched=tuple(sorted(finger + 1 for finger in cycle.touched)) if grasp_counts else (),
        seconds=cycle.ended_s - cycle.started_s,
        scans=scans,
        largest_ma=max((abs(ma) for row in currents.values for ma in row), default=0),
    )


def _run(
    source: Source,
    driver: HandDriver,
    cycle: GraspCycle,
    recorder: Recorder,
    currents: _Currents,
    stopped: Callable[[], bool],
) -> int:
    """Run a cycle to its end; return how many scans were recorded."""
    scans, hand = 0, driver.actuator.hand
    began_s = heard_s = driver.clock.now_s()
    while not cycle.done and not stopped():
        now_s = driver.clock.now_s()
        status = hand.status()
        driver.tick(cycle.step(now_s, status.state, status.currents_ma))
        currents.add(driver.actuator.readings)
        samples = source.read(0.0)
        for frame in source.frames():
            recorder.frame(frame)
        if len(samples):
            recorder.write(samples)
            scans, heard_s = scans + len(samples), now_s
        _check(source, now_s - heard_s, now_s - began_s)
        driver.clock.sleep(TICK_S)
    return scans


def _check(source: Source, silent_s: float, lasted_s: float) -> None:
    if source.ended or silent_s > _SILENCE_S:
        raise BadSource(
            "a source that goes on delivering scans",
            "its end" if source.ended else f"nothing for {_SILENCE_S:g} s",
            "check the cable and the device's power",
        )
    if lasted_s > _LONGEST_S:
        raise BadSource(
            f"a grasp of less than {_LONGEST_S:g} s",
            "one that goes on",
            "lower --contact-ma if the fingers press on the object and no motor stops, or "
            "--presses, --hold-s or --pause-s",
        )


def _read_for(source: Source, driver: HandDriver, seconds: float) -> None:
    """Read scans away while the hand rests, seconds."""
    until_s = driver.clock.now_s() + seconds
    while True:
        driver.tick(None)
        source.read(0.0)
        source.frames()
        if driver.clock.now_s() >= until_s:
            return
        driver.clock.sleep(TICK_S)


def rest(source: Source, driver: HandDriver, waiting: Callable[[], bool]) -> None:
    """Keep the hand alive and the source read while somebody puts an object into the hand.

    Args:
        source: The pads.
        driver: The hand, armed.
        waiting: True while it lasts.

    Raises:
        HandStopped: The hand was stopped in between.
    """
    while waiting():
        _read_for(source, driver, TICK_S)


def write_currents(
    path: Path, time_s: list[float], values: list[tuple[int, ...]], wall_anchor_ns: int
) -> dict[str, Any]:
    """Write motor currents as a recording of an array; return its ledger.

    Args:
        path: The recording to be; an older one is replaced.
        time_s: Monotonic seconds of each reading, rising.
        values: mA of each motor, a tuple a reading.
        wall_anchor_ns: Wall clock less the readings' clock, nanoseconds: they are written after
            the movement, and stand beside the pads' recording by this.
    """
    count = len(values[0]) if values else 4
    info = SensorInfo(
        name="motors",
        channels=tuple(f"motor-{number + 1}" for number in range(count)),
        units=("mA",) * count,
        rate_hz=100.0,  # CURRENT_MS in firmware/hand_control/hand_board.c
    )
    manifest = replace(Manifest.started_now(info), wall_anchor_ns=wall_anchor_ns)
    with Recorder(path, manifest, overwrite=True) as recorder:
        if values:
            recorder.write(Samples.from_values(np.array(values, np.float64), np.array(time_s)))
        recorder.close("cleanly")
        return recorder.statistics()
