"""Counters that wrapped rise again, and data frames become arrays (0049)."""

import numpy as np
import pytest

from taxel.wire.counters import data_arrays, data_size, unwrap
from taxel.wire.messages import Data, pack

WRAP = 2**32


def unwrapped(raw: list[int], near: int) -> list[int]:
    found = unwrap(np.array(raw, np.uint32), near)
    assert found.dtype == np.int64
    return found.tolist()


def test_no_counts_are_no_counts():
    assert unwrapped([], 7) == []


@pytest.mark.parametrize(("raw", "near", "count"), [
    (5, 0, 5), (5, WRAP, WRAP + 5), (WRAP - 1, 0, -1), (WRAP - 1, WRAP, WRAP - 1),
    (5, 7 * WRAP - 9, 7 * WRAP + 5), (2**31 - 1, 0, 2**31 - 1), (2**31, 0, -(2**31)),
    (2**31, 1, 2**31), (0, 2**31 - 1, 0), (0, 2**31, 0), (0, 2**31 + 1, WRAP),
])  # fmt: skip
def test_a_count_is_the_nearest_to_where_it_should_stand(raw: int, near: int, count: int):
    assert unwrapped([raw], near) == [count]


def test_counts_rise_over_the_wrap_and_a_step_back_stays_one():
    raw = [WRAP - 2, WRAP - 1, 0, 3, 2, 2 + 2**31 - 1]

    assert unwrapped(raw, 9 * WRAP - 2) == [
        9 * WRAP + step for step in (-2, -1, 0, 3, 2, 2 + 2**31 - 1)
    ]


@pytest.mark.parametrize("channels", [1, 4, 115])
def test_data_frames_become_arrays_of_the_same_numbers(channels: int):
    sent = [Data(3, WRAP - 1 - i, 1000 * i, tuple(range(i, i + channels))) for i in range(3)]
    payloads = [pack(message) for message in sent]
    seq, t_us, values = data_arrays(payloads, channels)

    assert {len(payload) for payload in payloads} == {data_size(channels)}
    assert seq.tolist() == [WRAP - 1, WRAP - 2, WRAP - 3]
    assert t_us.tolist() == [0, 1000, 2000]
    assert values.shape == (3, channels)
    assert [tuple(row) for row in values.tolist()] == [message.values for message in sent]
