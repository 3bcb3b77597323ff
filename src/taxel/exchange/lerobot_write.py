"""Write recordings as a LeRobot data set: an episode each, touch at its own rate beside images.

The folder appears as a whole or not at all. Images stay the camera's own JPEG: LeRobot's video
codecs move the gel quantities by 0.2 to 0.4 of their standard deviation (docs/decisions/0051).
Depth is left out: their images have 8 bits a colour. A simulator's ground truth is no observation.
Knows nothing about learning.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from taxel.errors import BadDataset
from taxel.exchange import lerobot_layout as layout
from taxel.exchange.episodes import Cut, Episode, Rhythm, episodes_of, rhythm_of, task_of, usable
from taxel.exchange.lerobot_stats import Stats, as_lists, image_stats, stats_of, together
from taxel.exchange.output import new_tree
from taxel.frame_codec import decode_jpeg
from taxel.recordings.manifest import Manifest, to_record
from taxel.recordings.reader import read_manifest
from taxel.signals import UNUSABLE, Frame
from taxel.sim.pour.state import has_truth

_ROWS = 256
"""Frames that are held at a time. Source: our choice; 256 pairs of images have 8 MB."""
_LOOKED_AT = 100
"""Images of an episode that its statistics are made of. Source: their smallest sample."""
_EVERY = 4
"""Of those, each so many-th pixel both ways. Source: our choice; theirs is 150 pixels a side."""


@dataclass(slots=True)
class Written:
    """Counts of what an export to LeRobot wrote, and of what it had to leave out."""

    episodes: int = 0
    frames: int = 0
    tasks: list[str] = field(default_factory=list)
    fps: int = 0
    rows: int = 0
    scans_left_out: int = 0
    """Scans within episodes that are in no window."""
    images_left_out: int = 0
    """Images within episodes that no frame has."""
    drift_s: float = 0.0
    """Largest difference between frame / fps and when a frame was taken, seconds."""
    apart_s: float = 0.0
    """Largest time between the images of a frame, seconds: long where a camera fell silent."""
    recordings_left_out: list[str] = field(default_factory=list)
    """Recordings without an episode: no scan, no image of some camera, or no mark to cut at."""
    marks_left_out: list[str] = field(default_factory=list)
    """Names of the marks without an episode, as no scan, or no image of the first camera, lies in
    them; those of recordings above are not among them."""
    truth: tuple[str, ...] = ()
    """Channels that are a simulator's ground truth: they are under truth, not observation."""

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain values."""
        return asdict(self)


def write_lerobot(
    paths: Sequence[Path],
    output: Path,
    *,
    fps: int | None = None,
    rows: int | None = None,
    cut: Cut = "recording",
    overwrite: bool = False,
    progress: Callable[[int, int], None] = lambda done, of: None,
) -> Written:
    """Write recordings as a data set of LeRobot's.

    Args:
        paths: The recordings, all of the same array and cameras.
        output: Folder to be made.
        fps: Frames a second; see `rhythm_of`.
        rows: Scans a frame; see `rhythm_of`.
        cut: What an episode is.
        overwrite: Replace an older data set.
        progress: Called with recordings done and in all.

    Raises:
        BadDataset: The recordings differ, or there is nothing in them.
        BadRecording: One is damaged or cut short.
        RecordingFailed: The disk refused.
    """
    manifest = read_manifest(paths[0])
    rhythm = rhythm_of(manifest, paths[0], fps, rows)
    with new_tree(output, layout.INFO, (".parquet", ".json"), overwrite=overwrite) as made:
        writer = _Writer(made, manifest, rhythm)
        try:
            for done, path in enumerate(paths, 1):
                writer.check(path)
                before = writer.written.frames
                empty: list[str] = []
                for episode in episodes_of(path, rhythm, cut, empty.append):
                    writer.add(episode)
                if writer.written.frames == before:
                    writer.written.recordings_left_out.append(path.name)
                else:
                    writer.written.marks_left_out += empty
                progress(done, len(paths))
        finally:
            writer.close_data()
        writer.finish(paths[0], "scans or images" if cut == "recording" else "marks to cut it at")
    return writer.written


class _Writer:
    """The files of a data set that is being written."""

    def __init__(self, folder: Path, manifest: Manifest, rhythm: Rhythm) -> None:
        self._folder, self._manifest, self._rhythm = folder, manifest, rhythm
        cameras = {camera.name: (camera.width, camera.height) for camera in manifest.of_jpeg}
        channels = manifest.sensor.channels
        truth = has_truth(channels)
        self._keys = layout.TRUTH if truth else layout.TOUCH
        self._features = layout.features_of(channels, rhythm.rows, cameras, self._keys)
        self._schema = layout.schema_of(self._features)
        self._data: pq.ParquetWriter | None = None
        self._file = 0
        self._rows: list[dict[str, Any]] = []
        self._stats: list[dict[str, Stats]] = []
        self._tasks: dict[str, int] = {}
        self.written = Written(
            fps=rhythm.fps, rows=rhythm.rows, truth=channels if truth else ()
        )  # fmt: skip

    def check(self, path: Path) -> None:
        """Refuse a recording of another array or other cameras.

        Raises:
            BadDataset: It is.
        """
        own, first = read_manifest(path), self._manifest
        kinds = [
            (m.sensor.channels, m.sensor.units, round(m.sensor.rate_hz, 3),
             [(c.name, c.width, c.height) for c in m.of_jpeg]) for m in (own, first)
        ]  # fmt: skip
        if kinds[0] != kinds[1]:
            raise BadDataset(
                "recordings of the same array and cameras", f"others in {path}",
                "export them one kind at a time",
            )  # fmt: skip

    def add(self, episode: Episode) -> None:
        """Write an episode's frames to Parquet; keep its metadata and statistics for `finish`."""
        path = self._folder / layout.DATA_PATTERN.format(
            chunk_index=self._file // layout.CHUNK_FILES, file_index=self._file % layout.CHUNK_FILES
        )
        if self._data is None:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._data = pq.ParquetWriter(path, self._schema)
        number, start = len(self._rows), self.written.frames
        tasks = [task_of(episode.labels_at(frame)) for frame in range(len(episode))]
        columns: dict[str, list[NDArray[Any]]] = {}
        seen: dict[str, list[NDArray[np.uint8]]] = {}
        frames, at = episode.frames(), 0
        while at < len(episode):
            stop = min(at + _ROWS, len(episode))
            pictures = list(islice(frames, stop - at)) if len(episode.images) else []
            values = self._numbers(episode, at, stop, number, tasks) | _exact(episode, pictures, at)
            self.written.apart_s = max(self.written.apart_s, _apart_s(pictures))
            self._data.write_batch(self._batch(values, pictures))
            for key, part in _measured(values, self._keys).items():
                columns.setdefault(key, []).append(part)
            self._look_at(episode, pictures, at, seen)
            at = stop
        stats = {key: stats_of(np.concatenate(parts)) for key, parts in columns.items()}
        stats |= {key: image_stats(images) for key, images in seen.items()}
        self._stats.append(stats)
        self._rows.append(self._row(episode, number, start, tasks, stats))
        self._account(episode)
        if path.stat().st_size > layout.FILE_MB * 2**20:
            self.close_data()
            self._file += 1

    def close_data(self) -> None:
        """Complete the data file that is open."""
        if self._data is not None:
            self._data.close()
            self._data = None

    def finish(self, first: Path, needed: str) -> None:
        """Write the folder meta/: episodes, tasks, statistics and info.

        Args:
            first: A recording, for messages.
            needed: What an episode is made of, for messages.

        Raises:
            BadDataset: There was nothing to write.
        """
        if not self._rows:
            raise BadDataset(f"a recording with {needed}", f"none in {first}", "check it")
        written = self.written
        written.episodes, written.tasks = len(self._rows), list(self._tasks)
        (self._folder / layout.EPISODES).parent.mkdir(parents=True)
        pq.write_table(_table(self._rows), self._folder / layout.EPISODES)
        pq.write_table(layout.tasks_table(written.tasks), self._folder / layout.TASKS)
        stats = {
            key: as_lists(together([own[key] for own in self._stats])) for key in self._stats[0]
        }
        info = layout.info_of(
            self._features, fps=written.fps, episodes=written.episodes, frames=written.frames,
            tasks=len(written.tasks), robot=self._manifest.sensor.name,
        )  # fmt: skip
        for place, content in ((layout.STATS, stats), (layout.INFO, info)):
            text = json.dumps(content, indent=4, ensure_ascii=False, allow_nan=False)
            (self._folder / place).write_text(text, encoding="utf-8")

    def _numbers(
        self, episode: Episode, at: int, stop: int, number: int, tasks: Sequence[str]
    ) -> dict[str, NDArray[Any]]:
        """Return the columns of some frames, but for what the cameras give."""
        frame = np.arange(at, stop)
        for task in tasks[at:stop]:
            self._tasks.setdefault(task, len(self._tasks))
        columns: dict[str, NDArray[Any]] = {
            "timestamp": (frame / self._rhythm.fps).astype(np.float32),
            "frame_index": frame,
            "episode_index": np.full(len(frame), number),
            "index": self.written.frames + frame,
            "task_index": np.array([self._tasks[task] for task in tasks[at:stop]]),
        }
        if not self._rhythm.rows:
            return columns
        samples, there = episode.windows(at, stop)
        shape = (stop - at, self._rhythm.rows, samples.values.shape[1])
        last = self._newest(there.reshape(shape[:2]))
        pick = (np.arange(len(last)), last)
        values = samples.values.reshape(shape)
        return columns | {
            self._keys.state: values[pick],
            self._keys.window: values,
            self._keys.validity: samples.validity.reshape(shape),
            self._keys.valid: usable(samples).reshape(shape)[pick],
            layout.SCAN_S: samples.fitted_s.reshape(shape[:2]),
            layout.SCAN: episode.first_scan[at:stop] - episode.limits[0],
        }

    @staticmethod
    def _newest(there: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Return the place of the newest scan of each window that exists; the last without any."""
        last: NDArray[np.int64] = there.shape[1] - 1 - np.argmax(there[:, ::-1], axis=1)
        return last

    def _batch(
        self, values: dict[str, NDArray[Any]], pictures: Sequence[tuple[Frame, ...]]
    ) -> pa.RecordBatch:
        columns = []
        for key, feature in self._features.items():
            if feature.dtype == "image":
                camera = [c.name for c in self._manifest.of_jpeg].index(key.split(".", 2)[2])
                jpegs = pa.array([row[camera].jpeg for row in pictures], pa.binary())
                paths = pa.nulls(len(pictures), pa.string())
                columns.append(pa.StructArray.from_arrays([jpegs, paths], ["bytes", "path"]))
            else:
                columns.append(feature.column(values[key]))
        return pa.RecordBatch.from_arrays(columns, schema=self._schema)

    def _look_at(
        self,
        episode: Episode,
        pictures: Sequence[tuple[Frame, ...]],
        at: int,
        seen: dict[str, list[NDArray[np.uint8]]],
    ) -> None:
        """Decode some images, evenly over the episode, for its statistics."""
        step = -(-len(episode) // _LOOKED_AT)
        for place, row in enumerate(pictures, at):
            for camera, frame in zip(self._manifest.of_jpeg, row, strict=True):
                if place % step == 0:
                    image = decode_jpeg(frame.jpeg, camera)[::_EVERY, ::_EVERY]
                    seen.setdefault(layout.image_key(camera.name), []).append(image)

    def _row(
        self,
        episode: Episode,
        number: int,
        start: int,
        tasks: Sequence[str],
        stats: dict[str, Stats],
    ) -> dict[str, Any]:
        """Return an episode's row of meta/episodes."""
        manifest, prefix = episode.manifest, layout.OWN
        marks = [asdict(mark) for mark in episode.marks]
        row: dict[str, Any] = {
            "episode_index": number,
            "tasks": list(dict.fromkeys(tasks)),
            "length": len(episode),
            "data/chunk_index": self._file // layout.CHUNK_FILES,
            "data/file_index": self._file % layout.CHUNK_FILES,
            "dataset_from_index": start,
            "dataset_to_index": start + len(episode),
            "meta/episodes/chunk_index": 0,
            "meta/episodes/file_index": 0,
            f"{prefix}recording": episode.name,
            f"{prefix}manifest": json.dumps(to_record(manifest), ensure_ascii=False),
            f"{prefix}marks": json.dumps(marks, ensure_ascii=False),
        }
        row |= {f"{prefix}label/{name}": value for name, value in manifest.labels.items()}
        row |= {f"{prefix}group/{name}": value for name, value in manifest.groups.items()}
        for key, found in stats.items():
            row |= {f"stats/{key}/{name}": value for name, value in as_lists(found).items()}
        return row

    def _account(self, episode: Episode) -> None:
        """Take an episode into the account of what was written and left out."""
        written = self.written
        written.frames += len(episode)
        written.scans_left_out += episode.scans_left_out
        for own in episode.images:
            written.images_left_out += int(own[-1] - own[0] + 1 - len(np.unique(own)))
        even = np.arange(len(episode)) / self._rhythm.fps
        drift = np.abs(episode.time_s - episode.time_s[0] - even).max()
        written.drift_s = max(written.drift_s, float(drift))


def _measured(values: dict[str, NDArray[Any]], keys: layout.ArrayKeys) -> dict[str, NDArray[Any]]:
    """Return the columns of some frames for statistics: what may not be used there is NaN."""
    if keys.window not in values:
        return values
    unusable = (values[keys.validity] & np.uint8(UNUSABLE)) != 0
    return values | {
        keys.window: np.where(unusable, np.nan, values[keys.window]),
        keys.state: np.where(values[keys.valid], values[keys.state], np.nan),
    }


def _exact(
    episode: Episode, pictures: Sequence[tuple[Frame, ...]], at: int
) -> dict[str, NDArray[Any]]:
    """Return exact time and number of the images of some frames."""
    found: dict[str, NDArray[Any]] = {}
    for camera, info in enumerate(episode.manifest.cameras):
        stop = at + len(pictures)
        times = [row[camera].fitted_s for row in pictures]
        found[layout.image_time_key(info.name)] = np.array(times)
        found[layout.image_number_key(info.name)] = episode.images[camera, at:stop]
    return found


def _apart_s(pictures: Sequence[tuple[Frame, ...]]) -> float:
    """Return the largest time between the images of a frame, seconds."""
    times = [[frame.fitted_s for frame in row] for row in pictures]
    return max((max(own) - min(own) for own in times), default=0.0)


def _table(rows: Sequence[dict[str, Any]]) -> pa.Table:
    """Return episodes as a table; what some lack is null there."""
    names: dict[str, None] = {name: None for row in rows for name in row}
    return pa.table({name: [row.get(name) for row in rows] for name in names})
