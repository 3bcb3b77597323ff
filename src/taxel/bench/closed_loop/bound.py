"""Rows of `taxel bench closed-loop`: what a grip that is raised by slip alone could reach at most.

The slip is the simulator's own, as old as a monitor's, and the first raise is to the largest force:
no monitor of slip knows more, and no policy raises sooner or further. Knows nothing about images,
bundles or how rows are printed.

Source: docs/decisions/0017.
"""

from __future__ import annotations

from typing import Final

from taxel.bench.closed_loop.pours import FAILING, HARD, UNSEEN, is_preventable
from taxel.bench.closed_loop.training import raisable
from taxel.bench.rows import Row
from taxel.jobs.running import side_by_side
from taxel.live.closed_loop import HOLDS_UM, LoopConfig, replay_loop
from taxel.sim.pour.cup_pour import list_runs
from taxel.sim.pour.cups import PourRun
from taxel.sim.pour.pours_at_once import first_slips

RAISED_FROM_MM: Final = (0.02, 0.05, 0.1, 0.2)
"""Slip from which the grip is raised, millimetres: from micro-slip (decision 13) on."""


def grip_bound() -> list[Row]:
    """Raise by exact slip alone: failing grips and sudden slips, and pours that hold."""
    runs = list_runs(UNSEEN)
    hard = [run for run in runs + list_runs(HARD) if run.kind in FAILING]
    needed = side_by_side(is_preventable, [(run,) for run in hard])
    drops = [run for run, prevents in zip(hard, needed, strict=True) if prevents]
    holds = _holding([run for run in runs if raisable(run)])
    rows = []
    for raised_mm in RAISED_FROM_MM:
        held = side_by_side(is_saved, [(run, raised_mm) for run in drops])
        raised = len(_beyond(holds, raised_mm * 1e3))
        rows.append(
            Row(
                name=f"bound: exact slip, largest force from {raised_mm:g} mm on: failing grips "
                "and sudden slips prevented",
                value=sum(held) / len(drops) if drops else None,
                unit="share",
                note=f"{sum(held)} of {len(drops)}; of {len(holds)} pours that hold it raises "
                f"{raised} ({raised / max(len(holds), 1):.1%}; the goal is 2 %)",
            )
        )
    return rows


def is_saved(run: PourRun, raised_mm: float) -> bool:
    """Return whether the cup stays where the grip is raised fully from some slip on.

    Args:
        run: What is tried.
        raised_mm: Slip, millimetres.
    """
    config = LoopConfig()

    def ask(_: float, slip_mm: float) -> float:
        return config.response.most_n if slip_mm > raised_mm else run.force_n

    return not replay_loop(run, config, ask=ask).dropped


def _holding(runs: list[PourRun]) -> list[PourRun]:
    slipped = {run.name for run in _beyond(runs, HOLDS_UM)}
    return [run for run in runs if run.name not in slipped]


def _beyond(runs: list[PourRun], slip_um: float) -> list[PourRun]:
    """Return the runs that slip further, or drop, with the grip that they began with."""
    config = LoopConfig()
    found = first_slips(runs, slip_um, config.frame_hz, config.duration_s)
    return [run for run, moment in zip(runs, found.moment, strict=True) if moment >= 0]
