"""Every backbone: the paper's counts, its operations, what it takes and gives."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from torch.utils.flop_counter import FlopCounterMode

from taxel.errors import BadInput
from taxel.models.backbones.catalogue import BACKBONES, find_backbone
from taxel.models.backbones.keras_layers import same_pad
from taxel.models.counting import keras_parameters

COUNTS = {
    "densenet121": 8_062_504,
    "efficientnet-b0": 5_330_571,
    "resnet50": 25_636_712,
    "resnet101": 44_707_176,
}
"""Of keras.applications' networks with their tops."""


@pytest.mark.parametrize("name", COUNTS)
def test_a_backbone_has_exactly_as_many_numbers_as_keras(name: str) -> None:
    with torch.device("meta"):
        module = BACKBONES[name].build("logits")

    assert keras_parameters(module) == COUNTS[name]


@pytest.mark.parametrize("name", BACKBONES)
def test_the_catalogue_states_size_features_and_operations_as_they_are(name: str) -> None:
    row = BACKBONES[name]
    with torch.device("meta"):
        module = row.build("logits").eval()
        features = module(torch.zeros(2, 3, row.height_px, row.width_px, dtype=torch.uint8))
        with FlopCounterMode(display=False) as counter, torch.no_grad():
            module(torch.zeros(1, 3, row.height_px, row.width_px))

    assert features.shape == (2, row.features)
    assert counter.get_total_flops() == row.flops


def test_the_edge_backbone_is_small() -> None:
    """At most 200,000 numbers and 40 MFLOP a frame."""
    with torch.device("meta"):
        assert keras_parameters(BACKBONES["edge"].build("logits")) <= 200_000

    assert 30e6 <= BACKBONES["edge"].flops <= 40e6


def test_bytes_and_floats_of_the_same_pixels_give_the_same_features() -> None:
    torch.manual_seed(0)
    module = BACKBONES["edge"].build("logits").eval()
    pixels = np.random.default_rng(0).integers(0, 256, (2, 3, 120, 160), np.uint8)

    with torch.no_grad():
        from_bytes = module(torch.from_numpy(pixels))
        from_floats = module(torch.from_numpy(pixels.astype(np.float32)))

    assert torch.equal(from_bytes, from_floats)


def test_the_softmax_top_is_the_softmax_of_the_logits() -> None:
    """The same network gives both, and says which."""
    torch.manual_seed(0)
    row = BACKBONES["efficientnet-lite0"]
    logits, probabilities = row.build("logits").eval(), row.build("softmax").eval()
    probabilities.load_state_dict(logits.state_dict())
    images = torch.randint(0, 256, (1, 3, 224, 224), dtype=torch.uint8)

    with torch.no_grad():
        wanted = logits(images).softmax(dim=1)
        found = probabilities(images)

    torch.testing.assert_close(found, wanted)
    assert found.sum().item() == pytest.approx(1.0, abs=1e-5)


@pytest.mark.parametrize("name", [name for name, row in BACKBONES.items() if row.places])
def test_logits_are_the_mean_over_places(name: str) -> None:
    """The same network gives both: its top is linear, and so the order does not matter."""
    torch.manual_seed(0)
    row = BACKBONES[name]
    whole, apart = row.build("logits").eval(), row.build("places").eval()
    apart.load_state_dict(whole.state_dict())
    images = torch.randint(0, 256, (1, 3, 96, 96), dtype=torch.uint8)

    with torch.no_grad():
        wanted, found = whole(images), apart(images)

    assert found.shape == (1, 9, row.features)
    largest = wanted.abs().max().item()
    torch.testing.assert_close(found.mean(dim=1), wanted, rtol=1e-4, atol=1e-4 * largest)


def test_same_padding_puts_the_odd_zero_behind_as_tensorflow_does() -> None:
    """A 3-wide kernel with stride 2 over 4 pixels looks at 0 1 2 and 2 3 and a zero."""
    row = torch.arange(1.0, 5.0).expand(1, 1, 4, 4)

    assert same_pad(3)(row)[0, 0, 0].tolist() == [1, 2, 3, 4, 0]
    assert same_pad(5)(row)[0, 0, 1].tolist() == [0, 1, 2, 3, 4, 0, 0]


def test_an_unknown_backbone_is_refused_in_one_line() -> None:
    with pytest.raises(BadInput, match=r"needed one of the backbones densenet121, .*got 'vgg'"):
        find_backbone("vgg")


def test_under_autocast_a_processor_convolves_channel_by_channel_in_32_bits() -> None:
    """PyTorch's backward pass of it in bfloat16 takes eight times as long; all else is in 16."""
    torch.manual_seed(0)
    module = BACKBONES["efficientnet-b0"].build("logits").eval()
    seen: dict[str, torch.dtype] = {}
    for name, layer in module.named_modules():
        if isinstance(layer, torch.nn.Conv2d):
            layer.register_forward_hook(lambda _m, _i, out, key=name: seen.update({key: out.dtype}))

    with torch.no_grad(), torch.autocast("cpu", torch.bfloat16):
        module(torch.randint(0, 256, (1, 3, 64, 64), dtype=torch.uint8))

    by_channel = {name for name in seen if name.endswith("dwconv")}
    assert len(by_channel) == 16
    assert {seen[name] for name in by_channel} == {torch.float32}
    assert {seen[name] for name in seen.keys() - by_channel} == {torch.bfloat16}
