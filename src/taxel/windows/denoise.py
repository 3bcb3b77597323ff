"""Clean finished windows: wavelet denoising and threshold segmentation.

The TENG thesis names both as software filters against interference (section
2.6) and uses the second, at 1.55 V, to separate contact from background (section
3.5.1); it gives no further detail, so the rest is ours (docs/decisions/0024). A
window is cleaned alone, from its own rows, so that offline equals live. Knows
nothing about gates, scaling or models.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadInput, MissingExtra
from taxel.windows.config import WindowConfig

NORMAL_MAD = 0.6745
"""Median of |x| for normal x of deviation 1. Source: Donoho and Johnstone, Biometrika 1994."""
_MODE = "symmetric"
"""How PyWavelets continues a window past its ends: mirrored, without a jump."""

Clean = Callable[[NDArray[np.float32], NDArray[np.bool_]], NDArray[np.float32]]
"""(values (n, steps, channels), mask (n, steps)) → cleaned values; padding stays 0."""


def cleaner(config: WindowConfig) -> Clean | None:
    """Return what cleans a window as configured; None where nothing is to be done.

    Args:
        config: Its `wavelet` and `segment`; the wavelet goes first.

    Raises:
        MissingExtra: PyWavelets is not installed and `wavelet` asks for it.
        BadInput: There is no such wavelet, or a window is too short for it.
    """
    if config.wavelet is None and config.segment is None:
        return None
    wavelet = None if config.wavelet is None else _find_wavelet(config.wavelet, config.steps)
    level = config.segment

    def clean(values: NDArray[np.float32], mask: NDArray[np.bool_]) -> NDArray[np.float32]:
        if wavelet is not None:
            values = _denoise_measured(values, mask, wavelet)
        if level is not None:
            values = segment(values, level)
        return values

    return clean


def segment(values: NDArray[np.float32], level: float) -> NDArray[np.float32]:
    """Return windows in which all that is not above a level is 0: background, not contact.

    Args:
        values: Shape (n, steps, channels), of channels that rest at 0.
        level: In the channels' unit.
    """
    return np.where(values > np.float32(level), values, np.float32(0.0))


def denoise(values: NDArray[np.float32], wavelet: Any) -> NDArray[np.float32]:
    """Return windows with small wavelet coefficients shrunk to 0, each channel by itself.

    Soft threshold at σ √(2 ln rows), the universal one; σ from the median of the finest
    coefficients of that channel in that window.

    Args:
        values: Shape (n, rows, channels).
        wavelet: A `pywt.Wavelet`; fewer rows than it needs come back as they are.

    Source: Donoho and Johnstone, Biometrika 1994; Donoho, IEEE Trans. Inf. Theory 1995.
    """
    import pywt

    rows = values.shape[1]
    levels = deepest_level(rows, wavelet.dec_len)
    if not levels or not len(values):
        return values
    smooth, *details = pywt.wavedec(values, wavelet, _MODE, levels, axis=1)
    sigma = np.median(np.abs(details[-1]), axis=1, keepdims=True) / NORMAL_MAD
    threshold = (sigma * math.sqrt(2.0 * math.log(rows))).astype(np.float32)
    shrunk = [np.sign(d) * np.maximum(np.abs(d) - threshold, np.float32(0.0)) for d in details]
    back = pywt.waverec([smooth, *shrunk], wavelet, _MODE, axis=1)
    return np.asarray(back[:, :rows], np.float32)


def deepest_level(rows: int, length: int) -> int:
    """Return how often a window can be halved before a filter of `length` outgrows it."""
    return math.floor(math.log2(max(1.0, rows / (length - 1))))


def _denoise_measured(
    values: NDArray[np.float32], mask: NDArray[np.bool_], wavelet: Any
) -> NDArray[np.float32]:
    """Denoise the measured rows alone: a step down into padding is no signal."""
    if mask.all():
        return denoise(values, wavelet)
    cleaned = values.copy()
    counts = mask.sum(axis=1)
    for count in np.unique(counts):
        own = np.flatnonzero(counts == count)
        cleaned[own, :count] = denoise(values[own, :count], wavelet)
    return cleaned


def _find_wavelet(name: str, steps: int) -> Any:
    try:
        import pywt
    except ImportError as error:
        raise MissingExtra("PyWavelets", "denoise", "wavelet denoising") from error
    if name not in pywt.wavelist(kind="discrete"):
        raise BadInput(
            "an orthogonal or biorthogonal wavelet, such as db2", repr(name), "name another"
        )
    wavelet = pywt.Wavelet(name)
    if not deepest_level(steps, wavelet.dec_len):
        raise BadInput(
            f"windows of at least {2 * (wavelet.dec_len - 1)} rows for the wavelet {name}",
            f"{steps}",
            "choose a shorter wavelet, such as haar, or longer windows",
        )
    return wavelet
