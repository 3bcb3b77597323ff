"""Which cells of an elastic contact stick, which slip, and what force each bears.

In one step the object moves; a cell that sticks moves along, a cell whose force has reached
friction times its pressure slips in the force's direction. With the pressure given, these are
the conditions of a convex problem: of all forces q within friction's discs, those that
minimise ½ qᵀC q − bᵀq, where C is the compliance and b the movement that stick would need.
Knows nothing about layers, time or cups.

Sources: the minimum principle, Johnson, Contact Mechanics, sections 5.7 and 7.2, after Kalker;
its solution by alternating directions (ADMM), Boyd et al., Foundations and Trends in Machine
Learning 3 (2011) 1, with over-relaxation.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float32]

_OVER = 1.6
"""Over-relaxation. Source: Boyd et al., section 3.4.3: 1.5 to 1.8."""
_LEAST = np.float32(1e-30)


@dataclass(frozen=True, slots=True)
class StickSlip:
    """What one step ends in."""

    force: Array
    """Shape (2 cells, contacts): on the layer, all x and then all y."""
    slip_mm: Array
    """Shape as above: movement of the object past the layer in this step."""


class FrictionSolver:
    """Finds stick and slip of contacts that share one compliance.

    Args:
        compliance: Shape (2 cells, 2 cells), symmetric and positive, mm a newton.
    """

    def __init__(self, compliance: NDArray[np.float64]) -> None:
        self.compliance = compliance.astype(np.float32)
        values = np.linalg.eigvalsh(compliance)
        # The geometric mean of the extremes is the penalty with the fastest convergence.
        self._weight = np.float32(np.sqrt(values[0] * values[-1]))
        shifted = compliance + float(self._weight) * np.eye(len(compliance))
        self._inverse = (_OVER * float(self._weight) * np.linalg.inv(shifted)).astype(np.float32)

    def settle(
        self,
        wanted_mm: Array,
        most: Array,
        force: Array,
        slip_mm: Array,
        tolerance_mm: float,
        most_iterations: int,
    ) -> StickSlip:
        """Return forces and slips after a step.

        Args:
            wanted_mm: Shape (2 cells, contacts): the movement that stick would need.
            most: Shape (cells, contacts): the largest force on a cell.
            force: Shape as `wanted_mm`: where to start, such as the forces before.
            slip_mm: Likewise, such as the slip of the step before.
            tolerance_mm: Change of movement in one iteration at which it ends.
            most_iterations: After which it ends in any case.
        """
        cells, less = len(most), np.float32(1.0 - _OVER)
        dual, wanted = slip_mm / self._weight, wanted_mm / self._weight
        most2 = most * most
        kept, close = force, tolerance_mm / float(self._weight)
        for _ in range(most_iterations):
            free = self._inverse @ (wanted + (kept - dual))
            before = kept
            mixed = free + (less * kept + dual)
            square = mixed * mixed
            size2 = square[:cells] + square[cells:]
            share = np.sqrt(np.minimum(most2 / np.maximum(size2, _LEAST), 1.0))
            kept = (mixed.reshape(2, cells, -1) * share).reshape(mixed.shape)
            dual = mixed - kept
            # Both end together: `free` is over-relaxed, so their gap is taken apart from it.
            gap = kept - (free + less * before)
            if max(np.abs(kept - before).max(), np.abs(gap).max()) < close:
                break
        return StickSlip(kept, dual * self._weight)
