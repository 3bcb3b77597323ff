"""ResNet50 and ResNet101 as Keras builds them, with their 1000-way top.

Unlike torchvision's: convolutions have biases and a block's stride stands on
its first, 1×1 convolution. 25,636,712 and 44,707,176 numbers. Knows nothing
about weights, files or training.

Source: He et al., CVPR 2016; keras.applications.resnet.
"""

from __future__ import annotations

from collections import OrderedDict

from torch import Tensor, nn

from taxel.models.backbones.keras_layers import KerasClassifier, PixelScale, Top, batch_norm

BLOCKS_50 = (3, 4, 6, 3)
"""Blocks in each stage. Source: the paper, Table 1, 50-layer."""
BLOCKS_101 = (3, 4, 23, 3)
"""Blocks in each stage. Source: the paper, Table 1, 101-layer."""
EPS = 1.001e-5
"""Added to a variance. Source: keras.applications.resnet."""
MEAN = (123.68, 116.779, 103.939)
"""ImageNet's mean pixel, R G B, of 255. Source: keras' preprocess_input, mode "caffe"."""
CLASSES = 1000


class Bottleneck(nn.ModuleDict):
    """Narrow, convolve, widen, and add what came in.

    Args:
        inputs: Channels that come in.
        width: Channels inside; four times as many go out.
        stride: Of the first convolution.
        project: Whether what came in must change its shape to be added.
    """

    def __init__(self, inputs: int, width: int, stride: int, project: bool) -> None:
        outputs = 4 * width
        layers: dict[str, nn.Module] = {
            "1_conv": nn.Conv2d(inputs, width, 1, stride=stride),
            "1_bn": batch_norm(width, EPS),
            "2_conv": nn.Conv2d(width, width, 3, padding=1),
            "2_bn": batch_norm(width, EPS),
            "3_conv": nn.Conv2d(width, outputs, 1),
            "3_bn": batch_norm(outputs, EPS),
        }
        if project:
            layers["0_conv"] = nn.Conv2d(inputs, outputs, 1, stride=stride)
            layers["0_bn"] = batch_norm(outputs, EPS)
        super().__init__(layers)

    def forward(self, maps: Tensor) -> Tensor:
        """Return maps (n, 4·width, h / stride, w / stride) of maps (n, inputs, h, w)."""
        short: Tensor = self["0_bn"](self["0_conv"](maps)) if "0_conv" in self else maps
        inner = self["1_bn"](self["1_conv"](maps)).relu()
        inner = self["2_bn"](self["2_conv"](inner)).relu()
        outcome: Tensor = (short + self["3_bn"](self["3_conv"](inner))).relu()
        return outcome


class ResNet(nn.Module):
    """Images (n, 3, 224, 224), R G B, 0 to 255 → features (n, 1000).

    Args:
        blocks: Blocks in each of the four stages.
        top: What the 1000-way top gives.
    """

    def __init__(self, blocks: tuple[int, int, int, int], top: Top = "logits") -> None:
        super().__init__()
        self.scale = PixelScale(MEAN, (1.0, 1.0, 1.0), bgr=True)
        first: dict[str, nn.Module] = {
            "conv": nn.Conv2d(3, 64, 7, stride=2, padding=3),
            "bn": batch_norm(64, EPS),
            "relu": nn.ReLU(),
            # Keras pads with zeros; after a ReLU that equals padding with nothing.
            "pool": nn.MaxPool2d(3, stride=2, padding=1),
        }
        self.conv1 = nn.Sequential(OrderedDict(first))
        self.conv2 = _stage(64, 64, blocks[0], stride=1)
        self.conv3 = _stage(256, 128, blocks[1], stride=2)
        self.conv4 = _stage(512, 256, blocks[2], stride=2)
        self.conv5 = _stage(1024, 512, blocks[3], stride=2)
        self.predictions = KerasClassifier(2048, CLASSES, top)

    def forward(self, images: Tensor) -> Tensor:
        """Return features, shape (n, 1000), of images (n, 3, 224, 224), 0 to 255."""
        maps = self.conv3(self.conv2(self.conv1(self.scale(images))))
        features: Tensor = self.predictions(self.conv5(self.conv4(maps)))
        return features


def build_resnet50(top: Top = "logits") -> ResNet:
    """Return a ResNet50."""
    return ResNet(BLOCKS_50, top)


def build_resnet101(top: Top = "logits") -> ResNet:
    """Return a ResNet101."""
    return ResNet(BLOCKS_101, top)


def _stage(inputs: int, width: int, blocks: int, stride: int) -> nn.Sequential:
    each = [Bottleneck(inputs, width, stride, project=True)]
    each += [Bottleneck(4 * width, width, 1, project=False) for _ in range(blocks - 1)]
    return nn.Sequential(OrderedDict((f"block{i + 1}", block) for i, block in enumerate(each)))
