"""What a gel would look like untouched, guessed from one frame in touch.

A recording of a grasp mostly begins in touch, so no touch-free frame exists. Where nothing
touches, the gel's light changes slowly over the image; a smooth surface through it shows what
lies under the imprint too. Knows nothing about depth, movement or files.

Background of our choices: docs/decisions/0012.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from taxel.gel.contact import ink_mask
from taxel.gel.markers import Rgb, check_rgb

_WORK_WIDTH = 160
"""Pixels a row at which the light is fitted: it is smooth."""
_DEGREE = 4
"""Of the polynomial over the image: 3 misses the dark corners, 5 follows the imprint. Source: our
choice, on 16 simulated sensors whose bare gel is known: contact against the guess overlaps that
against the truth by 0.90 (least 0.56; degree 3: 0.85, 5: 0.62); 0.3 % of untouched
gel is called touch."""
_ROUNDS = 8
_LEAST_SPREAD = 0.02
"""Relative change of colour that is noise: below it, nothing is an outlier."""
_DIM = 4.0
"""Grey levels added before the logarithm, so that dark corners do not rule the fit."""


def bare_gel(rgb: Rgb) -> Rgb:
    """Return a guess of the same gel without touch and without dots, same shape.

    Fits the logarithm of each colour robustly (Cauchy weights): the larger part of the image
    must be untouched, or touched flat.

    Args:
        rgb: Shape (height, width, 3), red first.

    Raises:
        BadSource: The frame is no colour image.
    """
    check_rgb(rgb)
    height, width = rgb.shape[:2]
    small_size = (_WORK_WIDTH, max(8, round(height * _WORK_WIDTH / width)))
    small = np.asarray(cv2.resize(rgb, small_size, interpolation=cv2.INTER_AREA), np.uint8)
    smooth = cv2.GaussianBlur(small.astype(np.float32), (0, 0), 1.5)
    terms = _terms(*small.shape[:2])
    light = _fit(terms, np.log(smooth + _DIM), ink_mask(small) == 0)
    whole = cv2.resize(light.astype(np.float32), (width, height), interpolation=cv2.INTER_LINEAR)
    return np.asarray(np.clip(np.rint(whole), 0, 255), np.uint8)


def _terms(height: int, width: int) -> NDArray[np.float64]:
    """Return the polynomial's terms over an image, shape (height, width, terms)."""
    y, x = np.mgrid[-1 : 1 : height * 1j, -1 : 1 : width * 1j]
    powers = [(i, j) for i in range(_DEGREE + 1) for j in range(_DEGREE + 1 - i)]
    return np.stack([x**i * y**j for i, j in powers], axis=-1)


def _fit(
    terms: NDArray[np.float64], levels: NDArray[np.float32], bare: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Return the smooth light, grey levels, shape (height, width, 3).

    Args:
        terms: Shape (height, width, terms).
        levels: Shape (height, width, 3), logarithm of the grey levels + 4.
        bare: Shape (height, width): False on dots.
    """
    used = bare if bare.sum() > terms.shape[-1] else np.ones_like(bare)
    rows, wanted = terms[used][::2], levels[used][::2].astype(np.float64)
    trust = np.ones((len(rows), 1))
    weights: NDArray[np.floating] = np.zeros((terms.shape[-1], 3))
    for _ in range(_ROUNDS):
        weights = np.linalg.lstsq(rows * trust, wanted * trust, rcond=None)[0]
        left = np.abs(wanted - rows @ weights).max(axis=1)
        spread = max(1.4826 * float(np.median(left)), _LEAST_SPREAD)
        trust = 1 / (1 + (left[:, None] / spread) ** 2)
    return np.asarray(np.exp(terms @ weights) - _DIM)
