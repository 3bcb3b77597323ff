"""The picture of docs/explanation/closed-loop.md, from nothing, in about a quarter of an hour.

    python -m taxel.bench.closed_loop.picture docs/pictures/closed-loop.png

Left: what each threshold gives on training cups that the head had not seen, and where the
loop works. Right: one unseen cup with and without taxel. Knows nothing about rows.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from matplotlib.axes import Axes

from taxel.actions.grip_policy import GripPolicy
from taxel.bench.closed_loop.pours import UNSEEN
from taxel.bench.closed_loop.scores import NEEDLESS, PREVENTED, LoopScores
from taxel.bundles.grasp import read_grasp_bundle
from taxel.live.closed_loop import (
    LoopConfig,
    LoopTrack,
    MonitoredGrip,
    at_full_force,
    open_pour,
    replay_loop,
    run_loop,
)
from taxel.live.grasp_monitor import GraspMonitor
from taxel.plotting import plt
from taxel.sim.pour.cup_pour import list_runs
from taxel.sim.pour.cups import PourRun

if TYPE_CHECKING:
    from taxel.bench.closed_loop.training import Learnt

_TAXEL, _PIXELS, _BARE = "#1f4e8c", "#d08700", "#c0281c"


def draw(path: Path, learnt: Learnt) -> None:
    """Write the picture.

    Args:
        path: The file to write.
        learnt: Bundle, thresholds and the curves that they were chosen on.
    """
    figure, (left, upper) = plt.subplots(1, 2, figsize=(11, 4.2), layout="constrained")
    _draw_curves(left, learnt)
    run = _shown_run()
    _draw_pour(upper, run, _held(run, learnt))
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _draw_curves(axes: Axes, learnt: Learnt) -> None:
    same = [point for point in learnt.curve if point.stability.raise_s == learnt.stability.raise_s]
    _draw_curve(axes, [point.scores for point in same], _TAXEL, "taxel, threshold on its forecast")
    _draw_curve(
        axes, [point.scores for point in learnt.pixel_curve], _PIXELS, "difference of pixels"
    )
    (chosen,) = (point.scores for point in same if point.stability == learnt.stability)
    axes.plot(
        100 * chosen.needless_share, 100 * chosen.prevented_share, "o", ms=11, mfc="none",
        mec=_TAXEL, mew=2, label=f"chosen: warn at {learnt.stability.warn:g}",
    )  # fmt: skip
    axes.axhline(100 * PREVENTED, color="#777777", lw=0.8, ls=":")
    axes.axvline(100 * NEEDLESS, color="#777777", lw=0.8, ls=":")
    axes.set_xlabel("raised needlessly, % of pours that hold")
    axes.set_ylabel("prevented, % of preventable drops")
    axes.set_title(f"training cups held out, {chosen.pours} pours; dotted: the goals")
    axes.set_xscale("symlog", linthresh=1.0)
    axes.set_xticks([0, 1, 10, 100], ["0", "1", "10", "100"])
    axes.set_xlim(-0.1, 110)
    axes.legend(loc="lower right")


def _draw_curve(axes: Axes, scores: list[LoopScores], colour: str, name: str) -> None:
    x = [100 * score.needless_share for score in scores]
    y = [100 * score.prevented_share for score in scores]
    axes.plot(x, y, "-o", color=colour, ms=3.5, lw=1.2, label=name)


def _shown_run() -> PourRun:
    """Return the first unseen pour whose drop can be prevented."""
    config = LoopConfig()
    for run in list_runs(UNSEEN):
        bare = run.kind == "pour" and replay_loop(run, config)
        if bare and bare.dropped and not at_full_force(run, config).dropped:
            return run
    raise ValueError("needed a preventable drop among the unseen pours")


def _held(run: PourRun, learnt: Learnt) -> LoopTrack:
    config = LoopConfig()
    pour = open_pour(run, config)
    monitor = GraspMonitor(read_grasp_bundle(learnt.bundle), pour.cameras, learnt.stability)
    return run_loop(pour, MonitoredGrip(monitor, GripPolicy(run.force_n)), config)


def _draw_pour(axes: Axes, run: PourRun, held: LoopTrack) -> None:
    bare = replay_loop(run, LoopConfig())
    axes.plot(bare.time_s, bare.truth[:, 0] / 1000, color=_BARE, label="slip without taxel")
    axes.plot(bare.time_s[-1], bare.truth[-1, 0] / 1000, "x", color=_BARE, ms=9, mew=2)
    axes.plot(held.time_s, held.truth[:, 0] / 1000, color=_TAXEL, label="slip with taxel")
    if held.raised_s is not None:
        axes.axvline(held.raised_s, color=_TAXEL, lw=0.8, ls=":")
    axes.set_xlabel("time since the grasp, s")
    axes.set_ylabel("slip, mm")
    axes.set_title(f"an unseen cup, held with {run.force_n:g} N; cross: dropped")
    force = axes.twinx()
    force.plot(held.time_s, held.force_n, color=_TAXEL, lw=1, ls="--", label="grip, right axis")
    force.set_ylabel("grip force, N")
    force.set_ylim(0, 60)
    lines = axes.get_lines()[:1] + axes.get_lines()[2:3] + force.get_lines()
    axes.legend(lines, [str(line.get_label()) for line in lines], loc="upper left")


if __name__ == "__main__":
    from taxel.bench.closed_loop.training import learn

    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        draw(Path(sys.argv[1]), learn(Path(scratch), on_step=print))
