"""Fit force-to-voltage curves, give their intervals, and judge them on presses held out.

Knows nothing about recordings, baselines or time.

Background of our choices: docs/decisions/0022.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from taxel.calibration.curves import FORMS, Curve, Form, volts_of
from taxel.plain_text import number_of

FEWEST_PRESSES = 5
"""A curve of three parameters needs more presses than it has parameters; then an error can
be estimated at all. Our choice."""
FEWEST_FORCES = 3
"""Forces that differ by 10 % or more. Our choice."""
BANDS = 8
"""Forces are put in at most so many bands to be held out whole. Our choice."""
DRAWS = 200
"""Bootstrap draws: enough for two digits of a 95 % interval. Our choice."""
_STEPS = 20
"""Steps of a draw: it starts next to its answer. Our choice."""
_DAMPING = 1e-3
"""Relative, at the first of these steps. Our choice."""

Forces = NDArray[np.float64]
Volts = NDArray[np.float64]


class NoCurve(ValueError):
    """These presses give no rising curve; the message says why."""


def fit_curve(form: Form, force_n: Forces, volts: Volts) -> Curve:
    """Return the least-squares curve of presses.

    Args:
        form: Which.
        force_n: Shape (presses,), newtons.
        volts: Shape (presses,), volts above the baseline.

    Raises:
        NoCurve: Too few presses, or volts that do not rise with force.
    """
    if len(force_n) < len(FORMS[form]) or distinct(force_n) < 2:
        raise NoCurve(
            f"{number_of(len(force_n), 'press')} at {number_of(distinct(force_n), 'force')}"
        )
    try:
        slope, offset = np.polyfit(force_n, volts, 1)
        line = Curve(form="line", parameters=(float(offset), float(slope)))
        if form == "line":
            return line
        found = _solve(form, _start(form, force_n, volts), force_n, volts)
        return Curve(form=form, parameters=tuple(map(float, np.exp(found))))
    except ValueError as error:
        raise NoCurve("volts do not rise with force") from error


def _start(form: Form, force_n: Forces, volts: Volts) -> NDArray[np.float64]:
    """Return logarithms of parameters to begin with."""
    top = float(np.max(volts))
    if top <= 0:
        raise ValueError("no volts above the baseline")
    if form == "power":
        return np.log([max(float(np.median(volts)), top / 10) / float(np.median(force_n)), 0.7])
    half = force_n[int(np.argmin(np.abs(volts - 0.63 * top)))]
    return np.log([1.05 * top, max(float(half), 1e-3), 0.8])


def _solve(
    form: Form, start: NDArray[np.float64], force_n: Forces, volts: Volts
) -> NDArray[np.float64]:
    """Return logarithms of the best parameters: all are positive in these forms."""
    # Bounds keep a curve without a bend from running to infinity: top at most 100 times the
    # largest volts, exponents 0.1 to 5.
    low, high = start - math.log(100.0), start + math.log(100.0)
    low[-1], high[-1] = math.log(0.1), math.log(5.0)

    def errors(parameters: NDArray[np.float64]) -> NDArray[np.float64]:
        return volts_of(form, np.exp(parameters), force_n) - volts

    def jacobian(parameters: NDArray[np.float64]) -> NDArray[np.float64]:
        return _jacobian(form, parameters, force_n)

    inside = np.clip(start, low + 1e-6, high - 1e-6)
    if len(volts) >= len(start):
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            try:  # ten times as fast, and knows no bounds
                free = least_squares(errors, inside, jac=jacobian, method="lm", max_nfev=100)
            except ValueError:  # it ran to infinity
                free = None
        if free is not None and free.success and (low < free.x).all() and (free.x < high).all():
            return np.asarray(free.x)
    return np.asarray(
        least_squares(errors, inside, jac=jacobian, bounds=(low, high), max_nfev=200).x
    )


def _jacobian(form: Form, logs: NDArray[np.float64], force_n: Forces) -> NDArray[np.float64]:
    """Return dV/d(log of each parameter), shape (…, presses, parameters).

    Args:
        form: power or saturating.
        logs: Logarithms of the parameters, shape (…, parameters).
        force_n: Shape (presses,).
    """
    first, last = np.exp(logs[..., 0, None]), np.exp(logs[..., -1, None])
    if form == "power":
        volts = first * force_n**last
        return np.stack([volts, volts * last * np.log(force_n)], axis=-1)
    ratio = force_n / np.exp(logs[..., 1, None])
    x = ratio**last
    bend = first * np.exp(-x) * x * last
    return np.stack([-first * np.expm1(-x), -bend, bend * np.log(ratio)], axis=-1)


def choose_form(presses: Sequence[tuple[Forces, Volts]]) -> tuple[Form, dict[Form, float]]:
    """Return the form that fits all sensors best by AICc summed over them, and each one's sum.

    One form for an array: sensors of one make are alike, and a form chosen for each by
    itself would follow its noise. Sensors whose volts do not rise have no form, so they
    do not count.
    """
    rising = [
        (force_n, volts) for force_n, volts in presses if np.polyfit(force_n, volts, 1)[0] > 0
    ]
    scores: dict[Form, float] = {}
    for form in FORMS:
        total = 0.0
        for force_n, volts in rising:
            try:
                curve = fit_curve(form, force_n, volts)
            except NoCurve:
                total += 1e6
                continue
            n, k = len(volts), len(curve.parameters) + 1
            residual = max(float(np.mean((curve.volts(force_n) - volts) ** 2)), 1e-18)
            correction = 2 * k * (k + 1) / (n - k - 1) if n > k + 1 else 1e3
            total += n * math.log(residual) + 2 * k + correction
        scores[form] = total
    return min(scores, key=lambda form: scores[form]), scores


def r_squared(curve: Curve, force_n: Forces, volts: Volts) -> float:
    """Return the share of the variance of `volts` that the curve explains, at most 1."""
    spread = float(np.sum((volts - volts.mean()) ** 2))
    return 1.0 - float(np.sum((curve.volts(force_n) - volts) ** 2)) / max(spread, 1e-18)


def band(
    curve: Curve,
    force_n: Forces,
    volts: Volts,
    grid_n: Forces,
    rng: np.random.Generator,
    draws: int = DRAWS,
) -> tuple[Volts, Volts]:
    """Return the curve's 95 % confidence band at `grid_n`, volts: presses drawn anew."""
    index = rng.integers(0, len(force_n), (draws, len(force_n)))
    weight = np.stack([np.bincount(draw, minlength=len(force_n)) for draw in index]).astype(float)
    if curve.form == "line":
        drawn = _weighted_lines(force_n, volts, weight)
    else:
        drawn = _refit(curve, force_n, volts, weight)
    at_grid = np.stack([volts_of(curve.form, constants, grid_n) for constants in drawn])
    at_grid = at_grid[np.isfinite(at_grid).all(axis=1)]
    if len(at_grid) < draws // 2:
        nothing = np.full(len(grid_n), np.nan)
        return nothing, nothing
    low, high = np.percentile(at_grid, [2.5, 97.5], axis=0)
    return low, high


def _weighted_lines(force_n: Forces, volts: Volts, weight: NDArray[np.float64]) -> Volts:
    """Return offset and slope of each draw, shape (draws, 2)."""
    total = weight.sum(axis=1)
    f, v = weight @ force_n / total, weight @ volts / total
    spread = weight @ force_n**2 / total - f**2
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = (weight @ (force_n * volts) / total - f * v) / spread
    return np.stack([v - slope * f, slope], axis=1)


def _refit(
    curve: Curve, force_n: Forces, volts: Volts, weight: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the parameters of each draw, shape (draws, parameters): Levenberg–Marquardt steps
    from the curve of all presses, for all draws at once; a step that is no better is not taken.
    """
    logs = np.tile(np.log(curve.parameters), (len(weight), 1))
    centre, damping = logs[0], np.full(len(weight), _DAMPING)

    def left(parameters: NDArray[np.float64]) -> tuple[Volts, Volts]:
        fitted = np.stack(
            [volts_of(curve.form, constants, force_n) for constants in np.exp(parameters)]
        )
        return volts - fitted, np.einsum("dp,dp->d", weight, (volts - fitted) ** 2)

    off, loss = left(logs)
    for _ in range(_STEPS):
        slopes = _jacobian(curve.form, logs, force_n)
        weighted = slopes * weight[..., None]
        normal = np.einsum("dpi,dpj->dij", weighted, slopes)
        side = np.einsum("dpi,dp->di", weighted, off)
        scale = np.einsum("dii->di", normal) + 1e-12 * np.trace(normal, axis1=1, axis2=2)[:, None]
        damped = normal + np.eye(logs.shape[1]) * (damping[:, None] * scale + 1e-300)[..., None]
        step = np.linalg.solve(damped, side[..., None])[..., 0]
        # No draw wanders further than a factor of 100, as in the fit itself.
        tried = np.clip(logs + np.clip(step, -0.5, 0.5), centre - 4.6, centre + 4.6)
        off_there, loss_there = left(tried)
        better = loss_there <= loss
        logs[better], off[better], loss[better] = (
            tried[better],
            off_there[better],
            loss_there[better],
        )
        damping = np.where(better, damping / 5.0, damping * 5.0)
    return np.asarray(np.exp(logs))


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldOut:
    """Newtons by a curve for presses that it was not fitted on, beside a straight line's."""

    force_n: Forces
    """Shape (presses,), what the gauge showed."""
    curve_n: Forces
    """What the curve of the other presses says, kept within the calibrated forces."""
    line_n: Forces
    """What a straight line through the other presses says: the trivial baseline."""

    def only(self, mask: NDArray[np.bool_]) -> HeldOut:
        """Return some of the presses; `mask` has the shape (presses,)."""
        return HeldOut(
            force_n=self.force_n[mask], curve_n=self.curve_n[mask], line_n=self.line_n[mask]
        )


def hold_out(form: Form, force_n: Forces, volts: Volts, folds: NDArray[np.int64]) -> HeldOut:
    """Return the forces of each fold's presses by the curve of all others.

    A fold whose curve cannot be fitted gives nothing: NaN.

    Args:
        form: Which.
        force_n: Shape (presses,).
        volts: Shape (presses,).
        folds: Shape (presses,): which fold each press is held out in.
    """
    by_curve, line = np.full(len(force_n), np.nan), np.full(len(force_n), np.nan)
    for fold in np.unique(folds):
        out = folds == fold
        for kind, into in ((form, by_curve), ("line", line)):
            try:
                curve = fit_curve(kind, force_n[~out], volts[~out])
            except NoCurve:
                continue
            into[out] = np.minimum(curve.force_n(volts[out]), force_n[~out].max())
    return HeldOut(force_n=force_n, curve_n=by_curve, line_n=line)


def bands_of(force_n: Forces) -> NDArray[np.int64]:
    """Return which band of like forces each press belongs to, from 0, at most `BANDS`.

    Forces that lie within 10 % of the one before them share a band.

    Args:
        force_n: Shape (presses,), at least one.

    Returns:
        Shape (presses,).
    """
    order = np.argsort(force_n, kind="stable")
    ranked = force_n[order]
    new = np.concatenate([[False], ranked[1:] > ranked[:-1] * 1.1])
    bands = np.cumsum(new)
    if bands[-1] >= BANDS:
        bands = bands * BANDS // (bands[-1] + 1)
    elif bands[-1] == 0:
        bands = np.arange(len(ranked)) * min(BANDS, len(ranked)) // len(ranked)
    placed = np.zeros(len(force_n), np.int64)
    placed[order] = bands
    return placed


def distinct(force_n: Forces) -> int:
    """Return how many forces there are that differ by more than 10 %."""
    if len(force_n) == 0:
        return 0
    ranked = np.sort(force_n)
    return 1 + int(np.sum(ranked[1:] > ranked[:-1] * 1.1))


def mean_error(
    predicted_n: Forces, force_n: Forces, rng: np.random.Generator, draws: int = DRAWS
) -> tuple[float, float, float]:
    """Return the mean absolute error and its 95 % interval, newtons: presses drawn anew.

    NaN where nothing was measured.
    """
    errors = np.abs(predicted_n - force_n)
    errors = errors[np.isfinite(errors)]
    if len(errors) == 0:
        return math.nan, math.nan, math.nan
    means = errors[rng.integers(0, len(errors), (draws, len(errors)))].mean(axis=1)
    low, high = np.percentile(means, [2.5, 97.5])
    return float(errors.mean()), float(low), float(high)
