"""What a window may be is refused where it is stated, not where it is cut."""

from __future__ import annotations

import math

import numpy as np
import pytest

from taxel.windows.config import WindowConfig


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ({"layout": "C", "gate": 1.0}, "needed layout A or B; got 'C'"),
        ({"grid_hz": 0.0}, "needed a grid above 0 Hz"),
        ({"grid_hz": -100.0}, "needed a grid above 0 Hz"),
        ({"grid_hz": math.inf}, "needed a grid above 0 Hz"),
        ({"grid_hz": math.nan}, "needed a grid above 0 Hz"),
        ({"channels": ()}, "needed at least one channel"),
    ],
)
def test_a_window_that_cannot_be_cut_is_refused(setting: dict[str, object], message: str) -> None:
    """Another layout was taken for B without a word."""
    with pytest.raises(ValueError, match=message):
        WindowConfig(**setting)


def test_numbers_of_numpys_become_pythons() -> None:
    """So that a bundle can state them as JSON."""
    window = WindowConfig(steps=np.int64(6), stride=np.int32(3), gate=np.float32(0.5))

    assert (window.steps, window.stride, window.gate) == (6, 3, 0.5)
    assert [type(v) for v in (window.steps, window.stride, window.gate)] == [int, int, float]
