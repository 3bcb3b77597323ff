"""Colour of a gel as a function of its surface's slope: three coloured lamps, one polynomial.

ΔI = Σ c_ij · nx^i · ny^j, 1 ≤ i + j ≤ 5, with (nx, ny) the slope (gx, gy) / √(1 + gx² + gy²):
photometric stereo as in Taxim (Si and Yuan, RA-L 2022), with one polynomial in place of its
table of 125 × 125 bins, so that a few presses suffice and slopes vary smoothly. Slopes beyond
the calibrated ones keep the calibrated limit's colour. Knows nothing about markers, noise,
cameras or how the coefficients were fitted (`taxel.gel.shading_fit`).
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from importlib.resources import files
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadTable, MissingExtra
from taxel.foreign.json_text import parse_json, read_json

try:
    import cv2 as cv2
except ModuleNotFoundError as error:
    raise MissingExtra("opencv-python-headless", "camera", "tactile cameras") from error

Array = NDArray[np.float64]

DEGREE = 5
"""Of the polynomial. Source: held-out presses, R² .83/.81/.81 at 3, .91/.88/.89 at 5, .91/.89/.89
at 6 (docs/decisions/0012)."""
_TABLE_SIDE = 257
_TABLE_SLOPE = 3.0
"""The table spans slopes of ±3, twice any calibrated one; its rim holds the limit's colour."""


@dataclass(frozen=True)
class Shading:
    """How a gel's colour changes with its slope."""

    coefficients: Array
    """Shape (terms, 3): grey levels (0…255) of red, green, blue per term of `terms`."""
    steepest: float
    """Largest calibrated length of (nx, ny), 0…1: steeper slopes are clamped to it."""
    provenance: str = ""
    """What it was fitted on, and how."""

    def render(self, gx: NDArray[np.floating], gy: NDArray[np.floating]) -> NDArray[np.float32]:
        """Return the change of colour, shape (h, w, 3), grey levels, red first.

        Args:
            gx: Shape (h, w): d depth/dx, mm per mm; depth grows into the gel, x to the right.
            gy: Shape (h, w): d depth/dy; y grows downwards.
        """
        scale = (_TABLE_SIDE - 1) / (2 * _TABLE_SLOPE)
        across = np.asarray(gx, np.float32) * np.float32(scale) + np.float32(_TABLE_SIDE // 2)
        down = np.asarray(gy, np.float32) * np.float32(scale) + np.float32(_TABLE_SIDE // 2)
        return np.asarray(
            cv2.remap(self.table, across, down, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE),
            np.float32,
        )

    @cached_property
    def table(self) -> NDArray[np.float32]:
        """The polynomial, tabled over slopes (gy, gx) from −3 to 3: shape (257, 257, 3)."""
        slopes = np.linspace(-_TABLE_SLOPE, _TABLE_SLOPE, _TABLE_SIDE)
        gx, gy = np.meshgrid(slopes, slopes)
        nx, ny = clamped_normal(gx, gy, self.steepest)
        return (terms(nx, ny) @ self.coefficients).astype(np.float32)


def clamped_normal(gx: Array, gy: Array, steepest: float = 1.0) -> tuple[Array, Array]:
    """Return (nx, ny) of slopes, with their length clamped to `steepest`; shapes as given."""
    length = np.sqrt(1.0 + gx**2 + gy**2)
    nx, ny = gx / length, gy / length
    keep = steepest / np.maximum(np.hypot(nx, ny), steepest)
    return nx * keep, ny * keep


def terms(nx: Array, ny: Array) -> Array:
    """Return the polynomial's terms nx^i · ny^j, shape (..., 20), by rising i + j, then i."""
    return np.stack(
        [nx**i * ny ** (total - i) for total in range(1, DEGREE + 1) for i in range(total + 1)],
        axis=-1,
    )


def save_shading(shading: Shading, where: Path) -> None:
    """Write a shading as JSON; a reader never sees half of it."""
    document = {
        "what": "grey levels per term nx^i ny^(d-i), d = 1..5, i = 0..d; rows: terms; columns: RGB",
        "provenance": shading.provenance,
        "steepest": round(shading.steepest, 4),
        "coefficients": [[round(float(v), 3) for v in row] for row in shading.coefficients],
    }
    part = where.with_name(where.name + ".part")
    part.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    part.replace(where)


def read_shading(where: Path | None = None) -> Shading:
    """Return a shading from its JSON; without a path, that of a GelSight Mini.

    Raises:
        BadTable: The file is missing or holds no shading.
    """
    try:
        if where is None:
            text = (files("taxel.gel") / "shading_gelsight_mini.json").read_text(encoding="utf-8")
            document = parse_json(text)
        else:
            document = read_json(where)
        coefficients = np.asarray(document["coefficients"], dtype=np.float64)
        steepest = float(document["steepest"])
        provenance = str(document["provenance"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise BadTable("a shading's JSON", f"{where}: {error!r}", "fit one anew") from error
    if coefficients.shape != ((DEGREE + 1) * (DEGREE + 2) // 2 - 1, 3) or not 0 < steepest <= 1:
        raise BadTable(
            "20 rows of 3 coefficients and a steepest of 0…1",
            f"{where}: shape {coefficients.shape}, steepest {steepest}",
            "fit one anew",
        )
    return Shading(coefficients, steepest, provenance)
