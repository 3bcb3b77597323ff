"""A recording as episodes of evenly numbered frames, as tools for learning robots want it.

An episode is a whole recording, or each of its marks. With cameras its frames are those of the
first camera; the others give the nearest in time, depth is left out. Without, each frame is the
next so many scans. Each frame has a window of the scans up to it, so that touch keeps its own rate.
Knows nothing about files of any format but the recording's own.

Background of our choices: docs/decisions/0051.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadDataset, BadInput
from taxel.recordings.manifest import Manifest
from taxel.recordings.reader import iterate_jpeg, read_recording
from taxel.signals import UNUSABLE, Frame, Mark, Samples, Validity

MARGIN = 1.1
"""Scans of a frame's window over those between two frames. Source: our choice, decision 51."""
ARRAY_FPS = 25
"""Frames a second that an array without cameras is cut into, about: what tactile cameras have."""
Cut = Literal["recording", "mark"]
"""What an episode is: a whole recording, or each of its marks."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Rhythm:
    """How many frames a second, and how many scans each has."""

    fps: int
    """Frames a second, a whole number as LeRobot wants it."""
    rows: int
    """Scans in the window of each frame; 0 without an array."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Episode:
    """A stretch of a recording as numbered frames, each with its images and scans."""

    path: Path
    name: str
    """The recording's, with the mark's number where it is cut."""
    manifest: Manifest
    """Its cameras are those of JPEG; labels and groups are the mark's as well, where it is cut."""
    samples: Samples
    """The whole recording's."""
    marks: tuple[Mark, ...]
    """Those of a whole recording; none where the episode is a mark."""
    time_s: NDArray[np.float64]
    """When each frame was taken, shape (frames,), fitted clock, seconds."""
    images: NDArray[np.int64]
    """Number of each camera's frame in the recording, shape (cameras, frames), increasing."""
    first_scan: NDArray[np.int64]
    """The first scan of each frame's window, shape (frames,); windows may reach over both ends."""
    limits: tuple[int, int]
    """The scans that belong to the episode, first and one past the last."""
    rows: int

    def __len__(self) -> int:
        return len(self.time_s)

    @property
    def scans_left_out(self) -> int:
        """How many scans of the episode are in no frame's window."""
        first, stop = self.limits
        covered = np.zeros(stop - first, bool)
        for start in np.unique(self.first_scan) if self.rows else ():
            covered[max(0, start - first) : max(0, start - first + self.rows)] = True
        return int(np.count_nonzero(~covered))

    def labels_at(self, frame: int) -> dict[str, str]:
        """Return the labels that hold at a frame: the recording's and those of its marks.

        Where marks give a label two values, as at the moment at which one ends and the next begins,
        that of the last to begin holds.
        """
        at_s = self.time_s[frame]
        found = dict(self.manifest.labels)
        for mark in sorted(self.marks, key=lambda mark: mark.start_s):
            if mark.start_s <= at_s <= mark.end_s:
                found |= dict(mark.labels)
        return found

    def windows(self, start: int, stop: int) -> tuple[Samples, NDArray[np.bool_]]:
        """Return the scans of some frames' windows, one after another, and which of them exist.

        A scan that does not exist is NaN and MISSING: before the recording, or beyond the episode.

        Returns:
            Scans, `rows` a frame; shape (frames · rows,), True where there is such a scan.
        """
        number = (self.first_scan[start:stop, None] + np.arange(self.rows)).ravel()
        first, last = self.limits
        there = (number >= first) & (number < last)
        if not there.any():
            return _nothing(len(number), self.samples.values.shape[1]), there
        samples = self.samples[np.where(there, number, number[there][0])]
        values = np.where(there[:, None], samples.values, np.float32(np.nan))
        validity = np.where(there[:, None], samples.validity, np.uint8(Validity.MISSING))
        fitted_s = np.where(there, samples.fitted_s, np.nan)
        return replace(samples, values=values, validity=validity, fitted_s=fitted_s), there

    def frames(self) -> Iterator[tuple[Frame, ...]]:
        """Yield for each frame that of every camera, in constant memory; nothing without cameras.

        Raises:
            BadRecording: The recording changed since it was opened.
        """
        cameras = len(self.images)
        held: list[dict[int, Frame]] = [{} for _ in range(cameras)]
        seen = [0] * cameras
        due = 0
        for frame in iterate_jpeg(self.path):
            number = seen[frame.camera]
            seen[frame.camera] += 1
            if number >= self.images[frame.camera, due]:  # those before a mark are not held
                held[frame.camera][number] = frame
            while due < len(self) and all(self.images[c, due] in held[c] for c in range(cameras)):
                yield tuple(held[c][int(self.images[c, due])] for c in range(cameras))
                due += 1
                for c in range(cameras if due < len(self) else 0):
                    for old in [n for n in held[c] if n < self.images[c, due]]:
                        del held[c][old]
            if due == len(self):
                return


def usable(samples: Samples) -> NDArray[np.bool_]:
    """Return which values may be used, shape (n, channels)."""
    flags: NDArray[np.bool_] = (samples.validity & np.uint8(UNUSABLE)) == 0
    flags &= np.isfinite(samples.values)
    return flags


def rhythm_of(manifest: Manifest, path: Path, fps: int | None, rows: int | None) -> Rhythm:
    """Return how a recording is cut into frames.

    Args:
        manifest: What it is.
        path: Its file, for messages.
        fps: Frames a second; the first camera's nominal rate, or about `ARRAY_FPS`, by default.
        rows: Scans a frame; by default a tenth more than fit between two frames, so that no scan
            is left out where a camera's frames come late. Without cameras just as many as fit.

    Raises:
        BadDataset: Its rates are not known.
        BadInput: Both are given where one follows from the other, or scans without an array.
    """
    sensor, cameras = manifest.sensor, manifest.of_jpeg
    if sensor.channels and sensor.rate_hz <= 0:
        raise BadDataset("a recording whose array has a rate", f"{path} without",
                         "record or import it again with its rate")  # fmt: skip
    if cameras and cameras[0].rate_hz <= 0 and not fps:
        raise BadDataset("a recording whose camera has a rate", f"{path} without", "give --fps")
    if rows and not sensor.channels:
        raise BadInput("an array beside --rows, the scans of each frame",
                       f"{path} of cameras alone", "leave it out")  # fmt: skip
    if cameras:
        fps = fps or max(1, round(cameras[0].rate_hz))
        rows = rows or math.ceil(MARGIN * sensor.rate_hz / fps)
        return Rhythm(fps=fps, rows=rows if sensor.channels else 0)
    if fps and rows:
        raise BadInput("--fps or --rows for an array without cameras", "both",
                       "leave one out: the other follows from the array's rate")  # fmt: skip
    rows = rows or max(1, round(sensor.rate_hz / (fps or ARRAY_FPS)))
    return Rhythm(fps=fps or max(1, round(sensor.rate_hz / rows)), rows=rows)


def episodes_of(
    path: Path,
    rhythm: Rhythm,
    cut: Cut = "recording",
    on_empty: Callable[[str], None] = lambda name: None,
) -> Iterator[Episode]:
    """Yield a recording's episodes; those without a frame are passed over.

    Args:
        path: The recording.
        rhythm: How it is cut into frames.
        cut: What an episode is.
        on_empty: Called with the name that each mark without a frame would have as an episode.

    Raises:
        BadRecording: It is damaged or cut short.
    """
    recording = read_recording(path)
    manifest = replace(recording.manifest, cameras=recording.manifest.of_jpeg)
    camera_s = _camera_times(path, len(manifest.cameras))
    whole = Mark(start_s=-np.inf, end_s=np.inf, labels={})
    marks = recording.marks if cut == "mark" else [whole]
    for number, mark in enumerate(marks):
        limits = (
            int(np.searchsorted(recording.samples.fitted_s, mark.start_s, "left")),
            int(np.searchsorted(recording.samples.fitted_s, mark.end_s, "right")),
        )
        time_s, images, first = _grid(recording.samples, camera_s, mark, limits, rhythm.rows)
        name = path.stem if cut == "recording" else f"{path.stem}_{number:04d}"
        if not len(time_s) and cut == "mark":
            on_empty(name)
        if len(time_s):
            about = replace(
                manifest, labels=dict(manifest.labels) | dict(mark.labels),
                groups=dict(manifest.groups) | dict(mark.groups),
            )  # fmt: skip
            yield Episode(
                path=path, name=name, manifest=about, samples=recording.samples,
                marks=tuple(recording.marks) if cut == "recording" else (),
                time_s=time_s, images=images, first_scan=first, limits=limits, rows=rhythm.rows,
            )  # fmt: skip


def _grid(
    samples: Samples,
    camera_s: Sequence[NDArray[np.float64]],
    mark: Mark,
    limits: tuple[int, int],
    rows: int,
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """Return time, images and first scan of each frame; see `Episode`."""
    first, stop = limits
    if not camera_s:
        starts = np.arange(first, stop, rows, dtype=np.int64)
        last = np.minimum(starts + rows, stop) - 1
        return samples.fitted_s[last], np.zeros((0, len(starts)), np.int64), starts
    inside = (camera_s[0] >= mark.start_s) & (camera_s[0] <= mark.end_s)
    if not all(map(len, camera_s)):
        inside[:] = False
    main = np.flatnonzero(inside)
    time_s = camera_s[0][main]
    images = np.array([main, *(_nearest(own, time_s) for own in camera_s[1:])], np.int64)
    ends = np.searchsorted(samples.fitted_s, time_s, "right")
    return time_s, images.reshape(len(camera_s), len(main)), (ends - rows).astype(np.int64)


def _nearest(time_s: NDArray[np.float64], wanted_s: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return for each moment the place of the nearest of some times, which increase."""
    if not len(wanted_s):
        return np.zeros(0, np.int64)
    after = np.clip(np.searchsorted(time_s, wanted_s), 1, max(1, len(time_s) - 1))
    if len(time_s) == 1:
        return np.zeros(len(wanted_s), np.int64)
    before_is_nearer = wanted_s - time_s[after - 1] <= time_s[after] - wanted_s
    return np.where(before_is_nearer, after - 1, after).astype(np.int64)


def _camera_times(path: Path, cameras: int) -> list[NDArray[np.float64]]:
    """Return when each camera's frames were taken, fitted clock, in the order of the file."""
    times: list[list[float]] = [[] for _ in range(cameras)]
    if cameras:
        for frame in iterate_jpeg(path):
            times[frame.camera].append(frame.fitted_s)
    return [np.array(own, np.float64) for own in times]


def _nothing(count: int, channels: int) -> Samples:
    """Return scans that were never taken."""
    empty = Samples.from_values(np.full((count, channels), np.nan), np.full(count, np.nan))
    return replace(empty, validity=np.full((count, channels), np.uint8(Validity.MISSING)))


def task_of(labels: Mapping[str, str]) -> str:
    """Return labels as the words of a task: "material: foam, shape: sphere"."""
    return ", ".join(f"{name}: {labels[name]}" for name in sorted(labels)) or "no label"
