"""Robustness curves as jobs: each level of each fault judged by whichever worker is free.

A job carries the paths of bundle and recordings; a worker reads them once. Knows nothing about
engines, screens or how recognisers are trained.

Source: docs/decisions/0050.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from pathlib import Path

from taxel.bundles.reader import read_bundle
from taxel.decisions.recognition import RecogniseConfig
from taxel.errors import BadDataset
from taxel.evaluation.robustness.array_sweep import Undisturbed
from taxel.evaluation.robustness.conditions import NewSessions, condition_point
from taxel.evaluation.robustness.curve import CLEAN, FaultPoint
from taxel.evaluation.robustness.touches import Model, bundle_model, read_touches
from taxel.jobs.running import side_by_side

Plan = Mapping[str, Sequence[float]]
"""Fault or condition → levels."""


def sweep_recordings(
    bundle: Path,
    data: tuple[Path, str],
    plan: Plan,
    config: RecogniseConfig,
    seed: int,
    on_point: Callable[[FaultPoint], None],
) -> list[FaultPoint]:
    """Return what `sweep_array` returns, level by level from the engine in use.

    Args:
        bundle: The recogniser.
        data: Recordings, and their digest.
        plan: As `plan_array` gives it.
        config: When an answer may be given.
        seed: Seed of everything that a fault draws.
        on_point: Called with each point.
    """
    path, digest = data
    about = (bundle.absolute(), path.absolute(), digest, config, seed)
    return side_by_side(recordings_at, [(*about, *place) for place in places(plan)], on_point)


def recordings_at(
    bundle: Path,
    data: Path,
    digest: str,
    config: RecogniseConfig,
    seed: int,
    name: str,
    level: float,
) -> FaultPoint:
    """Judge recordings at one level of one fault; a job for any worker."""
    judged = _undisturbed(bundle, data, digest, config, seed)
    if name != CLEAN:
        judged.check(name, level)
    return judged.point(name, level)


def sweep_simulated(
    bundle: Path,
    plan: Plan,
    which: NewSessions,
    config: RecogniseConfig,
    on_point: Callable[[FaultPoint], None],
) -> list[FaultPoint]:
    """Return what `sweep_conditions` returns, level by level from the engine in use."""
    jobs = [(bundle.absolute(), *place, which, config) for place in places(plan)]
    return side_by_side(simulated_at, jobs, on_point)


def simulated_at(
    bundle: Path, name: str, level: float, which: NewSessions, config: RecogniseConfig
) -> FaultPoint:
    """Judge new sessions at one level of one condition; a job for any worker."""
    return condition_point(_model_of(bundle, bundle.stat().st_mtime_ns), name, level, which, config)


def places(plan: Plan) -> list[tuple[str, float]]:
    """Return each fault with each level, the point without faults first."""
    return [(CLEAN, 0.0), *((name, level) for name, levels in plan.items() for level in levels)]


@lru_cache(maxsize=1)
def _model_of(bundle: Path, _changed_ns: int) -> Model:
    return bundle_model(read_bundle(bundle))


@lru_cache(maxsize=1)
def _undisturbed(
    bundle: Path, data: Path, digest: str, config: RecogniseConfig, seed: int
) -> Undisturbed:
    touches, found = read_touches(data)
    if found != digest:
        raise BadDataset(
            f"the same recordings in {data} for all workers", "others",
            "let all of them read the same folder, and leave it as it is meanwhile",
        )  # fmt: skip
    return Undisturbed.judge(_model_of(bundle, bundle.stat().st_mtime_ns), touches, config, seed)
