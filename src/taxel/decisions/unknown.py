"""Novelty scores of a window and of a contact, and their conformal p-values.

A window is summed up by three numbers a channel: level, deviation and change. In the few
directions that tell the classes apart it has a density, and its novelty score is minus the
density's logarithm; a contact's is the mean over its windows. Held-out sessions say
how often known touch scores as high (conformal p-value). NumPy only: the same code
offline and live. Knows nothing about networks, sources or screens (docs/decisions/0027).
"""

from __future__ import annotations

import math
import re
from bisect import bisect_left
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.foreign.json_text import Fields

MOMENTS = 3
"""Of each channel: level, deviation, change."""
SMALLEST = 0.05
"""Deviation and change below this share of the usual one are as good as none. Source: our
choice, docs/decisions/0027."""
_PLAIN_COUNT = re.compile(r"[1-9][0-9]{0,6}")


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
    """Novelty scores of known windows in sessions held out, sorted."""
    contacts: Mapping[int, NDArray[np.float64]]
    """Number of windows → novelty scores of so many windows at a known contact's start, sorted."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Unknown:
    """What a bundle stores to tell the unknown and the known apart."""

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
    """One a label: a joined target such as "shape+material" is predicted by its parts."""


class NoveltyTest:
    """The test of one bundle, ready to run.

    Args:
        unknown: What the bundle stores.
    """

    def __init__(self, unknown: Unknown) -> None:
        self.rejected = unknown.rejected
        self.labels = tuple(density.label for density in unknown.densities)
        self._unknown = unknown
        self._summaries: dict[int, Summary] = {}
        columns, self._parts, at = [], [], 0
        for density in unknown.densities:
            classes, k = density.centres.shape
            constant = density.log_share - 0.5 * (density.centres**2).sum(axis=1)
            columns += [density.projection @ density.centres.T, density.projection]
            self._parts.append((at, at + classes, at + classes + k, constant.tolist()))
            at += classes + k
        # All labels' projections in one product: a small array costs as much as a larger one.
        self._columns = np.concatenate(columns, axis=1).astype(np.float32)
        self._windows = [density.windows.tolist() for density in unknown.densities]
        self._contacts = [
            sorted((count, own.tolist()) for count, own in density.contacts.items())
            for density in unknown.densities
        ]

    def of_window(self, values: NDArray[np.float32]) -> list[float]:
        """Return a window's novelty score by each label, in nats up to a constant.

        NaN or infinity where values are NaN, or so large that their squares pass 32 bits.

        Args:
            values: Scaled and measured rows only, shape (rows, channels), rows ≥ 1.
        """
        n = len(values)
        if n not in self._summaries:
            self._summaries[n] = Summary(self._unknown, n, np.float32)
        with np.errstate(
            all="ignore"
        ):  # what is too large for 32 bits ends as NaN, which is reported
            found = (self._summaries[n].of(values) @ self._columns).tolist()
        each = []
        for start, middle, end, constants in self._parts:
            near = [a + b for a, b in zip(found[start:middle], constants, strict=True)]
            top = max(near)
            total = math.log(sum([math.exp(exponent - top) for exponent in near]))
            each.append(0.5 * sum([z * z for z in found[middle:end]]) - top - total)
        return each

    def p_window(self, novelty: list[float]) -> float:
        """Return how often a known window scores at least as high, 0…1."""
        return _joined(map(p_value, self._windows, novelty), len(novelty))

    def p_contact(self, novelty: list[float], windows: int) -> float:
        """Return how often a known contact scores at least as high, 0…1.

        Args:
            novelty: Mean over its windows so far, by each label.
            windows: How many there are; ≥ 1.
        """
        each = []
        for known, own in zip(self._contacts, novelty, strict=True):
            usual = known[0][1]
            for count, scores in known:
                usual = scores if count <= windows else usual
            each.append(p_value(usual, own))
        return _joined(each, len(each))


class Summary:
    """What the densities take of windows of one length; keeps its arrays between calls.

    Args:
        unknown: What the bundle stores.
        rows: Measured rows of a window, ≥ 1.
        kind: Of the numbers: 32 bits as windows come, 64 to fit.
    """

    def __init__(self, unknown: Unknown, rows: int, kind: type[np.floating[Any]]) -> None:
        channels, changes = len(unknown.level), max(rows - unknown.lag, 0)
        self._level = unknown.level.astype(kind)
        self._per_wander = (1.0 / unknown.wander).astype(kind)
        self._least = unknown.least.astype(kind)
        # Values, squares and changes stand in one array: one product takes all their means.
        stacked = np.zeros((2 * rows + changes, channels), kind)
        self._stacked = stacked
        self._values, self._squares = stacked[:rows], stacked[rows : 2 * rows]
        self._changes = stacked[2 * rows :]
        self._later, self._earlier = stacked[rows - changes : rows], stacked[:changes]
        self._means = np.zeros((MOMENTS, 2 * rows + changes), kind)
        self._means[0, :rows] = self._means[1, rows : 2 * rows] = 1.0 / rows
        self._means[2, 2 * rows :] = 1.0 / max(changes, 1)
        self._found = np.zeros((MOMENTS, channels), kind)
        self._level_row, self._variance, self._spread = (
            self._found[0], self._found[1], self._found[1:],
        )  # fmt: skip
        self._flat = self._found.reshape(-1)

    def of(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return level, log variance and log change, shape (3 · channels,); good until next call.

        Args:
            values: Scaled and measured, shape (rows, channels).
        """
        np.subtract(values, self._level, out=self._values)
        np.multiply(self._values, self._per_wander, out=self._values)
        np.multiply(self._values, self._values, out=self._squares)
        np.subtract(self._later, self._earlier, out=self._changes)
        np.absolute(self._changes, out=self._changes)
        np.matmul(self._means, self._stacked, out=self._found)
        self._variance -= self._level_row * self._level_row
        np.maximum(self._spread, 0.0, out=self._spread)  # rounding may leave a hair below 0
        np.arcsinh(self._level_row, out=self._level_row)
        self._spread += self._least
        np.log(self._spread, out=self._spread)
        return self._flat


def summaries(
    unknown: Unknown, values: NDArray[np.float32], mask: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Return what the densities take of many windows, shape (n, 3 · channels).

    Args:
        unknown: Its level, wander, least and lag.
        values: Scaled, shape (n, steps, channels).
        mask: Shape (n, steps).
    """
    kept: dict[int, Summary] = {}
    found = np.empty((len(values), MOMENTS * values.shape[2]))
    for number, (window, own) in enumerate(zip(values, mask, strict=True)):
        rows = int(own.sum())
        if rows not in kept:
            kept[rows] = Summary(unknown, rows, np.float64)
        found[number] = kept[rows].of(window[own])
    return found


def p_value(known: list[float], novelty: float) -> float:
    """Return (1 + how many known ones score at least as high) / (1 + how many there are).

    For touch that is exchangeable with the known, it lies at or below any p with probability
    at most p. Source: split conformal prediction (Vovk, Gammerman, Shafer 2005).

    Args:
        known: Sorted.
        novelty: Of the new one. NaN, which no known one can be, gives 0.
    """
    if novelty != novelty:
        return 0.0
    return (1 + len(known) - bisect_left(known, novelty)) / (1 + len(known))


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
                "label": density.label,
                "projection": density.projection.tolist(),
                "centres": density.centres.tolist(),
                "log_share": density.log_share.tolist(),
                "windows": density.windows.tolist(),
                "contacts": {str(count): own.tolist() for count, own in density.contacts.items()},
            }
            for density in unknown.densities
        ],
    }


def unknown_from_json(data: object) -> Unknown:
    """Return what `unknown_to_json` was given.

    Raises:
        ValueError: A field is missing, or no array of its shape, or out of its range.
    """
    given = Fields(data, "the test for the unknown")
    level = given.array("level", (None,))
    channels = len(level)
    wander, least = given.array("wander", (channels,)), given.array("least", (2, channels))
    if not (wander > 0).all() or not (least > 0).all():
        raise ValueError("wander or least is not above 0")
    densities = tuple(_density(entry, channels) for entry in given.items("densities"))
    if not densities:
        raise ValueError("the test for the unknown has no densities")
    return Unknown(
        rejected=given.number("rejected", 0.0, 1.0),
        lag=given.count("lag", 0, 10**6),
        level=level,
        wander=wander,
        least=least,
        densities=densities,
    )


def _density(data: object, channels: int) -> Density:
    given = Fields(data, "a density")
    centres = given.array("centres", (None, None))
    classes, k = centres.shape
    contacts = given.fields("contacts")
    counts = {name: int(name) for name in given.any("contacts") if _PLAIN_COUNT.fullmatch(name)}
    if not counts or len(counts) < len(given.any("contacts")) or not classes:
        raise ValueError("the contacts or centres of a density are none")
    return Density(
        label=given.text("label"),
        projection=given.array("projection", (MOMENTS * channels, k)),
        centres=centres,
        log_share=given.array("log_share", (classes,)),
        windows=given.array("windows", (None,)),
        contacts={count: contacts.array(name, (None,)) for name, count in counts.items()},
    )
