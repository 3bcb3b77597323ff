"""What a blend costs live: megabytes of its bundle, microseconds of a window on one core.

Knows nothing about limits, or about what is given up to keep to them.

Source: docs/decisions/0039.
"""

from __future__ import annotations

import zlib
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from time import perf_counter, sleep

import numpy as np
from numpy.typing import NDArray

from taxel.bundles.writer import Classifier, export_onnx
from taxel.models.blend import Blend, Part, read_plan
from taxel.models.onnx_session import WindowModel
from taxel.training.choose.preparations import Prepared

ROUNDS, RUNS, QUIET = 4, 30, 10.0
"""Stretches of single windows that are timed, windows in each, and which percentile counts in the
quietest stretch: another program can only lengthen a time."""
APART_S = 0.2
"""Between stretches, seconds: in every fourth stretch a shared machine was half as quick, for a
tenth to a third of a second. Source: our choice, docs/decisions/0039."""


Run = Callable[[NDArray[np.float32], NDArray[np.bool_]], object]
"""Takes one window and its mask."""


@dataclass(frozen=True, slots=True)
class Cost:
    """What a blend costs live."""

    mb: float
    us: float
    """Of one window on one core."""


def cost_of(blend: Blend, prepared: Prepared) -> Cost:
    """Export a blend and run it on single windows."""
    windows = prepared.dataset.windows
    steps, channels = windows.values.shape[1:]
    model = export_onnx(Classifier((blend,)).eval(), steps, channels)
    us = window_us(model, windows.values, windows.mask)
    return Cost(len(zlib.compress(model, 1)) / 1e6, us)


def window_us(model: bytes, values: NDArray[np.float32], mask: NDArray[np.bool_]) -> float:
    """Return the microseconds that an exported model takes for one window on one core.

    Args:
        model: An ONNX file's bytes.
        values: Windows to run it on, one at a time, shape (n, steps, channels).
        mask: Shape (n, steps).
    """
    return quietest_us(WindowModel(model), values, mask)


def quietest_us(run: Run, values: NDArray[np.float32], mask: NDArray[np.bool_]) -> float:
    """Return the microseconds that one window takes in a machine's quiet moments.

    Args:
        run: Called with one window, shape (1, steps, channels), and its mask.
        values: Windows, shape (n, steps, channels).
        mask: Shape (n, steps).
    """
    return quietest_of([run], values, mask)[0]


def quietest_of(
    runs: Sequence[Run], values: NDArray[np.float32], mask: NDArray[np.bool_]
) -> list[float]:
    """Return the microseconds that each of several takes, timed in turn in the same stretches.

    Args:
        runs: As `quietest_us` takes one.
        values: Shape (n, steps, channels).
        mask: Shape (n, steps).
    """
    times = np.empty((len(runs), ROUNDS, RUNS))
    for stretch in range(ROUNDS):
        if stretch:
            sleep(APART_S)
        for own, run in zip(times, runs, strict=True):
            for number in range(RUNS):
                place = (stretch * RUNS + number) % len(values)
                part = slice(place, place + 1)
                started = perf_counter()
                run(values[part], mask[part])
                own[stretch, number] = perf_counter() - started
    found = 1e6 * np.percentile(times, QUIET, axis=2).min(axis=1)
    return [float(us) for us in found]


@dataclass(slots=True)
class KnownCosts:
    """Costs of blends in several folds, timed once for all with the same heads and features.

    To export a blend takes seconds in which nothing else runs, and its time hardly differs between
    folds. A part of a blend that was quick enough is quick enough; what holds a blend that was too
    slow is too slow. Megabytes are of the blend itself.

    Args:
        most_us: From where on a window is too slow.
        measure: Times a blend that is not known.
    """

    most_us: float
    measure: Callable[[Blend, Prepared], Cost] = cost_of
    _known: list[tuple[int, Counter[Part], float]] = field(default_factory=list)

    def __call__(self, blend: Blend, prepared: Prepared) -> Cost:
        """Return a blend's cost."""
        plan = read_plan(bytes(blend.plan.tolist()))
        parts = Counter(plan.parts)
        for steps, known, us in self._known:
            within = parts <= known if us <= self.most_us else parts >= known
            if steps == plan.steps and within:
                return Cost(_packed_mb(blend), us)
        cost = self.measure(blend, prepared)
        self._known.append((plan.steps, parts, cost.us))
        return cost


def _packed_mb(blend: Blend) -> float:
    tables = (table.numpy().tobytes() for table in blend.state_dict().values())
    return len(zlib.compress(b"".join(tables), 1)) / 1e6
