"""The moments that wait for a grasp to begin: few, whatever the clock does (0045)."""

import numpy as np
import pytest

from taxel.labels.grasp_start import Hold
from taxel.live.grasp_starts import GraspStarts
from taxel.signals import Frame
from taxel.windows.pairs import FrameSet

HZ = 25.0
IMAGE = np.zeros((8, 8, 3), np.uint8)


def moment(time_s: float) -> FrameSet:
    frame = Frame(camera=0, jpeg=b"", counter=0, device_s=time_s, arrival_s=time_s, fitted_s=time_s)
    return FrameSet((frame,))


def test_only_the_last_moments_wait_also_where_a_clock_was_set_back(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Before, every image stayed until the clock was where it had been: gigabytes in minutes."""
    starts = GraspStarts(1)
    monkeypatch.setattr(starts._finder, "push", lambda *_: Hold.OPEN)
    for number in range(100):
        time_s = number / HZ + (4000.0 if number < 50 else 400.0)
        assert starts.take((IMAGE,), [0], moment(time_s)) == ([], False)
        assert len(starts._lately) <= 5
    monkeypatch.setattr(starts._finder, "push", lambda *_: Hold.HELD)
    ready, began = starts.take((IMAGE,), [0], moment(400.0 + 100 / HZ))
    assert began
    assert [round((found.time_s - 400.0) * HZ) for _, _, found in ready] == [96, 97, 98, 99, 100]
