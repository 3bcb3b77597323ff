"""What a grip of some force gives: indentation, patch, and how near a load is to its limit.

Knows nothing about time, noise or pixels.

Source: docs/explanation/physics-gel.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from taxel.sim.pour.brush_contact import elliptic_patch
from taxel.sim.pour.cups import PourRun

GRAVITY_M_S2 = 9.81
INDENTATION_POWER = 0.448
"""Of force, in the indentation. Source: FEATS; through 1.4 mm at 15 N and 2.4 mm at 50 N."""
_HOLD_RATIO = 0.6
"""Largest load, as a share of the limit, of a pour that is meant to hold. Our choice,
docs/decisions/0013."""


def indentation(force_n: float) -> tuple[float, float]:
    """Return depth (mm) and area (mm²): 1.4 and 124 at 15 N, 2.4 and 168 at 50 N.

    Source: FEATS, as collected in docs/explanation/physics-gel; powers fitted through both.
    """
    over = force_n / 15.0
    return 1.4 * over**INDENTATION_POWER, 124.0 * over**0.252


def force_of(depth_mm: float) -> float:
    """Return the grip force that presses a gel in so far, newtons: the inverse of `indentation`."""
    return 15.0 * float((max(depth_mm, 0.0) / 1.4) ** (1.0 / INDENTATION_POWER))


def half_axes(run: PourRun, force_n: float) -> tuple[float, float]:
    """Return the patch's half axes across and along the handle, millimetres."""
    _, area_mm2 = indentation(force_n)
    ratio = (run.cup.radius_across_mm / run.cup.bend_mm) ** 0.5
    across = min(np.sqrt(area_mm2 / np.pi * ratio), run.cup.width_mm / 2.0)
    return float(across), float(min(area_mm2 / np.pi / across, 11.0))


def load_ratio(run: PourRun, poured_g: float) -> float:
    """Return the resting load over the limit surface of both gels; slip begins at 1.

    Source: (f / μN)² + (m / μNe)² ≤ 1, docs/explanation/physics-gel; the weakest grip of
    the run, cup unturned.
    """
    grip_n = run.force_n * (1.0 + run.grip_error) * (1.0 - run.relaxation)
    friction_n = run.cup.friction * sum(run.side_friction) * grip_n
    patch = elliptic_patch(*half_axes(run, grip_n), 0.0)
    arm_mm = float(np.hypot(patch.x_mm, patch.y_mm) @ patch.share)
    weight_n = (run.cup.mass_kg + poured_g / 1000.0) * GRAVITY_M_S2
    return float(np.hypot(weight_n, weight_n * run.cup.lever_mm / arm_mm) / friction_n)


def pour_less(run: PourRun) -> PourRun:
    """Return a run that is meant to hold its pour with no more water than that allows."""
    if run.kind not in ("no-slip pour", "late slip"):
        return run
    empty = load_ratio(run, 0.0)
    room_g = 1000.0 * run.cup.mass_kg * (_HOLD_RATIO / empty - 1.0)
    return replace(run, amount_g=min(run.amount_g, max(room_g, 5.0)))
