"""Read what is to be audited: recordings of arrays or cameras, or a known set's own files.

Videos are decoded frame by frame and kept as small grey squares only. Knows nothing about
splits or checks.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadDataset, BadTable
from taxel.evaluation.audit.one_sensor import check_alike, check_cameras
from taxel.evaluation.audit.touch_set import LEAST_ROWS, TouchSet, checked, joined
from taxel.evaluation.audit.usable_rows import held_rows, sums_of
from taxel.labels.trials import Trial, ends_of_rows, trials_of
from taxel.plain_text import number_of
from taxel.recordings.imports.footage import open_footage
from taxel.recordings.imports.importing import import_rows
from taxel.recordings.imports.known import KNOWN, KNOWN_VIDEOS
from taxel.recordings.imports.video_rows import VideoRow, read_video_rows
from taxel.recordings.manifest import NO_ARRAY, Manifest
from taxel.recordings.reader import list_recordings, read_recording
from taxel.signals import CameraInfo, Mark
from taxel.windows.camera_recordings import decoded, frame_sets
from taxel.windows.camera_trials import TABLES, are_camera_trials
from taxel.windows.checks import check_size

SQUARES = (6, 8)
"""Rows and columns that a camera's frame is shrunk to. Source: the first-frame control of
camera trials, docs/decisions/0023."""
MOST = 50_000_000
"""Values that are held, 200 MB; a row counts as eight at least. Our choice, docs/decisions/0023."""
LEAST_RATE_HZ = 150.0
"""Arrays faster than this are thinned by two, and again, where a set holds more."""
_SLACK_S = 1e-6
_VIDEO_HZ = 25.0
"""Nominal, of a GelSight Mini; only the order of a video's frames matters here."""
_SQUARES = SQUARES[0] * SQUARES[1]

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Read:
    """One recording's rows, before they are cut into trials."""

    name: str
    manifest: Manifest
    marks: list[Mark]
    rows: NDArray[np.float32]
    time_s: NDArray[np.float64]
    files: dict[str, str]
    rate_hz: float = 0.0
    every: int = 1
    """One of so many rows is left."""
    scans: NDArray[np.float64] | None = None
    """Of all usable values of each channel: count, sum, sum of squares, shape (3, channels)."""


def read_touch(
    path: Path, target: str | None, on_progress: Progress, *, least: bool = True
) -> TouchSet:
    """Read a folder of recordings, a table of videos, or the own files of a data set taxel knows.

    Args:
        path: The folder or table.
        target: The label to be predicted; the first one with two classes unless given.
        on_progress: Called with what is read, how many are done, and how many there are.
        least: Refuse too few trials or classes for a statement.

    Raises:
        BadRecording: A recording is damaged, or there is none.
        BadTable: A known set's file cannot be read.
        BadDataset: Sensors differ, or labels or trials are missing.
    """
    videos = _known_videos(path)
    if videos is not None:
        views = tuple(v for v in videos[0].files for _ in range(_SQUARES))
        touch = _assemble(_read_videos(videos, on_progress), "camera", target, views)
        return checked(touch) if least else touch
    with tempfile.TemporaryDirectory(prefix="taxel-audit-") as scratch:
        folder = _imported(path, Path(scratch) / "made", on_progress)
        paths = list_recordings(folder)
        cameras = read_recording(paths[0]).manifest.tactile
        if cameras:
            views = tuple(camera.name for camera in cameras for _ in range(_SQUARES))
            reads = [_camera_recording(p, cameras) for p in
                     _announced(paths, "recordings", on_progress)]  # fmt: skip
            touch = _assemble(reads, "camera", target, views)
        else:
            reads = _array_recordings(_announced(paths, "recordings", on_progress))
            views = ("array",) * reads[0].rows.shape[1]
            touch = _assemble(reads, "array", target, views)
    return checked(touch) if least else touch


def read_both(
    path: Path, test: Path, target: str | None, on_progress: Progress
) -> tuple[TouchSet, int]:
    """Return the trials of a folder to train on and of one to test on, and where the second begin.

    Raises:
        BadRecording: A recording is damaged, or there is none.
        BadDataset: Sensors differ, or labels or trials are missing.
    """
    first = read_touch(path, target, on_progress)
    second = read_touch(test, first.target, on_progress, least=False)
    if len({max(map(len, touch.rows)) < LEAST_ROWS for touch in (first, second)}) > 1:
        raise BadDataset(f"trials of at least {LEAST_ROWS} rows in both folders, or in none",
                         "single readings in one of them", "cut both alike")  # fmt: skip
    return joined(first, second), len(first)


def _announced(paths: Sequence[Path], what: str, on_progress: Progress) -> Iterator[Path]:
    for done, path in enumerate(paths, 1):
        yield path
        on_progress(what, done, len(paths))


def _known_videos(path: Path) -> list[VideoRow] | None:
    """Return the rows of a table of videos, or of a known set's folder; None for all else."""
    if path.is_file() and path.suffix.lower() in TABLES and are_camera_trials(path):
        return read_video_rows(path, path.parent)
    if not path.is_dir() or any(path.glob("*.mcap*")):
        return None
    for rows in KNOWN_VIDEOS.values():
        try:
            return rows(path)
        except BadTable:
            continue
    return None


def _imported(path: Path, output: Path, on_progress: Progress) -> Path:
    """Return a folder of recordings: the one given, or a known set's files imported anew."""
    if not path.is_dir() or any(path.glob("*.mcap*")):
        return path
    for known in KNOWN.values():
        try:
            rows = known.rows(path)
        except BadTable:
            continue
        import_rows(rows, output, progress=lambda n, of: on_progress("files", n, of))
        return output
    return path


def _array_recordings(paths: Iterator[Path]) -> list[_Read]:
    """Return recordings with all of their rows, or all thinned alike where they are too large."""
    reads: list[_Read] = []
    every, held = 1, 0
    for path in paths:
        reads.append(_thinned(_array_recording(path), every))
        check_alike(reads[0].manifest.sensor, reads[-1].manifest.sensor, path)
        held += _size(reads[-1])
        while held > MOST and any(read.rate_hz / every > LEAST_RATE_HZ for read in reads):
            every *= 2
            reads = [_thinned(read, every) for read in reads]
            held = sum(map(_size, reads))
    return reads


def _size(read: _Read) -> int:
    return int(len(read.rows) * max(8, read.rows.shape[1]))


def _thinned(read: _Read, every: int) -> _Read:
    """Return one row of so many, as far as the rate allows."""
    while read.every < every and read.rate_hz / read.every > LEAST_RATE_HZ:
        read = replace(read, rows=read.rows[::2].copy(), time_s=read.time_s[::2].copy(),
                       every=2 * read.every)  # fmt: skip
    return read


def _array_recording(path: Path) -> _Read:
    recording = read_recording(path)
    samples, sensor = recording.samples, recording.manifest.sensor
    files = {
        "sensor's name": sensor.name, "sensor's serial": sensor.serial,
        "rate": f"{sensor.rate_hz:g} Hz", "full scale": str(sensor.full_scale),
        "software": recording.manifest.software,
        **{f"detail {key}": value for key, value in sensor.details.items()},
    }  # fmt: skip
    usable = samples.usable & np.isfinite(samples.values)
    rows = held_rows(samples.values, usable)
    check_size(rows, sensor.channels, lambda at: f"{path.name}, at {samples.fitted_s[at]:.2f} s")
    return _Read(name=path.name, manifest=recording.manifest, marks=recording.marks, rows=rows,
                 time_s=samples.fitted_s, files=files, rate_hz=sensor.rate_hz,
                 scans=sums_of(samples.values, usable))  # fmt: skip


def _camera_recording(path: Path, first: Sequence[CameraInfo]) -> _Read:
    recording, cameras = read_recording(path), len(first)
    check_cameras(first, recording.manifest.tactile, path)
    rows, times, shown = [], [], [b""] * cameras
    grey = [np.zeros(_SQUARES, np.float32)] * cameras
    for found in frame_sets(path, cameras):
        fresh = [frame.jpeg != shown[i] for i, frame in enumerate(found.frames)]
        if not any(fresh):
            continue  # a camera slower than its stream repeats its image
        for i, frame in enumerate(found.frames):
            if fresh[i]:
                shown[i] = frame.jpeg
                grey[i] = _small_jpeg(frame.jpeg, recording.manifest.tactile[i], path)
        rows.append(np.concatenate(grey))
        times.append(found.time_s)
    files = {"software": recording.manifest.software}
    for camera in recording.manifest.cameras:
        files |= {
            f"{camera.name}: serial": camera.serial,
            f"{camera.name}: size": f"{camera.width}×{camera.height}",
            f"{camera.name}: rate": f"{camera.rate_hz:g} Hz",
            **{f"{camera.name}: {key}": value for key, value in camera.details.items()},
        }
    return _Read(name=path.name, manifest=recording.manifest, marks=recording.marks,
                 rows=np.array(rows, np.float32).reshape(len(rows), cameras * _SQUARES),
                 time_s=np.array(times), files=files)  # fmt: skip


def _small_jpeg(jpeg: bytes, camera: CameraInfo, path: Path) -> NDArray[np.float32]:
    from taxel.frame_codec import decode_grey_quarter

    return _small(decoded(jpeg, camera, path, decode_grey_quarter))


def _small(grey: NDArray[np.uint8]) -> NDArray[np.float32]:
    import cv2

    size = (SQUARES[1], SQUARES[0])
    shrunk = cv2.resize(np.asarray(grey, np.float32), size, interpolation=cv2.INTER_AREA)
    return np.asarray(shrunk, np.float32).ravel()


def _read_videos(rows: list[VideoRow], on_progress: Progress) -> list[_Read]:
    reads = []
    for done, row in enumerate(rows, 1):
        greys = [_small_video(file) for file in row.files.values()]
        count = min(map(len, greys))
        if not count:
            raise BadTable("videos with frames", f"none in {row.name}", "copy them again")
        files = {f"{name}: kind of file": file.suffix.lower() if file.is_file() else "folder"
                 for name, file in row.files.items()}  # fmt: skip
        reads.append(
            _Read(
                name=f"{row.name}.mcap",
                manifest=Manifest(sensor=NO_ARRAY, labels=row.labels, groups=row.groups),
                marks=[],
                rows=np.concatenate([grey[:count] for grey in greys], axis=1),
                time_s=np.arange(count) / (row.rate_hz or _VIDEO_HZ),
                files=files,
            )
        )
        on_progress("videos", done, len(rows))
    return reads


def _small_video(path: Path) -> NDArray[np.float32]:
    import cv2

    with closing(open_footage(path)) as footage:
        rows = [
            _small(np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), np.uint8))
            for image in footage.frames()
        ]
    return np.array(rows, np.float32).reshape(len(rows), _SQUARES)


def _spans(read: _Read) -> Iterator[tuple[Trial, slice]]:
    """Yield a recording's trials, and their rows."""
    if not len(read.rows):
        return
    bounds = float(read.time_s[0]), float(read.time_s[-1])
    trials = trials_of(Path(read.name), read.manifest, read.marks, *bounds)
    for trial, end_s in zip(trials, ends_of_rows(trials, _SLACK_S), strict=True):
        ends = (trial.start_s - _SLACK_S, end_s)
        yield trial, slice(*np.searchsorted(read.time_s, ends).tolist())


def _least_rows(reads: Sequence[_Read], kind: str) -> int:
    """Return how many rows a trial needs: one where an array's trials are all single readings."""
    if kind == "camera" or any(
        inside.stop - inside.start >= LEAST_ROWS for read in reads for _, inside in _spans(read)
    ):
        return LEAST_ROWS
    return 1


def _assemble(
    reads: Sequence[_Read], kind: str, target: str | None, views: tuple[str, ...]
) -> TouchSet:
    """Return the labelled trials of all recordings, with notes on what was left out.

    Args:
        reads: The recordings.
        kind: "array" or "camera".
        target: The label to be predicted; the first one with two classes unless given.
        views: For each column of the rows the camera that it belongs to; all alike for an array.

    Raises:
        BadDataset: Recordings are of different sensors, trials are too short, or labels are
            missing.
    """
    least = _least_rows(reads, kind)
    cut: list[tuple[_Read, Trial, slice]] = []
    short: list[Trial] = []
    for read in reads:
        if read.rows.shape[1] != len(views):
            raise BadDataset(f"{number_of(len(views), 'channel')} in every recording",
                             f"{read.rows.shape[1]} in {read.name}",
                             "put recordings of different sensors into different folders",
                             )  # fmt: skip
        for trial, inside in _spans(read):
            if inside.stop - inside.start < least:
                short.append(trial)
            else:
                cut.append((read, trial, inside))
    _refuse_short(len(cut), len(short), least, kind)
    trials = [trial for _, trial, _ in cut]
    target, notes = _target(trials, target, _notes_on_lengths(reads, len(short), least, kind))
    labelled = np.flatnonzero([target in trial.labels for trial in trials])
    if lacking := len(trials) - len(labelled):
        notes += (f"{number_of(lacking, 'trial')} without the label {target!r}: left out",)
    whole = TouchSet(
        kind="camera" if kind == "camera" else "array",
        target=target,
        trials=tuple(trials),
        rows=tuple(read.rows[inside] for read, _, inside in cut),
        time_s=tuple(read.time_s[inside] for read, _, inside in cut),
        views=views,
        channels=() if kind == "camera" else reads[0].manifest.sensor.channels,
        squares=SQUARES if kind == "camera" else None,
        created=tuple(read.manifest.created for read, _, _ in cut),
        files=tuple(read.files for read, _, _ in cut),
        notes=notes,
        left_out=(*short, *(trial for trial in trials if target not in trial.labels)),
        every={read.name: read.every for read in reads if read.every > 1},
        scans={read.name: read.scans for read in reads if read.scans is not None},
    )
    return whole.only(labelled)


def _refuse_short(trials: int, short: int, least: int, kind: str) -> None:
    """Raise BadDataset where all trials, or most of them, have fewer than `least` rows."""
    what = "different frames" if kind == "camera" else "rows"  # repeated ones count once
    if short and not trials:
        raise BadDataset(
            f"trials of at least {least} {what}, to look for copies, drift and leaks in",
            f"{number_of(short, 'trial')}, all shorter",
            "judge single images under splits of their groups: "
            "taxel evaluate-trials --split group:KEY" if kind == "camera" else
            "mend the times of the trials",
        )  # fmt: skip
    if short > trials:
        raise BadDataset(
            f"trials of at least {least} {what}, or single readings alone",
            f"{short} shorter ones beside {trials}", "put them into different folders",
        )  # fmt: skip


def _notes_on_lengths(reads: Sequence[_Read], short: int, least: int, kind: str) -> tuple[str, ...]:
    """Return notes on trials that are too short, and on recordings of which rows were left out."""
    notes: tuple[str, ...] = ()
    what = "different frames" if kind == "camera" else "rows"
    if least < LEAST_ROWS:
        notes += (f"all trials have fewer than {LEAST_ROWS} rows, so what needs a course in time is"
                  " not checked: length, place, first row, level, windows, copies turned round",
                  )  # fmt: skip
    if short:
        notes += (f"{number_of(short, 'trial')} of fewer than {least} {what}: left out",)
    if every := {read.name: read.every for read in reads if read.every > 1}:
        rate = " or ".join(map(str, sorted(set(every.values()))))
        notes += (f"more values than are held: one row of {rate} is seen in {len(every)} "
                  f"of {number_of(len(reads), 'recording')}; copies begun between are not found",
                  )  # fmt: skip
    return notes


def _target(
    trials: list[Trial], wanted: str | None, lengths: tuple[str, ...]
) -> tuple[str, tuple[str, ...]]:
    known = {name: {t.labels[name] for t in trials if name in t.labels}
             for name in sorted({name for trial in trials for name in trial.labels})}  # fmt: skip
    labels = f"the labels {', '.join(known) or 'none'}"
    if wanted is not None:
        if wanted not in known:
            raise BadDataset(f"the label {wanted!r}", labels, "name one of those with --target")
        return wanted, lengths
    usable = [name for name, values in known.items() if len(values) > 1]
    if not usable:
        raise BadDataset("a label with at least two classes", "; ".join((labels, *lengths)),
                         "label the recordings, or name another folder")  # fmt: skip
    others = f"audited for {usable[0]!r}; other labels: {', '.join(usable[1:])} (--target)"
    return usable[0], ((others,) if len(usable) > 1 else ()) + lengths
