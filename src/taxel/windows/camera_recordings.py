"""Recordings of tactile cameras as data: sets of frames with their times, truth and groups.

Holds no pixels: images are read where they are needed, one recording at a time.
Knows nothing about features, labels or models.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadDataset, BadSource
from taxel.jobs.running import shared_out, side_by_side
from taxel.labels.trials import Trial, trials_of
from taxel.recordings.reader import iterate_tactile, list_recordings, read_recording
from taxel.signals import CameraInfo, SensorInfo
from taxel.windows.pairs import FrameSet, join_frames, within
from taxel.windows.sequence import largest_gap_s, whole_windows

LEAST_FRAMES = 12
"""A recording with fewer sets is refused: the longest window of the paper is 11."""


@dataclass(frozen=True, slots=True)
class Stretch:
    """Some successive sets of a recording's frames."""

    first: int
    """Number of the first."""
    count: int
    digest: str
    """SHA-256 over their images in order, hexadecimal."""
    turned: str
    """Likewise, with the cameras in reverse order."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraRecording:
    """One recording of tactile cameras: a pour, a lift, a trial."""

    path: Path
    groups: Mapping[str, str]
    """Cup, position, force, run … of the whole recording."""
    labels: Mapping[str, str]
    """What holds for the whole recording, such as outcome."""
    cameras: tuple[CameraInfo, ...]
    sensor: SensorInfo
    """The array recorded beside the cameras; without channels where there is none."""
    time_s: NDArray[np.float64]
    """Shape (n,): when each set of frames was taken, fitted clock, seconds."""
    image: NDArray[np.intp]
    """Shape (n, cameras): which of the recording's different images each frame shows."""
    beside: NDArray[np.float32]
    """Shape (n, channels): the array's last scan at each set's time."""
    digest: str
    """SHA-256 over all images in order, hexadecimal."""
    turned: str
    """Likewise, with the cameras in reverse order."""
    marked: int = 1
    """Labelled stretches; labels and groups are the first's."""
    stretch: Stretch | None = None
    """Where the first of them lies; None where it is all that was recorded."""

    def __len__(self) -> int:
        return len(self.time_s)

    @property
    def name(self) -> str:
        """The recording's file name without its ending."""
        return self.path.name.removesuffix(".mcap")

    @property
    def gap_s(self) -> float:
        """Longest time between two frames of one window, seconds."""
        return largest_gap_s(min(camera.rate_hz for camera in self.cameras))

    def whole(self, k: int) -> NDArray[np.bool_]:
        """Return whether each window of k frames spans no outage, shape (n - k + 1,)."""
        return whole_windows(len(self), k, self.time_s, self.gap_s)

    @property
    def images(self) -> int:
        """How many different images there are."""
        return int(self.image.max()) + 1


def read_camera_recording(path: Path | str, least: int = LEAST_FRAMES) -> CameraRecording:
    """Read what a recording holds, but for the pixels.

    Args:
        path: The recording.
        least: Sets of frames that it must have.

    Raises:
        BadRecording: It is damaged.
        BadDataset: It has no cameras, or too few sets of frames.
    """
    path = Path(path)
    recording = read_recording(path)
    manifest = recording.manifest
    if not manifest.tactile:
        raise BadDataset(
            "a recording with tactile cameras", f"{path}, which has none",
            "make some with: taxel simulate cup-pour, or taxel import",
        )  # fmt: skip
    times: list[float] = []
    image: list[list[int]] = []
    known: dict[bytes, int] = {}
    whole, turned = hashlib.sha256(), hashlib.sha256()
    for found in frame_sets(path, len(manifest.tactile)):
        digests = [hashlib.sha256(frame.jpeg).digest() for frame in found.frames]
        whole.update(b"".join(digests))
        turned.update(b"".join(reversed(digests)))
        image.append([known.setdefault(digest, len(known)) for digest in digests])
        times.append(found.time_s)
    if len(times) < least:
        raise BadDataset(
            f"at least {least} moments with a frame of each camera",
            f"{len(times)} in {path}",
            "record for longer, or check that all cameras deliver",
        )
    time_s = np.array(times)
    trials = trials_of(path, manifest, recording.marks, times[0], times[-1])
    first = trials[0] if trials else None
    return CameraRecording(
        path=path,
        groups=first.groups if first is not None else manifest.groups,
        labels=first.labels if first is not None else manifest.labels,
        cameras=manifest.tactile,
        sensor=manifest.sensor,
        time_s=time_s,
        image=np.array(image, np.intp),
        beside=_latest(recording.samples.values, recording.samples.fitted_s, time_s),
        digest=whole.hexdigest(),
        turned=turned.hexdigest(),
        marked=len(trials),
        stretch=None if first is None else _stretch(times, first, image, list(known)),
    )


def _stretch(
    times: Sequence[float], trial: Trial, image: Sequence[Sequence[int]], digests: Sequence[bytes]
) -> Stretch | None:
    """Return where a trial lies in its recording; None where it is all of it.

    Args:
        times: Of the sets of frames, seconds.
        trial: The labelled stretch.
        image: Which of the different images each frame of a set shows.
        digests: SHA-256 of the different images.
    """
    inside = [n for n, time_s in enumerate(times) if within(time_s, trial.start_s, trial.end_s)]
    if len(inside) == len(times):
        return None
    whole = hashlib.sha256(b"".join(digests[own] for n in inside for own in image[n]))
    turned = hashlib.sha256(b"".join(digests[own] for n in inside for own in reversed(image[n])))
    first = inside[0] if inside else 0
    return Stretch(first, len(inside), whole.hexdigest(), turned.hexdigest())


def read_camera_recordings(path: Path | str, least: int = LEAST_FRAMES) -> list[CameraRecording]:
    """Read a folder of recordings, or one; many at a time where an engine is in use.

    Args:
        path: The folder or recording.
        least: Sets of frames that each must have.

    Raises:
        BadRecording: One is damaged.
        BadDataset: One has no cameras, or they differ in number.
    """
    files = list_recordings(path)
    if shared_out():
        jobs = [(file.absolute(), least) for file in files]
        found = side_by_side(read_camera_recording, jobs)
        pours = [replace(pour, path=file) for pour, file in zip(found, files, strict=True)]
    else:
        pours = [read_camera_recording(file, least) for file in files]
    counts = {len(pour.cameras) for pour in pours}
    if len(counts) > 1:
        raise BadDataset(
            "recordings with the same number of cameras",
            f"some with {min(counts)} and some with {max(counts)} in {path}",
            "put them in folders of their own",
        )
    return pours


def digest_of_all(pours: Sequence[CameraRecording]) -> str:
    """Return the SHA-256 over all images of some recordings in order, hexadecimal."""
    return hashlib.sha256("".join(pour.digest for pour in pours).encode()).hexdigest()


def image_size(pours: Sequence[CameraRecording]) -> tuple[int, int]:
    """Return width and height of all cameras' images, pixels.

    Raises:
        BadDataset: They differ.
    """
    found = {
        (camera.width, camera.height): f"{camera.width}×{camera.height} of {camera.name} in "
        f"{pour.path.name}"
        for pour in reversed(pours) for camera in reversed(pour.cameras)
    }  # fmt: skip
    if len(found) > 1:
        *_, other, first = found.values()
        raise BadDataset(
            "images of one size from all cameras", f"{first} and {other}",
            "record all at one size, or put those of each size in a folder of their own",
        )  # fmt: skip
    ((size, _),) = found.items()
    return size


def check_order(pours: Sequence[CameraRecording]) -> None:
    """Refuse recordings of the same cameras in another order: heads know them by their place.

    Raises:
        BadDataset: There are some.
    """
    orders = {tuple(camera.name for camera in pour.cameras): pour.path for pour in reversed(pours)}
    known: dict[tuple[str, ...], tuple[str, ...]] = {}
    for order in orders:
        other = known.setdefault(tuple(sorted(order)), order)
        if other != order:
            raise BadDataset(
                "cameras in one order in all recordings",
                f"{', '.join(order)} in {orders[order].name} and {', '.join(other)} in "
                f"{orders[other].name}",
                "record or import them anew in one order",
            )  # fmt: skip


def camera_images(pour: CameraRecording, camera: int) -> Iterator[NDArray[np.uint8]]:
    """Yield every image of one camera, shape (height, width, 3), red first, oldest first.

    Equal images in a row are decoded once.
    """
    return images_in(pour.path, pour.cameras, camera)


def images_in(
    path: Path, cameras: Sequence[CameraInfo], camera: int
) -> Iterator[NDArray[np.uint8]]:
    """Yield what `camera_images` does, of a recording's file and what its cameras are."""
    last: tuple[bytes, NDArray[np.uint8]] | None = None
    for found in frame_sets(path, len(cameras)):
        jpeg = found.frames[camera].jpeg
        if last is None or last[0] != jpeg:
            last = (jpeg, decoded(jpeg, cameras[camera], path))
        yield last[1]


def decoded(
    jpeg: bytes,
    camera: CameraInfo,
    path: Path,
    decode: Callable[[bytes, CameraInfo], NDArray[np.uint8]] | None = None,
) -> NDArray[np.uint8]:
    """Return a recorded image's pixels, shape (height, width, 3), red first.

    Args:
        jpeg: The image.
        camera: Whose it is.
        path: Its recording.
        decode: Another way to decode it.

    Raises:
        BadSource: It is damaged, or not such as the camera sends; camera and recording are named.
    """
    from taxel.frame_codec import decode_jpeg

    try:
        return (decode or decode_jpeg)(jpeg, camera)
    except BadSource as error:
        got = f"{error.got} from {camera.name} in {path}"
        raise BadSource(error.needed, got, error.mend) from error


def frame_sets(path: Path | str, cameras: int) -> Iterator[FrameSet]:
    """Yield sets of a recording's tactile frames, oldest first, in constant memory."""
    return join_frames(iterate_tactile(path), cameras)


def _latest(
    values: NDArray[np.float32], fitted_s: NDArray[np.float64], time_s: NDArray[np.float64]
) -> NDArray[np.float32]:
    """Return the last scan at or before each time; the first one before any."""
    if not len(values):
        return np.zeros((len(time_s), values.shape[1]), np.float32)
    latest = np.maximum(np.searchsorted(fitted_s, time_s + 1e-6, side="right") - 1, 0)
    return np.asarray(values[latest])
