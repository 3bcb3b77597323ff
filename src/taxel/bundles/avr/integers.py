"""The network in integers: what the board computes, number for number.

All of it is exact: products and sums are whole numbers, what is scaled is multiplied by a whole
number and shifted. The C run-time (`runtime/taxel_cnn.c`) does the same in the same order, so both
give the same answers. Knows nothing about recordings, bundles or C.

Background of our choices: docs/decisions/0021.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.bundles.avr.network import patches, pooled

ACC_LIMIT = 2**23 - 1
"""Largest sum that 24 bits hold."""
SHIFT = 23
"""A 16-bit sum times a 16-bit multiplier is shifted by this to give 8 bits. Source: our choice, so
that the multiplier keeps 15 bits and the shift is two bytes and seven bits."""
INPUT_SHIFT = 16
"""Counts times the input's multiplier are shifted by this."""
EXP_STEP = 16
"""Entries of the table of e^(−x) a unit of x. Source: our choice, docs/decisions/0021."""
EXP_TABLE = np.round(65535 * np.exp(-np.arange(8 * EXP_STEP) / EXP_STEP)).astype(np.uint16)
"""e^(−i/16) × 65535 for i = 0 … 127; the same numbers stand in `runtime/taxel_cnn.c`."""
CERTAIN = 255
"""The confidence that stands for 1."""

Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Layer:
    """A layer whose sums become 8 bits again, 0 … 255; its ReLU is the 0."""

    weights: NDArray[np.int8]
    """Shape (filters, inputs), inputs as they stand in memory."""
    biases: NDArray[np.int32]
    """Shape (filters,): in units of the sums, with the half that rounds."""
    multipliers: NDArray[np.uint16]
    """Shape (filters,)."""
    shifts: NDArray[np.uint8]
    """Shape (filters,): before the multiplication, 0 … 15."""


@dataclass(frozen=True, slots=True, kw_only=True)
class IntegerNetwork:
    """All numbers that a board needs to predict a window's class."""

    rows: int
    columns: int
    signed: bool
    """Whether inputs are −128 … 127, as where the scaling takes something off; else 0 … 255."""
    input_factor: NDArray[np.int32]
    """Shape (columns,): a count times this, plus `input_offset`, shifted by 16, is an input."""
    input_offset: NDArray[np.int32]
    """Shape (columns,), with the half that rounds."""
    first: Layer
    second: Layer
    hidden: Layer
    last_weights: NDArray[np.int8]
    """Shape (classes, units)."""
    last_biases: NDArray[np.int32]
    """Shape (classes,)."""
    exp_shift: int
    """Differences of logits are shifted by this, and held to 16 bits, …"""
    exp_multiplier: int
    """… then times this over 2^16 they are an index of the table of e^(−x)."""

    @property
    def input_ends(self) -> tuple[int, int]:
        """Least and largest input."""
        return (-128, 127) if self.signed else (0, 255)

    @property
    def parameters(self) -> int:
        """Weights and biases."""
        layers = (self.first, self.second, self.hidden)
        inner = sum(layer.weights.size + layer.biases.size for layer in layers)
        return int(inner + self.last_weights.size + self.last_biases.size)


@dataclass(frozen=True, slots=True)
class BoardAnswers:
    """What the board says of windows."""

    best: NDArray[np.intp]
    """Shape (n,): the likeliest class; the first of equals."""
    confidence: NDArray[np.uint8]
    """Shape (n,): its probability, 255 for 1."""
    logits: NDArray[np.int32]
    """Shape (n, classes): the last layer's sums."""


def layer_bounds(
    weights: NDArray[np.int8], biases: NDArray[np.int32], ends: tuple[int, int]
) -> tuple[int, int]:
    """Return what no sum of a layer can leave, whatever it is given, at no step of the way.

    Args:
        weights: Shape (filters, inputs).
        biases: Shape (filters,); a sum begins with it.
        ends: Least and largest input; 0 lies between.
    """
    wide = weights.astype(np.int64)
    low, high = wide * ends[0], wide * ends[1]
    bias = biases.astype(np.int64)
    # Each product taken at its worst, and left out where that is better: parts of a sum too.
    down = np.minimum(np.minimum(low, high), 0).sum(axis=1) + np.minimum(bias, 0)
    up = np.maximum(np.maximum(low, high), 0).sum(axis=1) + np.maximum(bias, 0)
    return int(down.min()), int(up.max())


def network_bounds(network: IntegerNetwork) -> dict[str, tuple[int, int]]:
    """Return the bounds of each layer's sums, by the layer's name."""
    byte = (0, 255)
    found = {"first": layer_bounds(network.first.weights, network.first.biases,
                                   network.input_ends)}  # fmt: skip
    for name, layer in (("second", network.second), ("hidden", network.hidden)):
        found[name] = layer_bounds(layer.weights, layer.biases, byte)
    found["last"] = layer_bounds(network.last_weights, network.last_biases, byte)
    return found


def quantise_counts(network: IntegerNetwork, counts: NDArray[np.uint16]) -> Ints:
    """Return the network's inputs, shape (n, rows, columns).

    Args:
        network: Its columns are the channels.
        counts: The converter's readings, shape (n, rows, columns).
    """
    wide = counts.astype(np.int64) * network.input_factor + network.input_offset
    return np.asarray(np.clip(wide >> INPUT_SHIFT, *network.input_ends), np.int64)


def run_integers(network: IntegerNetwork, inputs: Ints) -> BoardAnswers:
    """Return the board's answers to windows.

    Args:
        network: What to run.
        inputs: Shape (n, rows, columns), as `quantise_counts` gives them.

    Raises:
        OverflowError: A sum left 24 bits, which `network_bounds` rules out.
    """
    first_layer = pooled(_convolved(network.first, inputs[..., None]), 0)
    two = pooled(_convolved(network.second, first_layer), 0)
    hidden = requantise(network.hidden, _sums(network.hidden, two.reshape(len(two), -1)))
    logits = hidden @ network.last_weights.astype(np.int64).T + network.last_biases
    _check(logits)
    best = logits.argmax(axis=1)
    return BoardAnswers(best, _confidence(network, logits), logits.astype(np.int32))


def requantise(layer: Layer, sums: Ints) -> Ints:
    """Return a layer's sums as 8 bits, 0 … 255; shape (…, filters) as they came."""
    part = np.minimum(np.maximum(sums, 0) >> layer.shifts, 0xFFFF)
    return np.asarray(np.minimum((part * layer.multipliers) >> SHIFT, 255), np.int64)


def _convolved(layer: Layer, images: Ints) -> Ints:
    return requantise(layer, _sums(layer, patches(images)))


def _sums(layer: Layer, inputs: Ints) -> Ints:
    # Whole numbers this small are exact in float64, whose products are fast.
    found = (inputs.astype(np.float64) @ layer.weights.T.astype(np.float64)).astype(np.int64)
    found += layer.biases
    _check(found)
    return found


def _check(sums: Ints) -> None:
    if sums.size and max(int(sums.max()), -int(sums.min())) > ACC_LIMIT:
        raise OverflowError(f"a sum of {sums.max()} or {sums.min()} leaves 24 bits")


def _confidence(network: IntegerNetwork, logits: Ints) -> NDArray[np.uint8]:
    """Return the likeliest class's share of the sum of e^(logit), 255 for all of it."""
    behind = logits.max(axis=1, keepdims=True) - logits
    part = np.minimum(behind >> network.exp_shift, 0xFFFF)
    index = (part * network.exp_multiplier) >> 16
    terms = np.where(index < len(EXP_TABLE), EXP_TABLE[np.minimum(index, len(EXP_TABLE) - 1)], 0)
    total = terms.astype(np.int64).sum(axis=1)
    return np.asarray((int(EXP_TABLE[0]) * CERTAIN + total // 2) // total, np.uint8)
