"""`taxel import`: turn tables of values into recordings."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Literal

import tyro

from taxel.cli.options.rules import Only
from taxel.cli.printing import command, counted, print_json, say, say_aside
from taxel.cli.recordings.export.need import need_packages
from taxel.errors import BadInput, MissingExtra
from taxel.plain_text import number_of, visible
from taxel.recordings.imports.header import table_cells
from taxel.recordings.imports.importing import (
    ImportOptions,
    import_rows,
    intervals_of,
    with_names,
)
from taxel.recordings.imports.intervals import Interval
from taxel.recordings.imports.known import KNOWN, KNOWN_VIDEOS
from taxel.recordings.imports.notes import FileFacts, notes_of
from taxel.recordings.imports.part import Row, spread
from taxel.recordings.imports.rows import ImportRow, read_rows
from taxel.recordings.imports.same_cameras import Pair, same_notes
from taxel.recordings.imports.spelling import look_alikes, unknown_words
from taxel.recordings.imports.video_rows import VideoRow

if TYPE_CHECKING:
    from taxel.recordings.imports.footage import Video

LEROBOT = "lerobot"
"""In the table's place: a data set of LeRobot's, in the folder --data."""


@dataclass(frozen=True)
class Import:
    """Turn data files or videos into recordings, one for each trial, as a table describes them.

    For arrays, the import table is a CSV with one row for each file: a text (.csv, .tsv, .txt or
    .dat, gzip-packed or not), .xlsx or .xlsx[SHEET], .npy or .wav. Its columns: file (relative to
    the table); label:NAME and group:NAME, as many as you like; channels, each with its name or
    number from 1 and its unit, as in Data0[count] Data1[count] 7[deg], *[N] for all, or
    skin:12x32[N] for a grid; time, as in Timestamp[ms] (s, ms, us, ns; iso for time stamps), or
    rate:100Hz; and optionally sensor (its name), full_scale (where it saturates), missing (numbers
    that mark missing values, as in -32768 9999), pieces (1s or 100rows: cut each recording into
    trials of that length) and layout (csv, icub, or module.py:function). A .wav needs neither
    channels nor time. If file names contain labels, one row may name all files that match a
    pattern: {group:session}/{label:object}_trial*.csv; * and ? match the rest, {digits} a whole
    number.

    One row may also name a file of many trials: a stacked .npy, or a .npz, MATLAB (.mat) or HDF5
    (.h5, .hdf5) file. Then trials names the array that holds them (X, or trials/*/force for one
    array per trial), and axes names its axes (trials rows channels, or trials rows height width for
    a grid; in a text, trials channels makes a trial of each line, trials rows:4 channels says that
    each line holds four rows, channels rows that each line is a channel of one trial). label:NAME,
    group:NAME and length (rows of each trial) take each trial's own value from an array: from:y, or
    from:labels.csv:object for another file; from:objects[y] where y numbers the classes that
    objects names; or from its name: star:1 is the text that the first * in trials matches. Time may
    be from:t[ms]. In a text with many trials, trials names the column that numbers them, or is
    restarts where the times begin anew in each trial, or empty rows where such rows part trials.

    For tactile cameras, the table's columns are left and right, or camera:NAME for each camera
    (videos, or folders of images, relative to the table); label:NAME; group:NAME; and
    optionally split (train, validation, test), rate (Hz) and mm_per_px.

    Instead of a table, name a public data set (teng-glove, icub-grasp or gelsight-slip), or
    lerobot for the LeRobot data set (version 3.0, images in Parquet) that --data names. For
    long recordings, --intervals names the labelled intervals of each file.
    """

    table: tyro.conf.Positional[str]
    """The import table (CSV); or the name of a public data set: teng-glove, icub-grasp,
    gelsight-slip; or lerobot, with --data."""
    output: Path
    """Folder to create for the recordings."""
    data: Path | None = None
    """Folder of the files; by default the table's own."""
    intervals: Path | None = None
    """Labelled intervals of the files, which become trials: a table (CSV) with the columns file,
    start_s, end_s or duration_s (seconds from the file's first scan), label:NAME and group:NAME;
    for a single file also an Audacity label track or MNE's annotations (.txt)."""
    missing: Literal["refuse", "keep"] | None = None
    """Arrays, with empty cells, NaN, NA or infinity: refuse the file (the default), or keep them,
    flagged as invalid. Rows of NaN at the end of a trial in a stack are padding unless they are
    kept."""
    repeated_times: Literal["refuse", "drop"] | None = None
    """Arrays, with rows that repeat the time of the row above: refuse the file (the default), or
    drop such rows, so that the first row of a time is kept, and count them. A file in which more
    than 5 % of the rows repeat is refused all the same: its clock is too coarse; give a rate."""
    garbled_times: Literal["refuse", "drop"] | None = None
    """Arrays, with rows whose time lies far outside those of the rows above and below, as in a line
    that lost bytes: refuse the file (the default), or drop such rows and count them. A file in
    which more than 5 % of the rows are such is refused all the same; mend it, or give a rate."""
    allow_code: bool = False
    """Run layouts of the form module.py:function; they can do whatever you can."""
    allow_outside: bool = False
    """Accept files outside the table's folder (or --data): absolute paths, .. and links that lead
    out of it."""
    skip_unreadable: bool = False
    """Arrays: leave out files that cannot be read as the table says, such as empty ones, and note
    each with the reason. Where none of the files that a row of the table names can be read, it is
    still refused."""
    at_most: int | None = None
    """Import a part only: at most so many recordings of each value of --of, evenly spread over the
    order of the table; all unless given."""
    of: tuple[str, ...] = ()
    """Columns whose values --at-most counts, such as label:object or group:session; with several,
    each combination of their values. All labels unless given."""
    overwrite: bool = False
    """Replace an existing output folder of an earlier import, with recordings in it that are not
    written again. Where it holds anything else, it is refused."""
    json: bool = False
    """Print the recordings' paths as JSON."""

    RULES: ClassVar = (
        Only(
            ("allow-code", "allow-outside", "skip-unreadable"), "a table of your own",
            lambda o: o.table not in (LEROBOT, *KNOWN, *KNOWN_VIDEOS),
        ),
        Only(
            ("at-most", "of"), "a table or public data set (not lerobot)",
            lambda o: o.table != LEROBOT,
        ),
        Only(("of",), "--at-most", lambda o: o.at_most is not None),
    )  # fmt: skip

    def run(self) -> None:
        """Import everything, or nothing at all."""
        files: list[FileFacts] = []
        earlier = [path.name for path in sorted(self.output.glob("*.mcap"))]
        with counted("importing") as progress:
            made, notes = self._import(progress, files.append)
        notes += _gone_note(earlier, made)
        if self.json:
            print_json({"recordings": [str(path) for path in made],
                        "notes": [*notes, *notes_of(files)]})  # fmt: skip
            return
        for note in notes_of(files):
            say_aside(f"note: {note}")
        for note in notes:
            say(note)
        say(
            f"{self.output}: {number_of(len(made), 'recording')}; next:",
            command("taxel", "info", self.output),
        )

    def _import(
        self, progress: Callable[[int, int], None], on_file: Callable[[FileFacts], None]
    ) -> tuple[list[Path], list[str]]:
        """Return the recordings, and what to say of their labels and groups."""
        table = Path(self.table)
        if self.table in (LEROBOT, *KNOWN_VIDEOS) or (
            self.table not in KNOWN and _of_videos(table)
        ):
            for name, given in (
                ("--intervals", self.intervals), ("--missing", self.missing),
                ("--repeated-times", self.repeated_times),
                ("--garbled-times", self.garbled_times),
                ("--allow-code", self.allow_code), ("--skip-unreadable", self.skip_unreadable),
            ):  # fmt: skip
                if given:
                    raise BadInput(f"a table of arrays beside {name}", "one of videos",
                                   f"leave {name} out")  # fmt: skip
            if self.table == LEROBOT:
                return self._import_lerobot(progress)
            return self._import_videos(progress)
        if self.table not in KNOWN:
            rows = read_rows(table, self.data or table.parent, outside=self.allow_outside,
                             skip_unreadable=self.skip_unreadable)  # fmt: skip
        elif self.data is None:
            raise self._no_folder()
        else:
            rows = KNOWN[self.table].rows(self.data)
        intervals = intervals_of(rows, self.intervals)
        rows, left = self._part(with_names(rows))
        options = ImportOptions(
            missing=self.missing or "refuse", repeated_times=self.repeated_times or "refuse",
            garbled_times=self.garbled_times or "refuse",
            allow_code=self.allow_code, skip_unreadable=self.skip_unreadable,
            overwrite=self.overwrite,
        )  # fmt: skip
        made = import_rows(
            rows, self.output, code_dir=table.parent, intervals=intervals, options=options,
            progress=progress, on_file=on_file,
        )  # fmt: skip
        marks = [interval for own in intervals.values() for interval in own]
        return made, [*_notes([*rows, *marks]), *left]

    def _part(self, rows: Sequence[Row]) -> tuple[list[Row], list[str]]:
        """Return the rows that are imported, and a line on the others, if there are any."""
        if self.at_most is None:
            return list(rows), []
        part, line = spread(rows, self.at_most, self.of)
        return part, [line] if line else []

    def _no_folder(self) -> BadInput:
        return BadInput(
            f"the folder of the data set {self.table}", "none", "name it with --data FOLDER"
        )

    def _import_lerobot(self, progress: Callable[[int, int], None]) -> tuple[list[Path], list[str]]:
        if self.data is None:
            raise self._no_folder()
        need_packages("pyarrow", "cv2", purpose="LeRobot data sets")
        from taxel.exchange.lerobot_read import import_lerobot

        made = import_lerobot(self.data, self.output, overwrite=self.overwrite, progress=progress)
        return made, []

    def _import_videos(self, progress: Callable[[int, int], None]) -> tuple[list[Path], list[str]]:
        from taxel.recordings.imports.video_rows import read_video_rows

        try:
            from taxel.recordings.imports.videos import import_videos
        except ModuleNotFoundError as error:
            raise MissingExtra(error.name or "cv2", "camera", "videos") from error
        if self.table not in KNOWN_VIDEOS:
            table = Path(self.table)
            rows = read_video_rows(table, self.data or table.parent, outside=self.allow_outside)
        elif self.data is None:
            raise self._no_folder()
        else:
            rows = KNOWN_VIDEOS[self.table](self.data)
        rows, left = self._part(rows)
        uneven: list[Video] = []
        same: list[Pair] = []
        made = import_videos(
            rows, self.output, overwrite=self.overwrite, progress=progress,
            on_uneven=uneven.append, on_same=same.append,
        )  # fmt: skip
        alike = same_notes(Counter(same), len(made))
        return made, [*_notes(rows), *_uneven_note(uneven), *alike, *left]


def _notes(parts: Sequence[ImportRow | VideoRow | Interval]) -> list[str]:
    """Return a line for each lot of labels or groups that may be one, or that may be none."""
    labels, groups = [part.labels for part in parts], [part.groups for part in parts]
    return [
        *look_alikes("label", labels), *unknown_words("label", labels),
        *look_alikes("group", groups), *unknown_words("group", groups),
    ]  # fmt: skip


def _gone_note(earlier: Sequence[str], made: Sequence[Path]) -> list[str]:
    """Return a line on recordings that were in the folder and are not any more, if there are any.

    Args:
        earlier: Names of the recordings that the folder held before.
        made: The recordings that it holds now.
    """
    gone = sorted(set(earlier) - {path.name for path in made})
    if not gone:
        return []
    some = f"the first is {visible(gone[0])}" if gone[1:] else visible(gone[0])
    were = "was" if len(gone) == 1 else "were"
    return [f"{number_of(len(gone), 'earlier recording')} {were} not written again, and removed: "
            f"{some}"]  # fmt: skip


def _uneven_note(videos: Sequence[Video]) -> list[str]:
    """Return a line on videos whose frames are not evenly spaced, if there are any."""
    if not videos:
        return []
    first, more = videos[0], len(videos) - 1
    least_s, most_s = first.steps_s or (0.0, 0.0)
    return [
        f"frames of {visible(first.path.name)}{f' and {more} more' if more else ''} are not "
        f"evenly spaced, {least_s:.3f} to {most_s:.3f} s apart; they were taken as if they were; "
        "where time matters, write the video at one rate first: ffmpeg -i VIDEO -r RATE NEW"
    ]


def _of_videos(table: Path) -> bool:
    """Return whether a table's first line names cameras."""
    from taxel.recordings.imports.video_rows import names_videos

    return names_videos(table_cells(table)[0])
