"""Camera trials as data: what each is labelled, who belongs together, and its images on demand.

A trial is a recording of tactile cameras, or a row of a table that names videos, folders of
images or single ones, which are read where they lie. Knows nothing about crops, features or models.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from itertools import chain, islice
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadDataset, BadTable
from taxel.frame_codec import encode_jpeg
from taxel.plain_text import visible_names
from taxel.recordings.footage_files import IMAGES, IMPORT_THEM, NAME_THEM, VIDEOS
from taxel.recordings.imports.footage import open_footage
from taxel.recordings.imports.known import KNOWN_VIDEOS
from taxel.recordings.imports.value_tables.table_columns import read_cells
from taxel.recordings.imports.video_rows import VideoRow, names_videos, read_video_rows
from taxel.recordings.imports.videos import QUALITY, naming, same_length, same_rate
from taxel.recordings.reader import list_recordings, read_manifest
from taxel.signals import CameraInfo
from taxel.sim.pour.state import has_truth
from taxel.windows.camera_recordings import (
    CameraRecording,
    Stretch,
    image_size,
    images_in,
    read_camera_recording,
    read_camera_recordings,
)

Image = NDArray[np.uint8]
TABLES = (".csv", ".tsv")
"""Endings of a table of trials."""


class Reader(Protocol):
    """Reads a trial's images, in any process that sees the same disk."""

    def __call__(self, camera: int) -> Iterator[Image]:
        """Yield a camera's images in order, shape (height, width, 3), red first."""
        ...

    def digest(self) -> str:
        """Return `CameraTrial.digest` of what lies on the disk now."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraTrial:
    """One trial of one or more tactile cameras; its images stay on disk."""

    name: str
    labels: Mapping[str, str]
    groups: Mapping[str, str]
    cameras: tuple[str, ...]
    frames: int
    """Of each camera."""
    width: int
    height: int
    """Of all cameras' images, pixels."""
    rate_hz: float
    mm_per_px: float | None
    """Millimetres that a pixel covers; None where nobody said."""
    digest: str
    """SHA-256 over all images, hexadecimal."""
    turned: str
    """Likewise, with the cameras in reverse order: `digest` of the same two files, swapped."""
    recorded: bool
    """True where the images are a recording's own, which `digest` is over; False for files."""
    read: Reader
    """Its images."""
    slip_um: NDArray[np.float32] | None = None
    """Shape (frames,): how far the object has slipped, where a simulator says it."""

    def images(self, camera: int, wanted: Sequence[int]) -> dict[int, Image]:
        """Return some of a camera's images by their number; memory is that of those."""
        needed = set(wanted)
        found = enumerate(islice(self.read(camera), max(needed) + 1))
        return {number: image for number, image in found if number in needed}

    def crops(self, starts: Sequence[int], span: int, step: int = 1) -> Iterator[list[list[Image]]]:
        """Yield crops: the images of each camera. Memory is that of the images of crops that
        overlap, whatever they span.

        Args:
            starts: First image of each crop, ascending.
            span: Frames from a crop's first image to its last, both counted.
            step: Frames from an image to the next.
        """
        streams = [self.read(camera) for camera in range(len(self.cameras))]
        held: list[dict[int, Image]] = [{} for _ in streams]
        crops = [range(start, start + span, step) for start in starts]
        wanted: set[int] = set().union(*crops)
        read = 0
        for crop in crops:
            for own, stream in zip(held, streams, strict=True):
                for number in [number for number in own if number < crop.start]:
                    del own[number]
                for number, image in enumerate(islice(stream, crop.start + span - read), read):
                    if number in wanted:
                        own[number] = image
            read = crop.start + span
            yield [[own[number] for number in crop if number in own] for own in held]

    def moments(self) -> Iterator[tuple[Image, ...]]:
        """Yield the images of all cameras, a moment after another.

        Raises:
            BadTable: A video cannot be read.
        """
        streams = [self.read(camera) for camera in range(len(self.cameras))]
        return islice(zip(*streams, strict=False), self.frames)

    def digests(self, *, turned: bool = False) -> tuple[str, ...]:
        """Return `digest` and, of files, the digest of the recording that an import makes of them.

        By both a trial is known again whether it is read in place or imported. Files are decoded
        and coded once for it.

        Args:
            turned: Also those with the cameras in reverse order.

        Raises:
            BadTable: A video cannot be read.
        """
        own = (self.digest, self.turned) if turned else (self.digest,)
        if self.recorded:
            return own
        whole, back = hashlib.sha256(), hashlib.sha256()
        for images in self.moments():
            each = [hashlib.sha256(encode_jpeg(image, QUALITY)).digest() for image in images]
            whole.update(b"".join(each))
            back.update(b"".join(reversed(each)))
        return (*own, whole.hexdigest(), *([back.hexdigest()] if turned else []))


def check_order(trials: Sequence[CameraTrial]) -> None:
    """Refuse trials of the same cameras in another order: recognisers know them by their place.

    Raises:
        BadDataset: There are some.
    """
    known: dict[tuple[str, ...], CameraTrial] = {}
    for trial in trials:
        first = known.setdefault(tuple(sorted(trial.cameras)), trial)
        if first.cameras != trial.cameras:
            raise BadDataset(
                "cameras in one order in all trials",
                f"{visible_names(first.cameras)} in {first.name} and "
                f"{visible_names(trial.cameras)} in {trial.name}",
                "put the tables' columns in one order, or record or import the trials anew",
            )


def check_unchanged(trial: CameraTrial) -> None:
    """Refuse a trial that was sent here, where the disk holds other images than it was read from.

    Raises:
        BadDataset: It does.
    """
    if trial.read.digest() != trial.digest:
        raise BadDataset(
            f"the images of {trial.name} as they were when the command began", "others",
            "run it again once they no longer change; workers on other machines need the same "
            "files under the same path",
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class _Files:
    """Reads images from a file or folder of each camera."""

    trial: str
    """Its name, for messages."""
    files: tuple[Path, ...]
    """Absolute."""

    def __call__(self, camera: int) -> Iterator[Image]:
        with naming(self.trial), closing(open_footage(self.files[camera])) as footage:
            yield from footage.frames()

    def digest(self) -> str:
        """Return the SHA-256 over all files, hexadecimal, as they are now."""
        each = []
        for file in self.files:
            with closing(open_footage(file)) as footage:
                each.append(footage.digest())
        return _together(each)


@dataclass(frozen=True, slots=True)
class _Recorded:
    """Reads images from some successive sets of frames of a recording."""

    path: Path
    """Absolute."""
    cameras: tuple[CameraInfo, ...]
    first: int
    behind: int

    def __call__(self, camera: int) -> Iterator[Image]:
        return islice(images_in(self.path, self.cameras, camera), self.first, self.behind)

    def digest(self) -> str:
        """Return the SHA-256 over the images, hexadecimal, as they are now."""
        return _of_pour(read_camera_recording(self.path, least=1)).digest


def are_camera_trials(path: Path) -> bool:
    """Return whether a path holds camera trials, looking at its first file only."""
    try:
        if path.suffix.lower() in TABLES:
            return names_videos(next(iter(read_cells(path)), []))
        if known_videos(path):
            return True
        return bool(read_manifest(list_recordings(path)[0]).cameras)
    except (OSError, ValueError):
        return False


def refuse_footage(path: Path, *, imported: bool = False) -> None:
    """Refuse a video, an image or a folder of them where trials belong: a table names them.

    Args:
        path: What a person named.
        imported: Only recordings are of use, also of a public data set's own folder.

    Raises:
        BadTable: It is one.
    """
    inside = list(path.iterdir()) if path.is_dir() else [path]
    if any(file.name.lower().endswith((".mcap", ".mcap.tmp")) for file in inside):
        return
    tabled = [file for file in inside if file.suffix.lower() in TABLES]
    own = [file.name for file in tabled if are_camera_trials(file)] if path.is_dir() else []
    if len(own) == 1 or "trials.csv" in own:
        return  # the reader names the table
    if own:
        raise BadTable(
            "one table of camera trials", f"{path}, which holds {visible_names(sorted(own))}",
            "name one of them instead of the folder",
        )  # fmt: skip
    deeper = () if tabled else chain(path.glob("*/*"), path.glob("*/*/*"))
    footage = (f for f in chain(inside, deeper) if f.suffix.lower() in (*IMAGES, *VIDEOS))
    found = next(footage, None)
    if found is None or not found.exists():
        return
    public = known_videos(path)
    what = "images or videos alone" if path.is_dir() else "one video or image"
    if imported and public:
        mend = f"import it: taxel import {public} --data {path} --output recordings"
        raise BadTable("a recording (MCAP)", f"{path}, {what}", mend)
    if imported:
        raise BadTable("a recording (MCAP)", f"{path}, {what}", IMPORT_THEM)
    if not public:
        raise BadTable(
            "a table of camera trials (CSV), or a recording (MCAP) or a folder of them",
            f"{path}, {what}", f"{NAME_THEM}; it works in place, as taxel live BUNDLE trials.csv",
        )  # fmt: skip


def read_camera_trials(path: Path, *, outside: bool = False) -> list[CameraTrial]:
    """Return the trials of a table, of a folder of recordings, or of a public data set's folder.

    Args:
        path: A table as FORMAT.md describes it, a folder of recordings, or one.
        outside: Also videos that a table names outside of its folder.

    Raises:
        BadTable: The table or a video is not as it should be.
        BadRecording: A recording is damaged, or there is none.
        BadDataset: There are no cameras, trials differ in their number or order, or those of a
            trial in their images' size.
    """
    if path.suffix.lower() in TABLES and path.is_file():
        trials = [_of_row(row) for row in read_video_rows(path, path.parent, outside=outside)]
    elif name := known_videos(path):
        trials = [_of_row(row) for row in KNOWN_VIDEOS[name](path)]
    else:
        refuse_footage(path)
        trials = [_of_pour(pour) for pour in read_camera_recordings(path, least=1)]
    counts = {len(trial.cameras) for trial in trials}
    if len(counts) > 1:
        raise BadDataset(
            "trials of as many cameras each", f"some of {min(counts)}, some of {max(counts)}",
            "make a table of each",
        )  # fmt: skip
    check_order(trials)
    return trials


def known_videos(path: Path) -> str:
    """Return the name of the public data set whose own folder this is; empty where it is none."""
    if not path.is_dir() or any(path.glob("*.mcap*")):
        return ""
    for name, rows in KNOWN_VIDEOS.items():
        with suppress(BadTable):
            return name if rows(path) else ""
    return ""


def _of_row(row: VideoRow) -> CameraTrial:
    videos = {name: open_footage(file) for name, file in row.files.items()}
    try:
        first = next(iter(videos.values()))
        for video in videos.values():
            if (video.width, video.height) != (first.width, first.height):
                raise BadTable(
                    f"images of one size from all cameras of the trial {row.name}",
                    f"{first.width}×{first.height} in {first.path} and "
                    f"{video.width}×{video.height} in {video.path}",
                    "scale them to one size",
                )
        digests = [video.digest() for video in videos.values()]
        return CameraTrial(
            name=row.name,
            labels=row.labels,
            groups=row.groups,
            cameras=tuple(videos),
            frames=same_length(row.name, videos),
            width=first.width,
            height=first.height,
            rate_hz=row.rate_hz or same_rate(row.name, videos),
            mm_per_px=row.mm_per_px,
            digest=_together(digests),
            turned=_together(digests[::-1]),
            recorded=False,
            read=_Files(row.name, tuple(file.absolute() for file in row.files.values())),
        )
    finally:
        for video in videos.values():
            video.close()


def _together(digests: Sequence[str]) -> str:
    return hashlib.sha256("".join(digests).encode()).hexdigest()


def _of_pour(pour: CameraRecording) -> CameraTrial:
    if pour.marked > 1:
        raise BadDataset(
            "one labelled stretch in each recording of cameras, as one trial",
            f"{pour.marked} in {pour.path}",
            "record each trial apart, or export the videos and cut them",
        )

    width, height = image_size([pour])
    camera = pour.cameras[0]
    cut = pour.stretch or Stretch(0, len(pour), pour.digest, pour.turned)
    if not cut.count:
        raise BadDataset(
            "a frame of each camera within the labelled stretch", f"none in {pour.path}",
            "correct the stretch's start and end",
        )  # fmt: skip
    behind = cut.first + cut.count
    slip_um = pour.beside[cut.first : behind, 0] if has_truth(pour.sensor.channels) else None
    return CameraTrial(
        name=pour.name,
        labels=pour.labels,
        groups=pour.groups,
        cameras=tuple(camera.name for camera in pour.cameras),
        frames=cut.count,
        width=width,
        height=height,
        rate_hz=camera.rate_hz,
        mm_per_px=camera.mm_per_px,
        digest=cut.digest,
        turned=cut.turned,
        recorded=True,
        read=_Recorded(pour.path.absolute(), pour.cameras, cut.first, behind),
        slip_um=slip_um,
    )
