"""`taxel import`: turn tables of values into recordings."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import tyro
from rich.console import Console
from rich.progress import Progress

from taxel.errors import BadInput, MissingExtra
from taxel.recordings.importing import ImportOptions, import_rows, import_table
from taxel.recordings.known import KNOWN, KNOWN_VIDEOS


@dataclass(frozen=True)
class Import:
    """Turn tables of values, or pairs of videos, into recordings, one file a recording.

    TABLE is a CSV with one row a file and these columns: file (relative to
    the table), label:NAME and group:NAME as many as you like, channels
    ("Data0[count] Data1[count] 7[deg]": name or number from 1, and unit),
    time ("Timestamp[ms]", in s, ms, us or ns; or "rate:100Hz"), and where
    wanted layout (csv, icub, or module.py:function), sensor (its name) and
    full_scale (where it saturates). Files: .csv, .csv.gz, .npy. For tactile
    cameras: left and right (videos relative to the table), label:NAME,
    group:NAME, and where wanted rate (Hz) and mm_per_px. Instead of a table,
    the name of a public data set: teng-glove, icub-grasp, gelsight-slip.
    """

    table: tyro.conf.Positional[str]
    """The import table (CSV), or the name of a public data set: teng-glove, icub-grasp,
    gelsight-slip."""
    output: Path
    """Folder to be made for the recordings."""
    data: Path | None = None
    """Folder of the files; by default the table's own."""
    missing: Literal["refuse", "keep"] = "refuse"
    """Empty cells, NaN and infinity: refuse the file, or keep them flagged as invalid."""
    allow_code: bool = False
    """Run layouts of the form module.py:function; they can do whatever you can."""
    overwrite: bool = False
    """Replace an existing output folder."""
    json: bool = False
    """Print the recordings' paths as JSON."""

    def run(self) -> None:
        """Import everything, or nothing at all."""
        with Progress(console=Console(stderr=True), transient=True) as progress:
            bar = progress.add_task("importing", total=None)
            made = self._import(lambda done, of: progress.update(bar, completed=done, total=of))
        if self.json:
            print(json.dumps({"recordings": [str(path) for path in made]}))
        else:
            print(f"{self.output}: {len(made)} recordings; next: taxel info {self.output}")

    def _import(self, progress: Callable[[int, int], None]) -> list[Path]:
        options = ImportOptions(
            missing=self.missing, allow_code=self.allow_code, overwrite=self.overwrite
        )
        if self.table in KNOWN_VIDEOS or _of_videos(Path(self.table)):
            return self._import_videos(progress)
        if self.table not in KNOWN:
            return import_table(
                Path(self.table), self.output, data_dir=self.data, options=options,
                progress=progress,
            )  # fmt: skip
        if self.data is None:
            raise BadInput(
                f"the folder of the data set {self.table}", "none", "name it with --data FOLDER"
            )
        rows = KNOWN[self.table].rows(self.data)
        return import_rows(rows, self.output, options=options, progress=progress)

    def _import_videos(self, progress: Callable[[int, int], None]) -> list[Path]:
        from taxel.recordings.video_rows import read_video_rows

        try:
            from taxel.recordings.videos import import_videos
        except ModuleNotFoundError as error:
            raise MissingExtra(error.name or "cv2", "camera", "videos") from error
        if self.table not in KNOWN_VIDEOS:
            table = Path(self.table)
            rows = read_video_rows(table, self.data or table.parent)
        elif self.data is None:
            raise BadInput(
                f"the folder of the data set {self.table}", "none", "name it with --data FOLDER"
            )
        else:
            rows = KNOWN_VIDEOS[self.table](self.data)
        return import_videos(rows, self.output, overwrite=self.overwrite, progress=progress)


def _of_videos(table: Path) -> bool:
    """True where a table's first line names a left camera's video."""
    try:
        with table.open(errors="replace") as file:
            return "left" in [name.strip() for name in file.readline().split(",")]
    except OSError:
        return False
