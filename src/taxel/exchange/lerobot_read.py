"""Recordings from a LeRobot data set of version 3.0: an episode each, all or none.

What `taxel export lerobot` wrote comes back exactly: JPEG, values, validity, times, labels, groups
and marks. Any other data set gives its images and its state, at times of frame over rate, for that
is all it has. Video is refused. Knows nothing about learning.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from taxel.errors import BadDataset, BadFile, BadRecording, BadSource, BadTable, RecordingFailed
from taxel.exchange import lerobot_layout as layout
from taxel.exchange.lerobot_episode import ForeignEpisode, Info, OwnEpisode, state_key
from taxel.foreign.files import MIB, in_words, open_file
from taxel.foreign.json_text import Fields, parse_json, read_json
from taxel.plain_text import number_of
from taxel.recordings.imports.earlier import IMPORTED, import_folder
from taxel.recordings.manifest import from_record
from taxel.recordings.writer import Recorder
from taxel.signals import Samples

_MOST_EPISODES, _MOST_FPS = 1_000_000, 100_000
"""Bounds of what meta/info.json may say. Source: our choice, 0051."""
_ROWS = 64
"""Frames that are read at a time. Source: our choice, 0051."""
_LONGEST_NAME = 100
"""Characters of a recording's name that come from a data set. Source: our choice, 0051."""
_LARGEST_META, _AT_ONCE = 256 * MIB, 64 * MIB
"""Bytes that the table of episodes or of tasks unpacks to, in all and at a time. Source: our
choice, 0051."""


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
        overwrite: Replace an existing folder that holds nothing else than these, and recordings of
            earlier imports.
        progress: Called with episodes done and in all.

    Raises:
        BadDataset: It is no data set of version 3.0, is damaged, or holds what is not read.
        BadTable: There is something at `output` already that is not to be replaced.
        RecordingFailed: The disk refused.
    """
    try:
        info = _read_info(folder)
        rows = _read_episodes(folder)
        tasks = _read_tasks(folder)
        files = [f"{name}.mcap" for name in _names(rows)]
        with import_folder(output, files, overwrite=overwrite) as made:
            batches = _Batches(folder)
            for done, (row, file) in enumerate(zip(rows, files, strict=True), 1):
                _write_episode(info, row, tasks, batches, made / file)
                progress(done, len(rows))
    except (BadDataset, BadTable, RecordingFailed):  # BadTable: the output is not to be replaced
        raise
    except (
        pa.ArrowException, BadFile, BadRecording, BadSource, KeyError, OSError, TypeError,
        ValueError,
    ) as error:  # fmt: skip
        raise _damaged(folder, error) from error
    return [output / file for file in files]


def _damaged(folder: Path, error: Exception) -> BadDataset:
    reason = getattr(error, "got", None) or f"{type(error).__name__}: {str(error)[:200]}"
    return BadDataset(
        "a whole data set of LeRobot's version 3.0", f"{folder}: {reason}", "copy it again"
    )


def _read_info(folder: Path) -> Info:
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
    info = Info(fields.count("fps", 1, _MOST_FPS), own)
    if info.keys("video"):
        raise BadDataset(
            "images in Parquet (dtype image)", f"video in {', '.join(info.keys('video')[:6])}",
            "export it again with images: video codecs change what touch is measured from",
        )  # fmt: skip
    held = state_key(info) or layout.TRUTH.window in info.features
    if not held and not info.keys("image"):
        raise BadDataset(
            f"{layout.STATE}, {layout.TACTILE} or images", "none of them", "choose another data set"
        )
    return info


def _read_episodes(folder: Path) -> list[dict[str, Any]]:
    """Return the rows of meta/episodes, in order, without statistics."""
    rows: list[dict[str, Any]] = []
    for path in sorted((folder / "meta/episodes").glob("*/*.parquet")):
        rows += _rows_of(path)
        if len(rows) > _MOST_EPISODES:
            raise ValueError(f"more than {_MOST_EPISODES:,} episodes")
    rows.sort(key=lambda row: row["episode_index"])
    if not rows or [row["episode_index"] for row in rows] != list(range(len(rows))):
        raise ValueError("episodes are missing in meta/episodes")
    return rows


def _read_tasks(folder: Path) -> dict[int, str]:
    """Return number → words; a part of a data set may lack numbers between."""
    rows = sorted(_rows_of(folder / layout.TASKS), key=lambda row: row["task_index"])
    named = "task" if rows and "task" in rows[0] else "__index_level_0__"
    return {row["task_index"]: str(row[named]) for row in rows}


def _rows_of(path: Path) -> list[dict[str, Any]]:
    """Return the rows of a table about the data, without statistics.

    Runs of equal values pack without a bound: a megabyte of Parquet may hold 300 million rows, or
    one long text a million times.

    Raises:
        ValueError: It is larger than any such table.
    """
    rows: list[dict[str, Any]] = []
    with open_file(path) as raw:
        file = pq.ParquetFile(raw)
        about = file.metadata
        if about.num_rows > _MOST_EPISODES:
            raise ValueError(f"{about.num_rows:,} rows in {path.name}")
        parts = [about.row_group(number) for number in range(about.num_row_groups)]
        # A value is at most as long as its column's part of a group.
        longest = max((part.column(n).total_uncompressed_size
                       for part in parts for n in range(part.num_columns)), default=1)  # fmt: skip
        at_once = min(_ROWS, max(1, _AT_ONCE // max(1, longest)))
        wanted = [name for name in file.schema_arrow.names if not name.startswith("stats/")]
        held = 0
        for batch in file.iter_batches(batch_size=at_once, columns=wanted):
            held += batch.nbytes
            if held > _LARGEST_META or len(rows) > _MOST_EPISODES:
                raise ValueError(f"more than {in_words(_LARGEST_META)} in {path.name}")
            rows += batch.to_pylist()
    return rows


def _names(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return a file's name for each episode, each different."""
    names = []
    for row in rows:
        stored = str(row.get(f"{layout.OWN}recording") or "")[:_LONGEST_NAME]
        plain = "".join(letter if letter.isalnum() or letter in "-_" else "_" for letter in stored)
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
                raise ValueError(f"episode {episode} lacks {number_of(frames, 'frame')}")
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
    info: Info, row: Mapping[str, Any], tasks: Mapping[int, str], batches: _Batches, path: Path
) -> None:
    frames = row["length"]
    if not isinstance(frames, int) or frames < 1:
        raise ValueError(f"episode {row['episode_index']} of {number_of(frames, 'frame')}")
    ours = row.get(f"{layout.OWN}manifest")
    parts = batches.next(row["episode_index"], frames)
    if ours is not None:
        manifest = from_record(_texts(ours))
        episode: OwnEpisode | ForeignEpisode = OwnEpisode(manifest, row)
    else:
        episode = ForeignEpisode(info, row, tasks)
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
        recorder.close(IMPORTED)
    except BaseException:
        recorder.discard()
        raise


def _texts(text: str) -> dict[str, str]:
    found = parse_json(text)
    if not isinstance(found, dict) or not all(isinstance(value, str) for value in found.values()):
        raise ValueError("a manifest that is no object of texts")
    return found
