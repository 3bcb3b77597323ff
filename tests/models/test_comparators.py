"""The networks of the thesis's survey, beyond what every model promises."""

import pytest
import torch

from taxel.models.catalogue import MODELS, count_parameters, find_network
from taxel.models.cnn3d import Cnn3d
from taxel.models.inception_time import DEPTH, RESIDUAL_EVERY, InceptionTime, fitting_kernels
from taxel.models.lstm import Lstm


@pytest.mark.slow
@pytest.mark.parametrize("name", ["lstm", "conv-lstm", "inception-time"])
def test_padding_never_changes_an_answer(name: str) -> None:
    """Neither how much of it there is nor what stands in it."""
    torch.manual_seed(0)
    network = find_network(name).build(12, 5, 3).eval()
    rows = torch.rand(4, 8, 5)

    def padded(length: int, filling: float) -> torch.Tensor:
        values = torch.full((4, length, 5), filling)
        values[:, :8] = rows
        mask = (torch.arange(length) < 8).expand(4, length)
        return network(values, mask)

    whole = network(rows, torch.ones(4, 8, dtype=torch.bool))

    torch.testing.assert_close(padded(12, 0.0), whole)
    torch.testing.assert_close(padded(20, 7.0), whole)


def test_the_lstm_reads_the_order_of_rows() -> None:
    torch.manual_seed(0)
    network = Lstm(12, 3, 2).eval()
    values, mask = torch.rand(2, 12, 3), torch.ones(2, 12, dtype=torch.bool)

    assert not torch.allclose(network(values, mask), network(values.flip(1), mask))


def test_the_3d_network_sees_fingers_and_phalanges_of_a_hand() -> None:
    """Channels 0 and 3 are neighbours across fingers, 2 and 3 are not neighbours at all."""
    network = Cnn3d(12, 12, 2)
    values = torch.zeros(1, 12, 12)
    values[0, 6, 3] = 1.0  # finger 1, phalanx 0
    volume = torch.zeros(1, 1, 12, 4, 3)
    volume[0, 0, 6, 1, 0] = 1.0

    logits = network(values, torch.ones(1, 12, dtype=torch.bool))

    torch.testing.assert_close(logits, network.last(network.hidden(network.features(volume))))


def test_kernels_keep_the_papers_lengths_and_never_outgrow_the_window() -> None:
    assert fitting_kernels(400) == (39, 19, 9)
    assert fitting_kernels(12) == (11, 5, 3)
    for steps in range(3, 60):
        assert all(size % 2 == 1 and size <= steps for size in fitting_kernels(steps))


def test_inception_time_has_the_papers_shape() -> None:
    network = InceptionTime(400, 8, 10)

    assert len(network.inceptions) == DEPTH == 6
    assert len(network.shortcuts) == DEPTH // RESIDUAL_EVERY == 2
    # A shortcut carries the input around three dead modules.
    for module in network.inceptions[:RESIDUAL_EVERY]:
        torch.nn.init.zeros_(module.norm.weight)
    values, mask = torch.rand(3, 400, 8), torch.ones(3, 400, dtype=torch.bool)
    assert not torch.allclose(*network.eval()(values, mask)[:2])


def test_the_comparators_have_the_documented_size() -> None:
    """docs/decisions/0024 and 0047 hang on these."""
    counts = {
        name: count_parameters(MODELS[name].build(12, 12, 3))
        for name in ("lstm", "cnn3d", "conv-lstm", "inception-time")
    }

    assert counts == {"lstm": 22147, "cnn3d": 22259, "conv-lstm": 16131, "inception-time": 178819}


def test_the_conv_lstm_reads_the_order_of_rows_and_where_on_the_hand_they_are() -> None:
    """The same values at other rows, or at pads that are no neighbours, give other answers."""
    torch.manual_seed(0)
    network = find_network("conv-lstm").build(12, 12, 2).eval()
    mask = torch.ones(1, 12, dtype=torch.bool)
    near, far = torch.zeros(1, 12, 12), torch.zeros(1, 12, 12)
    near[0, 2:5, [0, 3]] = 1.0  # one phalanx of two fingers side by side
    far[0, 2:5, [0, 9]] = 1.0

    assert not torch.allclose(network(near, mask), network(near.flip(1), mask))
    assert not torch.allclose(network(near, mask), network(far, mask))
