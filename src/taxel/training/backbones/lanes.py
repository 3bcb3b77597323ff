"""Stretches of recordings to train on, dealt to lanes: each process decodes its own part only.

A stretch is a run of frames that holds many windows, so that each of its images passes through the
backbone once. Every second one holds a change of label, where there is one: far from it any
network is right. All stretches of an epoch, recording after recording in a drawn order, are cut
into lanes of equal length. A step takes as many from each lane, so that it is the same step whether
one process walks all lanes or each has one of its own. Knows nothing about networks.

Source: docs/decisions/0050, docs/decisions/0057.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import permutations, product
from pathlib import Path
from typing import Protocol, TypeVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from taxel.errors import BadDataset, BadInput
from taxel.plain_text import number_of
from taxel.side_by_side import SideBySide
from taxel.signals import CameraInfo
from taxel.windows.camera_recordings import CameraRecording, decoded, frame_sets
from taxel.windows.rest import SETTLE
from taxel.windows.sequence import label_windows

LANES = 2
"""Lanes of one or two processes, so recordings whose stretches are mixed at a time; of each, the
files of all its images are in memory."""
RESTING = 5
"""Frames of the settled grasp that are shown beside each stretch. Source: our choice,
docs/decisions/0057."""
WINDOWS = 17
"""Windows of a stretch, unless a recording is shorter. Source: our choice, docs/decisions/0057."""
EVERY = 60
"""A recording gives one stretch for so many of its frames in an epoch. Source: our choice,
docs/decisions/0057."""

Item = TypeVar("Item")


@dataclass(frozen=True, slots=True)
class Batch:
    """Stretches of a step; each different image stands in it once."""

    images: Tensor
    """Shape (m, h, w, 3), uint8: of all stretches, then those at rest, then copies of the last that
    make m a multiple of `Lanes.multiple`."""
    stretch: Tensor
    """Shape (m,): whose each image is, so that all of one can be changed alike."""
    frames: Tensor
    """Shape (n, s, cameras): each frame's image."""
    rest: Tensor
    """Shape (n, r, cameras): images of each settled grasp; the median of their features is that of
    the grasp at rest. That of one median image would lack the cameras' noise, which every other
    image has."""
    variant: Tensor
    """Shape (n,): which of `VARIANTS` each stretch may be shown as."""
    labels: Tensor
    """Shape (n, s − k + 1): of each window, 0 or 1."""
    excess: Tensor
    """Shape (n, s, cameras): each frame's change over its threshold; NaN where it is not known."""

    def to(self, device: torch.device) -> Batch:
        """Return the same on a device."""
        return Batch(*(getattr(self, name).to(device, non_blocking=True) for name in _FIELDS))


_FIELDS = ("images", "stretch", "frames", "rest", "variant", "labels", "excess")
VARIANTS = tuple(product((False, True), (False, True), permutations(range(3))))
"""Turned upside down, mirrored, and the order of the colours: 24 ways to show an image."""


class HasBatch(Protocol):
    """What a batch depends on."""

    @property
    def batch(self) -> int:
        """Return the stretches in a step."""
        ...

    @property
    def seed(self) -> int:
        """Return the seed of the stretches and their order."""
        ...


@dataclass(frozen=True, slots=True)
class _Stretch:
    images: NDArray[np.uint8]
    rows: NDArray[np.intp]
    rest: NDArray[np.intp]
    variant: int
    labels: NDArray[np.int8]
    excess: NDArray[np.float32]


def lane_count(batch: int, processes: int, most: int) -> int:
    """Return into how many lanes stretches are dealt: equally many for each process and in a step.

    Args:
        batch: Stretches in a step, over all processes.
        processes: How many there are.
        most: Lanes at most; never fewer than processes.

    Raises:
        BadInput: A step cannot be shared out equally.
    """
    if batch % processes:
        raise BadInput(
            f"a --batch that {processes} processes can share equally", str(batch),
            f"choose a multiple of {processes}",
        )  # fmt: skip
    most = max(most, processes)
    return max(n for n in range(processes, most + 1, processes) if batch % n == 0)


class Lanes:
    """The stretches of some recordings.

    Args:
        pours: Recordings to learn from; those shorter than a stretch give none, unless all are.
        labels: One a frame, shape (n,): 0 stable, 1 unstable.
        frames: k.
        count: How many lanes.
        decoders: Threads that decode images.
        multiple: Of how many images a step has: for each number that it has not met, a graphics
            card prepares itself anew, for as long as many steps take.
        excess: Of each recording's frames, shape (n, cameras): change over its threshold.

    Raises:
        BadDataset: There are fewer stretches than lanes.
    """

    def __init__(
        self,
        pours: Sequence[CameraRecording],
        labels: Sequence[NDArray[np.int8]],
        frames: int,
        count: int,
        decoders: int = 1,
        multiple: int = 1,
        excess: Sequence[NDArray[np.float32]] | None = None,
    ) -> None:
        self.multiple = multiple
        self._excess = excess
        self._pours, self._labels, self._frames, self.count = pours, labels, frames, count
        longest = max(map(len, pours), default=0)
        self._length = min(frames + WINDOWS - 1, longest)
        long = self._length >= frames
        self._whole = [np.flatnonzero(p.whole(self._length)) for p in pours]
        """Of each recording, where a stretch may begin that spans no outage."""
        self._each = [
            -(-len(p) // EVERY) if long and len(whole) else 0
            for p, whole in zip(pours, self._whole, strict=True)
        ]
        self.share = sum(self._each) // count
        """Stretches of a lane in an epoch; of the rest, fewer than there are lanes, none is
        used."""
        if not self.share:
            raise BadDataset(
                f"at least {number_of(count, 'stretch')} of {number_of(frames, 'frame')} or "
                f"more, one for every {EVERY}",
                f"{sum(self._each)} in {number_of(len(pours), 'recording')}",
                "give more recordings, or choose a smaller --batch",
            )
        self._beside = SideBySide(decoders)

    def digest(self) -> str:
        """Return what a checkpoint must share with the training that goes on from it."""
        digest = hashlib.sha256(f"{self._frames} {self._length} {self.count}".encode())
        for pour, labels in zip(self._pours, self._labels, strict=True):
            digest.update(pour.digest.encode())
            digest.update(labels.tobytes())
        for each in self._excess or ():
            digest.update(each.tobytes())
        return digest.hexdigest()

    def batches(self, config: HasBatch, epoch: int, mine: Iterable[int]) -> Iterator[Batch]:
        """Yield an epoch's steps: the stretches of this process.

        Args:
            config: Stretches in a step over all lanes, and the seed of the order.
            epoch: 0 for the first.
            mine: The lanes of this process.
        """
        size = config.batch // self.count
        order = self.places(config.seed, epoch)
        key = config.seed, epoch
        parts = [order[lane * self.share : (lane + 1) * self.share] for lane in mine]
        walks = [self._walk(part, key) for part in parts]
        for first in range(0, self.share, size):
            part = range(min(size, self.share - first))
            yield _stack([next(walk) for walk in walks for _ in part], self.multiple)

    def places(self, seed: int, epoch: int) -> list[tuple[int, int]]:
        """Return an epoch's stretches, (recording, first frame), a recording's own together."""
        order = np.random.default_rng((seed, epoch)).permutation(len(self._pours))
        return [(int(i), start) for i in order for start in self._starts(int(i), seed, epoch)]

    def _starts(self, recording: int, seed: int, epoch: int) -> list[int]:
        """Return where a recording's stretches begin: every second one holds a change of label."""
        draw = np.random.default_rng((seed, epoch, recording))
        labels = self._labels[recording]
        last = len(labels) - self._length
        changes = np.flatnonzero(np.diff(labels)) + 1
        starts = []
        for number in range(self._each[recording]):
            first, end = 0, last
            if number % 2 == 0 and len(changes):
                change = int(draw.choice(changes))
                first, end = max(0, change - self._length + 1), min(last, change - 1)
            drawn = int(draw.integers(first, end + 1))
            whole = self._whole[recording]
            starts.append(int(whole[np.abs(whole - drawn).argmin()]))
        return starts

    def _walk(self, order: Sequence[tuple[int, int]], key: tuple[int, int]) -> Iterator[_Stretch]:
        """Yield stretches; one recording's files are held at a time, images of one stretch."""
        known = -1
        for i, start in order:
            if i != known:
                files, known = _files(self._pours[i]), i
                wanted = label_windows(self._labels[i], self._frames)
                excess = self._excess_of(i)
            end = min(SETTLE.stop, len(self._pours[i]))
            rest = np.linspace(SETTLE.start, end - 1, RESTING).astype(int)
            frames = np.concatenate([np.arange(start, start + self._length), rest])
            numbers, rows = np.unique(self._pours[i].image[frames], return_inverse=True)
            rows = rows.reshape(len(frames), -1)
            yield _Stretch(
                np.stack(self._beside.map(_decode, [files[number] for number in numbers])),
                rows[: self._length],
                rows[self._length :],
                int(np.random.default_rng((*key, i, start)).integers(len(VARIANTS))),
                wanted[start : start + self._length - self._frames + 1],
                excess[start : start + self._length],
            )

    def _excess_of(self, recording: int) -> NDArray[np.float32]:
        if self._excess is not None:
            return self._excess[recording].astype(np.float32)
        return np.full(self._pours[recording].image.shape, np.nan, np.float32)


def _files(pour: CameraRecording) -> list[tuple[bytes, CameraInfo, Path]]:
    """Return a recording's different images as they lie there, each with its camera and file."""
    files: list[tuple[bytes, CameraInfo, Path]] = []
    for found, row in zip(frame_sets(pour.path, len(pour.cameras)), pour.image, strict=True):
        for frame, number in zip(found.frames, row, strict=True):
            if number == len(files):
                files.append((frame.jpeg, pour.cameras[frame.camera], pour.path))
    return files


def _decode(file: tuple[bytes, CameraInfo, Path]) -> NDArray[np.uint8]:
    return decoded(*file)


def _stack(stretches: list[_Stretch], multiple: int) -> Batch:
    counts = [len(stretch.images) for stretch in stretches]
    firsts = np.cumsum([0, *counts[:-1]])
    images = np.concatenate([each.images for each in stretches])
    whose = np.arange(len(stretches)).repeat(counts)
    more = -len(images) % multiple
    pairs = list(zip(stretches, firsts, strict=True))
    return Batch(
        torch.from_numpy(np.concatenate([images, images[-1:].repeat(more, axis=0)])),
        torch.from_numpy(np.concatenate([whose, whose[-1:].repeat(more)])),
        torch.from_numpy(np.stack([s.rows + first for s, first in pairs])),
        torch.from_numpy(np.stack([s.rest + first for s, first in pairs])),
        torch.tensor([each.variant for each in stretches]),
        torch.from_numpy(np.stack([each.labels for each in stretches])).float(),
        torch.from_numpy(np.stack([each.excess for each in stretches])),
    )  # fmt: skip


def varied(batch: Batch) -> Batch:
    """Return stretches as their variants: all images of one, those at rest too, changed alike."""
    images = batch.images.clone()
    for number, variant in enumerate(batch.variant.tolist()):
        overhead, mirrored, colours = VARIANTS[variant]
        own = torch.nonzero(batch.stretch == number).squeeze(1)
        sides = [side for side, turned in ((1, overhead), (2, mirrored)) if turned]
        images[own] = images[own].flip(sides)[..., list(colours)]
    return replace(batch, images=images)


def prepared(items: Iterator[Item]) -> Iterator[Item]:
    """Yield the same; while the caller works with one, a thread fetches the next."""
    nothing = object()
    with ThreadPoolExecutor(1, "taxel next step") as pool:
        waiting = pool.submit(next, items, nothing)
        while (item := waiting.result()) is not nothing:
            waiting = pool.submit(next, items, nothing)
            yield item  # type: ignore[misc]
