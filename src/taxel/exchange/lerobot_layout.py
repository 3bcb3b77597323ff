"""LeRobot's data set, version 3.0: where its files are, and what each column holds.

Written without LeRobot: the layout is a folder of Parquet files and JSON. Knows nothing about
recordings.

Source: huggingface/lerobot 0.6.1, src/lerobot/datasets (utils.py, feature_utils.py, io_utils.py,
dataset_metadata.py); read for the layout, no line is taken. Background: docs/decisions/0051.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

VERSION = "v3.0"
"""The field codebase_version."""
INFO, STATS, TASKS = "meta/info.json", "meta/stats.json", "meta/tasks.parquet"
EPISODES = "meta/episodes/chunk-000/file-000.parquet"
DATA_PATTERN = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
CHUNK_FILES = 1000
"""Files a folder. Source: their DEFAULT_CHUNK_SIZE."""
FILE_MB = 100
"""A data file is closed once it has so much. Source: their DEFAULT_DATA_FILE_SIZE_IN_MB."""
VIDEO_MB = 200
"""Source: their DEFAULT_VIDEO_FILE_SIZE_IN_MB."""
OWN = "taxel/"
"""Before the columns of the episodes that only taxel reads."""

STATE, TACTILE = "observation.state", "observation.tactile"
SCAN_S, SCAN = "taxel.scan_s", "taxel.scan"
IMAGE_TYPE = pa.struct([("bytes", pa.binary()), ("path", pa.string())])


@dataclass(frozen=True, slots=True)
class ArrayKeys:
    """The features that hold an array's scans."""

    state: str
    """The newest scan of each frame."""
    window: str
    """The scans up to the frame."""
    validity: str
    """Flags of the window's values."""
    valid: str
    """Whether each value of `state` may be used."""


TOUCH = ArrayKeys(STATE, TACTILE, f"{TACTILE}_validity", f"{TACTILE}_valid")
TRUTH = ArrayKeys("truth.state", "truth.window", "truth.window_validity", "truth.state_valid")
"""Those of a simulator's ground truth. Not under observation: their policies take every feature
whose name begins so as an input (dataset_to_policy_features), and would see the answer."""


def image_key(camera: str) -> str:
    """Return the feature of a camera's images."""
    return f"observation.images.{camera}"


def image_time_key(camera: str) -> str:
    """Return the feature of the exact times of a camera's images.

    Its name may not hold "image": their aggregate_stats takes such a feature for one.
    """
    return f"taxel.frame_s.{camera}"


def image_number_key(camera: str) -> str:
    """Return the feature of the numbers of a camera's images in the recording."""
    return f"taxel.frame.{camera}"


@dataclass(frozen=True, slots=True)
class Feature:
    """A column of the data."""

    dtype: str
    """Of each value, such as float32; "image" for images."""
    shape: tuple[int, ...]
    names: tuple[str, ...] | None = None
    """Of the values along the only axis, where there is one."""

    def as_dict(self) -> dict[str, Any]:
        """Return it as meta/info.json holds it."""
        names = None if self.names is None else list(self.names)
        return {"dtype": self.dtype, "shape": list(self.shape), "names": names}

    @property
    def arrow(self) -> pa.DataType:
        """The type of its Parquet column; a single value is no list."""
        if self.dtype == "image":
            return IMAGE_TYPE
        value = pa.bool_() if self.dtype == "bool" else pa.from_numpy_dtype(np.dtype(self.dtype))
        if self.shape == (1,):
            return value
        if len(self.shape) == 1:
            return pa.list_(value, self.shape[0])
        return pa.list_(pa.list_(value))

    @property
    def hugging_face(self) -> dict[str, Any]:
        """The type as Hugging Face's `datasets` calls it, by which their tools merge data sets."""
        if self.dtype == "image":
            return {"_type": "Image"}
        value = {"dtype": self.dtype, "_type": "Value"}
        if self.shape == (1,):
            return value
        if len(self.shape) == 1:
            return {"feature": value, "length": self.shape[0], "_type": "Sequence"}
        return {"shape": list(self.shape), "dtype": self.dtype, "_type": "Array2D"}

    def column(self, values: NDArray[Any]) -> pa.Array:
        """Return values as a column.

        Args:
            values: Shape (frames, *shape); for a single value also (frames,).
        """
        kind = np.bool_ if self.dtype == "bool" else np.dtype(self.dtype)
        flat = pa.array(np.ascontiguousarray(values, kind).ravel())
        if self.shape == (1,):
            return flat
        if len(self.shape) == 1:
            return pa.FixedSizeListArray.from_arrays(flat, self.shape[0])
        rows, width = self.shape
        inner = pa.ListArray.from_arrays(_offsets(len(values) * rows, width), flat)
        return pa.ListArray.from_arrays(_offsets(len(values), rows), inner)


COUNTING = {
    "timestamp": Feature("float32", (1,)),
    "frame_index": Feature("int64", (1,)),
    "episode_index": Feature("int64", (1,)),
    "index": Feature("int64", (1,)),
    "task_index": Feature("int64", (1,)),
}
"""Columns that every data set has. Source: their DEFAULT_FEATURES."""


def features_of(
    channels: Sequence[str],
    rows: int,
    cameras: Mapping[str, tuple[int, int]],
    keys: ArrayKeys = TOUCH,
) -> dict[str, Feature]:
    """Return the features of a data set.

    Args:
        channels: Names of the array's; none without.
        rows: Scans a frame.
        cameras: Name → (width, height), pixels.
        keys: Of the array's features.
    """
    features: dict[str, Feature] = {}
    if channels:
        names, count = tuple(channels), len(channels)
        features[keys.state] = Feature("float32", (count,), names)
        features[keys.window] = Feature("float32", (rows, count))
        features[keys.validity] = Feature("uint8", (rows, count))
        features[keys.valid] = Feature("bool", (count,), names)
        features[SCAN_S] = Feature("float64", (rows,))
        features[SCAN] = Feature("int64", (1,))
    for name, (width, height) in cameras.items():
        features[image_key(name)] = Feature(
            "image", (height, width, 3), ("height", "width", "channels")
        )
        features[image_time_key(name)] = Feature("float64", (1,))
        features[image_number_key(name)] = Feature("int64", (1,))
    return features | COUNTING


def schema_of(features: Mapping[str, Feature]) -> pa.Schema:
    """Return the schema of the data files."""
    types = {key: feature.hugging_face for key, feature in features.items()}
    return pa.schema(
        [_field(key, feature) for key, feature in features.items()],
        metadata={"huggingface": json.dumps({"info": {"features": types}})},
    )


def _field(key: str, feature: Feature) -> pa.Field:
    """Return a column's field; tables within say that they are Hugging Face's Array2D."""
    if feature.dtype == "image" or len(feature.shape) < 2:
        return pa.field(key, feature.arrow)
    return pa.field(
        key, feature.arrow,
        metadata={
            "ARROW:extension:name": "datasets.features.features.Array2DExtensionType",
            "ARROW:extension:metadata": json.dumps([list(feature.shape), feature.dtype]),
        },
    )  # fmt: skip


def info_of(
    features: Mapping[str, Feature], *, fps: int, episodes: int, frames: int, tasks: int, robot: str
) -> dict[str, Any]:
    """Return what meta/info.json holds."""
    return {
        "codebase_version": VERSION,
        "robot_type": robot,
        "total_episodes": episodes,
        "total_frames": frames,
        "total_tasks": tasks,
        "chunks_size": CHUNK_FILES,
        "data_files_size_in_mb": FILE_MB,
        "video_files_size_in_mb": VIDEO_MB,
        "fps": fps,
        "splits": {"train": f"0:{episodes}"},
        "data_path": DATA_PATTERN,
        "video_path": None,
        "features": {key: feature.as_dict() for key, feature in features.items()},
    }


def tasks_table(tasks: Sequence[str]) -> pa.Table:
    """Return the tasks as the data frame, indexed by its words, that their reader expects."""
    table = pa.table({"task_index": pa.array(range(len(tasks)), pa.int64()), "task": list(tasks)})
    columns = [
        {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": numpy,
         "metadata": None}
        for name, kind, numpy in (("task_index", "int64", "int64"), ("task", "unicode", "object"))
    ]  # fmt: skip
    pandas = {"index_columns": ["task"], "column_indexes": [], "columns": columns,
              "creator": {"library": "pyarrow", "version": pa.__version__},
              "pandas_version": "2.2.0"}  # fmt: skip
    return table.replace_schema_metadata({"pandas": json.dumps(pandas)})


def _offsets(count: int, width: int) -> pa.Array:
    return pa.array(np.arange(count + 1, dtype=np.int32) * width)
