"""Claims about stick and slip on an elastic layer: Mindlin's annulus and friction's limits."""

from functools import lru_cache

import numpy as np
import pytest

from taxel.sim.pour.elastic_layer import LayerPatch, layer_patch
from taxel.sim.pour.layer_friction import FrictionSolver, StickSlip

RADIUS, MU_N = 1.0, 2.0


@lru_cache
def thick() -> tuple[LayerPatch, FrictionSolver]:
    """A circle of 1 mm on a layer 12 times as thick: nearly a half space."""
    patch = layer_patch(RADIUS, RADIUS, cells=21, thickness_mm=12.0, poisson=0.3, field_mm=18.0)
    return patch, FrictionSolver(patch.compliance)


def move(
    x: float, y: float = 0.0, turn: float = 0.0, steps: int = 20
) -> tuple[StickSlip, np.ndarray]:
    """Move an object that is held by Hertz's pressure; return the end and each cell's path."""
    patch, solver = thick()
    step = np.concatenate([x - turn * patch.y_mm, y + turn * patch.x_mm])[:, None] / steps
    most = (MU_N * patch.share[:, None]).astype(np.float32)
    end = StickSlip(np.zeros_like(step, np.float32), np.zeros_like(step, np.float32))
    path = np.zeros(len(patch.share))
    for _ in range(steps):
        wanted = solver.compliance @ end.force + step.astype(np.float32)
        end = solver.settle(wanted, most, end.force, end.slip_mm, 1e-6, 2000)
        path += np.hypot(*end.slip_mm.reshape(2, -1))
    return end, path


@pytest.mark.slow
def test_a_stuck_disc_is_as_stiff_as_mindlin_says() -> None:
    """8 G a / (2 − ν) on a half space; a layer of twelve radii is a few per cent stiffer."""
    patch, solver = thick()
    even = np.append(np.ones(len(patch.share)), np.zeros(len(patch.share)))
    stiffness = even @ np.linalg.solve(solver.compliance.astype(np.float64), even)
    assert 1.0 < stiffness / (8.0 * RADIUS / 1.7) < 1.08


@pytest.mark.slow
@pytest.mark.parametrize("load", [0.2, 0.4, 0.6, 0.8, 0.95])
def test_partial_slip_leaves_mindlins_stuck_disc(load: float) -> None:
    """Under a load T the disc of radius a (1 − T/μN)^(1/3) sticks; around it lies the annulus.

    The object is moved as far as Mindlin says that this load moves it.
    """
    full = 3.0 * MU_N * 1.7 / (16.0 * RADIUS)
    end, _ = move(full * (1.0 - (1.0 - load) ** (2 / 3)))
    patch, _ = thick()
    count = len(patch.share)
    held = float(end.force[:count].sum()) / MU_N
    assert held == pytest.approx(load, abs=0.03)
    assert abs(float(end.force[count:].sum())) < 1e-3
    size = np.hypot(*end.force.reshape(2, -1))
    stuck = size < 0.999 * MU_N * patch.share
    radius = np.sqrt(stuck.mean()) * RADIUS
    assert radius == pytest.approx(RADIUS * (1.0 - held) ** (1 / 3), abs=0.04)
    away = np.hypot(patch.x_mm, patch.y_mm)
    assert away[stuck].max() < away[~stuck].min() + 0.16  # a disc, but for Mindlin's round-off


def test_in_full_slip_the_force_is_friction_times_the_load() -> None:
    end, path = move(3.0, 4.0)
    count = len(path)
    force = np.array([end.force[:count].sum(), end.force[count:].sum()])
    np.testing.assert_allclose(force, MU_N * np.array([0.6, 0.8]), rtol=2e-3)
    assert path.min() > 3.0  # of 5 mm, less what the layer gives


def test_in_full_spin_the_moment_is_hertz_and_the_middle_stays() -> None:
    """3π/16 μ N a for Hertz's pressure, on cells within 2 %."""
    end, path = move(0.0, 0.0, 3.0, steps=60)
    patch, _ = thick()
    x, y = end.force.reshape(2, -1)
    assert patch.x_mm @ y - patch.y_mm @ x == pytest.approx(3 * np.pi / 16 * MU_N, rel=0.02)
    assert float(np.hypot(x.sum(), y.sum())) < 1e-2
    assert path[np.argmin(np.hypot(patch.x_mm, patch.y_mm))] < 0.1 * path.max()


def test_what_sticks_moves_with_the_object_and_no_force_exceeds_friction() -> None:
    patch, solver = thick()
    end, path = move(0.2, 0.1, 0.2)
    count = len(patch.share)
    x, y = (solver.compliance @ end.force).reshape(2, -1)
    stuck = path < 1e-6
    assert 10 < stuck.sum() < count
    np.testing.assert_allclose(x[stuck], 0.2 - 0.2 * patch.y_mm[stuck], atol=2e-4)
    np.testing.assert_allclose(y[stuck], 0.1 + 0.2 * patch.x_mm[stuck], atol=2e-4)
    size = np.hypot(*end.force.reshape(2, -1))
    assert (size <= MU_N * patch.share * (1 + 1e-5)).all()


def test_slip_goes_where_the_force_points() -> None:
    """Friction never pulls: each cell slips along its own force."""
    end, _ = move(0.5, 0.2, 0.3)
    force, slip = end.force.reshape(2, -1), end.slip_mm.reshape(2, -1)
    far = np.hypot(*slip) > 1e-4
    aligned = (force * slip).sum(axis=0) / np.maximum(np.hypot(*force) * np.hypot(*slip), 1e-12)
    assert far.any()
    assert aligned[far].min() > 0.999


def test_unloading_leaves_stress_behind() -> None:
    """Friction has a memory: back at the start, the rim still pulls the other way."""
    patch, solver = thick()
    most = (MU_N * patch.share[:, None]).astype(np.float32)
    count = len(patch.share)
    step = np.append(np.full(count, 0.02), np.zeros(count))[:, None].astype(np.float32)
    end = StickSlip(step * 0, step * 0)
    for way in [1] * 15 + [-1] * 15:
        wanted = solver.compliance @ end.force + way * step
        end = solver.settle(wanted, most, end.force, end.slip_mm, 1e-6, 2000)
    assert end.force[:count].sum() < -0.01 * MU_N
