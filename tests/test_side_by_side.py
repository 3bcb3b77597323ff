"""The same work with several values at once: in order, truly at once, no error lost."""

from __future__ import annotations

import threading

import pytest

from taxel.side_by_side import SideBySide


def test_results_come_in_the_order_of_the_values():
    beside = SideBySide(3)
    assert beside.map(lambda value: value * 2, [3, 1, 2]) == [6, 2, 4]
    assert beside.map(lambda value: value * 2, range(20)) == [2 * value for value in range(20)]
    assert beside.map(lambda value: value * 2, []) == []


def test_the_values_are_worked_on_at_once_and_the_first_here():
    """Nobody passes the barrier alone."""
    barrier = threading.Barrier(2)
    places = SideBySide(2).map(
        lambda _: (barrier.wait(timeout=20.0), threading.current_thread())[1], ["a", "b"]
    )
    assert places[0] is threading.current_thread()
    assert places[1] is not places[0]


def test_with_one_at_most_all_is_done_here():
    places = SideBySide(1).map(lambda _: threading.current_thread(), ["a", "b"])
    assert places == [threading.current_thread()] * 2


@pytest.mark.parametrize("failing", [0, 1])
def test_an_error_is_raised_once_all_have_ended(failing: int):
    ended = []

    def work(value: int) -> None:
        if value == failing:
            raise ValueError(f"value {value}")
        ended.append(value)

    with pytest.raises(ValueError, match=f"value {failing}"):
        SideBySide(2).map(work, [0, 1])
    assert ended == [1 - failing]
