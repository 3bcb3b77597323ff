"""The transfer set of a distillation: images, changed copies of them, and a teacher's answers.

Copies are drawn once, so that the teacher answers once; its answers are kept in the cache by the
images' contents, and an interrupted call continues there. Images at the student's size lie in
a file without a name, not in memory. Knows nothing about the student.

Background of our choices: docs/decisions/0057.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
import weakref
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from taxel.errors import BadDataset
from taxel.side_by_side import SideBySide
from taxel.training.backbones.touch_images import Image, ImageSource, changed
from taxel.training.frames.features import BATCH, Extractor, cache_room, load_kept, save_kept

CHUNK = 256
"""Images whose answers lie in one file. Source: our choice: 59 MB of pixels, half a minute."""


class ImageFile:
    """Images of one size, in a file that is gone when nobody holds it.

    Args:
        side_px: Their height and width, pixels.
        folder: On the disk to use; made if needed.

    Raises:
        RecordingFailed: The disk refused.
    """

    def __init__(self, side_px: int, folder: Path) -> None:
        self.shape = (0, side_px, side_px, 3)
        with cache_room(folder):
            self._file = tempfile.TemporaryFile(dir=folder, buffering=0)  # noqa: SIM115
        weakref.finalize(self, self._file.close)
        self._folder = folder

    def __len__(self) -> int:
        return self.shape[0]

    def append(self, image: Image) -> None:
        """Add an image, shape (side, side, 3).

        Raises:
            RecordingFailed: The disk refused.
        """
        data = np.ascontiguousarray(image).tobytes()
        with cache_room(self._folder):
            while data:  # a full disk takes a part, and refuses the next
                data = data[self._file.write(data) :]
        self.shape = (self.shape[0] + 1, *self.shape[1:])

    def __getitem__(self, rows: NDArray[np.intp]) -> NDArray[np.uint8]:
        """Return some images, shape (len(rows), side, side, 3).

        Raises:
            RecordingFailed: The disk no longer gives them.
        """
        size = int(np.prod(self.shape[1:]))
        found = np.empty((len(rows), *self.shape[1:]), np.uint8)
        with cache_room(self._folder):
            for place, row in zip(found, rows.tolist(), strict=True):
                if os.preadv(self._file.fileno(), [place.data], row * size) < size:
                    raise OSError("a file that was cut short")
        return found


@dataclass(frozen=True, slots=True)
class TransferSet:
    """Images with the teacher's answers."""

    images: NDArray[np.uint8] | ImageFile
    """Shape (n, side, side, 3), R G B."""
    answers: NDArray[np.float32]
    """Shape (n, 1000), logits."""
    plain: NDArray[np.bool_]
    """Shape (n,): as the camera gave it, not a changed copy."""

    def __len__(self) -> int:
        return len(self.images)

    def take(self, part: NDArray[np.intp], epoch: int) -> tuple[Tensor, Tensor]:
        """Return images, shape (n, 3, side, side), 0 to 255, and the answers, (n, 1000).

        Args:
            part: Which.
            epoch: Changes nothing: copies were drawn once.
        """
        images = torch.from_numpy(self.images[part]).permute(0, 3, 1, 2).float()
        return images, torch.from_numpy(self.answers[part])

    @property
    def device(self) -> torch.device:
        """Return where images and answers are given."""
        return torch.device("cpu")

    def digest(self) -> str:
        """Return the SHA-256 of all, hexadecimal."""
        whole = hashlib.sha256()
        for first in range(0, len(self), CHUNK):
            rows = np.arange(first, min(first + CHUNK, len(self)))
            whole.update(np.ascontiguousarray(self.images[rows]).data)
        whole.update(np.ascontiguousarray(self.answers).data)
        return whole.hexdigest()


@dataclass(frozen=True, slots=True, kw_only=True)
class TransferConfig:
    """Which images a transfer set holds, and at what size."""

    side_px: int
    """Height and width for the student, pixels."""
    frames: int = 2
    """Images of one video."""
    copies: int = 3
    """Of each image: itself, and `copies` − 1 changed ones."""
    seed: int = 0
    """Of the changes."""


def gather_transfer_set(
    videos: Sequence[ImageSource],
    teacher: Extractor,
    config: TransferConfig,
    cache: Path,
    on_images: Callable[[int], None] = lambda _: None,
) -> TransferSet:
    """Return images with a teacher's answers.

    Args:
        videos: Where images come from.
        teacher: Gives 1000 logits for an image.
        config: Which images.
        cache: Folder to keep answers in.
        on_images: Called with how many images are answered.

    Raises:
        BadDataset: There are no images.
        BadTable: A video is cut short.
        RecordingFailed: The disk refused.
    """
    side = config.side_px
    small = ImageFile(side, cache / "examples")
    answers: list[NDArray[np.float32]] = []
    plain: list[bool] = []
    for chunk in _chunks(_copies(videos, config)):
        images = [image for image, _ in chunk]
        answers.append(_answers(images, teacher, cache))
        for image in images:
            small.append(np.asarray(cv2.resize(image, (side, side)), np.uint8))
        plain += [as_it_was for _, as_it_was in chunk]
        on_images(len(plain))
    if not plain:
        raise BadDataset("videos with images", "none", "give other recordings")
    return TransferSet(small, np.concatenate(answers), np.array(plain))


def _copies(videos: Sequence[ImageSource], config: TransferConfig) -> Iterator[tuple[Image, bool]]:
    most = os.cpu_count() or 1
    beside = SideBySide(most)
    numbered = list(enumerate(videos))
    for first in range(0, len(numbered), most):
        for copies in beside.map(lambda each: _copies_of(*each, config),
                                 numbered[first : first + most]):  # fmt: skip
            yield from copies


def _copies_of(number: int, video: ImageSource, config: TransferConfig) -> list[tuple[Image, bool]]:
    draw = np.random.default_rng([19, config.seed, number])
    copies = []
    for image in video.images(config.frames):
        copies.append((image, True))
        copies += [(changed(image, draw), False) for _ in range(config.copies - 1)]
    return copies


def _chunks(images: Iterator[tuple[Image, bool]]) -> Iterator[list[tuple[Image, bool]]]:
    chunk: list[tuple[Image, bool]] = []
    for each in images:
        chunk.append(each)
        if len(chunk) == CHUNK:
            yield chunk
            chunk = []
    if chunk:
        yield chunk


def _answers(images: Sequence[Image], teacher: Extractor, cache: Path) -> NDArray[np.float32]:
    whole = hashlib.sha256()
    for image in images:
        whole.update(image.tobytes())
    path = cache / "answers" / teacher.key / f"{whole.hexdigest()[:32]}.npy"
    kept = load_kept(path, teacher.features)
    if kept is not None and len(kept) == len(images):
        return kept
    found = np.concatenate(
        [teacher.of(images[first : first + BATCH]) for first in range(0, len(images), BATCH)]
    )
    save_kept(path, found)
    return found
