"""A transfer set on a graphics card: copies are changed anew each time they are shown.

Images as the camera gave them lie on the card; it draws the copies, and the teacher answers them
there, so that no answer has to be kept. On a processor answers cost too much to be given twice:
see `transfer_set`. Knows nothing about the student.

Background of our choices: docs/decisions/0057.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from taxel.errors import BadDataset
from taxel.models.torch_engine import TorchEngine
from taxel.side_by_side import SideBySide
from taxel.training.backbones.touch_images import (
    BLUR_PX,
    BLURRED,
    COLOUR,
    CONTRAST,
    CUT,
    GAMMA,
    LIGHT,
    NEGATIVE,
    NOISE,
    TURN_DEG,
    ImageSource,
)
from taxel.training.backbones.transfer_set import TransferConfig

_RADIUS_PX = 8
"""Of a blur's kernel: four times its largest deviation."""


class FreshTransferSet:
    """Images on a device, with the teacher that answers them.

    Args:
        images: As the camera gave them, shape (n, h, w, 3), R G B.
        teacher: Frames (n, h, w, 3) → logits (n, 1000), on the same device.
        key: The teacher's, for `digest`.
        config: How many copies, and the student's size.
    """

    def __init__(
        self, images: NDArray[np.uint8], teacher: TorchEngine, key: str, config: TransferConfig
    ) -> None:
        whole = hashlib.sha256(f"{key} {config}".encode())
        whole.update(np.ascontiguousarray(images).data)
        self._digest = whole.hexdigest()
        self._images = torch.from_numpy(images).to(teacher.device)
        self._teacher, self._config = teacher, config

    def __len__(self) -> int:
        return len(self._images) * self._config.copies

    @property
    def device(self) -> torch.device:
        """Return where images and answers are given."""
        return self._images.device

    def digest(self) -> str:
        """Return a sum over all that determines them, hexadecimal."""
        return self._digest

    def take(self, part: NDArray[np.intp], epoch: int) -> tuple[Tensor, Tensor]:
        """Return images for the student, shape (n, 3, side, side), and the answers (n, 1000).

        Args:
            part: Which; of each image's copies, the first is the image itself.
            epoch: Copies are drawn anew in each.
        """
        device, copies = self._images.device, self._config.copies
        draw = torch.Generator(device)
        draw.manual_seed(int(np.random.default_rng([self._config.seed, epoch + 1, *part[:4]])
                             .integers(2**62)))  # fmt: skip
        images = self._images[torch.from_numpy(part // copies).to(device)]
        altered = torch.from_numpy(np.flatnonzero(part % copies)).to(device)
        if len(altered):
            images[altered] = changed_there(images[altered], draw)
        side = self._config.side_px
        small = functional.interpolate(
            images.permute(0, 3, 1, 2).float(), (side, side), mode="bilinear", align_corners=False
        )
        return small.round(), self._teacher.of(images)


def gather_fresh(
    videos: Sequence[ImageSource],
    teacher: TorchEngine,
    key: str,
    config: TransferConfig,
    on_images: Callable[[int], None] = lambda _: None,
) -> FreshTransferSet:
    """Return a transfer set whose images lie on the teacher's device.

    Args:
        videos: Where images come from.
        teacher: Gives 1000 logits for an image.
        key: The teacher's name, weights and numbers.
        config: Which images.
        on_images: Called with how many images there are, their copies counted.

    Raises:
        BadDataset: There are no images.
        BadTable: A video is cut short.
    """
    most = os.cpu_count() or 1
    beside = SideBySide(most)
    all_images: list[NDArray[np.uint8]] = []
    for first in range(0, len(videos), most):
        for images in beside.map(lambda video: list(video.images(config.frames)),
                                 videos[first : first + most]):  # fmt: skip
            all_images += images
        on_images(len(all_images) * config.copies)
    if not all_images:
        raise BadDataset("videos with images", "none", "give other recordings")
    return FreshTransferSet(np.stack(all_images), teacher, key, config)


def changed_there(images: Tensor, draw: torch.Generator) -> Tensor:
    """Return strongly changed copies, as `touch_images.changed` does with one, on any device.

    Args:
        images: Shape (n, h, w, 3), uint8.
        draw: What is drawn from, on the same device.
    """
    n = len(images)

    def uniform(low: float, high: float, *shape: int) -> Tensor:
        return low + (high - low) * torch.rand(n, *shape, generator=draw, device=draw.device)

    def normal(scale: float, *shape: int) -> Tensor:
        return scale * torch.randn(n, *shape, generator=draw, device=draw.device)

    values = _moved(images.permute(0, 3, 1, 2).float(), uniform)
    colours = torch.rand(n, 3, generator=draw, device=draw.device).argsort(dim=1)
    values = values.gather(1, colours[:, :, None, None].expand_as(values))
    values = torch.where((uniform(0, 1) < NEGATIVE)[:, None, None, None], 255 - values, values)
    values = (values.clamp(0, 255) / 255) ** normal(GAMMA, 1, 1, 1).exp()
    grey = values.mean(dim=(1, 2, 3), keepdim=True)
    gain = (normal(LIGHT, 1, 1, 1) + normal(COLOUR, 3, 1, 1)).exp()
    values = ((values - grey) * normal(CONTRAST, 1, 1, 1).exp() + grey) * gain
    blurred = uniform(0, 1) < BLURRED
    width = uniform(*BLUR_PX)[blurred]
    values[blurred] = _blurred(values[blurred], width)
    grain = torch.randn(values.shape, generator=draw, device=draw.device)
    values = values + uniform(0, NOISE, 1, 1, 1) * grain
    return (values * 255).clamp(0, 255).byte().permute(0, 2, 3, 1)


def _moved(images: Tensor, uniform: Callable[..., Tensor]) -> Tensor:
    """Return images cut, turned and mirrored; borders mirror what is inside."""
    height, width = images.shape[2:]
    size = uniform(*CUT, 1)
    turn = torch.deg2rad(uniform(-TURN_DEG, TURN_DEG, 1))
    mirror = torch.where(uniform(0, 1, 2) < 0.5, -1.0, 1.0)
    cos, sin = size * turn.cos(), size * turn.sin()
    across = torch.cat([cos * mirror[:, :1], -sin * mirror[:, 1:]], dim=1)
    down = torch.cat([sin * mirror[:, :1], cos * mirror[:, 1:]], dim=1)
    matrix = torch.stack([across, down], dim=1)
    half = torch.tensor([(width - 1) / 2, (height - 1) / 2], device=images.device)
    shift = uniform(-1.0, 1.0, 2) * (1.0 - size)
    # grid_sample's coordinates are −1…1 along each axis; the matrix is one of pixels.
    place = torch.cat([matrix * half[None, None] / half[None, :, None], shift[..., None]], dim=2)
    grid = functional.affine_grid(place, list(images.shape), align_corners=True)
    return functional.grid_sample(
        images, grid, mode="bilinear", padding_mode="reflection", align_corners=True
    )


def _blurred(images: Tensor, width: Tensor) -> Tensor:
    """Return images blurred by Gaussians, each of its own deviation, shape (n,), pixels."""
    n, channels, *_ = images.shape
    if not n:
        return images
    at = torch.arange(-_RADIUS_PX, _RADIUS_PX + 1, device=images.device)
    kernel = torch.exp(-0.5 * (at / width[:, None]) ** 2)
    kernel = (kernel / kernel.sum(dim=1, keepdim=True)).repeat_interleave(channels, dim=0)
    planes = functional.pad(images, [_RADIUS_PX] * 4, mode="reflect").reshape(
        1, n * channels, *(side + 2 * _RADIUS_PX for side in images.shape[2:])
    )
    planes = functional.conv2d(planes, kernel[:, None, :, None], groups=n * channels)
    planes = functional.conv2d(planes, kernel[:, None, None, :], groups=n * channels)
    return planes.reshape(images.shape)
