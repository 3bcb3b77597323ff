"""A backbone that begins with a relative's weights: it answers as the relative, or nearly so."""

import copy

import pytest
import torch
from torch import nn

from taxel.models.backbones.catalogue import BACKBONES
from taxel.models.backbones.efficientnet_b0 import EfficientNetB0, SqueezeExcite
from taxel.models.backbones.random_start import fill_randomly
from taxel.models.backbones.relatives import RELATIVES, begin_with_relative, grow_resnet
from taxel.models.backbones.resnet import BLOCKS_50, BLOCKS_101, ResNet


def _images(side_px: int = 64) -> torch.Tensor:
    return torch.rand(2, 3, side_px, side_px, generator=torch.Generator().manual_seed(3)) * 255


def _norms_are_no_identity(module: nn.Module) -> None:
    """Give batch norms numbers that show when one is not copied."""
    draw = torch.Generator().manual_seed(5)
    for layer in module.modules():
        if isinstance(layer, nn.BatchNorm2d):
            for tensor in (layer.weight.data, layer.bias.data, layer.running_var):
                tensor += 0.2 * torch.rand(tensor.shape, generator=draw)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("blocks", "more"),
    [((1, 1, 1, 1), (1, 1, 3, 1)), ((1, 2, 2, 1), (2, 3, 2, 2)), (BLOCKS_50, BLOCKS_101)],
)
def test_a_grown_resnet_gives_the_relatives_features(
    blocks: tuple[int, int, int, int], more: tuple[int, int, int, int]
) -> None:
    relative, network = ResNet(blocks).eval(), ResNet(more).eval()
    fill_randomly(relative, "resnet50", seed=1)
    _norms_are_no_identity(relative)

    grow_resnet(network, relative)

    with torch.no_grad():
        wanted, found = relative(_images()), network(_images())
    assert (found - wanted).abs().max() <= 1e-4 * wanted.abs().max()


def test_a_further_block_of_a_grown_resnet_learns() -> None:
    """Its gain is 0, but what it would add reaches the loss."""
    relative, network = ResNet((1, 1, 1, 1)), ResNet((1, 1, 2, 1))
    fill_randomly(relative, "resnet50", seed=1)
    grow_resnet(network, relative)

    network.eval()(_images()).square().mean().backward()

    gain = network.get_submodule("conv4.block2.3_bn").weight
    assert gain.abs().max() == 0
    assert gain.grad is not None
    assert gain.grad.abs().max() > 0


def test_lite0s_convolutions_fit_b0_one_by_one_and_its_gates_begin_nearly_open() -> None:
    lite = BACKBONES["efficientnet-lite0"].build("logits")
    network = BACKBONES["efficientnet-b0"].build("logits")
    fill_randomly(lite, "efficientnet-lite0", seed=1)
    _norms_are_no_identity(lite)

    begin_with_relative(network, "efficientnet-b0", lite, seed=0)

    own = network.state_dict()
    assert all(torch.equal(own[name], value) for name, value in lite.state_dict().items())
    gates = [module for module in network.modules() if isinstance(module, SqueezeExcite)]
    assert len(gates) == 16
    maps = torch.rand(2, gates[3].reduce.in_channels, 4, 4)
    open_share = gates[3](maps) / maps
    assert ((open_share > 0.9) & (open_share < 1)).all()


def test_with_open_gates_and_lite0s_activation_b0_is_lite0() -> None:
    """So its pixels are scaled as Lite0's are."""
    lite = BACKBONES["efficientnet-lite0"].build("logits").eval()
    network = BACKBONES["efficientnet-b0"].build("logits").eval()
    assert isinstance(network, EfficientNetB0)
    fill_randomly(lite, "efficientnet-lite0", seed=1)
    begin_with_relative(network, "efficientnet-b0", lite, seed=0)
    alike = copy.deepcopy(network)
    for module in alike.modules():
        for name, child in module.named_children():
            if isinstance(child, SqueezeExcite):
                setattr(module, name, nn.Identity())
            elif isinstance(child, nn.SiLU):
                setattr(module, name, nn.ReLU6())

    with torch.no_grad():
        wanted, found = lite(_images(224)), alike(_images(224))
    assert (found - wanted).abs().max() <= 1e-4 * wanted.abs().max()


def test_every_relative_is_a_backbone() -> None:
    assert {*RELATIVES, *RELATIVES.values()} <= set(BACKBONES)
