"""Claims about the contact gate: a row counts as a whole, a threshold comes from the noise."""

import numpy as np
import pytest

from taxel.windows.gate import NOISE_SIGMAS, gate_rows, noise_gate


def test_one_channel_above_keeps_the_whole_row():
    values = np.array([[0.0, 1.6], [1.5, 1.5], [2.0, 2.0]], np.float32)
    assert gate_rows(values, np.ones((3, 2), bool), 1.55).tolist() == [True, False, True]


def test_at_the_gate_is_not_above_it():
    """1.55 as float32 lies above 1.55: the comparison is made in float32 on both sides."""
    at = np.float32(1.55)
    values = np.array([[at], [np.nextafter(at, np.float32(2))]], np.float32)
    assert gate_rows(values, np.ones((2, 1), bool), 1.55).tolist() == [False, True]


def test_a_value_that_cannot_be_used_opens_no_gate():
    values = np.array([[9.0, 0.0], [np.nan, 0.0]], np.float32)
    usable = np.array([[False, True], [False, True]])
    assert gate_rows(values, usable, 1.55).tolist() == [False, False]


def test_no_gate_keeps_every_row():
    assert gate_rows(np.zeros((3, 2), np.float32), np.zeros((3, 2), bool), None).all()


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
    assert noise_gate(values, usable) == noise_gate(values[:, :1], usable[:, :1])


def test_too_few_values_for_a_threshold_are_refused():
    with pytest.raises(ValueError, match="10 usable values"):
        noise_gate(np.zeros((9, 2), np.float32), np.ones((9, 2), bool))
