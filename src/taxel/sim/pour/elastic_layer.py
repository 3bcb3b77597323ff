"""How the surface of an elastic layer moves under shear tractions: the layer's own mathematics.

A layer of thickness h is bonded to a rigid window; its free face bears tractions along the face
and none across it. In the Fourier domain (wave number k, H = k h, κ = 3 − 4ν) the face moves by

    along k:    (1 − ν) (2κ sinh 2H + 4H) / D / (G k)     D = 2κ cosh 2H + 4H² + 1 + κ²
    across k:   tanh H / (G k)
    inwards:    −i ((1 − 2ν) κ (cosh 2H − 1) − 2H²) / D / (G k)    of the traction along k

For H → ∞ the first two become Cerruti's half space, (1 − ν)/(G k) and 1/(G k). Knows nothing
about friction, handles or pixels.

Sources: half space, Johnson, Contact Mechanics, section 3.6; bonded layer, from Navier's
equations as in docs/explanation/gel-shear.md, used likewise by Merkel et al., Biophys. J. 93
(2007) 3314.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from taxel.sim.pour.gel_shear_constants import CELLS, FIELD_MM, LAYER_MM, POISSON

_REFINE = 4
"""Points that resolve a cell along each axis while a kernel is made."""
_THICK = 15.0
"""k h beyond which a layer is a half space to eleven digits."""

Grid = NDArray[np.float32]


def shear_response(
    k: NDArray[np.float64], thickness_mm: float = LAYER_MM, poisson: float = POISSON
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return G times the movement along k, across k and inwards (its −i left out), millimetres.

    Args:
        k: Wave numbers, any shape, 1/mm, at least 0.
        thickness_mm: Of the layer.
        poisson: Poisson's ratio, below 0.5.

    Returns:
        Movement in millimetres for a traction of G; each of the shape of `k`.
    """
    height = np.minimum(k * thickness_mm, _THICK)
    kappa = 3.0 - 4.0 * poisson
    below = 2.0 * kappa * np.cosh(2.0 * height) + 4.0 * height**2 + 1.0 + kappa**2
    safe = np.maximum(k, 1e-9)
    along = (1.0 - poisson) * (2.0 * kappa * np.sinh(2.0 * height) + 4.0 * height) / below / safe
    across = np.tanh(height) / safe
    inwards = (1.0 - 2.0 * poisson) * kappa * (np.cosh(2.0 * height) - 1.0)
    # The layer's own part fades as H² exp(−2H), so that a height cut at _THICK leaves nothing.
    inwards = (inwards - 2.0 * height**2) / below / safe
    still = k * thickness_mm < 1e-6
    along, across = np.where(still, thickness_mm, along), np.where(still, thickness_mm, across)
    return along, across, np.where(still, 0.0, inwards)


@dataclass(frozen=True, slots=True)
class CellKernel:
    """What a unit force, spread over one cell, does to all cells of a periodic grid, times G."""

    step_mm: tuple[float, float]
    """Size of a cell (x, y)."""
    xx: NDArray[np.float64]
    """Shape (ny, nx), 1/mm: movement along x by a force along x, mean over a cell; the place of
    the force is [0, 0], places before it are counted from the end."""
    yy: NDArray[np.float64]
    xy: NDArray[np.float64]
    spectrum: NDArray[np.complex64]
    """Shape (4, 2, ny, nx / 2 + 1): from a force along (x, y) to movement along x and y and to
    the inward slope along x and y."""


def cell_kernel(
    step_mm: tuple[float, float],
    shape: tuple[int, int],
    thickness_mm: float = LAYER_MM,
    poisson: float = POISSON,
) -> CellKernel:
    """Return the kernel of a grid, by Fourier transform.

    Args:
        step_mm: Size of a cell (x, y), millimetres.
        shape: Rows and columns of the grid; it repeats, so leave a margin of some thicknesses.
        thickness_mm: Of the layer.
        poisson: Poisson's ratio.
    """
    (rows, columns), (dx, dy) = shape, step_mm
    kx = 2.0 * np.pi * fft.fftfreq(columns * _REFINE, dx / _REFINE)[None, :]
    ky = 2.0 * np.pi * fft.fftfreq(rows * _REFINE, dy / _REFINE)[:, None]
    k = np.hypot(kx, ky)
    along, across, inwards = shear_response(k, thickness_mm, poisson)
    # Spread over the cell, and seen as a mean over a cell: sinc² of each axis.
    seen = (np.sinc(kx * dx / 2.0 / np.pi) * np.sinc(ky * dy / 2.0 / np.pi)) ** 2
    seen *= _REFINE**2 / (dx * dy)
    k2 = np.maximum(k * k, 1e-12)
    ux, uy, uxy = kx * kx / k2, ky * ky / k2, kx * ky / k2
    ux[0, 0] = uy[0, 0] = 0.5
    slope = inwards * k
    parts = (
        along * ux + across * uy, along * uy + across * ux, (along - across) * uxy,
        slope * ux, slope * uy, slope * uxy,
    )  # fmt: skip
    xx, yy, xy, sxx, syy, sxy = (
        fft.ifft2(part * seen).real[::_REFINE, ::_REFINE] for part in parts
    )
    rows_of = ((xx, xy), (xy, yy), (sxx, sxy), (sxy, syy))
    spectrum = fft.rfft2(np.array(rows_of)).astype(np.complex64)
    return CellKernel(step_mm, xx, yy, xy, spectrum)


@dataclass(frozen=True, slots=True)
class LayerPatch:
    """An elliptic contact on the layer, cut into cells in its own frame (across, along)."""

    half_mm: tuple[float, float]
    """Half axes (across, along)."""
    x_mm: NDArray[np.float64]
    """Shape (cells,), across."""
    y_mm: NDArray[np.float64]
    """Shape (cells,), along."""
    share: NDArray[np.float64]
    """Shape (cells,): Hertz's pressure as a share of the normal force; adds up to 1."""
    weights: Grid
    """Shape (3, 2 cells): from the cells' movement (all across, then all along) to its mean
    (across, along) and its turn (rad), weighted by the pressure."""
    compliance: NDArray[np.float64]
    """Shape (2 cells, 2 cells), 1/mm: G times the movement (all across, then all along) of the
    cells by forces on them."""
    mirror: NDArray[np.intp]
    """Shape (cells,): the cell across the long axis from each."""
    _kernel: CellKernel
    _at: NDArray[np.intp]
    """Shape (cells,): place of each cell in the flattened grid."""
    _shape: tuple[int, int]
    """Rows and columns of the field."""

    @property
    def cell_mm2(self) -> float:
        """Area of a cell."""
        return float(np.prod(self._kernel.step_mm))

    @property
    def step_mm(self) -> tuple[float, float]:
        """Distance between the field's points (across, along)."""
        return self._kernel.step_mm

    def field(self, force_over_g: Grid) -> Grid:
        """Return the movement of the layer's face around the contact.

        Args:
            force_over_g: Shape (cells, 2): force on each cell (across, along) over the shear
                modulus, mm².

        Returns:
            Shape (rows, columns, 4), both odd, the contact's middle in the middle: movement
            (across, along) in millimetres; inward slope (along those axes), mm per mm.
        """
        spectrum = self._kernel.spectrum
        grid = np.zeros((2, *self._kernel.xx.shape), np.float32)
        grid.reshape(2, -1)[:, self._at] = force_over_g.T
        load = fft.rfft2(grid)
        moved = spectrum[:, 0] * load[0]
        moved += spectrum[:, 1] * load[1]
        full = fft.irfft2(moved, s=grid.shape[1:], overwrite_x=True)
        rows, columns = self._shape
        field = np.empty((rows, columns, 4), np.float32)
        for part in range(4):
            field[..., part] = full[part, :rows, :columns]
        return field


@lru_cache(maxsize=24)
def layer_patch(
    across_mm: float,
    along_mm: float,
    *,
    cells: int = CELLS,
    thickness_mm: float = LAYER_MM,
    poisson: float = POISSON,
    field_mm: float = FIELD_MM,
) -> LayerPatch:
    """Return a contact with Hertz's pressure on a layer.

    Args:
        across_mm: Half axis across the handle.
        along_mm: Half axis along it.
        cells: Cells along each axis, odd.
        thickness_mm: Of the layer.
        poisson: Poisson's ratio.
        field_mm: Reach of `LayerPatch.field` from the middle.
    """
    steps = (2.0 * across_mm / cells, 2.0 * along_mm / cells)
    reach = [max(int(np.ceil(field_mm / step)), cells // 2) for step in steps]
    columns, rows = (2 * r + 1 for r in reach)
    shape = (fft.next_fast_len(rows + cells, True), fft.next_fast_len(columns + cells, True))
    kernel = cell_kernel(steps, shape, thickness_mm, poisson)
    unit = (np.arange(cells) + 0.5) / cells * 2.0 - 1.0
    u, v = np.meshgrid(unit, unit)
    down, right = np.nonzero(u**2 + v**2 < 1.0)
    pressure = np.sqrt(1.0 - unit[right] ** 2 - unit[down] ** 2)
    dy, dx = down[:, None] - down, right[:, None] - right
    xy = kernel.xy[dy, dx]
    compliance = np.block([[kernel.xx[dy, dx], xy], [xy, kernel.yy[dy, dx]]])
    share = pressure / pressure.sum()
    x, y, none = unit[right] * across_mm, unit[down] * along_mm, np.zeros(len(right))
    arm2 = float(share @ (x * x + y * y))
    turn = np.concatenate([-share * y, share * x]) / arm2
    weights = np.stack([np.append(share, none), np.append(none, share), turn])
    order = {place: index for index, place in enumerate(zip(down, right, strict=True))}
    mirror = [order[(i, cells - 1 - j)] for i, j in zip(down, right, strict=True)]
    corner_y, corner_x = reach[1] - cells // 2, reach[0] - cells // 2
    return LayerPatch(
        half_mm=(across_mm, along_mm),
        x_mm=x,
        y_mm=y,
        share=share,
        weights=weights.astype(np.float32),
        compliance=(compliance + compliance.T) / 2.0,
        mirror=np.array(mirror),
        _kernel=kernel,
        _at=(down + corner_y) * shape[1] + right + corner_x,
        _shape=(rows, columns),
    )
