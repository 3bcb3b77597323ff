"""Claims about the contact gate: a row counts as a whole, a threshold comes from the noise."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from taxel.signals import Samples, SensorInfo, Validity
from taxel.windows.config import WindowConfig
from taxel.windows.gate import NOISE_SIGMAS, above_gate, noise_gate
from taxel.windows.windower import cut_windows


def kept(values: NDArray[np.float32], gate: float | None, flags: NDArray[np.uint8]) -> int:
    """Return how many rows pass the gate: a window of one row each."""
    samples = replace(Samples.from_values(values, np.arange(len(values)) / 100.0), validity=flags)
    channels = tuple(f"c{index}" for index in range(values.shape[1]))
    sensor = SensorInfo(name="a", channels=channels, units=("V",) * len(channels), rate_hz=100.0)
    config = WindowConfig(gate=gate, steps=1, stride=1, grid_hz=None, max_gap_s=9.0)
    return len(cut_windows(samples, config, sensor))


def good(values: NDArray[np.float32]) -> NDArray[np.uint8]:
    return np.zeros(values.shape, np.uint8)


def test_one_channel_above_keeps_the_whole_row():
    values = np.array([[0.0, 1.6], [1.5, 1.5], [2.0, 2.0]], np.float32)
    assert kept(values, 1.55, good(values)) == 2


def test_at_the_gate_is_not_above_it():
    """1.55 as float32 lies above 1.55: the comparison is made in float32 on both sides."""
    at = np.float32(1.55)
    values = np.array([[at], [np.nextafter(at, np.float32(2))]], np.float32)
    assert above_gate(values, None, 1.55).tolist() == [[False], [True]]


def test_a_value_that_cannot_be_used_opens_no_gate():
    values = np.array([[9.0, 0.0], [np.nan, 0.0], [2.0, 0.0]], np.float32)
    flags = np.array([[Validity.MISSING, 0], [Validity.NOT_FINITE, 0], [0, 0]], np.uint8)
    assert kept(values, 1.55, flags) == 1


def test_no_gate_keeps_every_row():
    values = np.zeros((3, 2), np.float32)
    assert kept(values, None, good(values)) == 3


@pytest.mark.parametrize(("contact", "largest"), [(0.0, 1.05), (0.1, 1.25), (0.4, 3.5)])
def test_a_threshold_from_noise_lies_above_rest_and_below_contact(contact: float, largest: float):
    """Six deviations of the noisiest channel's rest; contact in between can only raise it."""
    rng = np.random.default_rng(0)
    values = rng.normal([0.2, 1.0], [0.01, 0.05], (20_000, 2))
    values[: round(contact * len(values))] += 2.0
    found = noise_gate(values.astype(np.float32), np.ones(values.shape, bool))
    assert 0.95 < (found - 1.0) / (NOISE_SIGMAS * 0.05) < largest
    assert found < 3.0


def test_a_channel_that_cannot_be_used_is_left_out_of_the_threshold():
    rng = np.random.default_rng(0)
    values = rng.normal(0.0, 0.01, (200, 2)).astype(np.float32)
    values[:, 1] = np.nan
    usable = np.isfinite(values)
    alone = noise_gate(values[:, :1], usable[:, :1])
    assert noise_gate(values, usable) == alone
    assert noise_gate(values[:, ::-1], usable[:, ::-1]) == alone


def test_too_few_values_for_a_threshold_are_refused():
    with pytest.raises(ValueError, match="10 usable values"):
        noise_gate(np.zeros((9, 2), np.float32), np.ones((9, 2), bool))


def test_below_0_a_value_that_cannot_be_used_opens_no_gate_either():
    """What is missing stands as 0 in a row, which lies above a gate of −1."""
    values = np.array([[-2.0, np.nan], [-2.0, -0.5], [-2.0, -2.0]], np.float32)
    flags = np.array([[0, Validity.MISSING], [0, 0], [0, 0]], np.uint8)
    assert kept(values, -1.0, flags) == 1


def test_saturation_is_that_of_the_worst_channel():
    """Of four rows two are saturated in the first of three channels."""
    values = np.ones((12, 3), np.float32)
    flags = np.zeros((12, 3), np.uint8)
    flags[[0, 1, 5], 0] = Validity.SATURATED
    samples = replace(Samples.from_values(values, np.arange(12) / 100.0), validity=flags)
    sensor = SensorInfo(name="a", channels=("x", "y", "z"), units=("V",) * 3, rate_hz=100.0)
    config = WindowConfig(steps=4, stride=4, grid_hz=None)
    assert cut_windows(samples, config, sensor).saturated.tolist() == [0.5, 0.25, 0.0]
