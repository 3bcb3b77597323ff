"""A student learns a teacher's 1000 answers: normalisation and top first, then the whole network.

Before the first epoch the batch norms take the statistics of touch, and the top is fitted to the
teacher's logits in closed form, unless the student's answers are nearer as it is. A checkpoint
after each epoch lets a run that was killed go on.
Knows nothing about where images come from, files of weights or tables.

Background of our choices: docs/decisions/0057.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from taxel.models.torch_engine import enough_memory, in_numbers
from taxel.plain_text import number_of
from taxel.training.backbones.fine_tuning import KeptEpochs
from taxel.training.backbones.pace import check_gradient, pace
from taxel.training.backbones.transfer_set import TransferSet
from taxel.training.checkpoints import load_checkpoint, save_checkpoint

BATCH = 32
"""Images in a step, for which step sizes are set. Source: our choice, docs/decisions/0057."""
RIDGE = 0.1
"""Of the closed form, times the mean square of a feature. Source: our choice."""
NORM_BATCHES = 24
"""Batches that batch norms take their statistics from. Source: our choice."""
_NORM_MOMENTUM = 0.1
"""Share of a new batch in the moving statistics while a student learns: Keras' 0.01 would lag
behind in so few steps. Source: our choice."""
_KEPT_PACE = 0.1
"""Share of the step size where norms keep their statistics: nothing rescales what a large step
breaks. Source: our choice, docs/decisions/0057."""
_COMPARED, _COMPARED_SHARE = 256, 0.1
"""Images by which a start is judged, and their share of all at most; the fit does not see them.
Source: our choice."""
_EVALUATION_BATCH = 64
"""Images looked at together where nothing is learned, at the least."""


class Learnable(Protocol):
    """Images with a teacher's answers, kept or given anew."""

    def __len__(self) -> int: ...

    @property
    def device(self) -> torch.device:
        """Return where images and answers are given."""
        ...

    def digest(self) -> str:
        """Return a sum over all that determines them."""
        ...

    def take(self, part: NDArray[np.intp], epoch: int) -> tuple[Tensor, Tensor]:
        """Return images, shape (n, 3, side, side), 0 to 255, and the answers, (n, 1000)."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class DistilConfig:
    """How a student learns."""

    epochs: int = 4
    """Passes over all images."""
    sides_px: tuple[int, ...] = ()
    """Height and width that images are resized to, pixels; passes are shared out evenly among them,
    in this order. Empty: as they are given."""
    batch: int = BATCH
    """Images in a step."""
    learning_rate: float = 1e-3
    """Adam's largest step size; it rises first, then falls to zero along half a cosine."""
    temperature: float = 2.0
    """Both sides' logits are divided by it before the softmax. Source: our choice, after Hinton,
    Vinyals and Dean, 2015, who soften answers so that wrong classes count too."""
    bf16: bool = False
    """Convolutions and products in 16 bits (bfloat16), for processors that multiply these."""
    seed: int = 0
    """Of the images' order."""


@dataclass(frozen=True, slots=True)
class DistilEpoch:
    """What an epoch gave, as a checkpoint keeps it."""

    loss: float
    """Mean over all steps, nats."""
    norms_kept: bool = False
    """Whether batch norms keep the statistics that they came with."""


@dataclass(frozen=True, slots=True)
class Agreement:
    """How often a student's first answer is its teacher's."""

    share: float
    """0…1."""
    commonest: float
    """What always naming the teacher's commonest answer there would reach, 0…1."""
    images: int

    @property
    def words(self) -> str:
        """In a few words, such as "0.84 of 300 images (commonest answer 0.41)"."""
        return (
            f"{self.share:.3f} of {number_of(self.images, 'image')} (commonest answer "
            f"{self.commonest:.3f})"
        )


@enough_memory()
def distil(
    network: nn.Module,
    examples: Learnable,
    config: DistilConfig,
    *,
    kept: KeptEpochs | None = None,
    start: str = "",
    on_step: Callable[[int, int, float], None] = lambda _step, _of, _loss: None,
    on_fit: Callable[[int, int], None] = lambda _images, _of: None,
) -> tuple[DistilEpoch, ...]:
    """Train a student in place, on the device of its images; return what each epoch gave.

    Args:
        network: Images (n, 3, h, w) → logits (n, 1000); its top is called `predictions`.
        examples: What to learn from.
        config: How.
        kept: Where a run that is interrupted continues from; None keeps nothing.
        start: Names what the network begins with: a checkpoint of another start is refused.
        on_step: Called with the step's number, how many there are and its loss.
        on_fit: Called before the first epoch with the images that the top was fitted to so far,
            and how many there are.

    Raises:
        BadInput: The checkpoint is damaged or belongs to other images, another start or another
            configuration, or a gradient is no longer a number, or the card has too little memory.
        RecordingFailed: The disk refused.
    """
    network.to(examples.device, memory_format=torch.channels_last)  # type: ignore[call-overload]
    adam = torch.optim.Adam(network.parameters(), lr=config.learning_rate)
    job = f"{examples.digest()} {start}".rstrip()
    history: list[DistilEpoch] = []
    if kept is not None and kept.resume and kept.path.exists():
        history = load_checkpoint(kept.path, network, adam, config, DistilEpoch, job)
    norms_kept = history[-1].norms_kept if history else begin(network, examples, config, on_fit)
    rate = config.learning_rate * (_KEPT_PACE if norms_kept else 1.0)
    _set_momentum(network, _NORM_MOMENTUM)
    steps = len(examples) // config.batch or 1
    for epoch in range(len(history), config.epochs):
        _train_mode(network, norms_kept=norms_kept)
        order = np.random.default_rng([config.seed, epoch]).permutation(len(examples))
        total = 0.0
        for step in range(steps):
            part = order[step * config.batch : (step + 1) * config.batch]
            done = epoch * steps + step
            for group in adam.param_groups:
                group["lr"] = rate * pace(done, config.epochs * steps)
            images, answers = examples.take(part, epoch)
            loss = _loss(network, resized(images, config, epoch), answers, config)
            adam.zero_grad(set_to_none=True)
            loss.backward()  # type: ignore[no-untyped-call]
            length = nn.utils.clip_grad_norm_(network.parameters(), math.inf)  # measured, not cut
            check_gradient(float(length), done + 1, "a smaller --batch, for smaller changes a step")
            adam.step()
            found = float(loss.detach())
            total += found
            on_step(done + 1, config.epochs * steps, found)
        history.append(DistilEpoch(total / steps, norms_kept))
        if kept is not None:
            save_checkpoint(kept.path, network, adam, config, history, job)
    network.to(memory_format=torch.contiguous_format)  # type: ignore[call-overload]
    network.eval()
    return tuple(history)


def agreement(
    network: nn.Module, examples: TransferSet, *, plain: bool, batch: int = BATCH
) -> Agreement:
    """Return how often a network's first answer is the teacher's.

    Args:
        network: Images (n, 3, h, w) → logits (n, 1000).
        examples: Images with the teacher's answers.
        plain: Of images as the camera gave them; else of changed copies.
        batch: Images in a training step, so that a card meets no other number; at least 64.
    """
    network.eval()
    device = next(network.parameters(), torch.empty(0)).device
    rows = np.flatnonzero(examples.plain == plain)
    found = []
    with torch.inference_mode():
        for part, count in _blocks(rows, max(batch, _EVALUATION_BATCH)):
            images, _ = examples.take(part, -1)
            found.append(network(images.to(device)).argmax(dim=1)[:count].cpu().numpy())
    wanted = examples.answers[rows].argmax(axis=1)
    return Agreement(
        float((np.concatenate(found) == wanted).mean()),
        float(np.bincount(wanted).max() / len(wanted)),
        len(rows),
    )


def begin(
    network: nn.Module,
    examples: Learnable,
    config: DistilConfig,
    on_fit: Callable[[int, int], None] = lambda _images, _of: None,
) -> bool:
    """Settle norms and fit the top, unless the student's answers are nearer as it is.

    They are where it begins as its teacher with blocks that do nothing yet: statistics of touch
    would spoil that.

    Returns:
        Whether it stays as it is; then its norms keep their statistics while it learns.
    """
    order = np.random.default_rng([config.seed, 29]).permutation(len(examples))
    judged = min(_COMPARED, int(_COMPARED_SHARE * len(examples)))
    judges, others = order[:judged], np.sort(order[judged:])
    before = {name: value.clone() for name, value in network.state_dict().items()}
    loss = _mean_loss(network, examples, config, judges)
    settle_norms(network, examples, config, others)
    fit_top(network, examples, config, others, on_fit)
    stays = loss < _mean_loss(network, examples, config, judges)
    if stays:
        network.load_state_dict(before)
    return stays


def settle_norms(
    network: nn.Module,
    examples: Learnable,
    config: DistilConfig,
    rows: NDArray[np.intp] | None = None,
) -> None:
    """Let batch norms take their statistics from these images, as the weights stand.

    Args:
        network: What is changed in place.
        examples: Images.
        config: How many at a time.
        rows: Those to use; all unless given.
    """
    norms = [module for module in network.modules() if isinstance(module, nn.BatchNorm2d)]
    momenta = [norm.momentum for norm in norms]
    for norm in norms:
        norm.reset_running_stats()
        norm.momentum = None  # the plain mean over batches
    network.train()
    with torch.no_grad():
        for part in _some(np.arange(len(examples)) if rows is None else rows, config):
            images, _ = examples.take(part, -1)
            with _numbers(config, images.device):
                network(images)
    for norm, momentum in zip(norms, momenta, strict=True):
        norm.momentum = momentum
    network.eval()


def fit_top(
    network: nn.Module,
    examples: Learnable,
    config: DistilConfig,
    rows: NDArray[np.intp] | None = None,
    on_fit: Callable[[int, int], None] = lambda _images, _of: None,
) -> None:
    """Fit the top to the teacher's logits: least squares, held near what it is (ridge).

    Args:
        network: Its top is changed in place.
        examples: Images with the teacher's answers.
        config: How many at a time.
        rows: Indices of those to use, shape (m,); all unless given.
        on_fit: Called with how many of them were seen, and how many there are.
    """
    top = network.get_submodule("predictions")
    assert isinstance(top, nn.Linear)
    pooled: list[Tensor] = []
    hook = top.register_forward_pre_hook(
        lambda _top, inputs: pooled.append(inputs[0].float().mean(dim=(2, 3)))
    )
    network.eval()
    rests: list[Tensor] = []
    done = 0
    with torch.no_grad():
        rows = np.arange(len(examples)) if rows is None else rows
        for part, count in _blocks(rows, max(config.batch, _EVALUATION_BATCH)):
            images, answers = examples.take(part, -1)
            with _numbers(config, images.device):
                rests.append((answers - network(images).float())[:count])
            pooled[-1] = pooled[-1][:count]
            done += count
            on_fit(done, len(rows))
    hook.remove()
    features, rest = torch.cat(pooled), torch.cat(rests)
    middle, mean_rest = features.mean(dim=0), rest.mean(dim=0)
    centred = (features - middle).double()
    gram = centred.T @ centred
    gram.diagonal().add_(RIDGE * gram.diagonal().mean())
    change = torch.linalg.solve(gram, centred.T @ (rest - mean_rest).double()).float()
    with torch.no_grad():
        top.weight.add_(change.T)
        top.bias.add_(mean_rest - middle @ change)


def _mean_loss(
    network: nn.Module, examples: Learnable, config: DistilConfig, rows: NDArray[np.intp]
) -> float:
    """Return the loss of a network as it stands, nats; infinite where there is no image."""
    network.eval()
    total = 0.0
    with torch.no_grad():
        size = max(config.batch, _EVALUATION_BATCH)
        for part in (rows[first : first + size] for first in range(0, len(rows), size)):
            total += len(part) * float(_loss(network, *examples.take(part, -1), config))
    return total / len(rows) if len(rows) else math.inf


def _blocks(rows: NDArray[np.intp], size: int) -> Iterator[tuple[NDArray[np.intp], int]]:
    """Yield so many rows at a time, the last ones repeated to fill up, and how many count.

    For each number of images that it has not met, a graphics card prepares itself anew.
    """
    size = min(size, len(rows))
    for first in range(0, len(rows), size or 1):
        part = rows[first : first + size]
        yield np.concatenate([part, part[-1:].repeat(size - len(part))]), len(part)


def _some(rows: NDArray[np.intp], config: DistilConfig) -> Iterator[NDArray[np.intp]]:
    """Yield batches drawn from some images."""
    order = rows[np.random.default_rng([config.seed, 23]).permutation(len(rows))]
    size = max(config.batch, BATCH)  # few images have no statistics
    for first in range(0, min(len(order), NORM_BATCHES * size), size):
        part = order[first : first + size]
        if len(part) > 1:
            yield part


def resized(images: Tensor, config: DistilConfig, epoch: int) -> Tensor:
    """Return images at the size of an epoch, shape (n, 3, side, side).

    Args:
        images: Shape (n, 3, side, side).
        config: The sizes, and how many epochs there are.
        epoch: 0 for the first.
    """
    sides = config.sides_px or (images.shape[-1],)
    side = sides[epoch * len(sides) // config.epochs]
    if side == images.shape[-1]:
        return images
    return functional.interpolate(
        images.float(), (side, side), mode="bilinear", align_corners=False, antialias=True
    )


def _loss(network: nn.Module, images: Tensor, answers: Tensor, config: DistilConfig) -> Tensor:
    """Return the divergence of the student's softened answers from the teacher's, nats."""
    with _numbers(config, images.device):
        logits = network(images).float()
    heat = config.temperature
    wanted = answers / heat
    loss = functional.kl_div(
        (logits / heat).log_softmax(dim=1), wanted.log_softmax(dim=1),
        reduction="batchmean", log_target=True,
    )  # fmt: skip
    return torch.as_tensor(loss * heat**2)


def _numbers(config: DistilConfig, device: torch.device) -> Any:
    """Return what chooses the numbers of convolutions and products in a block."""
    return in_numbers(device, bf16=config.bf16)


def _train_mode(network: nn.Module, *, norms_kept: bool) -> None:
    network.train()
    for module in network.modules():
        if isinstance(module, nn.BatchNorm2d):
            module.train(not norms_kept)


def _set_momentum(network: nn.Module, momentum: float) -> None:
    for module in network.modules():
        if isinstance(module, nn.BatchNorm2d):
            module.momentum = momentum
