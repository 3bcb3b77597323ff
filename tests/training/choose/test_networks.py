"""Networks as candidates: what their batch norms hold."""

from dataclasses import replace

import numpy as np
import pytest
from torch import Tensor, nn

from taxel.models.touchnet import TouchNet
from taxel.training.choose.networks import TRAIN, settle_norms
from taxel.training.loop import Labelled, evaluate, fit, new_network


@pytest.mark.slow
def test_a_network_trained_on_noise_knows_channels_that_stand_still():
    """Integer taxels that hardly move within a window: with the noise of training in its batch
    norms TouchNet named one class for all."""
    rng = np.random.default_rng(1)
    y = np.arange(60) % 3
    level = rng.integers(50, 200, (3, 12))
    values = (level[y] + rng.integers(-2, 3, (60, 12)))[:, None, :].repeat(20, axis=1)
    values[:, -1] += 40 * rng.integers(0, 2, (60, 12))
    data = Labelled(values.astype(np.float32), np.ones((60, 20), bool), y)
    network = new_network(lambda: TouchNet(20, 12, 3), 0)
    fit(network, data, replace(TRAIN, epochs=3))

    settle_norms(network, data)

    assert evaluate(network, data)[1] > 0.9


def test_batch_norms_are_measured_over_all_windows_however_these_are_sorted():
    """Windows stand by recording: within a batch of a session, levels vary by noise alone."""
    rng = np.random.default_rng(2)
    y = np.repeat(np.arange(4), 256)  # four sessions, each as long as a batch
    values = (3.0 * y[:, None, None] + rng.normal(0, 1, (1024, 5, 2))).astype(np.float32)
    norm = nn.BatchNorm1d(2)

    class Levels(nn.Module):
        def __init__(self) -> None:
            super().__init__()
            self.norm = norm

        def forward(self, values: Tensor, mask: Tensor) -> Tensor:
            return self.norm(values.mean(dim=1))

    settle_norms(Levels(), Labelled(values, np.ones((1024, 5), bool), y))

    means = values.mean(axis=1)
    assert norm.running_mean.numpy() == pytest.approx(means.mean(axis=0), rel=0.01)
    assert norm.running_var.numpy() == pytest.approx(means.var(axis=0), rel=0.03)
