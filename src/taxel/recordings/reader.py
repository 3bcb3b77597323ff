"""Read recordings: whole, in blocks of constant memory, or only the manifest.

Every check sum is verified; a file that is cut short or damaged is refused
with the command that saves it. Knows nothing about labels, windows or models.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from taxel.errors import BadFile, BadInput, BadRecording
from taxel.foreign.files import in_words
from taxel.foreign.json_text import parse_json
from taxel.plain_text import shell_words
from taxel.recordings import scan_layout as layout
from taxel.recordings.chunk_content import ChunkContent, decode_chunk
from taxel.recordings.footage_files import IMPORT_THEM, is_footage
from taxel.recordings.manifest import Manifest, from_record
from taxel.recordings.part_file import PART_SUFFIX, part_path
from taxel.recordings.walk import damaged, open_chunk, parse_metadata, walk
from taxel.signals import CameraInfo, Frame, Mark, Samples, SlipNote

_MARK_BYTES = 1000
"""What a mark takes in memory, about."""


def _half_of_memory() -> int:
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") // 2
    except (AttributeError, ValueError, OSError):  # systems that do not say
        return 4 * 2**30


_MOST_HELD = _half_of_memory()
"""Bytes of scans and marks that are read as a whole; a small file can hold much that packs well."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Recording:
    """A recording in memory, but for its cameras' frames (`iterate_frames`)."""

    path: Path
    manifest: Manifest
    samples: Samples
    """All scans, in the order in which they were recorded."""
    marks: list[Mark]
    """All marks, in the order in which they were recorded."""
    statistics: dict[str, Any]
    """The recorder's ledger: scans, measured rate, lost scans, how it ended (tally.py)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """What one chunk holds."""

    samples: Samples
    marks: list[Mark]
    frames: list[Frame]


def read_recording(path: Path | str) -> Recording:
    """Return a recording as a whole.

    Raises:
        BadRecording: It is missing, no recording of taxel's, cut short, or damaged.
    """
    manifest: Manifest | None = None
    statistics: dict[str, Any] = {}
    runs: list[NDArray[np.void]] = []
    marks: list[Mark] = []
    held = 0
    for item in _items(path):
        if isinstance(item, Manifest):
            manifest = item
        elif isinstance(item, dict):
            statistics = item
        else:
            runs += item.runs
            marks += item.marks
            held += sum(run.nbytes for run in item.runs) + _MARK_BYTES * len(item.marks)
            if held > _MOST_HELD:
                raise BadRecording(
                    f"a recording of at most {in_words(_MOST_HELD)} of scans, half of this "
                    "machine's memory", f"more in {path}", "record shorter ones",
                )  # fmt: skip
    if manifest is None:
        raise _no_manifest(path)
    dtype = layout.record_dtype(len(manifest.sensor.channels), manifest.version)
    records = np.concatenate(runs) if runs else np.zeros(0, dtype)
    return Recording(
        path=Path(path),
        manifest=manifest,
        samples=layout.decode_scans(records),
        marks=marks,
        statistics=statistics,
    )


def iterate_blocks(path: Path | str) -> Iterator[Block]:
    """Yield a recording chunk by chunk, scans, marks and frames, in constant memory.

    A finished file whose last check sum fails raises at the end, after its
    chunks, each of which was checked by itself.

    Raises:
        BadRecording: It is missing, no recording of taxel's, cut short, or damaged.
    """
    channels = 0
    for item in _items(path):
        if isinstance(item, Manifest):
            channels = len(item.sensor.channels)
        elif isinstance(item, ChunkContent):
            yield Block(samples=item.samples(channels), marks=item.marks, frames=item.frames)


def iterate_frames(path: Path | str, camera: int | None = None) -> Iterator[Frame]:
    """Yield a recording's frames, oldest first, in constant memory.

    Args:
        path: The recording.
        camera: Only this camera's; all unless given.

    Raises:
        BadRecording: It is missing, no recording of taxel's, cut short, or damaged.
    """
    for item in _items(path):
        if isinstance(item, ChunkContent):
            # A chunk holds one camera after another; in time they alternate.
            for frame in sorted(item.frames, key=lambda frame: frame.fitted_s):
                if camera is None or frame.camera == camera:
                    yield frame


def iterate_tactile(path: Path | str) -> Iterator[Frame]:
    """Yield the frames of a recording's tactile cameras, oldest first, numbered among these.

    Raises:
        BadRecording: It is missing, no recording of taxel's, cut short, or damaged.
    """
    manifest = read_manifest(path)
    yield from _frames_of(path, manifest, manifest.tactile)


def iterate_jpeg(path: Path | str) -> Iterator[Frame]:
    """Yield the frames of a recording's cameras of JPEG, oldest first, numbered among these.

    Raises:
        BadRecording: It is missing, no recording of taxel's, cut short, or damaged.
    """
    manifest = read_manifest(path)
    yield from _frames_of(path, manifest, manifest.of_jpeg)


def _frames_of(
    path: Path | str, manifest: Manifest, cameras: Sequence[CameraInfo]
) -> Iterator[Frame]:
    """Yield the frames of some of a recording's cameras, numbered among these."""
    numbers = {manifest.cameras.index(camera): place for place, camera in enumerate(cameras)}
    for frame in iterate_frames(path):
        if frame.camera in numbers:
            yield replace(frame, camera=numbers[frame.camera])


def iterate_slips(path: Path | str) -> Iterator[SlipNote]:
    """Yield the slip that was measured while it was recorded, oldest first, in constant memory.

    Raises:
        BadRecording: It is missing, no recording of taxel's, cut short, or damaged.
    """
    for item in _items(path):
        if isinstance(item, ChunkContent):
            yield from item.slips


def iterate_samples(path: Path | str, block_scans: int = 4096) -> Iterator[Samples]:
    """Yield a recording's scans in blocks of `block_scans` (the last may be shorter).

    Raises:
        BadInput: A block is to hold no scan.
        BadRecording: It is missing, no recording of taxel's, cut short, or damaged.
    """
    if block_scans < 1:
        raise BadInput("at least one scan in a block", f"{block_scans}", "give block_scans above 0")
    kept: list[Samples] = []
    count = 0
    for block in iterate_blocks(path):
        if len(block.samples) == 0:
            continue
        kept.append(block.samples)
        count += len(block.samples)
        if count >= block_scans:
            joined = Samples.join(kept)
            whole = count - count % block_scans
            for first in range(0, whole, block_scans):
                yield joined[first : first + block_scans]
            kept, count = [joined[whole:]], count - whole
    if count:
        yield Samples.join(kept)


def read_manifest(path: Path | str) -> Manifest:
    """Return what a recording is, from its head alone; also of an unfinished one.

    Raises:
        BadRecording: It is missing, no recording of taxel's, or its head is damaged.
    """
    for item in _items(path):
        if isinstance(item, Manifest):
            return item
    raise _no_manifest(path)


def how_ended(path: Path | str) -> str:
    """Return how a finished recording ended, such as `cleanly`; empty where it does not say.

    No chunk is opened, so that this takes as long as reading the file's bytes.

    Raises:
        BadRecording: It is missing, no recording, cut short, or damaged.
    """
    ended = ""
    for record in walk(Path(path)):
        if record.opcode == Opcode.METADATA:
            try:
                name, pairs = parse_metadata(record.payload)
                if name == "taxel.statistics":
                    ended = str(parse_json(pairs.get("ended", '""')))
            except ValueError as error:
                raise damaged(Path(path), str(error)) from error
    return ended


def _own(files: Iterable[Path]) -> list[Path]:
    return sorted(file for file in files if not file.name.startswith("._"))


def list_recordings(path: Path | str) -> list[Path]:
    """Return the recordings of a data set: a folder's *.mcap by name, or the one file.

    Not ._*.mcap: macOS leaves such a file beside each that it copies to a foreign disk.

    Raises:
        BadRecording: There is none, or one is unfinished and was not recovered.
    """
    path = Path(path)
    if path.is_file():
        return [path]
    if not path.exists():
        raise BadRecording("a recording or a folder of them", f"{path}, which is not there",
                           "check the path")  # fmt: skip
    parts = _own(path.glob(f"*.mcap{PART_SUFFIX}"))
    unfinished = [part for part in parts if not part.with_suffix("").exists()]
    if unfinished:
        raise damaged(unfinished[0], "a recording that was not finished")
    found = _own(path.glob("*.mcap"))
    if not found:
        raise BadRecording("a folder with recordings (*.mcap)", f"none in {path}", _instead(path))
    return found


def _instead(folder: Path) -> str:
    """Return what to do with a folder without recordings."""
    if (folder / "run.json").is_file():
        return f"for this run, a page: {shell_words('taxel', 'report', folder)} --output run.html"
    tables = sorted([*folder.glob("*.csv"), *folder.glob("*.tsv")])
    of_videos = [path for path in tables if _of_videos(path)]
    if table := _the_table(of_videos):
        return (
            f"name its table, {table}, where each video has a label (taxel train-trials, "
            "evaluate-trials and live take it); for grasps that are watched over time, run: taxel "
            f"import {table} --output RECORDINGS, then taxel train-monitor RECORDINGS"
        )
    if not of_videos and (table := _the_table(tables)):
        return f"if {table} describes its files: taxel import {table} --output RECORDINGS"
    if not tables and is_footage(folder):
        return f"for its videos or images, {IMPORT_THEM}"
    return "make some with: taxel simulate, taxel record or taxel import"


def _the_table(tables: Sequence[Path]) -> Path | None:
    """Return the table that is meant: trials.csv, or the only one; None where that is open."""
    usual = [path for path in tables if path.name == "trials.csv"]
    return next(iter(usual if len(tables) > 1 else tables), None)


def _of_videos(table: Path) -> bool:
    """Return whether a table's first line names cameras; False where it cannot be read."""
    from taxel.recordings.imports.header import table_cells
    from taxel.recordings.imports.video_rows import names_videos

    try:
        return names_videos(table_cells(table)[0])
    except (OSError, ValueError):
        return False


Item = Manifest | dict[str, Any] | ChunkContent


def _items(path: Path | str) -> Iterator[Item]:
    """Yield the manifest, then what each chunk holds, then the statistics."""
    path = Path(path)
    if not path.exists() and part_path(path).exists():
        raise damaged(part_path(path), "a recording that was not finished")
    manifest: Manifest | None = None
    try:
        for record in walk(path):
            if record.opcode == Opcode.METADATA:
                name, pairs = parse_metadata(record.payload)
                if name == "taxel":
                    manifest = from_record(pairs)
                    yield manifest
                elif name == "taxel.statistics":
                    yield {key: parse_json(value) for key, value in pairs.items()}
            elif record.opcode == Opcode.CHUNK:
                if manifest is None:
                    raise _no_manifest(path)
                content = open_chunk(record.payload)
                yield decoded(content, manifest)
    except BadRecording:
        raise
    except BadFile as error:
        raise damaged(path, error.got) from error
    except ValueError as error:
        raise damaged(path, str(error)) from error


def decoded(content: bytes, manifest: Manifest) -> ChunkContent:
    """Return what a chunk's uncompressed bytes hold, with times that a clock can have.

    Raises:
        ValueError: A record is not laid out as FORMAT.md says, or its time is none.
    """
    sensor, cameras = manifest.sensor, manifest.cameras
    found = decode_chunk(content, len(sensor.channels), len(cameras), manifest.version)
    times = [run["fitted_s"] for run in found.runs]
    times.append(np.array([frame.fitted_s for frame in found.frames]))
    if not all((np.abs(own) <= layout.FURTHEST_S).all() for own in times):  # NaN is not, either
        raise ValueError("a scan or frame has a time that no clock shows")
    return found


def _no_manifest(path: Path | str) -> BadRecording:
    return BadRecording(
        "a recording that taxel wrote",
        f"{path}, an MCAP file without taxel's manifest",
        "import its values as a table with: taxel import",
    )
