"""An episode of a LeRobot data set as scans, images and marks.

`OwnEpisode` is an episode that taxel exported and comes back as it was; `ForeignEpisode` is anybody
else's. Knows nothing about folders or files.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from taxel.exchange import lerobot_layout as layout
from taxel.foreign.json_text import Fields, parse_json
from taxel.frame_codec import decode_still, encode_jpeg
from taxel.jpeg_head import read_head
from taxel.recordings.imports.spelling import composed
from taxel.recordings.imports.videos import QUALITY
from taxel.recordings.manifest import NO_ARRAY, Manifest
from taxel.signals import CameraInfo, Frame, Mark, Samples, SensorInfo

_COLOURS = (1, 3, 4)
"""Channels that an image may have."""


@dataclass(frozen=True, slots=True)
class Info:
    """What meta/info.json says."""

    fps: int
    features: Mapping[str, Fields]

    def keys(self, kind: str) -> list[str]:
        """Return the features of a dtype."""
        return [key for key, own in self.features.items() if own.text("dtype") == kind]

    def shape(self, key: str) -> tuple[int, ...]:
        """Return a feature's shape."""
        return tuple(int(side) for side in self.features[key].items("shape"))

    def size(self, key: str) -> tuple[int, int]:
        """Return height and width of an image's feature: by its names, else the channels' place."""
        shape = self.shape(key)
        own = self.features[key]
        named = own.any("names") if "names" in own else None
        sides = ("height", "width")
        if isinstance(named, list) and len(named) == len(shape) and set(sides) <= set(named):
            return shape[named.index("height")], shape[named.index("width")]
        first = len(shape) == 3 and shape[0] in _COLOURS and shape[2] not in _COLOURS
        height, width = shape[1:] if first else shape[:2]
        return height, width


def state_key(info: Info) -> str | None:
    """Return the feature that holds touch, or at least a state; None without."""
    return next((key for key in (layout.TACTILE, layout.STATE) if key in info.features), None)


class OwnEpisode:
    """An episode that taxel exported: everything comes back as it was."""

    def __init__(self, manifest: Manifest, row: Mapping[str, Any]) -> None:
        self.manifest = manifest
        stored = parse_json(row.get(f"{layout.OWN}marks") or "[]")
        self.marks = [_mark(Fields(mark, "a mark")) for mark in stored]
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
        keys = layout.TRUTH if layout.TRUTH.window in part.schema.names else layout.TOUCH
        values = _numbers(part, keys.window).reshape(len(part), -1, channels)
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
        validity = _numbers(part, keys.validity).reshape(-1, channels)[places]
        return Samples(
            values=values.reshape(-1, channels)[places].astype(np.float32), counter=counter,
            device_s=np.full(len(places), np.nan), arrival_s=time_s, fitted_s=time_s,
            validity=validity.astype(np.uint8),
        )  # fmt: skip


class ForeignEpisode:
    """An episode of somebody else's: its state and images at times of frame over rate."""

    def __init__(self, info: Info, row: Mapping[str, Any], tasks: Mapping[int, str]) -> None:
        self._info, self._tasks = info, tasks
        self._key = state_key(info)
        self._task: list[tuple[float, str]] = []
        details = {"time": "frame number over rate", "imported_from": "LeRobot"}
        cameras = []
        for key in info.keys("image"):
            height, width = info.size(key)
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
        """A mark for each stretch of a task, where an episode has several.

        It holds all scans of its frames, of which those of a window come before their frame.
        """
        found: list[Mark] = []
        step_s = 1.0 / (self._info.fps * self._rows)
        before_s = (self._rows - 1) * step_s
        for place, (start_s, words) in enumerate(self._task):
            if place and self._task[place - 1][1] == words:
                found[-1] = replace(found[-1], end_s=start_s)
            else:
                labels = {"task": composed(words)}
                found.append(Mark(start_s=start_s - before_s, end_s=start_s, labels=labels))
        many = len({words for _, words in self._task}) > 1
        return [replace(mark, end_s=mark.end_s + 0.5 * step_s) for mark in found] if many else []

    def items(self, part: pa.RecordBatch) -> Iterator[Samples | Frame]:
        """Yield the scans and images of some frames."""
        info = self._info
        number = _numbers(part, "frame_index")
        time_s = number / info.fps
        chosen = _numbers(part, "task_index").astype(np.int64)
        if unknown := set(chosen.tolist()) - self._tasks.keys():
            raise ValueError(f"task {min(unknown)} of a frame is not among the tasks")
        self._task += [
            (at, self._tasks[task])
            for at, task in zip(time_s.tolist(), chosen.tolist(), strict=True)
        ]
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

    @property
    def _rows(self) -> int:
        """Scans of a frame; 1 without an array."""
        shape = () if self._key is None else self._info.shape(self._key)
        return shape[0] if len(shape) == 2 else 1

    def _sensor(self, details: Mapping[str, str]) -> SensorInfo:
        if self._key is None:
            return NO_ARRAY
        shape = self._info.shape(self._key)
        width = shape[-1]
        named = self._info.features[self._key].any("names")
        if isinstance(named, dict) and len(named) == 1:  # as {"motors": […]}
            (named,) = named.values()
        names = tuple(map(str, named)) if isinstance(named, list) else ()
        if len(names) != width or len({*names, ""}) != width + 1:  # none empty, none twice
            names = tuple(f"{i}" for i in range(width))
        return SensorInfo(
            name="state", channels=names, units=("",) * width,
            rate_hz=float(self._info.fps * self._rows), details=details,
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
