"""Recordings of an array, labelled afterwards: copies with intervals as marks; raw ones stay.

Knows nothing about cameras' label rules (corrections.py), windows or models.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from taxel.errors import BadInput
from taxel.recordings.imports.intervals import marks_of, read_intervals, stem_of, write_marked
from taxel.recordings.reader import iterate_frames, iterate_slips, list_recordings, read_recording
from taxel.recordings.whole import new_folder
from taxel.recordings.writer import Recorder
from taxel.signals import Mark


@dataclass(frozen=True, slots=True, kw_only=True)
class Marked:
    """What was labelled."""

    recordings: tuple[Path, ...]
    """The new recordings."""
    marks: tuple[Mark, ...]
    """All of their marks."""
    replaced: int
    """Marks of the old recordings that the new ones no longer hold."""
    left_out: tuple[Path, ...]
    """Recordings without an interval, of which no copy was made."""


def mark_recordings(
    path: Path,
    table: Path,
    output_dir: Path,
    *,
    overwrite: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> Marked:
    """Write a copy of each recording that has intervals; they become its only marks.

    Args:
        path: A recording of an array, or a folder of them.
        table: The intervals (recordings/imports/intervals.py).
        output_dir: Folder to be made; complete or not there.
        overwrite: Replace an existing folder that holds nothing else than the copies.
        progress: Called with recordings done and recordings in all.

    Raises:
        BadTable: The table is not as it should be, or an interval lies outside its recording.
        BadInput: The folder is that of the recordings, or a recording has no scans.
        BadRecording: A recording cannot be read.
        RecordingFailed: The disk refused.
    """
    paths = list_recordings(path)
    if output_dir.resolve() in paths[0].resolve().parents:
        raise BadInput("another folder for the labelled copies", f"{output_dir}, the raw "
                       "recordings' own", "choose another --output")  # fmt: skip
    names = [stem_of(path.name) for path in paths]
    intervals = read_intervals(table, names)
    chosen = [(path, name) for path, name in zip(paths, names, strict=True) if name in intervals]
    marks: list[Mark] = []
    replaced = 0
    files = [path.name for path, _ in chosen]
    with new_folder(output_dir, files, overwrite=overwrite) as made:
        for done, (path, name) in enumerate(chosen, 1):
            recording = read_recording(path)
            samples, manifest = recording.samples, recording.manifest
            if not len(samples):
                raise BadInput("recordings of an array", f"no scans in {path}", "leave it out")
            own = marks_of(intervals[name], samples.fitted_s, manifest.sensor.rate_hz)
            with Recorder(made / path.name, manifest) as recorder:
                write_marked(recorder, samples, own)
                for frame in iterate_frames(path) if manifest.cameras else ():
                    recorder.frame(frame)
                for note in iterate_slips(path):
                    recorder.slip(note)
                recorder.close("labelled")
            marks += own
            replaced += len(recording.marks)
            if progress is not None:
                progress(done, len(chosen))
    return Marked(
        recordings=tuple(output_dir / path.name for path, _ in chosen),
        marks=tuple(marks),
        replaced=replaced,
        left_out=tuple(path for path, name in zip(paths, names, strict=True)
                       if name not in intervals),
    )  # fmt: skip
