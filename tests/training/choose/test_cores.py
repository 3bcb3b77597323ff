"""Tries side by side take one share of the cores each, and give them back."""

from concurrent.futures import ThreadPoolExecutor
from threading import Event

import pytest
import torch

from taxel.training.choose.cores import shared_cores, working_threads


@pytest.fixture
def four_cores():
    before = torch.get_num_threads()
    torch.set_num_threads(4)
    yield
    torch.set_num_threads(before)


@pytest.mark.parametrize(("at_once", "share"), [(1, 4), (2, 2), (3, 1), (8, 1)])
def test_threads_that_start_inside_have_a_share(four_cores: None, at_once: int, share: int):
    with shared_cores(at_once), ThreadPoolExecutor(at_once) as pool:
        found = set(pool.map(lambda _: torch.get_num_threads(), range(at_once)))

    assert found == {share}
    assert torch.get_num_threads() == 4


def test_the_cores_are_given_back_after_a_failure(four_cores: None):
    with pytest.raises(ZeroDivisionError), shared_cores(2):
        raise ZeroDivisionError
    assert torch.get_num_threads() == 4


def test_after_ctrl_c_no_try_begins_that_waits_for_a_thread() -> None:
    """A search hands over all its tries at once; they would go on for as long as its budget."""
    begun: list[int] = []
    at_work, others_cancelled = Event(), Event()

    def first() -> None:
        at_work.set()
        others_cancelled.wait(5.0)

    def interrupted() -> None:
        with working_threads(1) as pool:
            pool.submit(first)
            for number in range(3):
                last = pool.submit(begun.append, number)
            last.add_done_callback(lambda _: others_cancelled.set())
            at_work.wait(5.0)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()

    assert begun == []
