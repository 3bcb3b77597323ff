"""Check a folder against LeRobot's layout, version 3.0, without LeRobot.

Each rule is one that their reader, their sampler or their tools rely on. Knows nothing about
recordings.

Source: huggingface/lerobot 0.6.1, src/lerobot/datasets: dataset_reader.py, io_utils.py,
feature_utils.py, aggregate.py.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq

from taxel.exchange import lerobot_layout as layout
from taxel.plain_text import number_of

_EPISODE_COLUMNS = (
    "episode_index", "tasks", "length", "data/chunk_index", "data/file_index",
    "dataset_from_index", "dataset_to_index", "meta/episodes/chunk_index",
    "meta/episodes/file_index",
)  # fmt: skip
_STATS = ("min", "max", "mean", "std", "count", "q01", "q10", "q50", "q90", "q99")


def problems(folder: Path) -> list[str]:
    """Return a line for each thing that is not as LeRobot's layout wants it; none is good."""
    info = json.loads((folder / layout.INFO).read_text(encoding="utf-8"))
    episodes = pq.read_table(folder / layout.EPISODES).to_pylist()
    tasks = pq.read_table(folder / layout.TASKS)
    return [
        *_info(info),
        *_episodes(info, episodes),
        *_tasks(info, tasks),
        *_stats(folder, info),
        *_data(folder, info, episodes),
    ]


def _info(info: dict[str, Any]) -> Iterator[str]:
    if info["codebase_version"] != layout.VERSION:
        yield f"codebase_version is {info['codebase_version']}"
    if type(info["fps"]) is not int or info["fps"] < 1:
        yield "fps is no whole number above 0"
    if info["splits"] != {"train": f"0:{info['total_episodes']}"}:
        yield "splits does not hold all episodes"
    for key, feature in info["features"].items():
        if "/" in key:
            yield f"a slash in the name of the feature {key}"
        if set(feature) < {"dtype", "shape", "names"}:
            yield f"the feature {key} lacks dtype, shape or names"
    missing = set(layout.COUNTING) - set(info["features"])
    if missing:
        yield f"the features {sorted(missing)} are missing"


def _episodes(info: dict[str, Any], rows: list[dict[str, Any]]) -> Iterator[str]:
    if len(rows) != info["total_episodes"]:
        yield f"{number_of(len(rows), 'episode')}, {info['total_episodes']} in info"
    at = 0
    for number, row in enumerate(rows):
        missing = [name for name in _EPISODE_COLUMNS if row.get(name) is None]
        if missing:
            yield f"episode {number} lacks {missing}"
            continue
        span = (row["dataset_from_index"], row["dataset_to_index"])
        if row["episode_index"] != number or span != (at, at + row["length"]):
            yield f"episode {number} does not follow the one before"
        at += row["length"]
    if at != info["total_frames"]:
        yield f"{number_of(at, 'frame')} in the episodes, {info['total_frames']} in info"


def _tasks(info: dict[str, Any], table: Any) -> Iterator[str]:
    index = json.loads(table.schema.metadata[b"pandas"])["index_columns"]
    if index != ["task"]:
        yield "tasks are not indexed by their words"
    if table.column("task_index").to_pylist() != list(range(info["total_tasks"])):
        yield "task_index does not count the tasks"


def _stats(folder: Path, info: dict[str, Any]) -> Iterator[str]:
    stats = json.loads((folder / layout.STATS).read_text(encoding="utf-8"))
    for key, feature in info["features"].items():
        shape = (3, 1, 1) if feature["dtype"] == "image" else tuple(feature["shape"])
        for name in _STATS:
            found = np.array(stats.get(key, {}).get(name, np.nan), float)
            if not np.isfinite(found).all():
                yield f"{name} of {key} is missing or not finite"
            elif found.shape != ((1,) if name == "count" else shape):
                yield f"{name} of {key} has the shape {found.shape}"


def _data(folder: Path, info: dict[str, Any], rows: list[dict[str, Any]]) -> Iterator[str]:
    at = 0
    for row in rows:
        place = info["data_path"].format(
            chunk_index=row["data/chunk_index"], file_index=row["data/file_index"]
        )
        if not (folder / place).is_file():
            yield f"{place} is missing"
    for path in sorted((folder / "data").glob("*/*.parquet")):
        file = pq.ParquetFile(path)
        types = {key: layout.Feature(f["dtype"], tuple(f["shape"])).arrow
                 for key, f in info["features"].items()}  # fmt: skip
        found = {field.name: field.type for field in file.schema_arrow}
        if found != types:
            yield f"the columns of {path.name} are not the features"
            continue
        table = file.read(columns=list(layout.COUNTING))
        columns = {name: table.column(name).to_numpy() for name in layout.COUNTING}
        if not np.array_equal(columns["index"], np.arange(at, at + len(table))):
            yield f"index does not count on in {path.name}"
        at += len(table)
        even = (columns["frame_index"] / info["fps"]).astype(np.float32)
        if not np.allclose(columns["timestamp"], even, atol=1e-4):  # their tolerance_s
            yield f"timestamp is not frame over fps in {path.name}"
    if at != info["total_frames"]:
        yield f"{number_of(at, 'frame')} of data, {info['total_frames']} in info"
