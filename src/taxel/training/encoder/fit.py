"""Pretrain the touch encoder: pairs of images of one video, a checkpoint each epoch.

An interrupted run continues from its last whole epoch with the numbers that an uninterrupted one
gives: what an epoch draws depends on the seed and its number alone. Knows nothing about cards,
labels or probes.

Background of our choices: docs/decisions/0058.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from taxel.errors import BadDataset
from taxel.models.backbones.touch import TouchEncoder
from taxel.models.backbones.weight_files import tensor_digest
from taxel.training.backbones.fine_tuning import EpochLoss, KeptEpochs
from taxel.training.checkpoints import load_checkpoint, save_checkpoint
from taxel.training.encoder.change import changes, slip_size
from taxel.training.encoder.pretext import Pretext, Targets
from taxel.training.encoder.videos import TouchVideo, seen_digest

Image = NDArray[np.uint8]
GAIN, LEVEL, JITTER, GRAIN = 0.15, 12.0, 0.02, 2.0
"""Spread of a pair's gain by colour, its level (grey levels), each image's own gain and grain.
Source: our choice: sensors differ in light, and one sensor's light drifts."""
_DECAY = 1e-4
_WARM = 0.05
"""Share of the steps in which the step size rises. Source: our choice."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EncoderConfig:
    """How the encoder is pretrained."""

    epochs: int = 4
    steps: int = 100
    """Of an epoch."""
    batch: int = 48
    """Pairs of images in a step."""
    learning_rate: float = 2e-3
    """AdamW's largest step size; it falls to 0 as a cosine."""
    bf16: bool = False
    """Train in 16 bits: 1.7 times as fast on a processor that multiplies bfloat16."""
    seed: int = 0


@dataclass(frozen=True, slots=True)
class Pretrained:
    """What pretraining gave."""

    encoder: TouchEncoder
    losses: list[float]
    """Of each epoch, mean over its steps."""


def fit_encoder(
    videos: Sequence[TouchVideo],
    config: EncoderConfig,
    *,
    start: Mapping[str, Tensor] | None = None,
    kept: KeptEpochs | None = None,
    on_step: Callable[[int, int, float], None] = lambda step, of, loss: None,
) -> Pretrained:
    """Return an encoder and each epoch's mean loss.

    Args:
        videos: What it may see; each folder is drawn from as often, whatever its size.
        config: How.
        start: An encoder's tensors to begin with; drawn anew unless given.
        kept: Where a run that is interrupted continues from; None keeps nothing.
        on_step: Called with the step's number, how many there are and its loss.

    Raises:
        BadDataset: There is no video.
        BadInput: The checkpoint is damaged or belongs to another configuration or other data.
    """
    if not videos:
        raise BadDataset("at least one video to pretrain on", "none", "name another folder")
    torch.manual_seed(config.seed)
    network = Pretext(bf16=config.bf16)
    network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    if start is not None:
        network.encoder.load_state_dict(dict(start), strict=False)
    optimiser = torch.optim.AdamW(
        network.parameters(), lr=config.learning_rate, weight_decay=_DECAY
    )
    job = f"touch encoder {seen_digest(videos)} {tensor_digest(start) if start else ''}"
    history: list[EpochLoss] = []
    if kept is not None and kept.resume and kept.path.exists():
        history = load_checkpoint(kept.path, network, optimiser, config, EpochLoss, job)
    for epoch in range(len(history), config.epochs):
        history.append(EpochLoss(_epoch(network, optimiser, videos, config, epoch, on_step)))
        if kept is not None:
            save_checkpoint(kept.path, network, optimiser, config, history, job)
    return Pretrained(network.encoder.eval(), [epoch.loss for epoch in history])


def _epoch(
    network: Pretext,
    optimiser: torch.optim.Optimizer,
    videos: Sequence[TouchVideo],
    config: EncoderConfig,
    epoch: int,
    on_step: Callable[[int, int, float], None],
) -> float:
    random = np.random.default_rng((config.seed, epoch))
    network.train()
    losses, whole = [], config.epochs * config.steps
    for number in range(config.steps):
        step = epoch * config.steps + number
        for group in optimiser.param_groups:
            group["lr"] = config.learning_rate * _share(step / whole)
        first, second, slip = _draw(videos, config.batch, random)
        changed = changes(first, second)
        targets = Targets(
            *(torch.from_numpy(part) for part in (changed.flow, changed.grey, changed.size, slip))
        )
        loss = network(_seen(first, random), _seen(second, random), targets)
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), 5.0)
        optimiser.step()
        losses.append(float(loss.detach()))
        on_step(step + 1, whole, losses[-1])
    return float(np.mean(losses))


def _share(done: float) -> float:
    """Return the share of the largest step size at a share of the way, 0…1."""
    return (
        done / _WARM
        if done < _WARM
        else 0.5 * (1 + math.cos(math.pi * (done - _WARM) / (1 - _WARM)))
    )


def _draw(
    videos: Sequence[TouchVideo], pairs: int, random: np.random.Generator
) -> tuple[Image, Image, NDArray[np.float32]]:
    """Return first and second images, shape (pairs, 120, 160, 3), and the slip between them."""
    folders = sorted({video.folder for video in videos})
    by_folder = [[video for video in videos if video.folder == folder] for folder in folders]
    first, second, slip = [], [], []
    for number in range(pairs):
        own = by_folder[number % len(by_folder)]
        video = own[random.integers(len(own))]
        stretch = random.integers(len(video.images))
        before, after = random.choice(video.images.shape[1], 2, replace=False)
        pair = _lit(video.images[stretch, [before, after]], random)
        first.append(pair[0])
        second.append(pair[1])
        slip.append(slip_size(video.slip_um[stretch, before], video.slip_um[stretch, after]))
    return np.stack(first), np.stack(second), np.array(slip, np.float32)


def _lit(pair: Image, random: np.random.Generator) -> Image:
    """Return both images mirrored and lit alike at random."""
    if random.random() < 0.5:
        pair = pair[:, :, ::-1]
    if random.random() < 0.5:
        pair = pair[:, ::-1]
    gain = np.exp(GAIN * random.normal(size=3)).astype(np.float32)
    level = np.float32(LEVEL * random.normal())
    lit: Image = np.clip(pair * gain + level, 0, 255).astype(np.uint8)
    return lit


def _seen(images: Image, random: np.random.Generator) -> Tensor:
    """Return images as the network takes them, each with a gain and grain of its own."""
    pixels = torch.from_numpy(images).permute(0, 3, 1, 2).float()
    gain = torch.from_numpy(np.exp(JITTER * random.normal(size=(len(images), 1, 1, 1))))
    grain = torch.from_numpy(random.standard_normal(pixels.shape, np.float32))
    seen = pixels * gain.float() + GRAIN * grain
    return seen.contiguous(memory_format=torch.channels_last)
