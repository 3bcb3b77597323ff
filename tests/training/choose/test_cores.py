"""Tries side by side take one share of the cores each, and give them back."""

from concurrent.futures import ThreadPoolExecutor

import pytest
import torch

from taxel.training.choose.cores import shared_cores


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
