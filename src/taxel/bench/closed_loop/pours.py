"""The pours that a closed loop is judged on, and which of their drops could be prevented at all.

Knows nothing about monitors, policies or rows.

Source: docs/decisions/0017.
"""

from __future__ import annotations

from dataclasses import replace

from taxel.live.closed_loop import LoopConfig, at_full_force, replay_loop
from taxel.sim.pour.cup_pour import CupPourConfig
from taxel.sim.pour.cups import PourRun

UNSEEN = CupPourConfig(cups=42, first_cup=5100, forces_n=(15.0, 25.0, 40.0), negatives=0.25)
"""Cups to judge on, fixed before any of them was looked at; at 50 N there is nothing to raise."""
HARD = replace(
    UNSEEN, kinds=("grip drop", "late slip", "bump"), positions=("middle",), negatives=0.0
)
"""The same cups, with failing grips, sudden slips and pushes: of these only drops that full force
would have prevented are played, which is found without taxel."""
FAILING = ("grip drop", "late slip")


def is_preventable(run: PourRun) -> bool:
    """Return whether a cup drops without taxel and full force would have held it."""
    config = LoopConfig()
    return replay_loop(run, config).dropped and not at_full_force(run, config).dropped
