"""A set of simulated pours: a folder with one recording a run, made side by side.

Recordings are made in OUTPUT.unfinished, each with its row beside it once it is whole; the folder
takes its name when all are there. A set that was interrupted continues where it was. Knows nothing
about how a pour is simulated.

Source: docs/decisions/0050.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

from taxel.errors import BadFile, BadInput, RecordingFailed, not_written
from taxel.foreign.files import sha256_of
from taxel.foreign.json_text import read_json
from taxel.held import only_writer
from taxel.jobs.call import code_digest
from taxel.jobs.running import as_done
from taxel.recordings.whole import write_whole
from taxel.sim.pour.cup_pour import CupPourConfig, list_runs
from taxel.sim.pour.cups import PourRun
from taxel.sources.simulated.pour_sets import CAMERA_HZ, write_run

_MADE, _ROWS = "made", "rows"


def unfinished_folder(output: Path) -> Path:
    """Return where recordings are until the set is whole."""
    return output.with_name(f"{output.name}.unfinished")


def write_pours(
    output: Path,
    config: CupPourConfig,
    on_run: Callable[[dict[str, Any]], None] = lambda _: None,
    *,
    camera_hz: float = CAMERA_HZ,
    workers: int | None = None,
) -> list[dict[str, Any]]:
    """Write one recording a run into a new folder, whole or not at all.

    Runs that a call before this finished are not simulated again, where set and code are the same.

    Args:
        output: The folder; it must not exist yet.
        config: Which runs.
        on_run: Called with each run's row once it is written.
        camera_hz: Images a second that the cameras take.
        workers: Processes side by side, as for `taxel.jobs.running.as_done`.

    Returns:
        A row a run: name, cup, position, force, kind, slip at the end, times of events.

    Raises:
        BadInput: The folder exists.
        RecordingFailed: The disk refused.
    """
    if output.exists():
        raise BadInput(
            "a folder that does not exist yet for --output", str(output), "choose another"
        )
    folder = unfinished_folder(output)
    runs = [(run, _key(run, config, camera_hz)) for run in list_runs(config)]
    with only_writer(output):
        try:
            for part in (_MADE, _ROWS):
                (folder / part).mkdir(parents=True, exist_ok=True)
            rows = _finished(folder, runs)
            for row in rows.values():
                on_run(row)
            left = [(run, key) for run, key in runs if run.name not in rows]
            jobs = [(folder.absolute(), run, config, camera_hz, key) for run, key in left]
            for _, row in as_done(finish_run, jobs, workers, [run.name for run, _ in left]):
                rows[row["run"]] = row
                on_run(row)
            _clear(folder / _MADE, {f"{run.name}.mcap" for run, _ in runs})
            os.rename(folder / _MADE, output)
            shutil.rmtree(folder)
        except RecordingFailed:
            raise
        except OSError as error:
            raise not_written(output, error, "choose another place") from error
        finally:
            _remove_empty(folder)
    return [rows[run.name] for run, _ in runs]


def finish_run(
    folder: Path, run: PourRun, config: CupPourConfig, camera_hz: float, key: str
) -> dict[str, Any]:
    """Write a run's recording, and when it is whole its row; a job for any worker."""
    row = write_run(folder / _MADE, run, config, camera_hz)
    digest = _digest(folder / _MADE / f"{run.name}.mcap")
    text = json.dumps({"key": key, "sha256": digest, "row": row})
    write_whole(folder / _ROWS / f"{run.name}.json", text.encode())
    return row


def _key(run: PourRun, config: CupPourConfig, camera_hz: float) -> str:
    """Return what a run's recording depends on, as a digest."""
    about = {
        "run": asdict(run), "duration_s": config.duration_s, "frame_hz": config.frame_hz,
        "gel": config.gel, "approach": config.approach, "camera_hz": camera_hz,
        "code": code_digest(),
    }  # fmt: skip
    return hashlib.sha256(json.dumps(about, sort_keys=True, default=str).encode()).hexdigest()


def _digest(recording: Path) -> str:
    """Return the SHA-256 of a recording that was made here, hexadecimal."""
    return sha256_of(recording, recording.stat().st_size)


def _finished(folder: Path, runs: Sequence[tuple[PourRun, str]]) -> dict[str, dict[str, Any]]:
    """Return the rows of recordings that are whole already."""
    found = {}
    for run, key in runs:
        recording = folder / _MADE / f"{run.name}.mcap"
        with suppress(OSError, BadFile, KeyError, TypeError, ValueError):
            kept = read_json(folder / _ROWS / f"{run.name}.json")
            if kept["key"] == key and kept["sha256"] == _digest(recording):
                found[run.name] = dict(kept["row"])
    return found


def _clear(folder: Path, wanted: set[str]) -> None:
    """Remove what a set of other runs, or a killed worker, left."""
    for path in folder.iterdir():
        if path.name not in wanted:
            path.unlink()


def _remove_empty(folder: Path) -> None:
    """Remove the unfinished folder where not a run was finished."""
    with suppress(OSError):
        if not any((folder / _ROWS).iterdir()):
            shutil.rmtree(folder)
