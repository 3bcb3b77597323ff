"""Features of small patterns whose biases are learned: fitted in each fold on its own windows.

Knows nothing about models on them.

Source: docs/decisions/0039; Dempster et al., "MiniRocket", KDD 2021.
"""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass, field
from hashlib import sha256
from threading import Lock
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray

from taxel.models.kernel_features import KernelFeatures, drawn_kernels

LOOKED_AT: Final = 200
"""Training windows from which biases are drawn. Source: our choice, 0039."""
MOST_KEPT: Final = 300_000_000
"""Bytes of features that are kept, so that a second model on the same windows need not compute them
again. Source: our choice: memory."""
_GOLDEN: Final = (5**0.5 - 1) / 2
_BATCH_VALUES: Final = 4_000_000


def fit_kernels(
    values: NDArray[np.float32], mask: NDArray[np.bool_], seed: int = 0, *, padded: bool
) -> KernelFeatures:
    """Return features whose biases are quantiles of what kernels answer in training windows.

    Each bias is a quantile of one window's answers, as MiniRocket's are; the quantiles follow the
    golden ratio, which spreads any number of them evenly.

    Args:
        values: Training windows, shape (n, steps, channels), unscaled.
        mask: Shape (n, steps), False where a row is padding.
        seed: Of the windows that are looked at.
        padded: Whether windows may be padded.
    """
    random = np.random.default_rng(seed)
    own = random.permutation(len(values))[:LOOKED_AT]
    shortest = int(mask.sum(axis=1).min()) if padded else None
    found = drawn_kernels(values.shape[1], values.shape[2], seed, shortest)
    looked_at = torch.from_numpy(values[own])
    rows = torch.from_numpy(mask[own].sum(axis=1)) if padded else None
    count = 0
    for number, biases in enumerate(found.bias):
        answers = found.answers(looked_at, rows, number).numpy()
        slot, kernel, _ = np.indices(biases.shape)
        taken = np.sort(answers[random.integers(len(own), size=biases.shape), slot, kernel], axis=3)
        share = (_GOLDEN * (1 + count + np.arange(biases.numel()))) % 1.0
        place = (share * taken.shape[3]).astype(np.intp).reshape(biases.shape)
        chosen = np.take_along_axis(taken, place[..., None], axis=3)[..., 0]
        found.bias[number] = torch.from_numpy(chosen)
        count += biases.numel()
    return found


def compute_kernels(
    kernels: KernelFeatures,
    values: NDArray[np.float32],
    mask: NDArray[np.bool_],
    *,
    padded: bool,
) -> NDArray[np.float32]:
    """Return features of many windows, shape (n, features) float32.

    Args:
        kernels: Fitted on training windows.
        values: Shape (n, steps, channels), unscaled.
        mask: Shape (n, steps).
        padded: Whether windows may be padded, as they were fitted.
    """
    places, (_, slots, each, biases) = len(kernels.place), kernels.bias.shape
    batch = max(1, _BATCH_VALUES // (places * slots * each * biases))
    parts = [np.zeros((0, kernels.bias.numel()), np.float32)]
    with torch.inference_mode():
        for start in range(0, len(values), batch):
            part = slice(start, start + batch)
            measured = torch.from_numpy(mask[part]) if padded else None
            parts.append(kernels(torch.from_numpy(values[part]), measured).float().numpy())
    return np.concatenate(parts)


@dataclass(slots=True)
class KeptKernels:
    """Fitted features of a data set, those that were asked for last."""

    _kept: OrderedDict[bytes, tuple[KernelFeatures, NDArray[np.float32]]] = field(
        default_factory=OrderedDict
    )
    _computing: Lock = field(default_factory=Lock)

    def of(
        self,
        values: NDArray[np.float32],
        mask: NDArray[np.bool_],
        learned: NDArray[np.intp],
        wanted: NDArray[np.intp],
        *,
        padded: bool,
        seed: int,
    ) -> tuple[KernelFeatures, NDArray[np.float32]]:
        """Return features fitted on some windows, and those of some, shape (wanted, features).

        Args:
            values: All windows, shape (n, steps, channels), unscaled.
            mask: Shape (n, steps).
            learned: Windows to learn from.
            wanted: Windows whose features are wanted.
            padded: Whether windows may be padded.
            seed: Of the windows that are looked at.
        """
        key = sha256(b"%d " % seed + learned.tobytes() + b" " + wanted.tobytes()).digest()
        with self._computing:
            if key not in self._kept:
                kernels = fit_kernels(values[learned], mask[learned], seed, padded=padded)
                found = compute_kernels(kernels, values[wanted], mask[wanted], padded=padded)
                self._kept[key] = kernels, found
                while len(self._kept) > 1 and self._bytes() > MOST_KEPT:
                    self._kept.popitem(last=False)
            self._kept.move_to_end(key)
            return self._kept[key]

    def _bytes(self) -> int:
        return sum(features.nbytes for _, features in self._kept.values())
