"""Rows of `taxel bench closed-loop`: the warnings that come with taxel, at their own thresholds, on
rigid gels and on gels that shear.

The cups, the pours and their drops are those of `unseen_cups`; nothing is learned or tuned here.
Knows nothing about how rows are printed.

Source: docs/decisions/0017, 0037.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Final

from taxel.actions.grip_policy import GripPolicy
from taxel.bench.closed_loop.pours import UNSEEN
from taxel.bench.closed_loop.scores import PERSON_S, LoopCase, LoopScores, score_loops
from taxel.bench.closed_loop.training import raisable
from taxel.bench.closed_loop.tuning import thin
from taxel.bench.rows import Row
from taxel.bundles.grasp import GraspBundle, read_grasp_bundle
from taxel.bundles.shipped import BOTH_GELS, CUP_POUR, shipped_bundle
from taxel.jobs.running import side_by_side
from taxel.live.closed_loop import (
    LoopConfig,
    MonitoredGrip,
    at_full_force,
    open_pour,
    replay_loop,
    run_loop,
)
from taxel.live.grasp_monitor import GraspMonitor
from taxel.plain_text import number_of
from taxel.sim.pour.cup_pour import Gel, list_runs
from taxel.sim.pour.cups import PourRun

GELS: Final[Mapping[Gel, str]] = {1: "rigid gels", 2: "gels that shear"}
"""Versions of the gel, in words."""
WARNINGS: Final = (CUP_POUR, BOTH_GELS)
"""Bundles that are judged."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GelCase:
    """One pour under one warning, on one version of the gel."""

    warning: str
    gel: Gel
    held: LoopCase
    """Its grip is raised."""
    person: LoopCase
    """Nothing is raised; the person stops pouring `PERSON_S` after the first raise would come."""


def grips_on_both_gels(
    workers: int | None = None,
    runs: Sequence[PourRun] | None = None,
) -> list[Row]:
    """Pour into unseen cups, the grip raised by each warning, on each version of the gel.

    Args:
        workers: Processes side by side.
        runs: Pours to judge on; all of the paper's kinds into `UNSEEN` below the largest force
            unless given.
    """
    if runs is None:
        runs = [run for run in list_runs(UNSEEN) if raisable(run)]
    judged = side_by_side(judge_on_gels, [(run,) for run in runs], workers=workers)
    cases = [case for pour in judged for case in pour]
    rows = []
    for warning in WARNINGS:
        for gel, words in GELS.items():
            own = [case for case in cases if (case.warning, case.gel) == (warning, gel)]
            rows += _rows(
                f"{warning} as it comes, {words}",
                score_loops([case.held for case in own]),
                score_loops([case.person for case in own]),
            )
    return rows


def judge_on_gels(run: PourRun) -> list[GelCase]:
    """Pour once into one cup under every warning and gel, with the same seed."""
    config = LoopConfig()
    bare, full = replay_loop(run, config), at_full_force(run, config)
    found = []
    for warning in WARNINGS:
        bundle = opened(shipped_bundle(warning))
        for gel in GELS:
            own = replace(config, gel=gel)
            pour = open_pour(run, own)
            monitor = GraspMonitor(bundle, pour.cameras, bundle.contract.stability)
            held = run_loop(pour, MonitoredGrip(monitor, GripPolicy(run.force_n)), own)
            person = bare
            if held.raised_s is not None:
                person = replay_loop(run, config, stop_pouring_s=held.raised_s + PERSON_S)
            played = LoopCase(bare=thin(bare), full=thin(full), held=thin(held))
            found.append(
                GelCase(
                    warning=warning, gel=gel, held=played, person=replace(played, held=thin(person))
                )
            )
    return found


def _rows(name: str, held: LoopScores, person: LoopScores) -> list[Row]:
    low, high = held.needless_interval
    least, most = held.prevented_interval
    by_person = person.prevented_interval
    return [
        _row(f"{name}: preventable drops prevented", held.prevented_share,
             f"{held.prevented} of {held.preventable} in {number_of(held.pours, 'pour')} of "
             f"{number_of(held.cups, 'cup')}, "
             f"95 % {least:.3f} … {most:.3f}; drops that it caused: {held.caused}"),
        _row(f"{name}: raised needlessly in pours that hold", held.needless_share,
             f"{held.needless} of {held.holds}, 95 % {low:.3f} … {high:.3f}; mean grip force "
             f"{held.force_n:.1f} N, without taxel {held.bare_force_n:.1f} N"),
        _row(f"{name}: warning only, the person stops 0.5 s after it: preventable drops prevented",
             person.prevented_share,
             f"{person.prevented} of {person.preventable}, 95 % {by_person[0]:.3f} … "
             f"{by_person[1]:.3f}"),
    ]  # fmt: skip


def _row(name: str, value: float, note: str) -> Row:
    # No number where there was no such pour.
    return Row(name=name, value=None if value != value else value, unit="share",
               note=note)  # fmt: skip


@lru_cache(maxsize=len(WARNINGS))
def opened(bundle: Path) -> GraspBundle:
    """Open a bundle once a process."""
    import cv2

    cv2.setNumThreads(1)
    return read_grasp_bundle(bundle)
