"""Recordings as Parquet tables: scans, frames and marks, a file each, with the manifest in it.

Polars, pandas, DuckDB and Arrow read them; nothing is resampled. Knows nothing about learning.

Background of our choices: docs/decisions/0051.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from taxel.exchange.output import new_tree
from taxel.recordings.manifest import Manifest, to_record
from taxel.recordings.reader import Block, iterate_blocks, read_manifest

SIGN = "manifests.json"
"""A file in every such folder: what each recording is."""
_TIMES = [(name, pa.float64()) for name in ("fitted_s", "device_s", "arrival_s")]
_PAIRS = pa.map_(pa.string(), pa.string())
MARKS = pa.schema(
    [("start_s", pa.float64()), ("end_s", pa.float64()), ("labels", _PAIRS), ("groups", _PAIRS)]
)
FRAMES = pa.schema(
    [("camera", pa.string()), ("coding", pa.string()), *_TIMES, ("counter", pa.int64()),
     ("image", pa.binary())]
)  # fmt: skip
"""`image` is as it came, of the kind that `coding` says: JPEG, or depth as PNG of 16 bits."""


def scans_schema(manifest: Manifest) -> pa.Schema:
    """Return the columns of scans: times, counter, each channel and its flags.

    A channel that is called like another column has "(channel)" behind its name: no program reads
    a table with two columns of one name.
    """
    names = _columns_of(manifest.sensor.channels)
    values = [
        pa.field(name, pa.float32(), metadata={"unit": unit})
        for name, unit in zip(names, manifest.sensor.units, strict=True)
    ]
    flags = [pa.field(_flags_of(name), pa.uint8()) for name in names]
    return pa.schema([*_TIMES, ("counter", pa.int64()), *values, *flags])


def _columns_of(channels: Sequence[str]) -> list[str]:
    """Return the column of each channel, its own name where no other column is called so."""
    taken, names = {"counter", *(name for name, _ in _TIMES)}, []
    for channel in channels:
        name = channel
        while {name, _flags_of(name)} & taken:
            name += " (channel)"
        taken |= {name, _flags_of(name)}
        names.append(name)
    return names


def _flags_of(name: str) -> str:
    return f"{name} validity"


def write_tables(
    paths: Sequence[Path],
    output: Path,
    *,
    overwrite: bool = False,
    progress: Callable[[int, int], None] = lambda done, of: None,
) -> dict[str, dict[str, int]]:
    """Write tables of each recording: NAME.scans.parquet, NAME.frames.parquet, NAME.marks.parquet.

    Args:
        paths: The recordings.
        output: Folder to be made.
        overwrite: Replace an older such folder.
        progress: Called with recordings done and in all.

    Returns:
        File → rows; a table without rows is not written.

    Raises:
        BadRecording: One is damaged or cut short.
        RecordingFailed: The disk refused.
    """
    rows_written: dict[str, dict[str, int]] = {}
    manifests = {}
    with new_tree(output, SIGN, (".parquet",), overwrite=overwrite) as made:
        for done, path in enumerate(paths, 1):
            manifest = read_manifest(path)
            manifests[path.stem] = to_record(manifest)
            rows_written[path.stem] = _write(path, manifest, made)
            progress(done, len(paths))
        text = json.dumps(manifests, indent=1, ensure_ascii=False)
        (made / SIGN).write_text(text, encoding="utf-8")
    return rows_written


def _write(path: Path, manifest: Manifest, folder: Path) -> dict[str, int]:
    about = {"taxel": json.dumps(to_record(manifest), ensure_ascii=False)}
    schemas = {"scans": scans_schema(manifest), "frames": FRAMES, "marks": MARKS}
    schemas = {kind: schema.with_metadata(about) for kind, schema in schemas.items()}
    writers: dict[str, pq.ParquetWriter] = {}
    rows: dict[str, int] = {}
    with ExitStack() as stack:
        for block in iterate_blocks(path):
            for kind, columns in _columns(block, manifest).items():
                table = pa.table(columns, schema=schemas[kind])
                if not len(table):
                    continue
                if kind not in writers:
                    place = folder / f"{path.stem}.{kind}.parquet"
                    writers[kind] = stack.enter_context(pq.ParquetWriter(place, schemas[kind]))
                writers[kind].write_table(table)
                rows[kind] = rows.get(kind, 0) + len(table)
    return rows


def _columns(block: Block, manifest: Manifest) -> dict[str, list[pa.Array]]:
    samples, cameras = block.samples, manifest.cameras
    scans = [samples.fitted_s, samples.device_s, samples.arrival_s, samples.counter]
    scans += [*samples.values.T, *samples.validity.T]
    frames = [
        [cameras[frame.camera].name for frame in block.frames],
        [cameras[frame.camera].coding for frame in block.frames],
        *([getattr(frame, name) for frame in block.frames]
          for name in ("fitted_s", "device_s", "arrival_s", "counter", "jpeg")),
    ]  # fmt: skip
    marks = [
        [mark.start_s for mark in block.marks],
        [mark.end_s for mark in block.marks],
        [list(mark.labels.items()) for mark in block.marks],
        [list(mark.groups.items()) for mark in block.marks],
    ]
    return {
        "scans": [pa.array(column) for column in scans],
        "frames": [pa.array(c, f.type) for c, f in zip(frames, FRAMES, strict=True)],
        "marks": [pa.array(c, f.type) for c, f in zip(marks, MARKS, strict=True)],
    }
