"""Fit a gel's shading to ball presses, and measure it on presses left out.

The annotated middles of a press may be off by many pixels (Taxim's by up to 25: its 24 presses
were made at two places, its annotations at 24), so each is moved to where the shading fits
best. Only slopes within the contact circle are used.

    python -m taxel.gel.shading_fit PRESSES.npz SHADING.json "where the presses come from"

The shipped `shading_gelsight_mini.json` was made so from calib/gelsight_mini/dataPack.npz of
taxim 1.4.1.

Knows nothing about rendering.

Background of our choices: docs/decisions/0012.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadTable
from taxel.gel.presses import Press, read_presses
from taxel.gel.shading import Shading, clamped_normal, cv2, save_shading, terms
from taxel.plain_text import number_of

Array = NDArray[np.float64]

_BACKGROUND_BLUR_PX = 8.0
"""Takes the noise out of the untouched image. Source: our choice, far above grain, far below
the lamps' falloff."""
_RIDGE = 1.0
"""Against some 5000 pixels a press: only keeps the solution defined."""
_STEEPEST_PERCENTILE = 99.0
_ROUNDS = 3
"""Of moving the middles and fitting anew; the third moves none by more than 2 px."""
_SEARCH_STEPS_PX = (4.0, 2.0, 1.0)
"""Between the places that are tried for a press's middle, the coarsest first."""
_SEARCH_REACH = 3
"""Steps to either side of a middle that are tried at each size of step."""


def fit_shading(presses: Sequence[Press], provenance: str = "") -> Shading:
    """Return the shading that explains these presses best, least squares.

    Raises:
        BadTable: There are fewer than 3 presses.
    """
    if len(presses) < 3:
        raise BadTable("3 or more ball presses", f"{len(presses)}", "press the ball more often")
    return _fit(_without_grain(presses), provenance)


def _fit(presses: Sequence[Press], provenance: str = "") -> Shading:
    shading = _solve(presses, provenance)
    for _ in range(_ROUNDS):
        presses = [_centred(press, shading) for press in presses]
        shading = _solve(presses, provenance)
    return shading


def _centred(press: Press, shading: Shading) -> Press:
    """Return a press whose middle lies where the shading explains the image best."""
    for step in _SEARCH_STEPS_PX:
        shifts = np.arange(-_SEARCH_REACH, _SEARCH_REACH + 1) * step
        x, y = press.centre_px
        moved = [replace(press, centre_px=(x + i, y + j)) for i in shifts for j in shifts]
        press = min(moved, key=lambda offset: _mean_square(offset, shading))
    return press


def held_out_r2(presses: Sequence[Press], folds: int = 6) -> Array:
    """Return R² of red, green and blue over presses that the fit has not seen, shape (3,).

    Every `folds`-th press is left out in turn; of a press left out, only its middle (two
    numbers for some 5000 pixels) is found with the fitted shading.
    """
    presses = _without_grain(presses)
    left = np.zeros(3)
    total = np.zeros(3)
    for fold in range(folds):
        shading = _fit([p for i, p in enumerate(presses) if i % folds != fold])
        for press in (_centred(p, shading) for p in presses[fold::folds]):
            slopes, change = _pixels(press)
            left += ((slopes @ shading.coefficients - change) ** 2).sum(axis=0)
            total += ((change - change.mean(axis=0)) ** 2).sum(axis=0)
    return 1.0 - left / total


def _without_grain(presses: Sequence[Press]) -> list[Press]:
    """Return the presses with their backgrounds smoothed, each distinct one once."""
    smooth = {
        id(p.background): np.asarray(
            cv2.GaussianBlur(p.background, (0, 0), _BACKGROUND_BLUR_PX), np.uint8
        )
        for p in {id(p.background): p for p in presses}.values()
    }
    return [replace(press, background=smooth[id(press.background)]) for press in presses]


def _solve(presses: Sequence[Press], provenance: str) -> Shading:
    pairs = [_pixels(press) for press in presses]
    slopes = np.concatenate([pair[0] for pair in pairs])
    change = np.concatenate([pair[1] for pair in pairs])
    normal = slopes.T @ slopes + _RIDGE * np.eye(slopes.shape[1])
    steepest = float(np.percentile(np.hypot(slopes[:, 0], slopes[:, 1]), _STEEPEST_PERCENTILE))
    return Shading(np.linalg.solve(normal, slopes.T @ change), steepest, provenance)


def _mean_square(press: Press, shading: Shading) -> float:
    slopes, change = _pixels(press, every=4)
    return float(((slopes @ shading.coefficients - change) ** 2).mean())


def _pixels(press: Press, every: int = 1) -> tuple[Array, Array]:
    """Return (n, terms) of the slope and (n, 3) change of colour of each pixel in contact."""
    x, y = press.centre_px
    reach = press.radius_px + 1
    height, width = press.image.shape[:2]
    rows = slice(max(int(y - reach), 0), min(int(y + reach) + 2, height), every)
    columns = slice(max(int(x - reach), 0), min(int(x + reach) + 2, width), every)
    crop = replace(
        press,
        image=press.image[rows, columns],
        background=press.background[rows, columns],
        centre_px=((x - columns.start) / every, (y - rows.start) / every),
        radius_px=press.radius_px / every,
        mm_per_px=press.mm_per_px * every,
    )
    inside = crop.inside()
    gx, gy = crop.gradient()
    change = crop.image[inside].astype(np.float64) - crop.background[inside]
    return terms(*clamped_normal(gx[inside], gy[inside])), change


def main(arguments: Sequence[str]) -> None:
    """Fit the presses at the first path, write the shading to the second, say the rest."""
    presses = read_presses(arguments[0])
    r2 = ", ".join(f"{value:.3f}" for value in held_out_r2(presses))
    made = (
        f"taxel.gel.shading_fit on {number_of(len(presses), 'ball press')} of "
        f"{Path(arguments[0]).name}{''.join(f' ({word})' for word in arguments[2:])}; "
        f"R2 of red, green, blue on presses left out: {r2}"
    )
    save_shading(fit_shading(presses, made), Path(arguments[1]))
    print(made)


if __name__ == "__main__":
    main(sys.argv[1:])
