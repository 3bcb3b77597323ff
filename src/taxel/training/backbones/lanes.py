"""Training windows of images, dealt to lanes: each process decodes its own recordings only.

All windows of an epoch, recording after recording in a drawn order, are cut into lanes of equal
length. A step takes as many windows from each lane, so that it is the same step whether one
process walks all lanes or each has one of its own. Knows nothing about networks.

Source: docs/decisions/0050.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Sequence
from typing import Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from taxel.frame_codec import decode_jpeg
from taxel.windows.camera_recordings import CameraRecording, frame_sets
from taxel.windows.rest import SETTLE
from taxel.windows.sequence import label_windows, window_starts

LANES = 2
"""Lanes of one or two processes, so recordings whose windows are mixed at a time: 332 MB for six
seconds at 60 Hz, 320×240."""

Drawn = tuple[NDArray[np.uint8], NDArray[np.uint8], int]
"""A window's images, shape (k, cameras, h, w, 3), those at rest, and its label."""


class HasBatch(Protocol):
    """What a batch depends on."""

    @property
    def batch(self) -> int:
        """Return the windows in a batch."""
        ...

    @property
    def seed(self) -> int:
        """Return the seed of the windows' order."""
        ...


class Lanes:
    """The training windows of some recordings.

    Args:
        pours: Recordings to learn from.
        labels: One a frame, shape (n,): 0 stable, 1 unstable.
        frames: k.
        stride: Frames from one training window's start to the next.
        count: How many lanes.
    """

    def __init__(
        self,
        pours: Sequence[CameraRecording],
        labels: Sequence[NDArray[np.int8]],
        frames: int,
        stride: int,
        count: int,
    ) -> None:
        self._pours, self._labels, self._frames, self.count = pours, labels, frames, count
        self._places = [window_starts(len(pour), frames, stride) for pour in pours]
        self.share = sum(map(len, self._places)) // count
        """Windows of a lane in an epoch; of the rest, fewer than there are lanes, none is used."""

    def digest(self) -> str:
        """Return what a checkpoint must share with the training that goes on from it."""
        digest = hashlib.sha256(f"{self._frames} {self.count}".encode())
        for pour, labels, places in zip(self._pours, self._labels, self._places, strict=True):
            digest.update(pour.digest.encode())
            digest.update(labels.tobytes() + places.tobytes())
        return digest.hexdigest()

    def batches(
        self, config: HasBatch, epoch: int, mine: Iterable[int]
    ) -> Iterator[tuple[Tensor, Tensor, Tensor]]:
        """Yield an epoch's steps: images, images at rest and labels of this process's windows.

        Args:
            config: Windows in a step over all lanes, and the seed of the order.
            epoch: 0 for the first.
            mine: The lanes of this process.
        """
        size = max(1, config.batch // self.count)
        order = self._order(np.random.default_rng((config.seed, epoch)))
        walks = [self._walk(order[lane * self.share : (lane + 1) * self.share]) for lane in mine]
        for first in range(0, self.share, size):
            part = range(min(size, self.share - first))
            yield _stack([next(walk) for walk in walks for _ in part])

    def _order(self, random: np.random.Generator) -> list[tuple[int, int]]:
        """Return all windows, (recording, start), a recording's own together."""
        return [
            (int(i), int(start))
            for i in random.permutation(len(self._pours))
            for start in random.permutation(self._places[i])
        ]

    def _walk(self, order: Sequence[tuple[int, int]]) -> Iterator[Drawn]:
        """Yield windows; one recording's images are held at a time."""
        known = -1
        for i, start in order:
            if i != known:
                images, known = _decode(self._pours[i]), i
                rest = np.median(images[SETTLE], axis=0).astype(np.uint8)
                wanted = label_windows(self._labels[i], self._frames)
            yield images[start : start + self._frames], rest, int(wanted[start])


def _decode(pour: CameraRecording) -> NDArray[np.uint8]:
    """Return all images, shape (n, cameras, h, w, 3)."""
    found = [[decode_jpeg(frame.jpeg, pour.cameras[frame.camera]) for frame in frame_set.frames]
             for frame_set in frame_sets(pour.path, len(pour.cameras))]  # fmt: skip
    return np.asarray(found, np.uint8)


def _stack(batch: list[Drawn]) -> tuple[Tensor, Tensor, Tensor]:
    windows, rests, wanted = zip(*batch, strict=True)
    return (
        torch.from_numpy(np.stack(windows)),
        torch.from_numpy(np.stack(rests)),
        torch.tensor(wanted, dtype=torch.float32),
    )
