"""The training loop: plain PyTorch, Adam, cross-entropy, seeded, resumable.

Knows nothing about files of recordings, splits or tables.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from taxel.errors import BadInput
from taxel.foreign.records import own_numbers
from taxel.models.forest import CourseForest
from taxel.models.touchnet import TouchNet
from taxel.training.augment import Augment
from taxel.training.checkpoints import load_checkpoint, save_checkpoint
from taxel.training.curves import Epoch, thinned


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainConfig:
    """How a network is trained. Saved with every run."""

    epochs: int = 10
    """Passes over the training windows."""
    batch: int = 128
    """Windows in a step."""
    learning_rate: float = 3e-3
    """Adam's largest step size; it falls to zero along half a cosine."""
    warmup: float = 0.0
    """Share of the training over which the step size first rises, 0…1."""
    steps: int | None = None
    """Steps in an epoch, each of windows drawn at random; None takes each window once."""
    clip: float | None = None
    """Largest norm of the gradient; None does not clip."""
    weight_decay: float = 0.0
    """Decoupled weight decay (AdamW); 0 is the thesis's plain Adam."""
    label_smoothing: float = 0.0
    """Share of each label spread over all classes."""
    augment: Augment = field(default_factory=Augment)
    """Random changes to training windows; none by default, as in the thesis."""
    seed: int = 0
    """Seed of weights, order and augmentation."""

    def __post_init__(self) -> None:
        own_numbers(self)
        counts = (self.epochs, self.batch, 1 if self.steps is None else self.steps)
        if min(counts) < 1:
            raise BadInput(
                "epochs, batch and steps of at least 1", f"{counts}", "give whole numbers"
            )
        sizes = (self.learning_rate, 1.0 if self.clip is None else self.clip)
        if not all(0 < size < math.inf for size in sizes) or not self.weight_decay >= 0:
            raise BadInput(
                "a learning_rate and clip above 0, and no weight_decay below 0",
                f"{self.learning_rate}, {self.clip} and {self.weight_decay}", "give such numbers",
            )  # fmt: skip
        shares = (self.warmup, self.label_smoothing)
        if not all(0 <= share <= 1 for share in shares):
            raise BadInput("warmup and label_smoothing within 0 and 1", f"{shares}", "give shares")


@dataclass(frozen=True, slots=True)
class Labelled:
    """Scaled windows with their classes."""

    values: NDArray[np.float32]
    """Shape (n, steps, channels), scaled."""
    mask: NDArray[np.bool_]
    """Shape (n, steps)."""
    y: NDArray[np.intp]
    """Shape (n,): class numbers."""

    def __len__(self) -> int:
        return len(self.y)

    def thinned(self) -> Labelled:
        """Return at most `WATCHED` of the windows, evenly drawn."""
        part = thinned(len(self))
        return Labelled(self.values[part], self.mask[part], self.y[part])

    def first(self, steps: int) -> Labelled:
        """Return the windows' first rows: training windows may be longer than a network takes."""
        return Labelled(self.values[:, :steps], self.mask[:, :steps], self.y)

    def tensors(self) -> tuple[Tensor, Tensor, Tensor]:
        """Return values, mask and classes as tensors that share memory."""
        return (
            torch.from_numpy(self.values),
            torch.from_numpy(self.mask),
            torch.from_numpy(self.y.astype(np.int64)),
        )


@dataclass(frozen=True, slots=True)
class Checkpoint:
    """Where training that is interrupted continues from."""

    path: Path
    job: str = ""
    """What else the file must have been written for, such as the data's digest."""


def new_network(build: Callable[[], nn.Module], seed: int) -> nn.Module:
    """Return a network whose first weights depend on the seed alone."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        return build()


def fit(
    network: nn.Module,
    train: Labelled,
    config: TrainConfig,
    *,
    steps: int | None = None,
    validation: Labelled | None = None,
    checkpoint: Checkpoint | None = None,
    on_epoch: Callable[[Epoch], None] | None = None,
) -> list[Epoch]:
    """Train a network in place and return its history.

    The last epoch's weights are kept: nothing is chosen by the validation
    windows, which are only watched.

    Args:
        network: forward(values, mask) → logits.
        train: Windows to learn from.
        config: How to train.
        steps: Rows that the network takes, where training windows are longer and
            `Augment.warp` draws a stretch from each; their own length unless given.
        validation: Windows to watch: some of them, and as many of the training windows, are
            looked at after each epoch.
        checkpoint: A file written after each epoch; if it exists, training
            goes on from it and gives the weights that an unbroken run gives.
        on_epoch: Called after each epoch, as by a progress bar.

    Raises:
        BadInput: The checkpoint is damaged or belongs to another configuration.
    """
    if isinstance(network, CourseForest):
        return _grow(network, train, config, validation, on_epoch)
    shape = _prepare(network, train, steps)
    optimiser = torch.optim.AdamW(
        network.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay
    )
    learnt = train.thinned().first(shape.steps)
    validation = None if validation is None else validation.thinned()
    history: list[Epoch] = []
    if checkpoint is not None and checkpoint.path.exists():
        path, job = checkpoint.path, checkpoint.job
        history = load_checkpoint(path, network, optimiser, config, Epoch, job)
    for number in range(len(history) + 1, config.epochs + 1):
        loss = _one_epoch(network, optimiser, train, config, shape, number)
        history.append(Epoch(number, loss, *_watch(network, validation, learnt)))
        if checkpoint is not None:
            save_checkpoint(checkpoint.path, network, optimiser, config, history, checkpoint.job)
        if on_epoch is not None:
            on_epoch(history[-1])
    network.eval()
    return history


_Watched = tuple[float | None, float | None]


def _watch(
    network: nn.Module, validation: Labelled | None, learnt: Labelled | None
) -> tuple[float | None, float | None, float | None, float | None]:
    """Return loss and accuracy of held-out windows, then of some that were learned from."""
    nothing: _Watched = (None, None)
    held = nothing if validation is None else evaluate(network, validation)
    own = nothing if validation is None or learnt is None else evaluate(network, learnt)
    return (*held, *own)


@dataclass(frozen=True, slots=True)
class _Shape:
    """What augmentation must know of the training windows."""

    steps: int
    spread: Tensor
    """Median over windows of each channel's deviation, shape (channels,)."""


def _prepare(network: nn.Module, train: Labelled, steps: int | None) -> _Shape:
    """Let the network measure its inputs, if it does; measure the channels' spread."""
    values, mask, _ = train.tensors()
    if isinstance(network, TouchNet):
        network.prepare(values, mask)
    whole = values[mask.all(dim=1)] if bool(mask.all(dim=1).any()) else values
    spread = whole.std(dim=1, correction=0).median(dim=0).values
    return _Shape(steps or values.shape[1], spread)


def _grow(
    network: CourseForest,
    train: Labelled,
    config: TrainConfig,
    validation: Labelled | None,
    on_epoch: Callable[[Epoch], None] | None,
) -> list[Epoch]:
    """Fit a forest, which has no epochs: its history is one."""
    network.grow(train.values, train.mask, train.y, config.seed)
    network.eval()
    loss, _ = evaluate(network, train)
    history = [Epoch(1, loss, *_watch(network, validation, None))]
    if on_epoch is not None:
        on_epoch(history[0])
    return history


def _one_epoch(
    network: nn.Module,
    optimiser: torch.optim.Optimizer,
    train: Labelled,
    config: TrainConfig,
    shape: _Shape,
    number: int,
) -> float:
    """Train over all windows once; order and augmentation depend on seed and epoch alone."""
    values, mask, y = train.tensors()
    generator = torch.Generator().manual_seed(config.seed * 100_003 + number)
    order = _order(len(y), config, generator)
    count = -(-len(order) // config.batch)
    total = 0.0
    network.train()
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(config.seed * 100_019 + number)
        for step in range(count):
            part = order[step * config.batch : (step + 1) * config.batch]
            done = (number - 1 + step / count) / config.epochs
            for group in optimiser.param_groups:
                group["lr"] = config.learning_rate * _share_of_step(done, config.warmup)
            inputs = config.augment.apply(
                values[part], mask[part], shape.spread, shape.steps, generator
            )
            logits = network(inputs, mask[part][:, : shape.steps])
            loss = functional.cross_entropy(logits, y[part], label_smoothing=config.label_smoothing)
            optimiser.zero_grad(set_to_none=True)
            loss.backward()  # type: ignore[no-untyped-call]
            if config.clip is not None:
                nn.utils.clip_grad_norm_(network.parameters(), config.clip)
            optimiser.step()
            total += float(loss.detach()) * len(part)
    return total / len(order)


def _order(windows: int, config: TrainConfig, generator: torch.Generator) -> Tensor:
    if config.steps is None:
        return torch.randperm(windows, generator=generator)
    return torch.randint(windows, (config.steps * config.batch,), generator=generator)


def _share_of_step(done: float, warmup: float) -> float:
    """Return the step size over its largest, after a share `done` of the training."""
    if done < warmup:
        return 0.5 * (1.0 - math.cos(math.pi * (0.05 + 0.95 * done / warmup)))
    return 0.5 * (1.0 + math.cos(math.pi * (done - warmup) / (1.0 - warmup)))


def predict(
    network: nn.Module, values: NDArray[np.float32], mask: NDArray[np.bool_], batch: int = 1024
) -> NDArray[np.float64]:
    """Return class probabilities, shape (n, classes).

    Args:
        network: forward(values, mask) → logits.
        values: Shape (n, steps, channels), scaled.
        mask: Shape (n, steps).
        batch: Windows at a time.
    """
    network.eval()
    parts = []
    with torch.inference_mode():
        for start in range(0, len(values), batch):
            part = slice(start, start + batch)
            logits = network(torch.from_numpy(values[part]), torch.from_numpy(mask[part]))
            parts.append(torch.softmax(logits.double(), dim=1).numpy())
    return np.concatenate(parts)


def evaluate(network: nn.Module, data: Labelled) -> tuple[float, float]:
    """Return (mean cross-entropy in nats, accuracy 0…1)."""
    probabilities = predict(network, data.values, data.mask)
    likelihood = probabilities[np.arange(len(data)), data.y]
    loss = float(-np.log(np.maximum(likelihood, 1e-15)).mean())
    return loss, float((probabilities.argmax(axis=1) == data.y).mean())
