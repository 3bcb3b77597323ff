"""Friction of a soft pad as a field of brushes: stick, micro-slip and slip in one model.

Each cell of the contact patch is a brush: it bends with the object, elastically, until its
force reaches friction times its pressure; then its tip slides. From this alone come an
annulus that slips first, rotation and translation together, and a limit close to the
ellipsoid (f / μN)² + (m / μNe)² = 1. Knows nothing about cups, gels' looks or time's origin.

Sources: limit surface, Goyal et al., Wear 1991; brush field and its distance to the ellipsoid,
docs/explanation/physics-gel; Stribeck, our choice of velocity, docs/decisions/0013.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

STRIBECK_MM_S = 4.0
"""Sliding speed over which friction falls from static to kinetic. Source: our choice."""
CELLS = 15
"""Cells along each axis of the patch; about 175 lie inside its ellipse. Source: our choice."""


@dataclass(frozen=True, slots=True)
class Patch:
    """An elliptic contact patch cut into cells of equal area."""

    x_mm: NDArray[np.float64]
    """Shape (cells,), from the patch's middle."""
    y_mm: NDArray[np.float64]
    """Shape (cells,)."""
    share: NDArray[np.float64]
    """Shape (cells,): each cell's share of the normal force; adds up to 1."""
    area_mm2: float
    """Of one cell."""


def elliptic_patch(across_mm: float, along_mm: float, axis_rad: float) -> Patch:
    """Return a patch with Hertz's pressure, √(1 − r²).

    Args:
        across_mm: Half axis across the handle.
        along_mm: Half axis along it.
        axis_rad: Direction of the long axis, 0 = vertical, clockwise.
    """
    grid = (np.arange(CELLS) + 0.5) / CELLS * 2.0 - 1.0
    u, v = (axis.ravel() for axis in np.meshgrid(grid, grid))
    inside = u**2 + v**2 < 1.0
    u, v = u[inside], v[inside]
    pressure = np.sqrt(1.0 - u**2 - v**2)
    across, along = u * across_mm, v * along_mm
    cos, sin = np.cos(axis_rad), np.sin(axis_rad)
    return Patch(
        x_mm=across * cos - along * sin,
        y_mm=across * sin + along * cos,
        share=pressure / pressure.sum(),
        area_mm2=4.0 * across_mm * along_mm / CELLS**2,
    )


class BrushField:
    """Pads on the two sides of one rigid object, which share its motion.

    Args:
        patch: Of both sides.
        stiffness_n_mm3: Shear stiffness of the pad, newtons a millimetre and square millimetre.
        friction: Shape (sides,), static.
        kinetic: Kinetic over static friction.
    """

    def __init__(
        self, patch: Patch, stiffness_n_mm3: float, friction: NDArray[np.float64], kinetic: float
    ) -> None:
        self.patch = patch
        self._stiffness = stiffness_n_mm3 * patch.area_mm2
        self._static = friction[:, None]
        self._kinetic = friction[:, None] * kinetic
        shape = (len(friction), len(patch.x_mm))
        self.shear_x, self.shear_y = np.zeros(shape), np.zeros(shape)
        """Shape (sides, cells): how far each brush is bent elastically, millimetres."""
        self._set_x, self._set_y = np.zeros(shape), np.zeros(shape)
        """Shape (sides, cells): movement of the pad that bears no force: it crept, or it was
        first touched after the pad had moved."""
        self.path = np.zeros(shape)
        """Shape (sides, cells): how far each tip has slid, millimetres."""
        self.speed = np.zeros(shape)
        """Shape (sides, cells): sliding speed of each tip, millimetres a second."""
        self._arm2 = patch.x_mm**2 + patch.y_mm**2

    def resize(self, patch: Patch) -> None:
        """Take another patch of the same cells, as when the grip changes.

        A patch that grows touches unsheared pad, so its forces stay; one that shrinks lets go
        of what its lost area held. Neither moves the pad's surface.
        """
        if patch.area_mm2 > self.patch.area_mm2:
            self.yield_by(1.0 - self.patch.area_mm2 / patch.area_mm2)
        self._stiffness *= patch.area_mm2 / self.patch.area_mm2
        self._arm2 = patch.x_mm**2 + patch.y_mm**2
        self.patch = patch

    def yield_by(self, share: float) -> None:
        """Let the pad give way where it is bent: the force fades, its surface stays.

        Args:
            share: Of the elastic bend, 0…1.
        """
        self._set_x += share * self.shear_x
        self._set_y += share * self.shear_y
        self.shear_x *= 1.0 - share
        self.shear_y *= 1.0 - share

    def let_go(self, kept: float) -> None:
        """Let the pads spring back once nothing touches them: `kept` of all movement remains."""
        for part in (self.shear_x, self.shear_y, self._set_x, self._set_y):
            part *= kept
        self.speed[:] = 0.0

    def move(
        self, dx_mm: float, dy_mm: float, turn_rad: float, normal_n: float, dt_s: float
    ) -> None:
        """Move the object by a small step, then let the tips slide that friction cannot hold.

        Args:
            dx_mm: Step of the patch's middle.
            dy_mm: As above, down.
            turn_rad: Clockwise turn about it.
            normal_n: Normal force on each side.
            dt_s: Length of the step.
        """
        self.shear_x += dx_mm - turn_rad * self.patch.y_mm
        self.shear_y += dy_mm + turn_rad * self.patch.x_mm
        bent = np.sqrt(self.shear_x**2 + self.shear_y**2)
        friction = self._kinetic + (self._static - self._kinetic) * np.exp(
            self.speed * (-1.0 / STRIBECK_MM_S)
        )
        limit = friction * (self.patch.share * (max(normal_n, 0.0) / self._stiffness))
        kept = np.minimum(1.0, limit / np.maximum(bent, 1e-12))
        slid = bent * (1.0 - kept)
        self.shear_x *= kept
        self.shear_y *= kept
        self.path += slid
        self.speed = slid / dt_s

    def friction(self) -> NDArray[np.float64]:
        """Return each side's load-weighted friction now, shape (sides,)."""
        fast = 1.0 - np.exp(self.speed * (-1.0 / STRIBECK_MM_S))
        limit = self._static + (self._kinetic - self._static) * fast
        return np.asarray(limit @ self.patch.share)

    def forces(self) -> tuple[float, float, float]:
        """Return what the pads hold against the object: x and y (N), and moment (N mm)."""
        x, y = self.shear_x.sum(axis=0), self.shear_y.sum(axis=0)
        moment = float(self.patch.x_mm @ y - self.patch.y_mm @ x)
        return (
            self._stiffness * float(x.sum()),
            self._stiffness * float(y.sum()),
            (self._stiffness * moment),
        )

    def most_drag(
        self, drag: NDArray[np.float64], held: NDArray[np.float64], normal_n: float
    ) -> NDArray[np.float64]:
        """Return what the pads' damping can bear beside what they hold, shape (3,).

        Friction bears both: a pad that is torn along cannot damp more than it could hold.

        Args:
            drag: Shape (3,): what damping would give, x and y (N), moment (N mm).
            held: Shape (3,): what the bent pads hold, as `forces`.
            normal_n: Normal force on each side.
        """
        most_n = float(self.friction().sum()) * max(normal_n, 0.0)
        arm_mm = float(np.sqrt(self._arm2) @ self.patch.share)
        held_n, wanted_n = float(np.hypot(*held[:2])), float(np.hypot(*drag[:2]))
        line = min(1.0, max(most_n - held_n, 0.0) / max(wanted_n, 1e-12))
        spare = max(most_n * arm_mm - abs(float(held[2])), 0.0)
        turn = min(1.0, spare / max(abs(float(drag[2])), 1e-12))
        return np.asarray(drag * np.array([line, line, turn]))

    def sticking(self) -> float:
        """Return the share of all brushes that do not slide, 0…1."""
        return float((self.speed <= 0.0).mean())

    def stiffness(self) -> tuple[float, float]:
        """Return the stuck pads' stiffness: N/mm, and N mm/rad."""
        sides = len(self._static)
        cells = len(self._arm2)
        return sides * cells * self._stiffness, sides * self._stiffness * float(self._arm2.sum())

    def surface_motion(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return each pad's mean movement, shape (sides, 2), mm, and twist, shape (sides,), rad."""
        x, y, share = self.shear_x + self._set_x, self.shear_y + self._set_y, self.patch.share
        moved = np.stack([x @ share, y @ share], axis=1)
        turn = (y * self.patch.x_mm - x * self.patch.y_mm) @ share
        return moved, turn / float(self._arm2 @ self.patch.share)
