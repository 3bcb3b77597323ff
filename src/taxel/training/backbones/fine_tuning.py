"""Train a backbone and heads together, from the cameras' images: any device, or several.

Start it under `torchrun` for several processes; Fabric finds them, and each decodes its own part of
the recordings. A checkpoint after each epoch lets a run that was killed go on. Heads only
shape the backbone here: train one on the new backbone's cached features afterwards, as always.
Knows nothing about files of weights, splits or tables.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from taxel.errors import MissingExtra
from taxel.models.backbones.catalogue import find_backbone
from taxel.models.frame_network import FrameNetwork
from taxel.models.torch_engine import enough_memory
from taxel.training.backbones.lanes import LANES, Batch, Lanes, lane_count, prepared, varied
from taxel.training.backbones.pace import check_gradient, pace
from taxel.training.checkpoints import load_checkpoint, save_checkpoint
from taxel.training.frames.heads import HeadConfig, Track, TrainedHead, fit_head, tracks_of
from taxel.windows.camera_recordings import CameraRecording

if TYPE_CHECKING:
    from taxel.training.frames.extractors import BackboneExtractor
    from taxel.training.frames.features import FrameFeatures


HEAD_RECORDINGS, HEAD_EPOCHS = 48, 4
"""Of the head before the backbone is trained: recordings that it is fitted on, and passes. Source:
our choice, docs/decisions/0057."""
_MOST_GRADIENT = 1.0
"""Length that a step's gradient is cut to. Source: our choice, docs/decisions/0057."""
_FAR = 2.0
"""Change over its threshold above which it does not matter how far. Source: our choice,
docs/decisions/0057."""
_GAUGE_KNEE = 0.1
"""Errors of the change over its threshold count by their square below this, by their size above.
Source: our choice, docs/decisions/0057."""
_RIDGE = 0.1
"""Of the gauge's closed form, times the mean square of a feature. Source: our choice,
docs/decisions/0057."""
_CARD_LANES, _CARD_MULTIPLE = 16, 64
"""Where a graphics card trains: lanes, so recordings whose stretches are mixed, and what the number
of images in a step is a multiple of. Source: our choice, docs/decisions/0057."""


@dataclass(frozen=True, slots=True)
class KeptEpochs:
    """A file written after each epoch, which all processes see."""

    path: Path
    resume: bool = True
    """Go on from what is there, with the losses that an unbroken run gives."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FineTuneConfig:
    """How a backbone is trained end to end."""

    epochs: int = 1
    """Passes over the recordings; each gives a stretch for every 60 frames."""
    batch: int = 4
    """Stretches in a step, over all processes: the same step from one and from several, who share
    it equally. Source: paper, section 5.1, of windows."""
    learning_rate: float = 1e-4
    """Adam's largest step size: a tenth of the paper's, since the backbone is trained already; it
    rises first, then falls to zero along half a cosine. At 3e-4 a ResNet50 lost itself."""
    varied: bool = True
    """Show stretches mirrored and with their colours in another order, each image of one alike."""
    accelerator: str = "auto"
    """Fabric's name of the device: auto, cpu, cuda, mps."""
    precision: Any = "32-true"
    """Fabric's name of the numbers, such as bf16-mixed."""
    seed: int = 0
    """Seed of the order."""
    kept: KeptEpochs | None = None
    """Where a run that is interrupted continues from; None keeps nothing."""


@dataclass(frozen=True, slots=True)
class EpochLoss:
    """What an epoch gave, as a checkpoint keeps it."""

    loss: float
    """Mean over all processes' stretches, nats."""


@dataclass(frozen=True, slots=True)
class FineTuned:
    """What a training did."""

    losses: tuple[float, ...]
    """Mean of each epoch over all processes' windows, nats."""
    first: bool
    """True in the process that writes files."""
    device: str
    processes: int


class EndToEnd(nn.Module):
    """Stretches of frames, and the grasp at rest → logits of "unstable" by head and window.

    A linear layer, the gauge, reads each frame's change over its threshold off the same features.

    Args:
        backbone: What `BACKBONES[name].build` made, with its weights.
        name: Its name there.
        heads: Trained on the same features of this backbone, so that they share their scaling;
            where they take "local-size", the backbone gives places.
        side_px: Height and width of its images, pixels; the backbone's own unless given.
    """

    def __init__(
        self,
        backbone: nn.Module,
        name: str,
        heads: Sequence[TrainedHead],
        side_px: int | None = None,
    ) -> None:
        super().__init__()
        self.features = FrameNetwork(backbone, name, side_px)
        self.heads = nn.ModuleList([head.module for head in heads])
        first = heads[0]
        self.tare, self.frames = first.config.tare, first.config.frames
        self.start = ""
        """The weights that training begins with, by their digest; empty where nobody said."""
        self.offset: Tensor
        self.factor: Tensor
        self.register_buffer("offset", torch.from_numpy(first.offset))
        self.register_buffer("factor", torch.from_numpy(first.factor))
        self.gauge = nn.Linear(first.offset.shape[-1], 1)
        nn.init.zeros_(self.gauge.weight)
        nn.init.ones_(self.gauge.bias)

    def forward(self, images: Tensor, frames: Tensor, rest: Tensor) -> tuple[Tensor, Tensor]:
        """Return logits of windows, (heads, n, s − k + 1), and frames' change, (n, s, cameras).

        The latter is that over its threshold, as the gauge reads it.

        Args:
            images: Shape (m, h, w, 3), uint8.
            frames: Shape (n, s, cameras): each frame's image.
            rest: Shape (n, r, cameras): images of each settled grasp.
        """
        found = self.features(images)
        seen = found[frames]
        if self.tare != "none":
            seen = seen - found[rest].median(dim=1, keepdim=True).values
            seen = seen if self.tare == "change" else seen.abs()
        if self.tare == "local-size":
            seen = seen.mean(dim=-2)
        scaled = (seen - self.offset) * self.factor
        windows = scaled.flatten(2).unfold(1, self.frames, 1).transpose(2, 3)
        flat, shape = windows.flatten(0, 1), windows.shape[:2]
        logits = torch.stack([head(flat).unflatten(0, shape) for head in self.heads])
        return logits, self.gauge(scaled).squeeze(-1)

    def train(self, mode: bool = True) -> EndToEnd:
        """Set the mode; normalisation keeps its statistics: batches here are too small for new."""
        super().train(mode)
        for module in self.features.modules():
            if isinstance(module, nn.modules.batchnorm._BatchNorm):
                module.eval()
        return self


def begin_end_to_end(
    extractor: BackboneExtractor,
    features: Sequence[FrameFeatures],
    labels: Sequence[NDArray[np.int8]],
    configs: Sequence[HeadConfig],
    excess: Sequence[NDArray[np.float32]] | None = None,
) -> EndToEnd:
    """Return a backbone with its weights and heads behind it, fitted on its features as they are.

    Args:
        extractor: The backbone.
        features: Of each recording, by this extractor.
        labels: Of each recording's frames, shape (n,).
        configs: How each head is fitted; in `HEAD_EPOCHS` at most, as it goes on learning. They
            differ in their network alone.
        excess: Of each recording's frames, shape (n, cameras): change over its threshold, which the
            gauge is fitted to.
    """
    tracks = tracks_of(features, labels)
    heads = [
        fit_head(tracks, replace(config, epochs=min(config.epochs, HEAD_EPOCHS)))
        for config in configs
    ]
    module = find_backbone(extractor.backbone).build("places" if extractor.places else "logits")
    extractor.weights.load_into(module)
    network = EndToEnd(module, extractor.backbone, heads, extractor.weights.side_px)
    network.start = extractor.weights.digest
    if excess is not None:
        _fit_gauge(network.gauge, heads[0], tracks, excess)
    return network


def _fit_gauge(
    gauge: nn.Linear, head: TrainedHead, tracks: Sequence[Track],
    excess: Sequence[NDArray[np.float32]],
) -> None:  # fmt: skip
    """Fit the gauge by least squares, its weights held small (ridge)."""
    some = slice(None, None, head.config.stride)
    rows = np.concatenate([head.scale(track.features())[some] for track in tracks])
    wanted = np.concatenate([np.minimum(each[some], _FAR) for each in excess]).ravel()
    rows = rows.reshape(len(wanted), -1).astype(np.float64)
    middle, mean = rows.mean(axis=0), wanted.mean()
    rows -= middle
    gram = rows.T @ rows
    gram[np.diag_indices_from(gram)] += _RIDGE * gram.diagonal().mean()
    weights = np.linalg.solve(gram, rows.T @ (wanted - mean))
    with torch.no_grad():
        gauge.weight.copy_(torch.from_numpy(weights)[None])
        gauge.bias.fill_(float(mean - middle @ weights))


@enough_memory()
def fine_tune(
    network: EndToEnd,
    pours: Sequence[CameraRecording],
    labels: Sequence[NDArray[np.int8]],
    config: FineTuneConfig,
    *,
    excess: Sequence[NDArray[np.float32]] | None = None,
    on_step: Callable[[int, int, float], None] = lambda _step, _of, _loss: None,
) -> FineTuned:
    """Train a network in place.

    Args:
        network: What is trained; filled with the result on every process.
        pours: Recordings to learn from.
        labels: One a frame, shape (n,): 0 stable, 1 unstable.
        config: How to train.
        excess: Of each recording's frames, shape (n, cameras): change over its threshold; the
            gauge's error is then part of the loss.
        on_step: Called with the step's number, how many there are and its loss.

    Raises:
        MissingExtra: Fabric is not installed.
        BadSource: An image cannot be decoded.
        BadDataset: The recordings give too few stretches.
        BadInput: The checkpoint is damaged or belongs to another configuration, a step cannot be
            shared out equally, a gradient is no longer a number, or the card has too little memory.
    """
    fabric = _launched(config)
    network.gauge.requires_grad_(excess is not None)
    network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    adam = torch.optim.Adam(
        [parameter for parameter in network.parameters() if parameter.requires_grad],
        lr=config.learning_rate,
    )
    model, optimiser = fabric.setup(network, adam)
    on_card = fabric.device.type != "cpu"
    count = lane_count(config.batch, fabric.world_size, _CARD_LANES if on_card else LANES)
    decoders, multiple = (os.cpu_count() or 1, _CARD_MULTIPLE) if on_card else (1, 1)
    lanes = Lanes(pours, labels, network.frames, count, decoders, multiple, excess)
    mine = range(fabric.global_rank, lanes.count, fabric.world_size)
    job = " ".join([lanes.digest(), network.tare, network.start]).rstrip()
    history: list[EpochLoss] = []
    checkpoint, config = config.kept, replace(config, kept=None)
    if checkpoint is not None and checkpoint.resume and checkpoint.path.exists():
        history = load_checkpoint(checkpoint.path, network, adam, config, EpochLoss, job)
    fabric.barrier()
    steps = -(-lanes.share // (config.batch // lanes.count))
    for epoch in range(len(history), config.epochs):
        model.train()
        torch.manual_seed(config.seed * 100_019 + epoch * 101 + fabric.global_rank)
        total, known = 0.0, 0
        for step, batch in enumerate(prepared(lanes.batches(config, epoch, mine)), 1):
            done = epoch * steps + step
            for group in adam.param_groups:
                group["lr"] = config.learning_rate * pace(done - 1, config.epochs * steps)
            here = batch.to(fabric.device)
            here = varied(here) if config.varied else here
            found = _take_step(fabric, model, optimiser, here, done, gauged=excess is not None)
            total, known = total + found * len(here.labels), known + len(here.labels)
            on_step(done, config.epochs * steps, found)
        both = fabric.all_reduce(torch.tensor([total, float(known)]), reduce_op="sum")
        history.append(EpochLoss(float(both[0]) / max(1.0, float(both[1]))))
        if checkpoint is not None and fabric.is_global_zero:
            save_checkpoint(checkpoint.path, network, adam, config, history, job)
        fabric.barrier()
    network.to(memory_format=torch.contiguous_format)  # type: ignore[call-overload]
    network.eval()
    return FineTuned(
        tuple(epoch.loss for epoch in history), fabric.is_global_zero, str(fabric.device),
        fabric.world_size,
    )  # fmt: skip


def _take_step(
    fabric: Any, model: Any, optimiser: Any, batch: Batch, step: int, *, gauged: bool
) -> float:
    """Change the weights by one batch; return its loss, without what the gauge adds.

    Args:
        fabric: In each of torchrun's processes.
        model: As Fabric has set it up.
        optimiser: The same.
        batch: On the model's device.
        step: Its number, 1 for the first.
        gauged: Whether the gauge learns too.

    Raises:
        BadInput: The gradient is no longer a number.
    """
    logits, read = model(batch.images, batch.frames, batch.rest)
    wanted = batch.labels.expand_as(logits)
    loss = functional.binary_cross_entropy_with_logits(logits.float(), wanted)
    optimiser.zero_grad(set_to_none=True)
    fabric.backward(loss + _misread(read, batch.excess) if gauged else loss)
    length = fabric.clip_gradients(
        model, optimiser, max_norm=_MOST_GRADIENT, error_if_nonfinite=False
    )
    check_gradient(float(length), step, "a smaller --learning-rate")
    optimiser.step()
    return float(loss.detach())


def _misread(read: Tensor, excess: Tensor) -> Tensor:
    """Return the gauge's mean error; above `_FAR` it need only say so."""
    error = torch.where(excess < _FAR, read - excess, (_FAR - read).clamp(min=0.0))
    return functional.smooth_l1_loss(error, torch.zeros_like(error), beta=_GAUGE_KNEE)


def _launched(config: FineTuneConfig) -> Any:
    """Return Fabric, in each of torchrun's processes."""
    try:
        from lightning_fabric import Fabric
    except ModuleNotFoundError as error:
        raise MissingExtra("lightning-fabric", "fine-tune", "training end to end") from error
    logging.getLogger("lightning_fabric").setLevel(logging.WARNING)  # its advice is of no use here
    # Fabric sees torchrun's processes, but takes one of them where the device is a processor.
    local, world = (int(os.environ.get(name, "0")) for name in ("LOCAL_WORLD_SIZE", "WORLD_SIZE"))
    fabric = Fabric(
        accelerator=config.accelerator,
        precision=config.precision,
        devices=local or "auto",
        num_nodes=world // local if local else 1,
    )
    fabric.launch()
    return fabric
