"""A force-to-voltage curve: three forms, each with its inverse and its slope.

Pure functions of numbers. Knows nothing about fits, sensors or time.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

Form = Literal["line", "power", "saturating"]
FORMS: dict[Form, tuple[str, ...]] = {
    "line": ("offset_v", "slope_v_per_n"),
    "power": ("scale_v", "exponent"),
    "saturating": ("top_v", "force_n", "exponent"),
}
"""Form → names of its parameters.

line: V = offset + slope·F. power: V = scale·F^exponent. saturating: V = top·(1 −
exp(−(F / force)^exponent)), a power law at small forces that ends at a top. Source: contact
area of a soft pad grows with force until it is full (docs/explanation/physics-teng:
S = 1 − exp(−F/α), which is exponent 1); docs/decisions/0022.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Curve:
    """Volts above the baseline as a function of newtons; strictly rising."""

    form: Form
    parameters: tuple[float, ...]
    """In the order of `FORMS`, volts and newtons."""

    def __post_init__(self) -> None:
        names = FORMS[self.form]
        if len(self.parameters) != len(names) or not all(map(math.isfinite, self.parameters)):
            raise ValueError(f"needed {', '.join(names)} as finite numbers; got {self.parameters}")
        rising = self.parameters[1:] if self.form == "line" else self.parameters
        if min(rising) <= 0:
            raise ValueError(f"needed a curve that rises; got {self.named()}")

    def named(self) -> dict[str, float]:
        """Return the parameters by name."""
        return dict(zip(FORMS[self.form], self.parameters, strict=True))

    @staticmethod
    def of(form: Form, named: Mapping[str, float]) -> Curve:
        """Return the curve that `named` described.

        Raises:
            ValueError: A parameter is missing, not finite, or the curve does not rise.
        """
        try:
            parameters = tuple(float(named[name]) for name in FORMS[form])
        except KeyError as error:
            raise ValueError(f"needed the parameters {', '.join(FORMS[form])}") from error
        return Curve(form=form, parameters=parameters)

    def volts(self, force_n: ArrayLike) -> NDArray[np.float64]:
        """Return volts above the baseline at forces from 0 N, same shape."""
        return volts_of(self.form, np.asarray(self.parameters), force_n)

    def force_n(self, volts: ArrayLike) -> NDArray[np.float64]:
        """Return the forces that give these volts, newtons, same shape: 0 for volts at or
        below those of no force, infinity at and above the curve's top, NaN for NaN.
        """
        v = np.asarray(volts, np.float64)
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            if self.form == "line":
                force = (v - self.parameters[0]) / self.parameters[1]
            elif self.form == "power":
                scale, exponent = self.parameters
                force = (np.maximum(v, 0.0) / scale) ** (1.0 / exponent)
            else:
                top, scale_n, exponent = self.parameters
                share = np.clip(v / top, 0.0, 1.0)
                force = scale_n * (-np.log1p(-share)) ** (1.0 / exponent)
            return np.where(np.isnan(v), np.nan, np.maximum(force, 0.0))

    def slope_v_per_n(self, force_n: ArrayLike) -> NDArray[np.float64]:
        """Return the sensitivity dV/dF at forces above 0 N, volts a newton, same shape."""
        f = np.asarray(force_n, np.float64)
        if self.form == "line":
            return np.full(f.shape, self.parameters[1])
        if self.form == "power":
            scale, exponent = self.parameters
            return np.asarray(scale * exponent * f ** (exponent - 1.0))
        top, scale_n, exponent = self.parameters
        x = (f / scale_n) ** exponent
        return np.asarray(top * np.exp(-x) * exponent * x / f)


def volts_of(
    form: Form, parameters: NDArray[np.float64], force_n: ArrayLike
) -> NDArray[np.float64]:
    """Return volts above the baseline; `parameters` need not make a rising curve.

    Args:
        form: Which.
        parameters: Shape (parameters,).
        force_n: Forces from 0 N.
    """
    f = np.asarray(force_n, np.float64)
    if form == "line":
        return np.asarray(parameters[0] + parameters[1] * f)
    if form == "power":
        return np.asarray(parameters[0] * f ** parameters[1])
    return np.asarray(parameters[0] * -np.expm1(-((f / parameters[1]) ** parameters[2])))
