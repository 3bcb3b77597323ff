"""How poses that are followed in images differ from the true ones: fitted, then added.

What a warning learns from are simulated poses, a hundredfold faster than images; they must be as
wrong as those that images give. From pours of training cups that were rendered, each gel's errors
are taken apart: gain, what a turn adds to the shift, slow drift, noise of an image. Each row of
these is one gel as it was, so that what goes together stays together. Knows nothing about
learning or thresholds.

Source: docs/decisions/0036.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadDataset
from taxel.training.slip.cups import GelRows, PourRows, by_rim
from taxel.windows.rest import SETTLE

DRIFT_S: Final = 0.7
"""Time over which drift forgets itself, seconds. Source: our choice."""
_FITTED_UM: Final = 1000.0
"""Slip up to which errors are looked at, micrometres."""
_SETTLED_S: Final = 0.4
_TURNS_RAD: Final = 0.03
"""A gel that turned less shows no gain: it takes the usual one."""
_MOVES_MM: Final = 0.05
"""Likewise of one that moved less along an axis."""
Values = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class GelNoise:
    """Errors of one gel's poses; object first, then gel; shapes (2, 3): x, y (mm), turn (rad)."""

    gain: Values
    """Followed over true motion."""
    by_turn: Values
    """Shift that a true turn adds, mm a rad; the turn's own is 0."""
    drift: Values
    """Standard deviation."""
    white: Values
    """Standard deviation, new in each image."""


def fit_noise(seen: Sequence[PourRows], true: Sequence[PourRows]) -> list[GelNoise]:
    """Return the errors of each gel of some pours.

    Args:
        seen: Followed in images.
        true: The same pours' own poses.

    Raises:
        BadDataset: Too few images to fit to.
    """
    found = []
    for followed, truth in zip(seen, true, strict=True):
        for rows, own in zip(followed.gels, truth.gels, strict=True):
            noise = _fit_gel(rows, own, truth)
            if noise is not None:
                found.append(noise)
    if not found:
        raise BadDataset("rendered pours of at least 1 s before their slip", "none", "add some")
    gains = np.stack([noise.gain for noise in found])
    known = np.isfinite(gains)
    usual = np.ones(gains.shape[1:])
    for place in np.ndindex(usual.shape):
        if known[:, *place].any():
            usual[place] = np.median(gains[:, *place][known[:, *place]])
    return [replace(n, gain=np.where(np.isfinite(n.gain), n.gain, usual)) for n in found]


def settle(rows: GelRows) -> GelRows:
    """Return poses against those of the settled grasp, as a follower's reference makes them."""
    first = sorted(set(rows.shown[SETTLE].tolist()))
    return replace(
        rows,
        object=rows.object - np.median(rows.object[first], axis=0),
        gel=rows.gel - np.median(rows.gel[first], axis=0),
    )


@dataclass(frozen=True, slots=True)
class PoseNoise:
    """Errors of the poses of several gels, in the same order."""

    inside: list[GelNoise]
    """Object, and gel inside the contact."""
    rim: list[GelNoise]
    """Object, and gel around the contact's rim."""


def fit_noises(seen: Sequence[PourRows], true: Sequence[PourRows]) -> PoseNoise:
    """Return the errors of each gel of some pours, inside the contact and around its rim.

    Args:
        seen: Followed in images.
        true: The same pours' own poses.

    Raises:
        BadDataset: Too few images to fit to.
    """
    return PoseNoise(fit_noise(seen, true), fit_noise(by_rim(seen), by_rim(true)))


def add_noise(pour: PourRows, noise: PoseNoise, random: np.random.Generator) -> PourRows:
    """Return a pour's poses as images might have given them.

    Args:
        pour: With its own poses.
        noise: Of which each gel draws one gel's errors.
        random: Where numbers come from.
    """
    gels = []
    for rows, around in zip(pour.gels, by_rim([pour])[0].gels, strict=True):
        drawn = int(random.integers(len(noise.inside)))
        inside = _worsen(settle(rows), noise.inside[drawn], random)
        rim = _worsen(settle(around), noise.rim[drawn], random)
        gels.append(replace(inside, rim=rim.gel))
    return replace(pour, gels=(gels[0], gels[1]))


def _fit_gel(rows: GelRows, own: GelRows, truth: PourRows) -> GelNoise | None:
    """Return one gel's errors; None where it slipped too soon to measure."""
    count = len(rows.taken_s)
    slip_um = np.interp(rows.taken_s, truth.time_s, truth.slip_um)
    used = (rows.taken_s > _SETTLED_S) & (slip_um < _FITTED_UM) & rows.seen
    used &= np.interp(rows.taken_s, truth.time_s, truth.dropped.astype(float)) == 0
    if used.sum() < 15:
        return None
    mine, exact = settle(rows), settle(own)
    parts = []
    for followed, moved in ((mine.object, exact.object[:count]), (mine.gel, exact.gel[:count])):
        parts.append(_fit_one(followed[used], moved[used]))
    gain, by_turn, drift, white = (np.stack(each) for each in zip(*parts, strict=True))
    return GelNoise(gain, by_turn, drift, white)


def _fit_one(followed: Values, moved: Values) -> tuple[Values, Values, Values, Values]:
    gain, by_turn = np.full(3, np.nan), np.zeros(3)
    left = followed - moved
    turn = moved[:, 2]
    turns = float(np.ptp(turn)) > _TURNS_RAD
    for axis in range(3):
        columns = [moved[:, axis]] if np.ptp(moved[:, axis]) > _MOVES_MM or axis == 2 else []
        own = bool(columns) if axis < 2 else turns
        if axis < 2 and turns:
            columns = [*columns, turn]
        if not columns or (axis == 2 and not turns):
            continue
        matrix = np.stack(columns, axis=1)
        scale = np.maximum(np.abs(matrix).max(axis=0), 1e-9)
        ridge = 1e-4 * len(matrix) * np.eye(matrix.shape[1])
        unit = matrix / scale
        solved = np.linalg.solve(unit.T @ unit + ridge, unit.T @ left[:, axis]) / scale
        if own:
            gain[axis] = 1 + solved[0]
        if axis < 2 and turns:
            by_turn[axis] = solved[-1]
        left[:, axis] -= matrix @ solved
    white = np.std(np.diff(left, axis=0), axis=0) / np.sqrt(2)
    drift = np.sqrt(np.maximum(np.mean(left**2, axis=0) - white**2, 0))
    return gain, by_turn, drift, white


def _worsen(rows: GelRows, noise: GelNoise, random: np.random.Generator) -> GelRows:
    count = len(rows.taken_s)
    keep = np.exp(-np.diff(rows.taken_s, prepend=rows.taken_s[0]) / DRIFT_S)
    kicks = random.normal(size=(count, 2, 3))
    slow = np.zeros((count, 2, 3))
    state = np.zeros((2, 3))  # a follower starts without error: its reference is what it saw
    for index in range(count):
        state = keep[index] * state + np.sqrt(1 - keep[index] ** 2) * kicks[index]
        slow[index] = state
    error = slow * noise.drift + random.normal(size=(count, 2, 3)) * noise.white
    both = []
    for part, moved in enumerate((rows.object, rows.gel)):
        worse = moved * noise.gain[part] + moved[:, 2:] * noise.by_turn[part]
        both.append(worse + error[:, part])
    return replace(rows, object=both[0], gel=both[1])
