"""Turn videos, or folders of images, into recordings: one a camera, frames side by side.

Frames are decoded and kept as JPEG of high quality; equal frames stay equal. A video has no
clock of its own: times are frame number over rate, and the manifest says so. All videos are
read and written before the output folder appears. Knows nothing about particular data sets.

Background of our choices: docs/decisions/0012.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import combinations
from pathlib import Path

from taxel.errors import BadTable
from taxel.frame_codec import encode_jpeg
from taxel.recordings.imports.earlier import IMPORTED, import_folder
from taxel.recordings.imports.footage import Footage, Video, coloured, open_footage
from taxel.recordings.imports.same_cameras import Pair
from taxel.recordings.imports.video_rows import VideoRow
from taxel.recordings.manifest import NO_ARRAY, Manifest
from taxel.recordings.writer import Recorder
from taxel.signals import CameraInfo, Frame

QUALITY = 95
"""Of the JPEG that imported frames are kept as, 0…100. Source: our choice, decision 12."""
LARGEST_DIFFERENCE = 2
"""Frames by which the videos of a pair may differ in length; the longer one is cut."""


def import_videos(
    rows: Sequence[VideoRow],
    output_dir: Path,
    *,
    overwrite: bool = False,
    progress: Callable[[int, int], None] | None = None,
    on_uneven: Callable[[Video], None] = lambda _: None,
    on_same: Callable[[Pair], None] = lambda _: None,
) -> list[Path]:
    """Write one recording for each row, all or none.

    Args:
        rows: What each recording is made of.
        output_dir: Folder to be made.
        overwrite: Replace an existing folder that holds nothing else than these, and recordings of
            earlier imports.
        progress: Called with recordings done and in all.
        on_uneven: Called with each video whose frames are not evenly spaced; they are taken so.
        on_same: Called for each recording with two cameras that show the same images throughout.

    Raises:
        BadTable: A video is missing, empty, cut short, grey, or unlike its partner.
        RecordingFailed: The disk refused.
    """
    files = [f"{row.name}.mcap" for row in rows]
    with import_folder(output_dir, files, overwrite=overwrite) as made:
        for done, (row, file) in enumerate(zip(rows, files, strict=True), 1):
            videos, same = _import_row(row, made / file)
            for pair in same:
                on_same(pair)
            for video in videos:
                if isinstance(video, Video) and video.uneven():
                    on_uneven(video)
            if progress is not None:
                progress(done, len(rows))
    return [output_dir / file for file in files]


def _import_row(row: VideoRow, path: Path) -> tuple[list[Footage], list[Pair]]:
    """Write a row's recording; return what it was made of, closed, and cameras that are alike."""
    videos = {name: open_footage(file) for name, file in row.files.items()}
    try:
        rate_hz = row.rate_hz or same_rate(row.name, videos)
        count = same_length(row.name, videos)
        cameras = tuple(
            CameraInfo(
                name=name,
                width=video.width,
                height=video.height,
                rate_hz=rate_hz,
                mm_per_px=row.mm_per_px,
                details={"time": "frame number over rate", "file": video.path.name}
                | dict(row.details),
            )
            for name, video in videos.items()
        )
        manifest = Manifest(
            sensor=NO_ARRAY, cameras=cameras, labels=dict(row.labels), groups=dict(row.groups)
        )
        with naming(row.name), Recorder(path, manifest) as recorder:
            streams = [coloured(video) for video in videos.values()]
            same = list(combinations(range(len(streams)), 2))
            for index in range(max(video.count for video in videos.values())):
                images: dict[int, bytes] = {}
                for camera, stream in enumerate(streams):
                    rgb = next(stream, None)  # the longer one is read to its end: it may be cut
                    if rgb is not None and index < count:
                        time_s = index / rate_hz
                        images[camera] = encode_jpeg(rgb, QUALITY)
                        recorder.frame(
                            Frame(
                                camera=camera,
                                jpeg=images[camera],
                                counter=index,
                                device_s=time_s,
                                arrival_s=time_s,
                                fitted_s=time_s,
                            )
                        )
                same = [(a, b) for a, b in same if images.get(a) == images.get(b)]
            recorder.close(IMPORTED)
    finally:
        for video in videos.values():
            video.close()
    names = list(videos)
    return list(videos.values()), [(names[a], names[b]) for a, b in same]


@contextmanager
def naming(trial: str) -> Iterator[None]:
    """Name a trial where the images of a file of it are not as they should be.

    Raises:
        BadTable: They are not.
    """
    try:
        yield
    except BadTable as error:
        got = f"{error.got}, in the trial {trial}"
        raise BadTable(error.needed, got, error.mend) from error


def same_rate(name: str, videos: Mapping[str, Footage]) -> float:
    """Return the rate of a trial's videos, frames a second.

    Raises:
        BadTable: They differ.
    """
    rates = {round(video.rate_hz, 3): video.path for video in videos.values()}
    if len(rates) > 1:
        each = (f"{rate:g} Hz in {path}" for rate, path in sorted(rates.items()))
        raise BadTable(
            f"videos of one rate in the trial {name}", " and ".join(each),
            "give the true rate in the column rate, or record again",
        )  # fmt: skip
    return next(iter(rates))


def same_length(name: str, videos: Mapping[str, Footage]) -> int:
    """Return how many frames all of a trial's videos have.

    Raises:
        BadTable: They differ by more than `LARGEST_DIFFERENCE`.
    """
    counts = [video.count for video in videos.values()]
    if max(counts) - min(counts) > LARGEST_DIFFERENCE:
        each = (f"{video.count} in {video.path}" for video in videos.values())
        raise BadTable(
            f"videos whose lengths differ by {LARGEST_DIFFERENCE} frames at most in the trial "
            f"{name}",
            " and ".join(each), "cut them to the same moments",
        )  # fmt: skip
    return min(counts)
