"""Public data sets whose files taxel can import by name, without an import table.

Each entry turns a folder of the data set's own files into import rows. The
data themselves are not part of taxel. Knows nothing about models or splits.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from taxel.errors import BadTable
from taxel.foreign.text_lines import lines_of
from taxel.recordings.imports.rows import ImportRow
from taxel.recordings.imports.value_tables.table_columns import LARGEST_TABLE
from taxel.recordings.imports.video_rows import VideoRow

GLOVE_CHANNELS = (
    "Data0[count] Data1[count] Data2[count] Data3[count] Data4[count] "
    "Data6[deg] Data7[deg] Data8[deg]"
)
"""Five triboelectric channels, then three Euler angles (the data set's columns 2 to 9)."""
SITTING_GAP_S = 120.0
"""Longest pause within one sitting: of the 51 pauses between files of one sign, 45 are 3 to
119 s, the others 131 to 448 s (docs/decisions/0004)."""
POWER_ON_GAP_S = 300.0
"""Longest pause within one power-on of the board; an earlier time stamp means a new one."""
ICUB_LEFT_OUT = ("full_coke",)
"""Not reliable, says the data set's own COPYRIGHT-AND-FORMAT.txt."""


@dataclass(frozen=True, slots=True)
class KnownDataset:
    """A public data set."""

    rows: Callable[[Path], list[ImportRow]]
    """Folder of the data set → what each of its files is."""
    description: str


def chain_sessions(files: Sequence[tuple[str, float, float]], max_gap_s: float) -> dict[str, str]:
    """Return which files are pieces of one session, from the device's own time stamps.

    A device's clock starts at power-on. Two files of one session never
    overlap and follow one another within `max_gap_s`. Files are taken by
    their start; each joins the session that ended last before it, or opens a
    new one.

    Args:
        files: Name, start and end of each file on the device's clock, milliseconds.
        max_gap_s: Longest pause within a session, seconds.

    Returns:
        File name → session name, which is the name of the session's first file.
    """
    ends: dict[str, float] = {}
    sessions: dict[str, str] = {}
    for name, start_ms, end_ms in sorted(files, key=lambda file: (file[1], file[0])):
        open_ones = {
            session: end
            for session, end in ends.items()
            if 0 <= start_ms - end <= max_gap_s * 1000.0
        }
        session = max(open_ones, key=lambda key: open_ones[key]) if open_ones else name
        sessions[name] = session
        ends[session] = end_ms
    return sessions


def glove_rows(folder: Path) -> list[ImportRow]:
    """Return the import rows of the triboelectric glove's data set.

    The sign is the file's name up to the first "_". Files of one sign are
    chained by `chain_sessions`, twice: group "session" is one sitting, group
    "power_on" the looser chain.

    Raises:
        BadTable: The folder holds no such files.

    Source:
        B. Yang et al., "Triboelectric-inertial sensing glove", Advanced Science 2025.
    """
    files = _files(folder, "*_*.csv.gz")
    spans: dict[str, list[tuple[str, float, float]]] = {}
    for file in files:
        sign = file.name.split("_")[0]
        spans.setdefault(sign, []).append((file.name.removesuffix(".csv.gz"), *_span_ms(file)))
    sitting: dict[str, str] = {}
    power_on: dict[str, str] = {}
    for of_sign in spans.values():
        sitting |= chain_sessions(of_sign, SITTING_GAP_S)
        power_on |= chain_sessions(of_sign, POWER_ON_GAP_S)
    return [
        ImportRow(
            file=file,
            labels={"sign": file.name.split("_")[0]},
            groups={"file": stem, "session": sitting[stem], "power_on": power_on[stem]},
            channels=GLOVE_CHANNELS,
            time="Timestamp[ms]",
            sensor="glove",
        )
        for file in files
        for stem in [file.name.removesuffix(".csv.gz")]
    ]


def icub_rows(folder: Path) -> list[ImportRow]:
    """Return the import rows of the iCub Grasp Dataset.

    OBJECT_TRIAL.txt is one grasp. Group "session" is the object, because an
    object's grasps follow one another and share their drift.

    Raises:
        BadTable: The folder holds no such files.

    Source:
        H. Soh, Y. Su, Y. Demiris, IROS 2012.
    """
    inner = folder / "iCubGraspDataset"
    rows = []
    for file in _files(inner if inner.is_dir() else folder, "*_*.txt"):
        match = re.fullmatch(r"(.+)_(\d+)\.txt", file.name)
        if match is None or match[1] in ICUB_LEFT_OUT:
            continue
        rows.append(
            ImportRow(
                file=file,
                labels={"object": match[1]},
                groups={
                    "file": file.stem,
                    "grasp": file.stem,
                    "trial_number": match[2],
                    "session": match[1],
                },
                layout="icub",
                sensor="icub_hand",
                details={"time": "no time stamps: one step is counted as 1 s"},
            )
        )
    return rows


KNOWN: dict[str, KnownDataset] = {
    "teng-glove": KnownDataset(glove_rows, "triboelectric glove, ten hand signs"),
    "icub-grasp": KnownDataset(icub_rows, "iCub hand, 60 taxels, nine objects and none"),
}
"""Name for `taxel import` → the data set."""


def gelsight_slip_rows(folder: Path) -> list[VideoRow]:
    """Return the import rows of the incipient slip data set.

    trials/OBJECT/exp_num_N holds two AVIs; a file slip.txt beside them says that the object
    slipped, none that it held.

    Raises:
        BadTable: The folder holds no such trials.

    Source:
        A. Parag, E. Misimi, E. Adelson, "Incipient slip detection", 2024.
    """
    trials = sorted((folder / "trials").glob("*/exp_num_*"))
    if not trials:
        raise BadTable(
            "folders trials/OBJECT/exp_num_N", f"none in {folder}", "name their folder with --data"
        )
    return [
        VideoRow(
            name=f"{trial.parent.name}-{trial.name.removeprefix('exp_num_')}",
            files={"left": trial / "camera_0.avi", "right": trial / "camera_2.avi"},
            labels={"outcome": "slip" if (trial / "slip.txt").exists() else "hold"},
            groups={"object": trial.parent.name, "trial": f"{trial.parent.name}/{trial.name}"},
        )
        for trial in trials
    ]


KNOWN_VIDEOS: dict[str, Callable[[Path], list[VideoRow]]] = {"gelsight-slip": gelsight_slip_rows}
"""Name for `taxel import` → rows of a public data set of tactile cameras."""


def _files(folder: Path, pattern: str) -> list[Path]:
    found = sorted(folder.glob(pattern))
    if not found:
        raise BadTable(f"files {pattern}", f"none in {folder}", "name their folder with --data")
    return found


def _span_ms(path: Path) -> tuple[float, float]:
    """Return the first and the last time stamp of a glove's file, milliseconds."""
    try:
        lines = lines_of(path, LARGEST_TABLE)
        next(lines)
        first = last = next(lines)
        for line in lines:
            last = line
        return float(first.split(",")[0]), float(last.split(",")[0])
    except (OSError, ValueError, StopIteration) as error:  # BadFile is a ValueError
        raise BadTable(
            "a gzipped table with time stamps in its first column",
            f"{path}: {getattr(error, 'got', error)}",
            "copy the file again",
        ) from error
