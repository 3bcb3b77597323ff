"""Recordings from a LeRobot data set of version 3.0: an episode each, all or none.

What `taxel export lerobot` wrote comes back exactly: JPEG, values, validity, times, labels, groups
and marks. Any other data set gives its images and its state, at times of frame over rate, for that
is all it has. Video is refused. Knows nothing about learning.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from taxel.errors import BadDataset, BadFile, BadRecording, BadSource
from taxel.exchange import lerobot_layout as layout
from taxel.foreign.files import open_file
from taxel.foreign.json_text import Fields, parse_json, read_json
from taxel.frame_codec import decode_still, encode_jpeg
from taxel.jpeg_head import read_head
from taxel.recordings.manifest import NO_ARRAY, Manifest, from_record
from taxel.recordings.spelling import composed
from taxel.recordings.videos import QUALITY
from taxel.recordings.whole import new_folder
from taxel.recordings.writer import Recorder
from taxel.signals import CameraInfo, Frame, Mark, Samples, SensorInfo

_MOST_EPISODES, _MOST_FPS = 1_000_000, 100_000
"""Bounds of what meta/info.json may say. Source: our choice."""
_ROWS = 64
"""Frames that are read at a time. Source: our choice."""
_LONGEST_NAME = 100
"""Characters of a recording's name that come from a data set. Source: our choice."""


def import_lerobot(
    folder: Path,
    output: Path,
    *,
    overwrite: bool = False,
    progress: Callable[[int, int], None] = lambda done, of: None,
) -> list[Path]:
    """Write a recording for each episode of a data set, all or none.

    Args:
        folder: The data set's.
        output: Folder to be made.
        overwrite: Replace an existing folder that holds nothing else than these.
        progress: Called with episodes done and in all.

    Raises:
        BadDataset: It is no data set of version 3.0, is damaged, or holds what is not read.
        RecordingFailed: The disk refused.
    """
    try:
        info = _read_info(folder)
        rows = _read_episodes(folder)
        tasks = _read_tasks(folder)
        files = [f"{name}.mcap" for name in _names(rows)]
        with new_folder(output, files, overwrite=overwrite) as made:
            batches = _Batches(folder)
            for done, (row, file) in enumerate(zip(rows, files, strict=True), 1):
                _write_episode(info, row, tasks, batches, made / file)
                progress(done, len(rows))
    except (pa.ArrowException, KeyError, BadFile, BadRecording, BadSource, OSError) as error:
        if isinstance(error, BadDataset) or type(error).__name__ == "RecordingFailed":
            raise
        raise _damaged(folder, error) from error
    except ValueError as error:
        if isinstance(error, BadDataset):
            raise
        raise _damaged(folder, error) from error
    return [output / file for file in files]


def _damaged(folder: Path, error: Exception) -> BadDataset:
    said = getattr(error, "got", None) or f"{type(error).__name__}: {str(error)[:200]}"
    return BadDataset(
        "a whole data set of LeRobot's version 3.0", f"{folder}: {said}", "copy it again"
    )


@dataclass(frozen=True, slots=True)
class _Info:
    """What meta/info.json says."""

    fps: int
    features: Mapping[str, Fields]

    def keys(self, kind: str) -> list[str]:
        """Return the features of a dtype."""
        return [key for key, own in self.features.items() if own.text("dtype") == kind]

    def shape(self, key: str) -> tuple[int, ...]:
        """Return a feature's shape."""
        return tuple(int(side) for side in self.features[key].items("shape"))


def _read_info(folder: Path) -> _Info:
    path = folder / layout.INFO
    if not path.is_file():
        raise BadDataset(
            f"a folder of LeRobot's with {layout.INFO}", f"{folder} without", "check the path"
        )
    fields = Fields(read_json(path), layout.INFO)
    version = fields.text("codebase_version")
    form = fields.any("storage_format") if "storage_format" in fields else "parquet"
    if version != layout.VERSION or form != "parquet":
        raise BadDataset(
            f"LeRobot's version {layout.VERSION} in Parquet", f"{version!r} in {form!r}",
            "convert it with LeRobot's own tools",
        )  # fmt: skip
    features = Fields(fields.any("features"), "features")
    own = {str(key): features.fields(key) for key in fields.any("features")}
    info = _Info(fields.count("fps", 1, _MOST_FPS), own)
    if info.keys("video"):
        raise BadDataset(
            "images in Parquet (dtype image)", f"video in {', '.join(info.keys('video')[:6])}",
            "export it again with images: video codecs change what touch is measured from",
        )  # fmt: skip
    if not _state_key(info) and not info.keys("image"):
        raise BadDataset(
            f"{layout.STATE}, {layout.TACTILE} or images", "none of them", "choose another data set"
        )
    return info


def _state_key(info: _Info) -> str | None:
    return next((key for key in (layout.TACTILE, layout.STATE) if key in info.features), None)


def _read_episodes(folder: Path) -> list[dict[str, Any]]:
    """Return the rows of meta/episodes, in order, without statistics."""
    rows: list[dict[str, Any]] = []
    for path in sorted((folder / "meta/episodes").glob("*/*.parquet")):
        file = pq.ParquetFile(path)
        wanted = [name for name in file.schema_arrow.names if not name.startswith("stats/")]
        rows += file.read(columns=wanted).to_pylist()
        if len(rows) > _MOST_EPISODES:
            raise ValueError(f"more than {_MOST_EPISODES:,} episodes")
    rows.sort(key=lambda row: row["episode_index"])
    if not rows or [row["episode_index"] for row in rows] != list(range(len(rows))):
        raise ValueError("episodes are missing in meta/episodes")
    return rows


def _read_tasks(folder: Path) -> list[str]:
    table = pq.read_table(folder / layout.TASKS)
    words = table.column("task" if "task" in table.column_names else "__index_level_0__")
    order = np.argsort(table.column("task_index").to_numpy())
    return [str(words[int(place)]) for place in order]


def _names(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return a file's name for each episode, each different."""
    names = []
    for row in rows:
        told = str(row.get(f"{layout.OWN}recording") or "")[:_LONGEST_NAME]
        plain = "".join(letter if letter.isalnum() or letter in "-_" else "_" for letter in told)
        names.append(plain or f"episode_{row['episode_index']:06d}")
    if len(set(names)) < len(names):
        return [f"episode_{row['episode_index']:06d}" for row in rows]
    return names


class _Batches:
    """Reads frames one episode after another, in constant memory."""

    def __init__(self, folder: Path) -> None:
        self._parts = self._read(sorted((folder / "data").glob("*/*.parquet")))
        self._left: pa.RecordBatch | None = None

    def next(self, episode: int, frames: int) -> Iterator[pa.RecordBatch]:
        """Yield the frames of the episode that follows.

        Raises:
            ValueError: They are another episode's, or fewer.
        """
        while frames:
            batch = self._left if self._left is not None else next(self._parts, None)
            if batch is None:
                raise ValueError(f"episode {episode} lacks {frames} frames")
            taken = min(frames, len(batch))
            part = batch.slice(0, taken)
            self._left = batch.slice(taken) if taken < len(batch) else None
            if set(part.column("episode_index").to_pylist()) != {episode}:
                raise ValueError(f"frames of episode {episode} are not where they should be")
            frames -= taken
            yield part

    @staticmethod
    def _read(paths: Sequence[Path]) -> Iterator[pa.RecordBatch]:
        for path in paths:
            with open_file(path) as raw:
                yield from pq.ParquetFile(raw).iter_batches(batch_size=_ROWS)


def _write_episode(
    info: _Info, row: Mapping[str, Any], tasks: Sequence[str], batches: _Batches, path: Path
) -> None:
    frames = row["length"]
    if not isinstance(frames, int) or frames < 1:
        raise ValueError(f"episode {row['episode_index']} of {frames} frames")
    ours = row.get(f"{layout.OWN}manifest")
    parts = batches.next(row["episode_index"], frames)
    if ours is not None:
        manifest = from_record(_texts(ours))
        episode: _Own | _Foreign = _Own(manifest, row)
    else:
        first = next(parts)
        episode = _Foreign(info, row, tasks, first)
        parts = _again(first, parts)
    recorder = Recorder(path, episode.manifest)
    try:
        for part in parts:
            for item in episode.items(part):
                if isinstance(item, Samples):
                    recorder.write(item)
                else:
                    recorder.frame(item)
        for mark in episode.marks:
            recorder.mark(mark)
        recorder.close("imported")
    except BaseException:
        recorder.discard()
        raise


def _again(first: pa.RecordBatch, others: Iterator[pa.RecordBatch]) -> Iterator[pa.RecordBatch]:
    yield first
    yield from others


def _texts(text: str) -> dict[str, str]:
    found = parse_json(text)
    if not isinstance(found, dict) or not all(isinstance(value, str) for value in found.values()):
        raise ValueError("a manifest that is no object of texts")
    return found


class _Own:
    """An episode that taxel exported: everything comes back as it was."""

    def __init__(self, manifest: Manifest, row: Mapping[str, Any]) -> None:
        self.manifest = manifest
        told = parse_json(row.get(f"{layout.OWN}marks") or "[]")
        self.marks = [_mark(Fields(mark, "a mark")) for mark in told]
        self._next_scan = 0
        self._next_image = [-1] * len(manifest.cameras)

    def items(self, part: pa.RecordBatch) -> Iterator[Samples | Frame]:
        """Yield the scans and images of some frames, each once."""
        if self.manifest.sensor.channels:
            yield self._scans(part)
        for camera, info in enumerate(self.manifest.cameras):
            numbers = _numbers(part, layout.image_number_key(info.name))
            times = _numbers(part, layout.image_time_key(info.name))
            images = part.column(layout.image_key(info.name))
            for place, number in enumerate(numbers.astype(np.int64).tolist()):
                if number > self._next_image[camera]:
                    self._next_image[camera] = number
                    time_s = float(times[place])
                    yield Frame(
                        camera=camera, jpeg=_jpeg(images[place].as_py(), info), counter=number,
                        device_s=float("nan"), arrival_s=time_s, fitted_s=time_s,
                    )  # fmt: skip

    def _scans(self, part: pa.RecordBatch) -> Samples:
        channels = len(self.manifest.sensor.channels)
        values = _numbers(part, layout.TACTILE).reshape(len(part), -1, channels)
        rows = values.shape[1]
        number = _numbers(part, layout.SCAN).astype(np.int64)[:, None] + np.arange(rows)
        fitted_s = _numbers(part, layout.SCAN_S).reshape(len(part), rows)
        known = np.isfinite(fitted_s.ravel())
        _, first = np.unique(number.ravel(), return_index=True)
        places = first[known[first] & (number.ravel()[first] >= self._next_scan)]
        counter = number.ravel()[places]
        if len(counter):
            self._next_scan = int(counter[-1]) + 1
        time_s = fitted_s.ravel()[places]
        validity = _numbers(part, layout.VALIDITY).reshape(-1, channels)[places]
        return Samples(
            values=values.reshape(-1, channels)[places].astype(np.float32), counter=counter,
            device_s=np.full(len(places), np.nan), arrival_s=time_s, fitted_s=time_s,
            validity=validity.astype(np.uint8),
        )  # fmt: skip


class _Foreign:
    """An episode of somebody else's: its state and images at times of frame over rate."""

    def __init__(
        self, info: _Info, row: Mapping[str, Any], tasks: Sequence[str], first: pa.RecordBatch
    ) -> None:
        self._info, self._tasks = info, tasks
        self._key = _state_key(info)
        self._task: list[tuple[float, str]] = []
        details = {"time": "frame number over rate", "imported_from": "LeRobot"}
        cameras = []
        for key in info.keys("image"):
            height, width = info.shape(key)[:2]
            name = key.removeprefix("observation.images.").replace("/", "_")
            cameras.append(CameraInfo(name=name, width=width, height=height,
                                      rate_hz=float(info.fps), details=details))  # fmt: skip
        words = [str(task) for task in row.get("tasks") or []]
        labels = {"task": composed(words[0])} if len(words) == 1 else {}
        self.manifest = Manifest(
            sensor=self._sensor(details), cameras=tuple(cameras), labels=labels,
            groups={"episode": str(row["episode_index"])},
        )  # fmt: skip

    @property
    def marks(self) -> list[Mark]:
        """A mark for each stretch of a task, where an episode has several."""
        found: list[Mark] = []
        fps = self._info.fps
        for place, (start_s, words) in enumerate(self._task):
            if place and self._task[place - 1][1] == words:
                found[-1] = replace(found[-1], end_s=start_s)
            else:
                labels = {"task": composed(words)}
                found.append(Mark(start_s=start_s, end_s=start_s, labels=labels))
        many = len({words for _, words in self._task}) > 1
        return [replace(mark, end_s=mark.end_s + 0.5 / fps) for mark in found] if many else []

    def items(self, part: pa.RecordBatch) -> Iterator[Samples | Frame]:
        """Yield the scans and images of some frames."""
        info = self._info
        number = _numbers(part, "frame_index")
        time_s = number / info.fps
        chosen = _numbers(part, "task_index").astype(np.int64)
        self._task += [(float(at), self._tasks[int(task)]) for at, task in zip(time_s, chosen)]  # noqa: B905
        if self._key is not None:
            values = _numbers(part, self._key).reshape(len(part), -1, len(self._names))
            rows = values.shape[1]
            behind = (np.arange(rows) - (rows - 1)) / (info.fps * rows)
            at = (time_s[:, None] + behind).ravel()
            yield Samples.from_values(values.reshape(-1, len(self._names)), at)
        for camera, (key, about) in enumerate(
            zip(info.keys("image"), self.manifest.cameras, strict=True)
        ):
            images = part.column(key)
            for place, when in enumerate(time_s.tolist()):
                yield Frame(
                    camera=camera, jpeg=_jpeg(images[place].as_py(), about),
                    counter=int(number[place]), device_s=float("nan"), arrival_s=when,
                    fitted_s=when,
                )  # fmt: skip

    @property
    def _names(self) -> tuple[str, ...]:
        return self.manifest.sensor.channels

    def _sensor(self, details: Mapping[str, str]) -> SensorInfo:
        if self._key is None:
            return NO_ARRAY
        shape = self._info.shape(self._key)
        width, rows = shape[-1], shape[0] if len(shape) == 2 else 1
        told = self._info.features[self._key].any("names")
        fits = isinstance(told, list) and len(told) == width
        names = tuple(map(str, told)) if fits else tuple(f"{i}" for i in range(width))
        return SensorInfo(
            name="state", channels=names, units=("",) * width,
            rate_hz=float(self._info.fps * rows), details=details,
        )  # fmt: skip


def _mark(fields: Fields) -> Mark:
    return Mark(start_s=fields.number("start_s"), end_s=fields.number("end_s"),
                labels=fields.pairs("labels"), groups=fields.pairs("groups"))  # fmt: skip


def _numbers(part: pa.RecordBatch, key: str) -> NDArray[np.float64]:
    """Return a column's values, all lists within lists behind one another."""
    column = part.column(key)
    if isinstance(column, pa.ExtensionArray):
        column = column.storage
    while pa.types.is_list(column.type) or pa.types.is_fixed_size_list(column.type):
        column = column.flatten()
    if column.null_count:
        raise ValueError(f"missing values in {key}")
    return np.asarray(column.to_numpy(zero_copy_only=False))


def _jpeg(image: object, camera: CameraInfo) -> bytes:
    """Return an image as JPEG: as it came where it is one, else coded with quality 95.

    Raises:
        BadSource: It is neither PNG nor JPEG, damaged, or of another size.
        ValueError: It is not in the data set but beside it.
    """
    content = image.get("bytes") if isinstance(image, dict) else None
    if not isinstance(content, bytes):
        raise ValueError(f"an image of {camera.name} is not in the Parquet file")
    if content.startswith(b"\xff\xd8"):
        read_head(content, (camera.width, camera.height))
        return content
    rgb = decode_still(content)
    if rgb.shape[:2] != (camera.height, camera.width):
        raise ValueError(f"an image of {camera.name} has another size than meta/info.json says")
    return encode_jpeg(rgb, QUALITY)
