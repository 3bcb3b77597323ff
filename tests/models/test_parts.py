"""Joined classes by their parts: scores are sums, and what is trained is an ordinary network."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from torch import nn

from taxel.models.catalogue import MODELS, Network, find_network
from taxel.models.forest import CourseForest
from taxel.models.parts import settle_parts, share_parts
from taxel.training.loop import Labelled, TrainConfig, fit, new_network, predict

PARTS = np.array([(shape, material) for shape in range(3) for material in range(3)])
NETWORKS = [name for name, one in MODELS.items()
            if isinstance(one, Network) and one.build is not CourseForest]  # fmt: skip


def network(name: str = "cnn2d", classes: int = 9) -> nn.Module:
    return new_network(lambda: find_network(name).build(12, 12, classes), seed=1)


def windows(n: int = 20) -> tuple[torch.Tensor, torch.Tensor]:
    values = torch.rand(n, 12, 12, generator=torch.Generator().manual_seed(2))
    return values, torch.ones(n, 12, dtype=torch.bool)


def interaction(logits: torch.Tensor) -> float:
    """Return how far scores are from a sum of one term a shape and one a material."""
    table = logits.reshape(-1, 3, 3)
    rest = table - table.mean(1, keepdim=True) - table.mean(2, keepdim=True)
    return float((rest + table.mean((1, 2), keepdim=True)).abs().max())


@pytest.mark.parametrize("name", NETWORKS)
def test_a_class_is_scored_as_the_sum_of_its_parts(name: str):
    own = network(name).eval()
    assert interaction(own(*windows()).detach()) > 1e-3
    share_parts(own, PARTS)
    assert interaction(own(*windows()).detach()) < 1e-5


@pytest.mark.parametrize("name", NETWORKS)
def test_the_settled_layer_is_an_ordinary_one_of_the_same_scores(name: str):
    own, plain = network(name).eval(), network(name)
    share_parts(own, PARTS)
    shared = own(*windows()).detach()
    settle_parts(own)
    torch.testing.assert_close(own(*windows()).detach(), shared)
    assert own.state_dict().keys() == plain.state_dict().keys()
    assert type(own.last) is nn.Linear


def test_single_labels_and_classes_in_any_order_are_served():
    own = network(classes=4).eval()
    before = own(*windows()).detach()
    share_parts(own, np.arange(4)[:, None])
    torch.testing.assert_close(own(*windows()).detach(), before)
    share_parts(own, np.array([[0, 1], [1, 0], [0, 0], [1, 1]]))
    scores = own(*windows()).detach()
    torch.testing.assert_close(scores[:, 0] + scores[:, 1], scores[:, 2] + scores[:, 3])


def test_a_joined_class_that_was_never_seen_is_told_by_its_parts():
    """Channel 0 tells the shape, channel 1 the material; glass spheres are left out."""
    rng = np.random.default_rng(0)
    shape, material = rng.integers(0, 3, 1500), rng.integers(0, 3, 1500)
    values = rng.normal(0, 0.05, (1500, 12, 12)).astype(np.float32)
    values[:, :, 0] += shape[:, None]
    values[:, :, 6] += material[:, None]
    y, mask = 3 * shape + material, np.ones((1500, 12), bool)
    seen = y != 8
    found = {}
    for by_parts in (False, True):
        own = network()
        config = TrainConfig(epochs=15, by_parts=by_parts)
        fit(own, Labelled(values[seen], mask[seen], y[seen]), config, parts=PARTS)
        told = predict(own, values[~seen], mask[~seen]).argmax(axis=1)
        found[by_parts] = float((told == 8).mean())
    assert found[False] < 0.1
    assert found[True] > 0.9
