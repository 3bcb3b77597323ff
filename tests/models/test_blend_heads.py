"""Forests of a blend that are walked together answer as each does, node by node."""

import numpy as np
import pytest
import torch

from taxel.models.blend import DOUBT, Blend, Part, Plan
from taxel.models.heads import LEAST_SHARE, walk
from taxel.models.touch_features import compute_features
from taxel.training.choose.blending import doubted, softmax
from taxel.training.choose.candidates import Candidate
from taxel.training.choose.fitting import fit_head

RNG = np.random.default_rng(0)
SETS = (("level", "shape"), ("level", "shape", "quantiles"), ("mean",))
PADS = (0, 0, 0, 0)


def forests():
    """Return three forests of unequal depth, what each sees, and the windows."""
    y = np.arange(60) % 3
    values = RNG.normal(size=(60, 24, 4)).astype(np.float32)
    values[:, :, 0] += y[:, None]
    mask = np.ones((60, 24), bool)
    seen = [compute_features(blocks, PADS, values, mask) for blocks in SETS]
    kinds = [("extra-trees", 2.0), ("random-forest", 2.0), ("extra-trees", 10.0)]
    heads = [
        fit_head(Candidate("trees", model, "all", leaf), own, y, 3, 0)
        for (model, leaf), own in zip(kinds, seen, strict=True)
    ]
    return heads, [torch.from_numpy(own) for own in seen], values, mask


def by_hand(head, features: np.ndarray) -> np.ndarray:
    """Return logits, shape (n, classes): node by node, tree by tree."""
    tables = {name: table.numpy() for name, table in head.state_dict().items()}
    shares = []
    for row in features.astype(np.float32):
        found = []
        for node in tables["root"]:
            while tables["left"][node] != node:
                goes_left = row[tables["column"][node]] <= tables["threshold"][node]
                node = tables["left" if goes_left else "right"][node]
            found.append(tables["value"][tables["leaf"][node]].astype(np.float32))
        shares.append(np.mean(found, axis=0))
    return np.log(np.array(shares) + LEAST_SHARE)


def test_forests_walked_together_answer_as_each_node_by_node():
    heads, seen, _, _ = forests()

    together = walk(heads, seen)

    assert len({int(head.depth) for head in heads}) > 1
    for head, own, found in zip(heads, seen, together, strict=True):
        assert torch.equal(found, head(own))
        assert found.numpy() == pytest.approx(by_hand(head, own.numpy()), abs=1e-5)


def test_a_blend_is_never_certain_and_says_so_as_it_was_chosen_by():
    heads, seen, values, mask = forests()
    plan = Plan(24, PADS, 3, (Part("trees", SETS[0]),))
    given = torch.from_numpy(values), torch.from_numpy(mask)
    sharp, plain = (Blend(plan, heads[:1], (1.0,), (1.0,), last) for last in (50.0, 1.0))

    found = softmax(sharp(*given).double().numpy())

    assert found.min() == pytest.approx(DOUBT / 3, rel=1e-3)
    assert found.max() == pytest.approx(1 - DOUBT * 2 / 3, rel=1e-3)
    shares = softmax(heads[0](seen[0]).double().detach().numpy())
    assert softmax(plain(*given).double().numpy()) == pytest.approx(doubted(shares), abs=1e-5)
