"""Features of frames, computed once and kept on disk.

Each recording's features lie in one file, named by the extractor and by the
contents of the recording's images: another backbone, other weights or another
image give another file. Knows nothing about labels, windows or heads.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from time import perf_counter
from typing import BinaryIO, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadFile, RecordingFailed
from taxel.foreign.archives import LARGEST_ARRAYS, array_of
from taxel.foreign.files import read_bytes
from taxel.held import MADE, scratch_folder
from taxel.side_by_side import SideBySide
from taxel.windows.camera_recordings import CameraRecording, camera_images, decoded, frame_sets
from taxel.windows.rest import SETTLE, compared, settled
from taxel.windows.sequence import whole_windows

Item = TypeVar("Item")

CACHE_VARIABLE = "TAXEL_CACHE"
"""Environment variable: the folder for features and other things that can be made again."""
_OTHER_CACHE = f"--cache or ${CACHE_VARIABLE}"


def default_cache() -> Path:
    """Return the folder for features: $TAXEL_CACHE, or ~/.cache/taxel."""
    return Path(os.environ.get(CACHE_VARIABLE) or Path.home() / ".cache" / "taxel")


class Extractor(Protocol):
    """What turns the images of one camera into features."""

    @property
    def key(self) -> str:
        """Name for the cache: model, weights, engine and precision."""
        ...

    @property
    def features(self) -> int:
        """Numbers a frame."""
        ...

    @property
    def in_order(self) -> bool:
        """True where a frame's features depend on the frames before it."""
        ...

    @property
    def places(self) -> bool:
        """True where it gives features of each place of an image, which are compared with those
        of the grasp at rest before they are kept (`taxel.windows.rest`, "local-size").
        """
        ...

    def of(self, images: Sequence[NDArray[np.uint8]]) -> NDArray[np.float32]:
        """Return features, shape (n, features), of images (height, width, 3), red first; with
        `places`, shape (n, places, features).

        With `in_order`, the images are all those of one camera from the recording's
        start, and each call is a new recording.
        """
        ...


@dataclass(frozen=True, slots=True)
class FrameFeatures:
    """Features of one recording's frames; equal images share a row."""

    values: NDArray[np.float32]
    """Shape (rows, features)."""
    row: NDArray[np.intp]
    """Shape (n, cameras): each frame's row."""
    time_s: NDArray[np.float64] | None = None
    """Shape (n,): when each was taken, seconds. None: frames are taken to follow each other."""
    gap_s: float = float("inf")
    """Longest time between two frames of one window, seconds."""

    def whole(self, k: int) -> NDArray[np.bool_]:
        """Return whether each window of k frames spans no outage, shape (n - k + 1,)."""
        return whole_windows(len(self.row), k, self.time_s, self.gap_s)

    def all(self) -> NDArray[np.float32]:
        """Return shape (n, cameras, features)."""
        return self.values[self.row]


@dataclass(frozen=True, slots=True)
class Progress:
    """How far an extraction is."""

    recordings: int
    of: int
    frames: int
    """Images that were computed in this run, not found in the cache."""
    seconds: float
    """Time spent on them."""

    @property
    def frames_hz(self) -> float:
        """Images a second, 0 where all came from the cache."""
        return self.frames / self.seconds if self.seconds else 0.0


def extract(
    pours: Sequence[CameraRecording],
    extractor: Extractor,
    cache: Path,
    on_progress: Callable[[Progress], None] = lambda _: None,
) -> list[FrameFeatures]:
    """Return the features of recordings, from the cache where it has them.

    Broken off and started again, it goes on with the first recording that is not
    in the cache. Memory is that of the features and one recording's images.

    Args:
        pours: The recordings.
        extractor: What computes features.
        cache: Folder to keep them in.
        on_progress: Called after each recording.

    Raises:
        RecordingFailed: The disk refused.
        BadSource: An image cannot be decoded.
    """
    features = []
    frames, seconds = 0, 0.0
    for number, pour in enumerate(pours, start=1):
        path = kept_path(cache, extractor, pour)
        values = load_kept(path, extractor.features)
        if values is None:
            started = perf_counter()
            values = _compute(pour, extractor)
            save_kept(path, values)
            seconds += perf_counter() - started
            frames += len(values)
        row = pour.image
        if extractor.in_order:
            row = np.arange(pour.image.size, dtype=np.intp).reshape(pour.image.shape)
        features.append(FrameFeatures(values, row, pour.time_s, pour.gap_s))
        on_progress(Progress(number, len(pours), frames, seconds))
    return features


def kept_path(cache: Path, extractor: Extractor, pour: CameraRecording) -> Path:
    """Return where a recording's features are kept."""
    return cache / "features" / extractor.key / f"{pour.digest[:32]}.npy"


BATCH = 16
"""Images given to a backbone at once: bounds memory."""


def _compute(pour: CameraRecording, extractor: Extractor) -> NDArray[np.float32]:
    cameras = len(pour.cameras)
    if extractor.in_order:
        each = [extractor.of(list(camera_images(pour, camera))) for camera in range(cameras)]
        return np.stack(each, axis=1).reshape(-1, extractor.features)
    at_once = getattr(extractor, "at_once", BATCH)
    # Where a card computes, decoding would be what takes the time.
    beside = SideBySide(min(os.cpu_count() or 1, at_once) if at_once > BATCH else 1)

    def features(batch: list[tuple[bytes, int]]) -> NDArray[np.float32]:
        return extractor.of(
            beside.map(lambda file: decoded(file[0], pour.cameras[file[1]], pour.path), batch)
        )

    rest = _at_rest(pour, features) if extractor.places else None
    parts = []
    for batch in _batches(_different(pour), at_once):
        found = features(batch)
        if rest is not None:
            found = compared(found, rest[[camera for _, camera in batch]])
        parts.append(found)
    return np.concatenate(parts)


def _at_rest(
    pour: CameraRecording, features: Callable[[list[tuple[bytes, int]]], NDArray[np.float32]]
) -> NDArray[np.float32]:
    """Return the grasp at rest as each camera shows it, shape (cameras, places, features)."""
    rows = pour.image[SETTLE]
    wanted, own = np.unique(rows, return_inverse=True)
    files = list(islice(_different(pour), int(wanted[-1]) + 1))
    found = features([files[row] for row in wanted])
    return np.stack([settled(found[each]) for each in own.reshape(rows.shape).T])


def _different(pour: CameraRecording) -> Iterator[tuple[bytes, int]]:
    """Yield the recording's different images, each with its camera's number, in the order of
    `CameraRecording.image`.
    """
    known = 0
    for found, row in zip(frame_sets(pour.path, len(pour.cameras)), pour.image, strict=True):
        for frame, number in zip(found.frames, row, strict=True):
            if number == known:
                known += 1
                yield frame.jpeg, frame.camera


def _batches(images: Iterable[Item], at_once: int) -> Iterator[list[Item]]:
    batch: list[Item] = []
    for image in images:
        batch.append(image)
        if len(batch) == at_once:
            yield batch
            batch = []
    if batch:
        yield batch


def load_kept(path: Path, features: int) -> NDArray[np.float32] | None:
    """Return what the cache holds, shape (rows, features).

    None where it holds nothing, or something damaged or of another width.
    """
    try:
        values = array_of(read_bytes(path, LARGEST_ARRAYS)).copy()
    except (OSError, BadFile):
        return None
    right = values.ndim == 2 and values.shape[1] == features and values.dtype == np.float32
    return values if right else None


class _Stream:
    """A file as a mere stream, so that the system's words arrive where it refuses.

    To a file NumPy writes by itself, and of a full disk says "2304 requested and 224 written".
    """

    def __init__(self, file: BinaryIO) -> None:
        self._file = file

    def write(self, data: bytes) -> int:
        return self._file.write(data)


def save_kept(path: Path, values: NDArray[np.float32]) -> None:
    """Write a file of the cache, whole or not at all.

    Args:
        path: The file.
        values: Shape (rows, features).

    Raises:
        RecordingFailed: The disk refused.
    """
    with _whole(path) as file:
        np.save(_Stream(file), values, allow_pickle=False)


def save_bytes(path: Path, data: bytes) -> None:
    """Write another file of the cache, whole or not at all.

    Raises:
        RecordingFailed: The disk refused.
    """
    with _whole(path) as file:
        file.write(data)


@contextmanager
def _whole(path: Path) -> Iterator[BinaryIO]:
    with cache_room(path.parent), scratch_folder(path, _OTHER_CACHE) as scratch:
        temporary = scratch / MADE
        with temporary.open("wb") as file:
            yield file
        os.replace(temporary, path)


@contextmanager
def cache_room(folder: Path) -> Iterator[None]:
    """Make a folder of the cache if needed, and name it where it takes nothing more.

    Raises:
        RecordingFailed: The disk refused.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield
    except OSError as error:
        raise RecordingFailed(
            f"needed room in the cache, {folder}; got {error.strerror or error}; "
            f"free space, or choose another folder with {_OTHER_CACHE}."
        ) from error
