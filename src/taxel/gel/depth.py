"""Slope, normals and depth of what touches a gel, from the change of its colours.

Each lamp lights slopes that face it, so three colours give a slope's two
components. The inverse, from relative change of colour to slope, is a cubic
fitted on presses of a ball of known radius. Depth is the slope's Poisson
integral. Depth grows into the gel; x to the right, y down. Knows nothing about
markers' movement, force or files other than its own coefficients.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib import resources
from itertools import combinations_with_replacement

import cv2
import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadDataset
from taxel.gel.colour_change import colour_change
from taxel.gel.integration import Gradient, depth_from_gradients, normals_of
from taxel.gel.markers import Rgb
from taxel.gel.presses import Press
from taxel.gel.scale import ROW_PX

_DEGREE = 3
_CENTRING_MM = 0.35
"""Furthest that a marked middle is moved: Taxim's marks are up to this far off."""
_RIDGE = 1e-3
"""Of the features' mean square: keeps the cubic tame where no press has been."""
_SKIRT = 2.2
"""Contact radii beyond which the gel is taken as flat; between 1 and this its slope is unknown."""
_BARE_SHARE = 0.5
"""Weight of all flat pixels against all pixels in contact."""
_STEEPEST = 1.5
"""Largest slope that is believed, mm per mm; the calibration's steepest is about 1.3."""
_COEFFICIENTS = "depth.json"
_TERMS = [
    term
    for degree in range(1, _DEGREE + 1)
    for term in combinations_with_replacement(range(3), degree)
]
"""Which colours are multiplied, a term; no constant: no change is no slope."""


@dataclass(frozen=True, slots=True)
class FitCheck:
    """How well a model says the slope and the depth of presses it was not fitted on."""

    r2_x: float
    """Of the slope along x in contact, unitless; 1 is perfect."""
    r2_y: float
    """Of the slope along y in contact."""
    depth_error_mm: float
    """Median over presses of the mean absolute error of depth in contact, mm."""
    depth_mm: float
    """Median over presses of the true greatest depth below the contact circle, mm."""
    presses: int
    """How many were checked."""


@dataclass(frozen=True, slots=True)
class DepthModel:
    """A cubic from relative change of colour to slope."""

    weights: NDArray[np.float32]
    """Shape (19, 2): a row a term of `terms`, columns slope along x and y."""
    provenance: str
    """What it was fitted on."""

    @staticmethod
    def fit(presses: Sequence[Press], provenance: str = "own presses") -> DepthModel:
        """Return the model that fits ball presses best (ridge regression).

        Args:
            presses: At least two, better twenty over the whole gel.
            provenance: What they are, in words.

        Raises:
            BadDataset: There are fewer than two presses.
        """
        if len(presses) < 2:
            raise BadDataset(
                "at least 2 ball presses", f"{len(presses)}", "press a ball in more places"
            )
        weights = _solve([_at_working_size(press) for press in presses])
        return DepthModel(weights, provenance)

    def centred(self, press: Press) -> Press:
        """Return a press with its middle moved to where the slopes found fit the ball best.

        People mark the middle of an imprint some tenths of a millimetre off,
        which `check` counts as the model's error. Looks within `_CENTRING_MM`
        of the mark. (Fitting again on such presses changes nothing: tried.)
        """
        press = _at_working_size(press)
        found = self.gradients(press.image, press.background)
        reach = int(_CENTRING_MM / press.mm_per_px)
        steps = range(-reach, reach + 1)
        x, y = press.centre_px
        moved = [replace(press, centre_px=(x + a, y + b)) for a in steps for b in steps]
        return min(moved, key=lambda guess: _misfit(guess, *found))

    @staticmethod
    def shipped() -> DepthModel:
        """Return the model fitted on the 24 presses of a GelSight Mini that `taxim` carries.

        Source: taxim 1.4.1 (MIT), by `DepthModel.fit(read_presses(dataPack.npz)).to_json()`.
        All its presses lie near the gel's middle;
        relative change carries it to the rims.
        """
        text = resources.files("taxel.gel").joinpath(_COEFFICIENTS).read_text("utf-8")
        stored = json.loads(text)
        return DepthModel(np.array(stored["weights"], np.float32), stored["provenance"])

    def to_json(self) -> str:
        """Return the coefficients as the text that `shipped` reads."""
        rows = [[round(float(value), 6) for value in row] for row in self.weights]
        return json.dumps({"provenance": self.provenance, "weights": rows}, indent=1) + "\n"

    def gradients(self, rgb: Rgb, reference: Rgb) -> tuple[Gradient, Gradient]:
        """Return the slope of the gel's surface, d depth/dx and d depth/dy, mm per mm.

        Args:
            rgb: Shape (height, width, 3), red first.
            reference: The same gel untouched, same shape.

        Returns:
            Two arrays of shape (height, width); positive where it gets deeper
            to the right and downwards.

        Raises:
            BadSource: Shapes differ, or are none of colour images.
        """
        slope = self._slopes(colour_change(rgb, reference))
        return slope[..., 0], slope[..., 1]

    def _slopes(self, change: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return slopes, shape (h, w, 2), of a change of colour, shape (h, w, 3)."""
        planes = [np.ascontiguousarray(change[..., i]) for i in range(3)]
        slope = np.zeros((*change.shape[:2], 2), np.float32)
        products: dict[tuple[int, ...], NDArray[np.float32]] = {}
        for term, (along_x, along_y) in zip(_TERMS, self.weights, strict=True):
            value = planes[term[-1]]
            if len(term) > 1:
                value = products[term[:-1]] * value
            products[term] = value
            slope[..., 0] += along_x * value
            slope[..., 1] += along_y * value
        return np.clip(slope, -_STEEPEST, _STEEPEST)

    def normals(self, rgb: Rgb, reference: Rgb) -> NDArray[np.float32]:
        """Return unit normals of the gel's surface, out of the gel, shape (height, width, 3).

        Columns are x, y and z; (0, 0, 1) is flat. Arguments and errors as `gradients`.
        """
        return normals_of(*self.gradients(rgb, reference))

    def depth_mm(self, rgb: Rgb, reference: Rgb, mm_per_px: float) -> NDArray[np.float32]:
        """Return how deep the gel is pressed in, mm, shape (height, width).

        Arguments and errors as `gradients` and `depth_from_gradients`.
        """
        return depth_from_gradients(*self.gradients(rgb, reference), mm_per_px)

    def check(self, presses: Sequence[Press]) -> FitCheck:
        """Return the errors of slope and depth on ball presses; use presses left out of the fit."""
        truth, predicted, errors, depths = [], [], [], []
        for press in map(_at_working_size, presses):
            inside, (gx, gy) = press.inside(), press.gradient()
            found = self.gradients(press.image, press.background)
            truth.append(np.stack([gx[inside], gy[inside]]))
            predicted.append(np.stack([part[inside] for part in found]))
            depth, true = depth_from_gradients(*found, press.mm_per_px), press.depth_mm()
            level = float(np.mean(depth[inside]) - np.mean(true[inside]))
            errors.append(float(np.mean(np.abs(depth[inside] - level - true[inside]))))
            depths.append(float(true.max()))
        all_true, all_predicted = np.concatenate(truth, axis=1), np.concatenate(predicted, axis=1)
        left = ((all_true - all_predicted) ** 2).sum(axis=1)
        spread = ((all_true - all_true.mean(axis=1, keepdims=True)) ** 2).sum(axis=1)
        r2 = 1 - left / spread
        error, depth_mm = float(np.median(errors)), float(np.median(depths))
        return FitCheck(float(r2[0]), float(r2[1]), error, depth_mm, len(presses))


def _at_working_size(press: Press) -> Press:
    """Return a press at 320 pixels a row."""
    height, width = press.image.shape[:2]
    if width == ROW_PX:
        return press
    shrink = width / ROW_PX
    size = (ROW_PX, round(height / shrink))
    image, background = (
        np.asarray(cv2.resize(part, size, interpolation=cv2.INTER_AREA), np.uint8)
        for part in (press.image, press.background)
    )
    x, y = ((value + 0.5) / shrink - 0.5 for value in press.centre_px)
    return Press(
        image=image,
        background=background,
        centre_px=(x, y),
        radius_px=press.radius_px / shrink,
        ball_radius_mm=press.ball_radius_mm,
        mm_per_px=press.mm_per_px * shrink,
    )


def _solve(presses: Sequence[Press]) -> NDArray[np.float32]:
    """Return the ridge regression's weights, shape (19, 2)."""
    square, product = np.zeros((len(_TERMS), len(_TERMS))), np.zeros((len(_TERMS), 2))
    for press in presses:
        features, slopes, weight = _equations(press)
        square += features.T @ (features * weight[:, None])
        product += features.T @ (slopes * weight[:, None])
    square += _RIDGE * np.diag(np.diag(square))
    return np.asarray(np.linalg.solve(square, product), np.float32)


def _misfit(press: Press, gx: Gradient, gy: Gradient) -> float:
    """Return the mean squared difference to the ball's slopes in contact."""
    inside, (true_x, true_y) = press.inside(), press.gradient()
    return float(((gx - true_x)[inside] ** 2 + (gy - true_y)[inside] ** 2).mean())


def _equations(
    press: Press,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return features (n, 19), slopes (n, 2) and weights (n,) of a press's known pixels."""
    inside = press.inside()
    x_mm, y_mm = press.offsets_mm()
    bare = np.hypot(x_mm, y_mm) > _SKIRT * press.radius_px * press.mm_per_px
    known = inside | bare
    change = colour_change(press.image, press.background)[known].astype(np.float64)
    features = np.stack([change[:, list(term)].prod(axis=1) for term in _TERMS], axis=1)
    slopes = np.stack([part[known] for part in press.gradient()], axis=1)
    weight = np.where(inside[known], 1.0, _BARE_SHARE * inside.sum() / max(1, bare.sum()))
    return features, slopes, weight
