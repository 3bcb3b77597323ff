"""From a trained network to one of whole numbers, by what training windows make of it.

Each filter has its own scale, each layer's result one. The scaling of the windows (volts to what
the network was trained on) is folded into the step from converter counts to 8 bits. Knows nothing
about files, C or test sets.

Source: the usual affine scheme (Jacob et al., CVPR 2018) without zero points, since all that goes
between layers is behind a ReLU; details and where it departs: docs/decisions/0021.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import floor, log2

import numpy as np
from numpy.typing import NDArray

from taxel.bundles.avr.integers import (
    ACC_LIMIT,
    EXP_STEP,
    INPUT_SHIFT,
    SHIFT,
    IntegerNetwork,
    Layer,
    network_bounds,
)
from taxel.bundles.avr.network import Floats, ImageNetwork, run_float
from taxel.errors import BadBundle
from taxel.windows.scaling import Scaling

ADC_BITS = 10
"""Of the ATmega2560's converter. Source: its datasheet."""
_TOP = 255
_MOST_SHIFT = 15
_BIAS_SHARE = 2**21
"""A bias takes at most this much of the 24 bits: a filter of tiny weights gets a coarser scale."""
_CALIBRATION = 4000
"""Windows that scales are measured on, spread over all given. Source: our choice."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Converter:
    """The board's analog to digital converter."""

    reference_mv: int
    """Voltage of 1024 counts, millivolts: 5000, or 3300 with 3.3 V on the pin AREF."""

    @property
    def step_v(self) -> float:
        """Volts a count."""
        return self.reference_mv / 1000.0 / (1 << ADC_BITS)

    def counts(self, volts: Floats) -> NDArray[np.uint16]:
        """Return the count whose voltage lies nearest, 0 … 1023; any shape."""
        found = np.rint(volts / self.step_v)
        return np.asarray(np.clip(found, 0, 2**ADC_BITS - 1), np.uint16)

    def volts(self, counts: NDArray[np.uint16]) -> Floats:
        """Return the voltages of counts, as a recording holds them; any shape."""
        return np.asarray(counts * self.step_v, np.float32)

    def last_below(self, gate: float) -> int:
        """Return the largest count that does not lie above a voltage; −1 where all do."""
        above = self.volts(np.arange(2**ADC_BITS, dtype=np.uint16)) > np.float32(gate)
        return int(np.argmax(above)) - 1 if above.any() else 2**ADC_BITS - 1


def quantise(
    network: ImageNetwork, scaling: Scaling, converter: Converter, values: Floats
) -> IntegerNetwork:
    """Return the network in whole numbers.

    Args:
        network: As it was trained.
        scaling: From volts to what it was trained on.
        converter: The board's.
        values: Training windows, volts, unscaled, shape (n, rows, columns), n ≥ 1.

    Raises:
        BadBundle: The scaling or a layer's sums do not fit the board's integers.
    """
    every = np.linspace(0, len(values) - 1, min(_CALIBRATION, len(values))).astype(int)
    images = (values[every] - scaling.offset) * scaling.factor
    signed = bool((scaling.offset > 0).any())
    input_scale = _peak(np.abs(images)) / (127 if signed else _TOP)
    peaks = [_peak(result) for result in run_float(network, images)[:3]]
    first, scale = _layer(*network.first, input_scale, peaks[0])
    second, scale = _layer(*network.second, scale, peaks[1])
    hidden, scale = _layer(*network.hidden, scale, peaks[2])
    weights, biases, logit = _last(*network.last, scale)
    factor, offset = _input(scaling, converter, input_scale)
    exp_shift, exp_multiplier = _exp(logit)
    quantised = IntegerNetwork(
        rows=network.rows, columns=network.columns, signed=signed,
        input_factor=factor, input_offset=offset, first=first, second=second, hidden=hidden,
        last_weights=weights, last_biases=biases,
        exp_shift=exp_shift, exp_multiplier=exp_multiplier,
    )  # fmt: skip
    _check_bounds(quantised)
    return quantised


def _peak(values: Floats) -> float:
    """Return the largest value; 1 where all are 0, so that there is a scale."""
    return float(values.max()) or 1.0


def _layer(weights: Floats, biases: Floats, input_scale: float, peak: float) -> tuple[Layer, float]:
    """Return a layer in integers and its result's scale.

    Args:
        weights: Shape (filters, …).
        biases: Shape (filters,).
        input_scale: What a 1 of its inputs stands for.
        peak: Its largest result over the training windows.
    """
    flat = weights.reshape(len(weights), -1).astype(np.float64)
    bias = biases.astype(np.float64)
    scales = np.maximum(np.abs(flat).max(axis=1) / 127, np.abs(bias) / (input_scale * _BIAS_SHARE))
    scales = np.maximum(scales, max(float(scales.max()), 1e-9) * 2.0**-8)
    # 2^-7 is the most that a multiplier of 16 bits can be worth.
    output_scale = max(peak / _TOP, float(scales.max()) * input_scale * 2**7 * 1.0001)
    ratio = scales * input_scale / output_scale
    shifts = np.array([_shift(factor) for factor in ratio], np.uint8)
    multipliers = np.floor(ratio * 2.0 ** (shifts.astype(np.float64) + SHIFT) + 0.5)
    whole = np.rint(bias / (input_scale * scales) + 0.5 / ratio)
    layer = Layer(
        weights=np.rint(flat / scales[:, None]).astype(np.int8),
        biases=whole.astype(np.int32),
        multipliers=np.minimum(multipliers, 0xFFFF).astype(np.uint16),
        shifts=shifts,
    )
    return layer, output_scale


def _shift(ratio: float) -> int:
    """Return the shift before the multiplication that leaves the multiplier 16 bits."""
    return min(max(floor(16 - SHIFT - log2(ratio) - 1e-9), 0), _MOST_SHIFT)


def _last(
    weights: Floats, biases: Floats, given: float
) -> tuple[NDArray[np.int8], NDArray[np.int32], float]:
    """Return the last layer with one scale for all classes, and that of its sums."""
    most = max(float(np.abs(weights).max()) / 127, float(np.abs(biases).max())
               / (given * _BIAS_SHARE), 1e-9)  # fmt: skip
    whole = np.rint(weights.astype(np.float64) / most).astype(np.int8)
    sums = np.rint(biases.astype(np.float64) / (most * given)).astype(np.int32)
    return whole, sums, most * given


def _input(
    scaling: Scaling, converter: Converter, scale: float
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Return factor and offset from counts to inputs."""
    a_count = scaling.factor.astype(np.float64) / scale * 2**INPUT_SHIFT
    factor = np.rint(converter.step_v * a_count)
    offset = np.rint(-scaling.offset * a_count) + 2 ** (INPUT_SHIFT - 1)
    if (np.abs(factor) * 2**ADC_BITS + np.abs(offset)).max() >= 2**31:
        raise BadBundle(
            "a scaling that fits a converter of 10 bits", "one that spreads a part of a count",
            "train on recordings of this board",
        )  # fmt: skip
    return factor.astype(np.int32), offset.astype(np.int32)


def _exp(logit: float) -> tuple[int, int]:
    """Return shift and multiplier from differences of logits to the table's index.

    Args:
        logit: What a 1 of the last sums stands for.
    """
    ratio = logit * EXP_STEP * 2**16
    shift = 0
    while ratio * 2**shift < 2**15 and shift < _MOST_SHIFT:
        shift += 1
    return shift, min(round(ratio * 2**shift), 0xFFFF)


def _check_bounds(network: IntegerNetwork) -> None:
    for name, (least, largest) in network_bounds(network).items():
        if max(-least, largest) > ACC_LIMIT:
            raise BadBundle(
                f"sums within ±{ACC_LIMIT:,} (24 bits)",
                f"{least:,} … {largest:,} possible in the {name} layer",
                "train a network with fewer filters or units",
            )
