"""Where no row is padding, features are computed without a mask: the same numbers, fewer steps."""

import numpy as np
import pytest
import torch

from taxel.bundles.writer import Classifier, export_onnx
from taxel.models.blend import Blend, Part, Plan, read_plan
from taxel.models.heads import LinearHead
from taxel.models.onnx_session import WindowModel
from taxel.models.touch_blocks import BLOCKS, UNIT
from taxel.models.touch_features import TouchFeatures, fitting_blocks

PADS = (0, 0, 0, 0)
RNG = np.random.default_rng(0)


@pytest.mark.parametrize("steps", [1, 5, 40, 80, 1203])
def test_every_block_gives_the_same_numbers_without_the_mask(steps: int):
    values = torch.from_numpy(RNG.normal(size=(3, steps, 4)).cumsum(1).astype(np.float32))
    every = fitting_blocks((*BLOCKS, *(UNIT + name for name in BLOCKS)), steps, 4)
    assert every
    for block in every:
        features = TouchFeatures((block,), PADS)

        whole, masked = features(values, None), features(values, torch.ones(3, steps) > 0)

        assert torch.equal(whole, masked), block


def blend(padded: bool, blocks: tuple[str, ...]) -> Blend:
    columns = TouchFeatures(blocks, PADS)(torch.zeros(1, 40, 4), None).shape[1]
    weight = torch.from_numpy(RNG.normal(size=(columns, 2)).astype(np.float32))
    head = LinearHead(
        offset=torch.zeros(columns), factor=torch.ones(columns), weight=weight, bias=torch.zeros(2)
    )
    plan = Plan(40, PADS, 2, (Part("linear", blocks),), padded)
    return Blend(plan, (head,), (1.0,), (1.0,)).eval()


def test_a_bundle_without_padding_takes_no_mask_and_says_the_same():
    blocks = ("statistics", "quantiles", "octaves", "spectrum")
    values = RNG.normal(size=(5, 40, 4)).astype(np.float32)
    mask = np.ones((5, 40), bool)
    found = blend(False, blocks)
    masked = blend(True, blocks)
    masked.load_state_dict({**found.state_dict(), "plan": masked.plan})

    models = [export_onnx(Classifier((own,)).eval(), 40, 4) for own in (found, masked)]
    whole, other = (WindowModel(model)(values, mask) for model in models)

    np.testing.assert_allclose(whole, other, atol=1e-6)
    assert len(models[0]) < len(models[1])


def test_a_plan_of_before_it_was_said_may_be_padded():
    plan = bytes(blend(False, ("mean",)).plan.tolist())
    assert not read_plan(plan).padded

    assert read_plan(plan.replace(b', "padded": false', b"")).padded


def test_weights_of_before_large_windows_were_thinned_see_every_row():
    plan = Plan(1000, (0,) * 100, 2, (Part("linear", ("mean",)),), padded=False)
    head = LinearHead(
        offset=torch.zeros(100), factor=torch.ones(100), weight=torch.ones(100, 2),
        bias=torch.zeros(2),
    )  # fmt: skip
    now = Blend(plan, (head,), (1.0,), (1.0,))
    values = torch.from_numpy(RNG.normal(size=(2, 1000, 100)).astype(np.float32))
    older = now.state_dict()
    text = bytes(older["plan"].tolist()).replace(b', "every_row": false', b"")
    older["plan"] = torch.tensor(list(text), dtype=torch.uint8)
    before = Blend()
    before.load_state_dict(older)

    (thin,), (whole,) = (own.features for own in (now, before))
    assert torch.allclose(whole(values, None), values.double().mean(dim=1))
    rows = ((torch.arange(400) + 0.5) / 400 * 1000).long()
    assert torch.allclose(thin(values, None), values[:, rows].double().mean(dim=1), atol=1e-6)
