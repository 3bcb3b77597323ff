"""Train a backbone and its head together, from the cameras' images: any device, or several.

Start it under `torchrun` for several processes; Fabric finds them. The head only shapes
the backbone here: train one on the new backbone's cached features afterwards, as always.
Knows nothing about files of weights, splits or tables.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from taxel.errors import MissingExtra
from taxel.frame_codec import decode_jpeg
from taxel.models.frame_features import FrameFeatures
from taxel.training.heads import TrainedHead
from taxel.windows.camera_recordings import CameraRecording, frame_sets
from taxel.windows.rest import SETTLE
from taxel.windows.sequence import label_windows, window_starts

SHUFFLED = 2
"""Recordings whose windows are mixed at a time: 332 MB for six seconds at 60 Hz, 320×240."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FineTuneConfig:
    """How a backbone is trained end to end."""

    epochs: int = 1
    """Passes over the training windows."""
    batch: int = 4
    """Windows in a step and process. Source: paper, section 5.1."""
    learning_rate: float = 1e-4
    """Adam's step size: a tenth of the paper's, since the backbone is trained already."""
    accelerator: str = "auto"
    """Fabric's name of the device: auto, cpu, cuda, mps."""
    precision: Any = "32-true"
    """Fabric's name of the numbers, such as bf16-mixed."""
    seed: int = 0
    """Seed of the order."""


@dataclass(frozen=True, slots=True)
class FineTuned:
    """What a training did."""

    losses: tuple[float, ...]
    """Mean of each epoch over this process's windows, nats."""
    first: bool
    """True in the process that writes files."""
    device: str
    processes: int


class EndToEnd(nn.Module):
    """Frames of a window and of the grasp at rest → logit of "unstable".

    Args:
        backbone: What `BACKBONES[name].build` made, with its weights.
        name: Its name there.
        head: Trained on this backbone's features, with their scaling.
    """

    def __init__(self, backbone: nn.Module, name: str, head: TrainedHead) -> None:
        super().__init__()
        self.features = FrameFeatures(backbone, name)
        self.head = head.module
        self.tare = head.config.tare
        self.offset: Tensor
        self.factor: Tensor
        self.register_buffer("offset", torch.from_numpy(head.offset))
        self.register_buffer("factor", torch.from_numpy(head.factor))

    def forward(self, windows: Tensor, rest: Tensor) -> Tensor:
        """Return logits, shape (n,).

        Args:
            windows: Shape (n, k, 2, h, w, 3), uint8.
            rest: The settled grasp's images, shape (n, 2, h, w, 3), uint8.
        """
        n, k, cameras = windows.shape[:3]
        frames = torch.cat([windows, rest[:, None]], dim=1)
        found = self.features(frames.flatten(0, 2)).unflatten(0, (n, k + 1, cameras))
        seen = found[:, :k]
        if self.tare != "none":
            seen = seen - found[:, k:]
            seen = seen.abs() if self.tare == "size" else seen
        logits: Tensor = self.head(((seen - self.offset) * self.factor).flatten(2))
        return logits

    def train(self, mode: bool = True) -> EndToEnd:
        """Set the mode; normalisation keeps its statistics: batches here are too small for new."""
        super().train(mode)
        for module in self.features.modules():
            if isinstance(module, nn.modules.batchnorm._BatchNorm):
                module.eval()
        return self


def fine_tune(
    network: EndToEnd,
    pours: Sequence[CameraRecording],
    labels: Sequence[NDArray[np.int8]],
    config: FineTuneConfig,
    *,
    frames: int,
    stride: int,
    on_step: Callable[[int, int, float], None] = lambda _step, _of, _loss: None,
) -> FineTuned:
    """Train a network in place.

    Args:
        network: What is trained; filled with the result on every process.
        pours: Recordings to learn from.
        labels: One a frame, shape (n,): 0 stable, 1 unstable.
        config: How to train.
        frames: k.
        stride: Frames from one training window's start to the next.
        on_step: Called with the step's number, how many there are and its loss.

    Raises:
        MissingExtra: Fabric is not installed.
        BadSource: An image cannot be decoded.
    """
    try:
        from lightning_fabric import Fabric
    except ModuleNotFoundError as error:
        raise MissingExtra("lightning-fabric", "fine-tune", "training end to end") from error
    # Fabric sees torchrun's processes, but takes one of them where the device is a processor.
    local, world = (int(os.environ.get(name, 0)) for name in ("LOCAL_WORLD_SIZE", "WORLD_SIZE"))
    fabric = Fabric(
        accelerator=config.accelerator,
        precision=config.precision,
        devices=local or "auto",
        num_nodes=world // local if local else 1,
    )
    fabric.launch()
    optimiser = torch.optim.Adam(
        [one for one in network.parameters() if one.requires_grad],
        lr=config.learning_rate, eps=1e-3,
    )  # fmt: skip
    model, optimiser = fabric.setup(network, optimiser)
    model.train()
    places = [window_starts(len(pour), frames, stride) for pour in pours]
    share = sum(map(len, places)) // fabric.world_size
    own = _Own(fabric.global_rank, fabric.world_size, share)
    steps = config.epochs * -(-share // config.batch)
    number, losses = 0, []
    for epoch in range(config.epochs):
        order = np.random.default_rng((config.seed, epoch))
        total, count = 0.0, 0
        drawn = _windows(pours, labels, places, frames, order, own)
        for windows, rest, wanted in _batches(drawn, config.batch):
            logits = model(windows.to(fabric.device), rest.to(fabric.device))
            loss = functional.binary_cross_entropy_with_logits(logits, wanted.to(fabric.device))
            optimiser.zero_grad(set_to_none=True)
            fabric.backward(loss)
            optimiser.step()
            number += 1
            total, count = total + float(loss.detach()) * len(wanted), count + len(wanted)
            on_step(number, steps, float(loss.detach()))
        losses.append(total / max(1, count))
    network.eval()
    return FineTuned(tuple(losses), fabric.is_global_zero, str(fabric.device), fabric.world_size)


@dataclass(frozen=True, slots=True)
class _Own:
    """Which windows one of several processes draws: every `ranks`-th."""

    rank: int
    ranks: int
    windows: int
    """How many of an epoch, the same for all."""


_Drawn = tuple[NDArray[np.uint8], NDArray[np.uint8], int]


def _windows(
    pours: Sequence[CameraRecording],
    labels: Sequence[NDArray[np.int8]],
    places: Sequence[NDArray[np.intp]],
    frames: int,
    order: np.random.Generator,
    own: _Own,
) -> Iterator[_Drawn]:
    """Yield this process's windows, a few recordings mixed at a time."""
    given, turn = 0, 0
    shuffled = order.permutation(len(pours))
    for first in range(0, len(pours), SHUFFLED):
        group = shuffled[first : first + SHUFFLED]
        mixed = order.permutation([(i, start) for i in group for start in places[i]])
        images, rests = {}, {}
        for i in group:
            images[i] = _decode(pours[i])
            rests[i] = np.median(images[i][SETTLE], axis=0).astype(np.uint8)
        wanted = {i: label_windows(labels[i], frames) for i in group}
        for i, start in mixed:
            turn += 1
            if turn % own.ranks == own.rank and given < own.windows:
                given += 1
                yield images[i][start : start + frames], rests[i], int(wanted[i][start])


def _decode(pour: CameraRecording) -> NDArray[np.uint8]:
    """Return all images, shape (n, cameras, h, w, 3)."""
    found = [[decode_jpeg(frame.jpeg, pour.cameras[frame.camera]) for frame in one.frames]
             for one in frame_sets(pour.path, len(pour.cameras))]  # fmt: skip
    return np.asarray(found, np.uint8)


def _batches(drawn: Iterator[_Drawn], size: int) -> Iterator[tuple[Tensor, Tensor, Tensor]]:
    batch: list[_Drawn] = []
    for one in drawn:
        batch.append(one)
        if len(batch) == size:
            yield _stack(batch)
            batch = []
    if batch:
        yield _stack(batch)


def _stack(batch: list[_Drawn]) -> tuple[Tensor, Tensor, Tensor]:
    windows, rests, wanted = zip(*batch, strict=True)
    return (
        torch.from_numpy(np.stack(windows)),
        torch.from_numpy(np.stack(rests)),
        torch.tensor(wanted, dtype=torch.float32),
    )
