"""Windows of frames: live equals offline, and no window spans a gap."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taxel.errors import BadInput
from taxel.windows.sequence import (
    FeatureRing,
    label_windows,
    labels_ahead,
    sequence_windows,
    window_starts,
)


def numbered(n: int) -> np.ndarray:
    """Frame number in every feature, so that lost or repeated frames show."""
    return np.broadcast_to(np.arange(n, dtype=np.float32)[:, None, None], (n, 2, 3)).copy()


def streamed(n: int, k: int, time_s: np.ndarray, gap_s: float) -> list[np.ndarray]:
    ring = FeatureRing(k, 2, 3, gap_s)
    found = []
    for frame, t in zip(numbered(n), time_s.tolist(), strict=True):
        window = ring.push(frame, t)
        if window is not None:
            found.append(window.copy())
    return found


def test_a_window_is_unstable_once_any_frame_is() -> None:
    labels = np.array([0, 0, 0, 1, 0, 0], np.int8)

    assert label_windows(labels, 3).tolist() == [0, 1, 1, 1]
    assert label_windows(labels, 7).tolist() == []


def test_labels_run_ahead_within_a_stretch_without_an_outage() -> None:
    """A slip after half a minute's outage is no warning of the frames before it."""
    labels = np.array([0, 0, 0, 0, 1, 0, 0], np.int8)
    time_s = np.array([0.0, 0.1, 30.0, 30.1, 30.2, 30.3, 30.4])

    assert labels_ahead(labels, 3).tolist() == [0, 1, 1, 1, 1, 0, 0]
    assert labels_ahead(labels, 3, time_s, 0.2).tolist() == [0, 0, 1, 1, 1, 0, 0]
    assert labels_ahead(labels, 0, time_s, 0.2).tolist() == labels.tolist()
    assert labels_ahead(labels[:0], 3, time_s[:0], 0.2).tolist() == []


def test_starts_of_windows() -> None:
    assert window_starts(6, 3).tolist() == [0, 1, 2, 3]
    assert window_starts(6, 3, stride=2).tolist() == [0, 2]
    assert window_starts(2, 3).tolist() == []


def test_no_window_spans_a_gap_or_a_step_back() -> None:
    time = np.array([0.0, 0.1, 0.2, 0.9, 1.0, 1.1, 0.5, 0.6])

    assert window_starts(8, 2, time_s=time, largest_gap_s=0.15).tolist() == [0, 1, 3, 4, 6]


@given(
    st.lists(st.sampled_from([0.1, 0.1, 0.1, 0.5, -0.3]), min_size=1, max_size=40),
    st.integers(1, 11),
)
def test_the_ring_gives_the_windows_of_the_batch(steps: list[float], k: int) -> None:
    time = np.cumsum(steps)
    n = len(time)
    starts = window_starts(n, k, time_s=time, largest_gap_s=0.2)
    batch = sequence_windows(numbered(n), k, starts)
    live = streamed(n, k, time, 0.2)

    assert len(live) == len(batch)
    assert np.array_equal(np.array(live).reshape(batch.shape), batch)


def test_all_windows_at_once_are_a_view() -> None:
    features = numbered(10)
    windows = sequence_windows(features, 4)

    assert windows.shape == (7, 4, 2, 3)
    assert np.shares_memory(windows, features)
    assert windows[2, :, 0, 0].tolist() == [2, 3, 4, 5]
    assert sequence_windows(features, 11).shape == (0, 11, 2, 3)


def test_a_reset_ring_starts_anew() -> None:
    ring = FeatureRing(2, 2, 3)
    first, second, third = numbered(3)
    ring.push(first)
    assert ring.push(second) is not None
    ring.reset()

    assert len(ring) == 0
    assert ring.push(second) is None
    window = ring.push(third)
    assert window is not None
    assert window.flags.c_contiguous
    assert window[:, 0, 0].tolist() == [1, 2]


def test_wrong_sizes_are_refused() -> None:
    with pytest.raises(BadInput, match="shape"):
        FeatureRing(2, 2, 3).push(np.zeros((1, 3), np.float32))
    with pytest.raises(BadInput, match="at least 1"):
        FeatureRing(0, 2, 3)
    with pytest.raises(BadInput, match="at least 1"):
        window_starts(5, 0)
