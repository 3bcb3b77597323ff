"""matplotlib as every figure here uses it: no window, no formulas in names.

matplotlib reads `$…$` in any text as a formula, so that a class `$x^$` ends a figure with an
error, and leaves names that begin with `_` out of legends. Figures import `plt` from here and
pass foreign names through `drawn_name` (docs/decisions/0034). Knows nothing about what is drawn.
"""

from __future__ import annotations

import io

import matplotlib
from matplotlib.figure import Figure

from taxel.plain_text import visible

matplotlib.use("Agg")
matplotlib.rcParams["text.parse_math"] = False
from matplotlib import pyplot as plt  # noqa: E402  # both settings come first

__all__ = ["drawn_name", "finished", "plt"]

_DPI = 110
"""Pixels an inch of a figure."""


def drawn_name(name: object) -> str:
    """Return a foreign name as a figure can draw it, in legends too."""
    text = visible(name)
    return f" {text}" if text.startswith("_") else text


def finished(figure: Figure, kind: str = "png", dpi: int = _DPI) -> bytes:
    """Return a figure as a file of a kind that matplotlib writes, and close it."""
    raw = io.BytesIO()
    figure.savefig(raw, format=kind, dpi=dpi)
    plt.close(figure)
    return raw.getvalue()
