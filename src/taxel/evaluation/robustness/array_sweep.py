"""A recogniser's accuracy over faults of its array: one point a fault and level.

Knows nothing about files, screens or how recognisers are trained.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from taxel.decisions.recognition import RecogniseConfig
from taxel.evaluation.robustness.array_faults import (
    ARRAY_FAULTS,
    ArrayFault,
    Touched,
    check_level,
    find_array_fault,
    limits_of,
    touched,
)
from taxel.evaluation.robustness.curve import (
    CLEAN,
    FaultPoint,
    SessionAnswers,
    mildest_first,
    point_of,
    shared_accuracy,
)
from taxel.evaluation.robustness.touches import ANSWER_ALL, Model, Recorded, judge


def sweep_array(
    model: Model,
    touches: Sequence[Recorded],
    plan: Mapping[str, Sequence[float]],
    *,
    config: RecogniseConfig = ANSWER_ALL,
    seed: int = 0,
    on_point: Callable[[FaultPoint], None] = lambda _: None,
) -> list[FaultPoint]:
    """Return the point without faults, then one a fault and level.

    Args:
        model: What predicts.
        touches: Recordings that it was not trained on.
        plan: Fault → levels, as `plan_array` gives them.
        config: When an answer may be given.
        seed: Seed of everything that a fault draws.
        on_point: Called with each point.

    Raises:
        BadInput: A fault or level is unknown.
        BadBundle, BadDataset: As `judge` says.
    """
    judged = Undisturbed.judge(model, touches, config, seed)
    for name, levels in plan.items():
        for level in levels:
            judged.check(name, level)
    points = []
    for name, level in [(CLEAN, 0.0), *((name, at) for name, own in plan.items() for at in own)]:
        points.append(judged.point(name, level))
        on_point(points[-1])
    return points


@dataclass(frozen=True, slots=True)
class Undisturbed:
    """Recordings, and a model's predictions without faults: where every level starts from."""

    model: Model
    touches: Sequence[Recorded]
    known: Sequence[Touched]
    answers: SessionAnswers
    config: RecogniseConfig
    seed: int

    @staticmethod
    def judge(
        model: Model, touches: Sequence[Recorded], config: RecogniseConfig, seed: int
    ) -> Undisturbed:
        """Judge recordings as they are."""
        known = [_touched(touch, model.contract.window.gate) for touch in touches]
        return Undisturbed(model, touches, known, judge(model, touches, config), config, seed)

    def check(self, name: str, level: float) -> None:
        """Refuse a level that a fault of these recordings cannot have."""
        check_level(name, find_array_fault(name), level, len(self.known[0].full))

    def point(self, name: str, level: float) -> FaultPoint:
        """Return the point of one level of one fault, or without any."""
        if name == CLEAN:
            return point_of(self.answers, CLEAN, 0.0, "")
        fault = find_array_fault(name)
        passes = [
            judge(
                self.model,
                list(_faulted(self.touches, self.known, name, fault, level, self.seed, draw)),
                self.config,
            )
            for draw in range(fault.draws)
        ]
        base = shared_accuracy(self.answers, passes[0]) if fault.shortens else None
        return point_of(SessionAnswers.join(passes), name, level, fault.unit, fault.draws, base)


def plan_array(
    faults: Sequence[str] = (), levels: Sequence[float] = (), channels: int | None = None
) -> dict[str, tuple[float, ...]]:
    """Return fault → levels, the mildest first.

    Args:
        faults: Names; all unless given.
        levels: For every fault named; each fault's own that the array can have unless given.
        channels: How many the array has; not known unless given. Faults that it cannot have are
            left out.

    Raises:
        BadInput: A fault is unknown, a level outside its limits, or the array can have no fault
            of those named.
    """
    plan = {}
    for name in faults or tuple(ARRAY_FAULTS):
        fault = find_array_fault(name)
        most = limits_of(fault, channels)[1]
        own = tuple(level for level in fault.levels if level <= most)
        impossible = fault.levels if len(faults) == 1 and not own else ()
        for level in levels or impossible:  # a fault named alone is refused, not left out
            check_level(name, fault, level, channels)
        plan[name] = mildest_first(levels, fault.levels) or own
    return {name: own for name, own in plan.items() if own}


def _faulted(
    touches: Sequence[Recorded],
    known: Sequence[Touched],
    name: str,
    fault: ArrayFault,
    level: float,
    seed: int,
    draw: int,
) -> Iterator[Recorded]:
    """Yield the recordings with the fault; what it draws is the same at every level."""
    for index, (touch, about) in enumerate(zip(touches, known, strict=True)):
        random = np.random.default_rng([seed, draw, index, zlib.crc32(name.encode())])
        samples = fault.make(about, level, random)
        yield replace(touch, samples=samples)


def _touched(recorded: Recorded, gate: float | None) -> Touched:
    spans = np.array([(trial.start_s, trial.end_s) for trial in recorded.trials])
    return touched(recorded.samples, recorded.sensor, gate, spans)
