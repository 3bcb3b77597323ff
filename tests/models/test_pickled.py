"""Arrays of a network that was pickled whole, read without running anything of it."""

import pickle

import pytest
import torch
from torch import nn

from taxel.errors import BadFile
from taxel.models.published.pickled import arrays_in_order


class Foreign(nn.Module):
    """A class that only its package has."""

    loaded = 0

    def __init__(self) -> None:
        super().__init__()
        self.features = nn.Sequential(nn.Conv2d(3, 4, 3, bias=False), nn.BatchNorm2d(4))
        self.last = nn.Linear(4, 2)

    def __setstate__(self, state: dict[str, object]) -> None:
        Foreign.loaded += 1
        super().__setstate__(state)


def _foreign() -> Foreign:
    torch.manual_seed(2)
    network = Foreign()
    network.features(torch.rand(2, 3, 8, 8))
    return network


def test_arrays_come_in_the_networks_order_and_nothing_is_run() -> None:
    network = _foreign()
    wanted = {k: torch.empty_like(v) for k, v in network.features.state_dict().items()}

    found = arrays_in_order(pickle.dumps(network, protocol=4), wanted)

    assert Foreign.loaded == 0
    assert all(torch.equal(found[k], v) for k, v in network.features.state_dict().items())


@pytest.mark.parametrize(
    "content",
    [b"", b"nothing of the kind", pickle.dumps([1, 2]), pickle.dumps(_foreign(), protocol=4)[:900]],
)
def test_what_is_no_such_pickle_is_refused(content: bytes) -> None:
    wanted = dict(_foreign().features.state_dict())
    with pytest.raises(BadFile):
        arrays_in_order(content, wanted)


def test_an_array_of_another_size_is_refused() -> None:
    wanted = {"weight": torch.zeros(4, 3, 5, 5)}
    with pytest.raises(BadFile, match="300 numbers for weight"):
        arrays_in_order(pickle.dumps(_foreign(), protocol=4), wanted)
