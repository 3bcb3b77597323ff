"""Is this like anything learned? How strange a window and a contact are, and how rare that is.

A window is summed up by three numbers a channel: level, deviation and change. In the few
directions that tell the classes apart it has a density, and its strangeness is minus the
density's logarithm; a contact's is the mean over its windows. Held-out sessions say
how often known touch is as strange (conformal p-value). NumPy only: the same code
offline and live. Knows nothing about networks, sources or screens (docs/decisions/0027).
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

MOMENTS = 3
"""Of each channel: level, deviation, change."""
SMALLEST = 0.05
"""Deviation and change below this share of the usual one are as good as none. Source: our
choice, docs/decisions/0027."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Density:
    """How usual a window is, seen by one label: a Gaussian about each class's centre."""

    label: str
    """The label whose classes it was fitted to, such as "shape"."""
    projection: NDArray[np.float64]
    """Shape (3 · channels, k): onto the k directions that tell the classes apart, in units of
    the scatter within a class."""
    centres: NDArray[np.float64]
    """Shape (classes, k)."""
    log_share: NDArray[np.float64]
    """Shape (classes,): logarithm of each class's share of the training windows."""
    windows: NDArray[np.float64]
    """Strangeness of known windows in sessions held out, sorted."""
    contacts: Mapping[int, NDArray[np.float64]]
    """Number of windows → strangeness of so many windows at a known contact's start, sorted."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Unknown:
    """What a bundle stores to tell the unknown from the known."""

    rejected: float
    """Share of known touch that may be called unknown, 0…1."""
    lag: int
    """Rows between the two ends of a change."""
    level: NDArray[np.float64]
    """Shape (channels,): the usual level of scaled values."""
    wander: NDArray[np.float64]
    """Shape (channels,): how far a window's level usually lies from it."""
    least: NDArray[np.float64]
    """Shape (2, channels): variance and change, in units of `wander`, that are as good as none."""
    densities: tuple[Density, ...]
    """One a label: a joined target such as "shape+material" is told by its parts."""


class Strangeness:
    """The test of one bundle, ready to run.

    Args:
        unknown: What the bundle stores.
    """

    def __init__(self, unknown: Unknown) -> None:
        self.rejected = unknown.rejected
        self.labels = tuple(one.label for one in unknown.densities)
        self._lag = unknown.lag
        # 32 bits, as the windows come: a mixture with 64 would cost a small window half its time.
        self._level = unknown.level.astype(np.float32)
        self._per_wander = (1.0 / unknown.wander).astype(np.float32)
        self._least = unknown.least.astype(np.float32)
        self._densities = [
            (
                one.projection.astype(np.float32),
                one.centres.astype(np.float32),
                (one.log_share - 0.5 * (one.centres**2).sum(axis=1)).astype(np.float32),
            )
            for one in unknown.densities
        ]
        self._windows = [one.windows.tolist() for one in unknown.densities]
        self._contacts = [
            sorted((count, own.tolist()) for count, own in one.contacts.items())
            for one in unknown.densities
        ]
        self._sums: dict[int, NDArray[Any]] = {}

    def of_window(self, values: NDArray[np.float32]) -> list[float]:
        """Return a window's strangeness by each label, in nats up to a constant.

        Args:
            values: Scaled and measured rows only, shape (rows, channels), rows ≥ 1.
        """
        rows = (values - self._level) * self._per_wander
        summed = _transform(touch_moments(rows, self._lag, self._sums), self._least)
        found = []
        for projection, centres, constant in self._densities:
            z = summed @ projection
            near = (centres @ z + constant).tolist()
            top = max(near)
            total = math.log(sum([math.exp(one - top) for one in near]))
            found.append(0.5 * float(z @ z) - top - total)
        return found

    def p_window(self, strangeness: list[float]) -> float:
        """Return how often a known window is at least as strange, 0…1."""
        return _joined(map(p_value, self._windows, strangeness), len(strangeness))

    def p_contact(self, strangeness: list[float], windows: int) -> float:
        """Return how often a known contact is at least as strange, 0…1.

        Args:
            strangeness: Mean over its windows so far, by each label.
            windows: How many there are; ≥ 1.
        """
        each = []
        for known, own in zip(self._contacts, strangeness, strict=True):
            usual = known[0][1]
            for count, scores in known:
                usual = scores if count <= windows else usual
            each.append(p_value(usual, own))
        return _joined(each, len(each))


def touch_moments(rows: NDArray[Any], lag: int, sums: dict[int, NDArray[Any]]) -> NDArray[Any]:
    """Return mean, variance and mean absolute change of each channel, shape (3, channels).

    One matrix product instead of three means: it takes a third of the time of a small window.

    Args:
        rows: Shape (n, channels), n ≥ 1, of 32 or 64 bits.
        lag: Rows between the two ends of a change; a window of so few rows has no change.
        sums: Kept between calls: number of rows → the matrix that takes the means.
    """
    n = len(rows)
    changes = max(n - lag, 0)
    if n not in sums:
        sums[n] = np.zeros((MOMENTS, 2 * n + changes), rows.dtype)
        sums[n][0, :n] = sums[n][1, n : 2 * n] = 1.0 / n
        sums[n][2, 2 * n :] = 1.0 / max(changes, 1)
    stacked = np.empty((2 * n + changes, rows.shape[1]), rows.dtype)
    stacked[:n] = rows
    np.multiply(rows, rows, out=stacked[n : 2 * n])
    if changes:
        own = stacked[2 * n :]
        np.subtract(rows[lag:], rows[:-lag], out=own)
        np.absolute(own, out=own)
    moments: NDArray[Any] = sums[n] @ stacked
    moments[1] -= moments[0] * moments[0]
    return moments


def _transform(moments: NDArray[Any], least: NDArray[Any]) -> NDArray[Any]:
    """Return what the densities take, shape (3 · channels,): levels, log deviations, changes.

    Rounding may leave a variance a hair below 0.
    """
    np.maximum(moments[1], 0.0, out=moments[1])
    np.arcsinh(moments[0], out=moments[0])
    np.log(moments[1:] + least, out=moments[1:])
    return moments.ravel()


def summaries(
    values: NDArray[np.float32],
    mask: NDArray[np.bool_],
    level: NDArray[np.float64],
    wander: NDArray[np.float64],
    least: NDArray[np.float64],
    lag: int,
) -> NDArray[np.float64]:
    """Return what the densities take of many windows, shape (n, 3 · channels).

    Args:
        values: Scaled, shape (n, steps, channels).
        mask: Shape (n, steps).
        level: As in `Unknown`.
        wander: As above.
        least: As above.
        lag: As above.
    """
    sums: dict[int, NDArray[Any]] = {}
    return np.array([
        _transform(touch_moments((one[own] - level) / wander, lag, sums), least)
        for one, own in zip(values, mask, strict=True)
    ])  # fmt: skip


def p_value(known: list[float], strangeness: float) -> float:
    """Return (1 + how many known ones are at least as strange) / (1 + how many there are).

    For touch that is exchangeable with the known, it lies at or below any p with probability
    at most p. Source: split conformal prediction (Vovk, Gammerman, Shafer 2005).

    Args:
        known: Sorted.
        strangeness: Of the new one.
    """
    return (1 + len(known) - bisect_left(known, strangeness)) / (1 + len(known))


def _joined(each: Iterable[float], count: int) -> float:
    """Return one p-value for several labels: the least, times their number (Bonferroni)."""
    return min(1.0, count * min(each))


def unknown_to_json(unknown: Unknown) -> dict[str, Any]:
    """Return plain lists and numbers."""
    return {
        "rejected": unknown.rejected,
        "lag": unknown.lag,
        "level": unknown.level.tolist(),
        "wander": unknown.wander.tolist(),
        "least": unknown.least.tolist(),
        "densities": [
            {
                "label": one.label,
                "projection": one.projection.tolist(),
                "centres": one.centres.tolist(),
                "log_share": one.log_share.tolist(),
                "windows": one.windows.tolist(),
                "contacts": {str(count): own.tolist() for count, own in one.contacts.items()},
            }
            for one in unknown.densities
        ],
    }


def unknown_from_json(data: dict[str, Any]) -> Unknown:
    """Return what `unknown_to_json` was given.

    Raises:
        KeyError: A field is missing.
        ValueError: A list is no array.
    """
    densities = tuple(
        Density(
            label=one["label"],
            contacts={int(count): np.array(own, float) for count, own in one["contacts"].items()},
            **{
                name: np.array(one[name], float)
                for name in ("projection", "centres", "log_share", "windows")
            },
        )
        for one in data["densities"]
    )
    arrays = {name: np.array(data[name], float) for name in ("level", "wander", "least")}
    return Unknown(
        rejected=float(data["rejected"]), lag=int(data["lag"]), densities=densities, **arrays
    )
