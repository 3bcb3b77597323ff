"""Train a head on cached features: sliding windows, binary cross-entropy, Adam, seeded.

Knows nothing about files, splits or tables.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from taxel.errors import BadDataset
from taxel.models.sequence import find_head
from taxel.plain_text import number_of
from taxel.training.curves import Epoch, thinned
from taxel.training.frames.features import FrameFeatures
from taxel.windows.rest import SETTLE, Tare, seen, settled
from taxel.windows.sequence import (
    label_windows,
    labels_ahead,
    sequence_windows,
    window_starts,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class HeadConfig:
    """How a head is trained. Saved with every run."""

    head: str = "lstm"
    """A name in `HEADS`."""
    frames: int = 8
    """k: frames in a window. Source: paper, section 5.2."""
    tare: Tare = "change"
    """What of a frame's features a head sees: "none" as they are, as the paper; "change" less
    those of the settled first frames; "size" the absolute value of that; "local-size" the same at
    each place of the image, in the mean over places: then features are computed so. Source: our
    choice, docs/decisions/0013."""
    standardise: bool = True
    """Each feature to mean 0 and deviation 1 over the training recordings; False leaves features
    as the backbone gives them, as the paper, which names no scaling."""
    epochs: int = 12
    """Passes over the training windows."""
    batch: int = 32
    """Windows in a step."""
    learning_rate: float = 0.003
    """Adam's largest step size; it falls to zero along half a cosine, where `decay`."""
    epsilon: float = 1e-3
    """Adam's ε. Source: paper, section 5.1."""
    decay: bool = True
    """False keeps the step size, as the paper does."""
    stride: int = 4
    """Frames from one training window's start to the next; all windows are tested on."""
    ahead: int = 0
    """Frames by which training labels run ahead: a window counts as unstable when it will be
    within so many frames. Scores are always against the labels themselves. Source: our choice,
    docs/decisions/0013."""
    seed: int = 0
    """Seed of weights and order."""


PAPER = HeadConfig(
    tare="none", standardise=False, epochs=100, batch=4, learning_rate=0.001, decay=False, stride=1
)  # fmt: skip
"""The paper's settings (section 5.1): Adam lr 0.001, β 0.9 and 0.999, ε 0.001, batch 4,
100 epochs, every window, features as they are."""


@dataclass(frozen=True, slots=True)
class Track:
    """One recording for a head; its features may lie on disk (a memory map)."""

    values: NDArray[np.float32]
    """Shape (rows, features): features of the recording's different images."""
    row: NDArray[np.intp]
    """Shape (n, cameras): each frame's row."""
    labels: NDArray[np.int8]
    """Shape (n,): 0 stable, 1 unstable."""
    time_s: NDArray[np.float64] | None = None
    """As in `FrameFeatures`, as is `gap_s`."""
    gap_s: float = float("inf")

    def __len__(self) -> int:
        return len(self.row)

    def features(self, part: slice | NDArray[np.intp] = slice(None)) -> NDArray[np.float32]:
        """Return features of some frames, shape (…, cameras, features)."""
        return np.asarray(self.values[self.row[part]], dtype=np.float32)


def tracks_of(
    features: Sequence[FrameFeatures],
    labels: Sequence[NDArray[np.int8]],
    part: NDArray[np.intp] | slice = slice(None),
) -> list[Track]:
    """Return recordings for a head: all, or those of some indices."""
    wanted = np.arange(len(labels))[part].tolist()
    return [
        Track(own.values, own.row, labels[i], own.time_s, own.gap_s)
        for i, own in ((i, features[i]) for i in wanted)
    ]


@dataclass(frozen=True, slots=True)
class TrainedHead:
    """A head with the scaling that it was trained on."""

    module: nn.Module
    offset: NDArray[np.float32]
    """Shape (cameras, features)."""
    factor: NDArray[np.float32]
    """Shape (cameras, features)."""
    config: HeadConfig
    history: tuple[Epoch, ...]
    """Of each epoch: its loss, and where recordings were watched, both sides after it."""

    def probabilities(self, features: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the probability of "unstable" at each window's end, shape (n − k + 1,).

        Args:
            features: One recording, shape (n, cameras, features).
        """
        windows = sequence_windows(self.scale(features), self.config.frames)
        parts = [np.zeros(0, np.float32)]
        self.module.eval()
        with torch.inference_mode():
            for first in range(0, len(windows), 256):
                part = torch.from_numpy(np.ascontiguousarray(windows[first : first + 256]))
                parts.append(torch.sigmoid(self.module(part.flatten(2))).numpy())
        return np.asarray(np.concatenate(parts), np.float32)

    def judged(self, found: FrameFeatures) -> NDArray[np.float32]:
        """Return what `probabilities` does of one recording, NaN where a window spans an outage.

        Live gives no probability there either.
        """
        k = self.config.frames
        return np.where(found.whole(k), self.probabilities(found.all()), np.float32(np.nan))

    def scale(self, features: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return features as the head takes them, same shape."""
        features = seen(features, settled(features[SETTLE]), self.config.tare)
        return np.asarray((features - self.offset) * self.factor, np.float32)


def fit_head(
    tracks: Sequence[Track],
    config: HeadConfig,
    on_epoch: Callable[[int, float], None] = lambda _number, _loss: None,
    watched: Sequence[Track] = (),
) -> TrainedHead:
    """Train a head on whole recordings.

    Windows never cross recordings; a window's label is the largest of its frames'
    (paper, section 4.1). Scaling is fitted on these recordings alone.

    Args:
        tracks: Recordings to learn from.
        config: How to train.
        on_epoch: Called with the epoch's number and loss.
        watched: Recordings that are held out and looked at after each epoch, for a curve; nothing
            is chosen by them.

    Raises:
        BadDataset: There is no window.
    """
    offset, factor = _scaling(tracks, config)
    where, labels = _places(tracks, config)
    if not len(where):
        raise BadDataset(
            f"recordings with {number_of(config.frames, 'moment')} in a row, which a window has",
            f"at most {max(map(len, tracks), default=0)} moments in a recording, outages included",
            "record for longer, or choose fewer --frames",
        )
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(config.seed)
        module = find_head(config.head).build(offset.shape[-1], config.frames)
    batches = _Batches(tracks, where, labels, offset, factor, config)
    held = None
    if watched:
        held = _Batches(watched, *_places(watched, config), offset, factor, config)
    history = _train(module, batches, config, on_epoch, held)
    return TrainedHead(module, offset, factor, config, tuple(history))


def _seen_now(module: nn.Module, batches: _Batches) -> tuple[float, float]:
    """Return loss in nats and accuracy of some windows as the head stands, without learning."""
    windows, labels = batches.take(thinned(len(batches)))
    module.eval()
    with torch.inference_mode():
        logits = module(windows)
        loss = float(functional.binary_cross_entropy_with_logits(logits, labels))
        right = float(((logits > 0) == (labels > 0.5)).float().mean())
    module.train()
    return loss, right


def _scaling(
    tracks: Sequence[Track], config: HeadConfig
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return offset and factor, each shape (cameras, features), one recording at a time."""
    if not config.standardise:
        shape = tracks[0].features(slice(0, 1)).shape[1:]
        return np.zeros(shape, np.float32), np.ones(shape, np.float32)
    count, first, second = 0, 0.0, 0.0
    for track in tracks:
        rows = track.features(slice(None, None, config.stride))
        rows = seen(rows, settled(track.features(SETTLE)), config.tare).astype(np.float64)
        count += len(rows)
        first, second = first + rows.sum(axis=0), second + (rows**2).sum(axis=0)
    mean = np.asarray(first / count)
    offset = np.zeros_like(mean) if config.tare == "change" else mean
    spread = np.sqrt(np.maximum(np.asarray(second / count) - offset**2, 0.0))
    factor = 1.0 / np.maximum(spread, 1e-3 * spread.max() + 1e-9)
    return offset.astype(np.float32), factor.astype(np.float32)


def _places(
    tracks: Sequence[Track], config: HeadConfig
) -> tuple[NDArray[np.intp], NDArray[np.float32]]:
    """Return each training window's recording and first frame, shape (m, 2), and its label."""
    where, labels = [], []
    for number, track in enumerate(tracks):
        starts = window_starts(len(track), config.frames, config.stride, track.time_s, track.gap_s)
        where.append(np.stack([np.full(len(starts), number, np.intp), starts], axis=1))
        ahead = labels_ahead(track.labels, config.ahead, track.time_s, track.gap_s)
        labels.append(label_windows(ahead, config.frames)[starts])
    return np.concatenate(where), np.concatenate(labels).astype(np.float32)


class _Batches:
    """Windows drawn from recordings whose features may be larger than memory."""

    def __init__(
        self,
        tracks: Sequence[Track],
        where: NDArray[np.intp],
        labels: NDArray[np.float32],
        offset: NDArray[np.float32],
        factor: NDArray[np.float32],
        config: HeadConfig,
    ) -> None:
        self._tracks, self._where, self._labels = tracks, where, labels
        self._offset, self._factor, self._config = offset, factor, config
        self._settled = [settled(track.features(SETTLE)) for track in tracks]

    def __len__(self) -> int:
        return len(self._where)

    def take(self, part: NDArray[np.intp]) -> tuple[Tensor, Tensor]:
        """Return windows, shape (batch, k, cameras · features), and labels, shape (batch,)."""
        windows = []
        for number, start in self._where[part]:
            own = self._tracks[number].features(slice(start, start + self._config.frames))
            own = seen(own, self._settled[number], self._config.tare)
            windows.append((own - self._offset) * self._factor)
        return (
            torch.from_numpy(np.stack(windows)).flatten(2),
            torch.from_numpy(self._labels[part]),
        )


def _train(
    module: nn.Module,
    batches: _Batches,
    config: HeadConfig,
    on_epoch: Callable[[int, float], None],
    held: _Batches | None,
) -> list[Epoch]:
    optimiser = torch.optim.Adam(
        [parameter for parameter in module.parameters() if parameter.requires_grad],
        lr=config.learning_rate,
        eps=config.epsilon,
    )
    generator = torch.Generator().manual_seed(config.seed)
    steps = -(-len(batches) // config.batch)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, config.epochs * steps)
    history: list[Epoch] = []
    module.train()
    for number in range(1, config.epochs + 1):
        total = 0.0
        for part in torch.randperm(len(batches), generator=generator).split(config.batch):  # type: ignore[no-untyped-call]
            windows, labels = batches.take(part.numpy())
            loss = functional.binary_cross_entropy_with_logits(module(windows), labels)
            optimiser.zero_grad(set_to_none=True)
            loss.backward()  # type: ignore[no-untyped-call]
            optimiser.step()
            if config.decay:
                schedule.step()
            total += float(loss.detach()) * len(part)
        epoch = Epoch(number, total / len(batches))
        if held is not None and len(held):
            epoch = Epoch(number, epoch.loss, *_seen_now(module, held), *_seen_now(module, batches))
        history.append(epoch)
        on_epoch(number, epoch.loss)
    module.eval()
    return history
