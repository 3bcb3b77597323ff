"""`taxel bench closed-loop`: cups saved by a grip that follows touch, beside other policies.

A bundle is learned on training cups, its thresholds are tuned there, and cups that neither
has seen are poured into: without taxel, at full force, and with each policy, by the same
seeds. Knows nothing about how rows are printed.

Source: docs/decisions/0017.
"""

from __future__ import annotations

import hashlib
import tempfile
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

from taxel.actions.grip_policy import GripPolicy, PixelDifference, PixelDifferenceConfig
from taxel.bench.closed_loop.bound import grip_bound
from taxel.bench.closed_loop.gels import grips_on_both_gels, opened
from taxel.bench.closed_loop.pours import FAILING, HARD, UNSEEN, is_preventable
from taxel.bench.closed_loop.scores import (
    NEEDLESS,
    PERSON_PREVENTED,
    PERSON_S,
    PREVENTED,
    LoopCase,
    LoopScores,
    score_loops,
)
from taxel.bench.closed_loop.tuning import thin
from taxel.bench.rows import Row, missing, row
from taxel.decisions.stability import StabilityConfig
from taxel.jobs.running import side_by_side
from taxel.live.closed_loop import (
    LoopConfig,
    LoopTrack,
    MonitoredGrip,
    PixelGrip,
    at_full_force,
    open_pour,
    replay_loop,
    run_loop,
)
from taxel.live.grasp_monitor import GraspMonitor
from taxel.sim.pour.cup_pour import list_runs
from taxel.sim.pour.cups import PourRun

if TYPE_CHECKING:
    from taxel.bench.closed_loop.training import Learnt

LEAST_PREVENTED, FAILING_PREVENTED = 0.93, 0.5
"""Goals: the lower end of the interval of the share prevented; failing grips and sudden slips."""
FORCE_N = 31.1
"""Goal: mean grip force stays below that of the monitor before this one, newtons."""
Measure = Callable[[], list[Row]]


@dataclass(frozen=True, slots=True, kw_only=True)
class JudgedPour:
    """One unseen pour under every policy; tracks are thinned."""

    run: PourRun
    taxel: LoopCase
    pixels: LoopCase | None
    """None where only taxel was tried."""
    always: LoopCase
    person: LoopCase
    """Nothing is raised; the person stops pouring `PERSON_S` after taxel's alarm."""
    latencies_s: tuple[float, ...]
    """What the monitor's decisions took."""


def quick_steps() -> list[tuple[str, Measure]]:
    """Return the measurements of a normal run: (what, how)."""
    return [("frames while the loop is closed", stepping_speed)]


def full_steps(data: Path | None) -> list[tuple[str, Measure]]:
    """Return the measurements that take longer than a few minutes; `data` is not used."""
    return [
        ("training cups, then unseen cups", unseen_cups),
        ("grips on both gels", grips_on_both_gels),
        ("bound of grips", bound_of_grips),
    ]


def data_digest(data: Path | None) -> str:
    """Return a digest of what is judged: every run of `UNSEEN` and `HARD`."""
    return hashlib.sha256(repr((list_runs(UNSEEN), list_runs(HARD))).encode()).hexdigest()


def stepping_speed() -> list[Row]:
    """Simulate a pour moment by moment with both cameras: moments a second of one core."""
    pour = open_pour(list_runs(UNSEEN)[0], LoopConfig())
    pour.step()
    started, count = perf_counter(), 0
    while not pour.ended:
        pour.step()
        count += 1
    speed = count / (perf_counter() - started)
    return [
        row("sim://cup-pour moment by moment, two cameras of 25 Hz", speed, "moments/s", ">=", 60.0,
            "dynamics, optics and JPEG of both, one core"),
    ]  # fmt: skip


def unseen_cups() -> list[Row]:
    """Learn on training cups, judge on unseen ones."""
    from taxel.bench.closed_loop.training import learn

    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        learnt = learn(Path(scratch))
        hard = list_runs(HARD)
        needed = side_by_side(is_preventable, [(run,) for run in hard])
        runs = [run for run, drops in zip(hard, needed, strict=True) if drops]
        return loop_rows(judge_cups(learnt, list_runs(UNSEEN) + runs))


def bound_of_grips() -> list[Row]:
    """Raise by the simulator's own slip: what no grip that is raised by slip alone can exceed."""
    return grip_bound()


def judge_cups(learnt: Learnt, runs: Sequence[PourRun]) -> list[JudgedPour]:
    """Pour into each cup under every policy."""
    from taxel.bench.closed_loop.training import raisable

    jobs = [
        (learnt.bundle, run, learnt.stability, learnt.pixels if raisable(run) else None)
        for run in runs
    ]
    return side_by_side(judge_pour, jobs)


def judge_pour(
    bundle: Path, run: PourRun, stability: StabilityConfig, pixels: PixelDifferenceConfig | None
) -> JudgedPour:
    """Pour once into one cup under every policy, with the same seed.

    Args:
        bundle: Of the monitor.
        run: What is tried.
        stability: The monitor's thresholds.
        pixels: The difference of pixels; None: it is not tried.
    """
    config = LoopConfig()
    bare, full = replay_loop(run, config), at_full_force(run, config)
    pour = open_pour(run, config)
    monitor = GraspMonitor(opened(bundle), pour.cameras, stability)
    taxel = run_loop(pour, MonitoredGrip(monitor, GripPolicy(run.force_n)), config)
    plain = None
    if pixels is not None:
        other = open_pour(run, config)
        policy = PixelDifference(run.force_n, len(other.cameras), config.frame_hz, pixels)
        plain = run_loop(other, PixelGrip(policy), config)
    person = bare
    if taxel.raised_s is not None:
        person = replay_loop(run, config, stop_pouring_s=taxel.raised_s + PERSON_S)

    def case(held: LoopTrack) -> LoopCase:
        return LoopCase(bare=thin(bare), full=thin(full), held=thin(held))

    return JudgedPour(
        run=run,
        taxel=case(taxel),
        pixels=None if plain is None else case(plain),
        always=case(full),
        person=case(person),
        latencies_s=taxel.latencies_s,
    )


def loop_rows(pours: Sequence[JudgedPour]) -> list[Row]:
    """Return the rows: the promised pours under each policy, then pushes and failing grips."""
    from taxel.bench.closed_loop.training import raisable

    main = [pour for pour in pours if raisable(pour.run)]
    hard = [pour for pour in pours if not raisable(pour.run)]
    taxel = score_loops([case.taxel for case in main])
    rows = [*_goal_rows("taxel", taxel)]
    rows.append(
        row("taxel: mean grip force", taxel.force_n, "N", "<=", FORCE_N,
            f"without taxel {taxel.bare_force_n:.1f} N, always maximum {taxel.full_force_n:.1f} N"),
    )  # fmt: skip
    rows.append(
        _info("taxel: first slip > 100 µm to the raise, median", taxel.slip_to_raise_s, "s",
              "drops that it could prevent; bus, gripper and inference included in what follows")
    )  # fmt: skip
    rows.append(
        _info("taxel: raised though the cup only slid", _over(taxel.slides_raised, taxel.slides),
              "share", f"{taxel.slides} pours that slip > 300 µm and are not dropped")
    )  # fmt: skip
    for name, which in (("pixel difference", "pixels"), ("always maximum", "always")):
        cases = [getattr(case, which) for case in main]
        scores = score_loops([case for case in cases if case is not None])
        rows += _plain_rows(name, scores, always=which == "always")
    person = score_loops([case.person for case in main])
    rows.append(
        row("warning only, the person stops 0.5 s after it: preventable drops prevented",
            person.prevented_share, "share", ">=", PERSON_PREVENTED, _of(person))
    )  # fmt: skip
    rows += _hard_rows(hard)
    rows += _latency_rows(pours)
    return rows


def _goal_rows(name: str, scores: LoopScores) -> list[Row]:
    if not (scores.preventable and scores.holds):
        what = f"{name}: preventable drops prevented, unseen cups"
        why = f"needed drops and pours that hold; {_of(scores)}"
        return [missing(what, "share", f">= {PREVENTED}", why)]
    low, high = scores.needless_interval
    return [
        row(f"{name}: preventable drops prevented, unseen cups", scores.prevented_share, "share",
            ">=", PREVENTED, _of(scores)),
        row(f"{name}: preventable drops prevented, lower end of 95 %", scores.prevented_interval[0],
            "share", ">=", LEAST_PREVENTED, "the wider of cups resampled and exact binomial"),
        row(f"{name}: raised needlessly in pours that hold", scores.needless_share, "share",
            "<=", NEEDLESS, f"{scores.needless} of {scores.holds}, 95 % {low:.3f} … {high:.3f}; "
            "holds: slip up to 300 µm"),
        row(f"{name}: drops that it caused", scores.caused, "drops", "<=", 0),
    ]  # fmt: skip


def _plain_rows(name: str, scores: LoopScores, *, always: bool) -> list[Row]:
    needless = 1.0 if always else scores.needless_share
    note = "by its nature" if always else f"{scores.needless} of {scores.holds}"
    return [
        _info(f"{name}: preventable drops prevented", scores.prevented_share, "share",
              _of(scores)),
        _info(f"{name}: raised needlessly in pours that hold", needless, "share", note),
        _info(f"{name}: mean grip force", scores.force_n, "N", ""),
    ]  # fmt: skip


def _hard_rows(hard: Sequence[JudgedPour]) -> list[Row]:
    """Return what failing grips, sudden slips and pushes give."""
    rows = []
    for name, kinds in (("failing grips and sudden slips", FAILING), ("pushes", ("bump",))):
        pours = [pour for pour in hard if pour.run.kind in kinds]
        what = f"taxel, {name}: preventable drops prevented"
        goal = f">= {FAILING_PREVENTED}" if kinds == FAILING else ""
        scores = score_loops([pour.taxel for pour in pours]) if pours else None
        if scores is None or not scores.preventable:
            rows.append(missing(what, "share", goal, "no preventable drop among them"))
            continue
        counts = Counter(pour.run.kind for pour in pours)
        note = ", ".join(f"{count} {kind}" for kind, count in sorted(counts.items()))
        by_person = score_loops([pour.person for pour in pours])
        note = f"{_of(scores)}; {note}"
        rows.append(
            row(what, scores.prevented_share, "share", ">=", FAILING_PREVENTED, note)
            if goal
            else _info(what, scores.prevented_share, "share", f"{note}; a push lasts 80 ms")
        )
        rows.append(
            _info(f"taxel, {name}: raised needlessly", scores.needless_share, "share",
                  f"{scores.needless} of {scores.holds} that hold; the person who stops to pour "
                  f"prevents {by_person.prevented} of {by_person.preventable}"),
        )  # fmt: skip
    return rows


def _latency_rows(pours: Sequence[JudgedPour]) -> list[Row]:
    each_ms = np.concatenate([np.array(pour.latencies_s) for pour in pours]) * 1e3
    middle, late = np.percentile(each_ms, [50, 99])
    return [
        row("inference, measured 99 %, within what the loop assumes", float(late), "ms", "<=",
            LoopConfig().inference_s * 1e3, f"median {middle:.1f} ms, {len(each_ms)} decisions; "
            "all pours side by side on one machine"),
    ]  # fmt: skip


def _of(scores: LoopScores) -> str:
    low, high = scores.prevented_interval
    return (
        f"{scores.prevented} of {scores.preventable} preventable of {scores.drops} drops in "
        f"{scores.pours} pours of {scores.cups} cups, 95 % {low:.3f} … {high:.3f}"
    )


def _info(name: str, value: float, unit: str, note: str) -> Row:
    known = bool(np.isfinite(value))
    return Row(
        name=name, value=value if known else None, unit=unit,
        note=note if known else f"none to measure it on; {note}",
    )  # fmt: skip


def _over(part: int, whole: int) -> float:
    return part / whole if whole else float("nan")
