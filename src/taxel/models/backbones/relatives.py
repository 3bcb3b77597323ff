"""A backbone without trained weights begins with those of a relative that has some.

ResNet101 grows out of ResNet50: the blocks that both have are copied, and each further one begins
as a copy of its stage's last whose gain is 0, so that it hands on what came in. EfficientNetB0
takes Lite0's convolutions, which have the same shapes; its gates begin nearly open. Knows nothing
about where weights lie, or about training.

Background of our choices: docs/decisions/0057.
"""

from __future__ import annotations

import torch
from torch import nn

from taxel.models.backbones.efficientnet_b0 import EfficientNetB0, SqueezeExcite
from taxel.models.backbones.efficientnet_lite import MEAN, SPREAD
from taxel.models.backbones.resnet import ResNet

RELATIVES = {"resnet101": "resnet50", "efficientnet-b0": "efficientnet-lite0"}
"""Backbone → the relative that it can begin with."""
OPEN_GATE = 3.0
"""What a gate of a squeeze-and-excitation begins with, before the logistic function: 0.95 of a
channel passes. Source: our choice."""
_FEW = 0.1
"""Of a gate's usual random weights, so that all gates begin alike. Source: our choice."""


def grow_resnet(network: ResNet, relative: ResNet) -> None:
    """Fill a ResNet from one with fewer blocks, so that both give the same features.

    Args:
        network: What is filled; each of its stages has at least as many blocks.
        relative: With trained weights.
    """
    for name in ("conv2", "conv3", "conv4", "conv5"):
        stage, given = network.get_submodule(name), relative.get_submodule(name)
        assert isinstance(stage, nn.Sequential)
        assert isinstance(given, nn.Sequential)
        for number, block in enumerate(stage):
            further = number >= len(given)
            source = given[-1 if further else number]
            # The first block of a stage changes the shape, which no further one does.
            if not further or len(given) > 1:
                block.load_state_dict(source.state_dict())
            if further:
                _hand_on(block)
    network.conv1.load_state_dict(relative.conv1.state_dict())
    network.predictions.load_state_dict(relative.predictions.state_dict())


def _hand_on(block: nn.Module) -> None:
    """Let a block add nothing: what comes in is not negative, so that its last ReLU keeps it."""
    norm = block.get_submodule("3_bn")
    assert isinstance(norm, nn.BatchNorm2d)
    nn.init.zeros_(norm.weight)
    nn.init.zeros_(norm.bias)


def open_gates(network: EfficientNetB0, relative: nn.Module, seed: int = 0) -> None:
    """Fill an EfficientNetB0 with Lite0's weights, pixels scaled as Lite0 takes them.

    Args:
        network: What is filled.
        relative: An EfficientNet-Lite0 with trained weights.
        seed: Of the gates.
    """
    given = {k: v for k, v in relative.state_dict().items() if not k.startswith("scale.")}
    found = network.load_state_dict(given, strict=False)
    left = {key for key in found.missing_keys if ".se." not in key and "normalization" not in key}
    assert not left
    assert not found.unexpected_keys
    draw = torch.Generator().manual_seed(seed)
    for gate in network.modules():
        if isinstance(gate, SqueezeExcite):
            for conv, share in ((gate.reduce, 1.0), (gate.expand, _FEW)):
                nn.init.kaiming_normal_(conv.weight, nonlinearity="linear", generator=draw)
                conv.weight.data *= share
            nn.init.zeros_(gate.reduce.bias)  # type: ignore[arg-type]
            nn.init.constant_(gate.expand.bias, OPEN_GATE)  # type: ignore[arg-type]
    _scale_as_lite(network)


def _scale_as_lite(network: EfficientNetB0) -> None:
    """Set B0's own normalisation so that the stem sees (pixel − 127) ÷ 128."""
    factor = network.rescale.reshape(3)
    network.normalization.mean.fill_(MEAN / 255)
    network.normalization.variance.copy_((factor * SPREAD / 255).square())


def begin_with_relative(module: nn.Module, backbone: str, relative: nn.Module, seed: int) -> None:
    """Fill a backbone with what a relative of `RELATIVES` has learned.

    Args:
        module: What `BACKBONES[backbone].build` made.
        backbone: Its name there.
        relative: The relative with its weights.
        seed: Of what has no counterpart.
    """
    if backbone == "resnet101":
        assert isinstance(module, ResNet)
        assert isinstance(relative, ResNet)
        grow_resnet(module, relative)
        return
    assert isinstance(module, EfficientNetB0)
    open_gates(module, relative, seed)
