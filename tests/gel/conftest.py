"""A painted gel with dots at known sub-pixel places."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

Painter = Callable[..., NDArray[np.uint8]]


def grid(spacing_px: float, shape: tuple[int, int] = (240, 320)) -> NDArray[np.float64]:
    """Places of dots, shape (m, 2), x then y, none at the border."""
    half = spacing_px / 2
    x, y = (np.arange(half + 6, side - half, spacing_px) for side in (shape[1], shape[0]))
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def paint_gel(
    dots: NDArray[np.float64],
    *,
    diameter_px: float = 12.0,
    exposure: float = 1.0,
    noise: float = 0.0,
    seed: int = 0,
    shape: tuple[int, int] = (240, 320),
) -> NDArray[np.uint8]:
    """Return an uneven gel with soft dark dots; dots may lie outside."""
    y, x = np.mgrid[: shape[0], : shape[1]].astype(float)
    light = 1 - 0.3 * ((x / shape[1] - 0.5) ** 2 + (y / shape[0] - 0.4) ** 2) * 4
    image = light[..., None] * np.array([100.0, 115.0, 90.0]) * exposure
    darkness = np.zeros(shape)
    for at_x, at_y in dots:
        far = np.hypot(x - at_x, y - at_y)
        darkness = np.maximum(darkness, 1 / (1 + np.exp((far - diameter_px / 2) / 0.6)))
    image = image * (1 - 0.62 * darkness[..., None])
    image += noise * np.random.default_rng(seed).normal(size=image.shape)
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


@pytest.fixture(scope="session")
def paint() -> Painter:
    return paint_gel


@pytest.fixture(scope="session")
def dot_grid() -> Callable[..., NDArray[np.float64]]:
    return grid


@pytest.fixture(scope="session")
def gel_trials() -> Path:
    """The folder of real GelSight Mini trials, or skip."""
    data = os.environ.get("TAXEL_DATA", Path(__file__).parents[2] / "../shared/data")
    trials = Path(data) / "gelsight-slip" / "trials"
    if not trials.is_dir():
        pytest.skip(f"no real recordings at {trials}; set TAXEL_DATA to have them read")
    return trials
