"""A ball of known radius pressed into a gel, where its imprint's slope is known exactly.

The data from which shading and depth are calibrated. Knows nothing about either fit.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadTable
from taxel.foreign.archives import read_arrays

Archive = dict[str, NDArray[np.generic]]
_FIELDS = ("imgs", "f0", "touch_center", "touch_radius", "ball_radius_mm", "mm_per_px", "order")

TAXIM_BALL_RADIUS_MM = 2.0
"""Radius of the ball behind Taxim's archive `dataPack.npz`, which does not hold it. Source:
Taxim, Basics/sensorParams.py, `ball_radius = 4.00/2` beside `pixmm = 0.0295`."""
TAXIM_MM_PER_PX = 0.0295
"""At 640×480. Source: taxim 1.4.1, calib/gelsight_mini/params.json, `pixmm`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Press:
    """One image of a ball pressed into a gel."""

    image: NDArray[np.uint8]
    """Shape (height, width, 3), red first."""
    background: NDArray[np.uint8]
    """The same gel untouched, same shape."""
    centre_px: tuple[float, float]
    """Middle of the imprint (x, y), pixels."""
    radius_px: float
    """Radius of the contact circle, pixels."""
    ball_radius_mm: float
    """Radius of the ball, millimetres."""
    mm_per_px: float
    """Millimetres of gel that a pixel covers."""

    def __post_init__(self) -> None:
        if self.image.shape != self.background.shape or self.image.shape[2:] != (3,):
            raise ValueError(
                "needed an image and a background of one shape (height, width, 3); "
                f"got {self.image.shape} and {self.background.shape}"
            )
        if not 0 < self.radius_px * self.mm_per_px < self.ball_radius_mm:
            raise ValueError(
                f"needed a contact circle smaller than the ball, {self.ball_radius_mm} mm; "
                f"got {self.radius_px * self.mm_per_px:.2f} mm"
            )

    def offsets_mm(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return each pixel's (x, y) from the imprint's middle, millimetres, shape (h, w)."""
        height, width = self.image.shape[:2]
        x = (np.arange(width) - self.centre_px[0]) * self.mm_per_px
        y = (np.arange(height) - self.centre_px[1]) * self.mm_per_px
        across, down = np.meshgrid(x, y)
        return across, down

    def inside(self) -> NDArray[np.bool_]:
        """Return which pixels lie within the contact circle, shape (h, w)."""
        x, y = self.offsets_mm()
        return np.asarray(np.hypot(x, y) <= self.radius_px * self.mm_per_px)

    def gradient(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the slope (d depth/dx, d depth/dy) of the imprint, mm per mm, shape (h, w).

        Depth grows into the gel. Outside the contact circle the slope is not known: 0.
        """
        x, y = self.offsets_mm()
        inside = self.inside()
        height = np.sqrt(np.where(inside, self.ball_radius_mm**2 - x**2 - y**2, 1.0))
        return np.where(inside, -x / height, 0.0), np.where(inside, -y / height, 0.0)

    def depth_mm(self) -> NDArray[np.float64]:
        """Return the ball's depth below the contact circle, mm, shape (h, w), 0 outside."""
        x, y = self.offsets_mm()
        rim = self.ball_radius_mm**2 - (self.radius_px * self.mm_per_px) ** 2
        below = np.sqrt(np.maximum(self.ball_radius_mm**2 - x**2 - y**2, 0.0)) - np.sqrt(rim)
        return np.asarray(np.maximum(below, 0.0))


def read_presses(where: Path | str) -> list[Press]:
    """Return the ball presses of one archive, or of each `.npz` in a folder.

    An archive holds `imgs` (n, h, w, 3), `f0` (h, w, 3) the untouched gel, `touch_center`
    (n, 2) as (x, y) in pixels and `touch_radius` (n,) in pixels: Taxim's `dataPack.npz`, whose
    channels are blue first. One's own archives add `ball_radius_mm`, `mm_per_px` and
    `order` ("rgb" or "bgr"); without them Taxim's values are assumed.

    Raises:
        BadTable: There is no such file, or it lacks or misstates a field.
    """
    path = Path(where)
    files = sorted(path.glob("*.npz")) if path.is_dir() else [path]
    if not files or not files[0].is_file():
        raise BadTable(
            "a .npz of ball presses", f"nothing at {path}", "give an archive, or a folder of them"
        )
    return [press for file in files for press in _read_archive(file)]


def _read_archive(file: Path) -> list[Press]:
    try:
        return _presses(read_arrays(file, _FIELDS))
    except (OSError, ValueError, KeyError, TypeError, IndexError) as error:
        got = getattr(error, "got", error)
        raise BadTable(
            "an archive with imgs, f0, touch_center and touch_radius",
            f"{file.name}: {' '.join(str(got).split())}",
            "see read_presses for the fields",
        ) from error


def _presses(archive: Archive) -> list[Press]:
    order = str(archive["order"]) if "order" in archive else "bgr"
    if order not in ("rgb", "bgr"):
        raise ValueError(f"needed order rgb or bgr; got {order}")
    step = 1 if order == "rgb" else -1
    images, background = (
        np.ascontiguousarray(archive[name][..., ::step], dtype=np.uint8) for name in ("imgs", "f0")
    )
    return [
        Press(
            image=image,
            background=background,
            centre_px=(float(centre[0]), float(centre[1])),
            radius_px=float(radius),
            ball_radius_mm=_number(archive, "ball_radius_mm", TAXIM_BALL_RADIUS_MM),
            mm_per_px=_number(archive, "mm_per_px", TAXIM_MM_PER_PX),
        )
        for image, centre, radius in zip(
            images,
            archive["touch_center"].astype(float),
            archive["touch_radius"].astype(float),
            strict=True,
        )
    ]


def _number(archive: Archive, name: str, default: float) -> float:
    return float(archive[name].astype(float)) if name in archive else default
