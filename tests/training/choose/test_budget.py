"""No choice has less time than another, however long training takes what was chosen."""

from __future__ import annotations

import pytest

from taxel.training.choose.budget import LEAST_TRYING, TRYING, Budget


class Clock:
    """Stands still until it is moved."""

    now = 0.0

    def __call__(self) -> float:
        return self.now


def stretches(seconds: float, folds: int, training_s: float) -> tuple[list[float], float]:
    """Return how long each choice may take, and when the last training ends, seconds.

    As `taxel train` does: a choice on all data, one a fold with its training, and at the end the
    training of the first.
    """
    clock = Clock()
    budget = Budget(seconds, folds + 1, clock)
    found = []
    for number in range(folds + 1):
        budget.begin()
        began = clock.now
        while budget.allows(0.01):
            clock.now += 0.01
        found.append(clock.now - began)
        if number:
            with budget.training():
                clock.now += training_s
    return found, clock.now + training_s


@pytest.mark.parametrize("training_s", [2.0, 12.5, 15.0])
def test_each_choice_has_about_the_same_time_and_all_ends_in_time(training_s: float):
    found, end = stretches(300.0, 5, training_s)

    assert end == pytest.approx(300.0, abs=0.05)
    assert min(found[2:]) > 0.95 * max(found[2:])  # once a training was seen
    assert min(found) > 0.5 * max(found)


def test_a_try_that_is_nearly_done_may_outlast_its_time_and_one_that_would_not_end_does_not_begin():
    clock = Clock()
    budget = Budget(100.0, 1, clock)
    budget.begin()
    clock.now = budget._share_end - 7.0

    assert budget.goes_on(14.0, 14.0)
    assert not budget.goes_on(14.0, 14.1)
    assert budget.starts("network")
    budget.took("network", 10.5)
    assert budget.starts("network")
    budget.took("network", 11.0)
    assert not budget.starts("network")
    clock.now += 7.1
    assert not budget.starts("new")


def test_slow_training_leaves_half_of_what_is_left_to_candidates():
    clock = Clock()
    budget = Budget(100.0, 2, clock)
    budget.begin()
    with budget.training():
        clock.now += 60.0

    budget.begin()

    assert budget.allows(LEAST_TRYING * 40.0)
    assert not budget.allows(LEAST_TRYING * 40.0 + 0.1)


def test_before_any_training_was_seen_a_quarter_is_set_aside():
    budget = Budget(100.0, 1, Clock())
    budget.begin()

    assert budget.allows(100.0 * TRYING)
    assert not budget.allows(100.0 * TRYING + 0.1)
