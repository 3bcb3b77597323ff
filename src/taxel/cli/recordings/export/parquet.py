"""`taxel export parquet`: tables of scans, frames and marks."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import tyro

from taxel.cli.printing import counted, print_json, say
from taxel.cli.recordings.export.need import need_packages
from taxel.recordings.reader import list_recordings


@dataclass(frozen=True)
class Parquet:
    """Write Parquet tables of each recording: scans, frames and marks, nothing resampled.

    NAME.scans.parquet has the times, the counter, and for each channel a column of values and one
    of flags; NAME.frames.parquet the cameras' images (JPEG, depth as PNG) and times;
    NAME.marks.parquet labels and groups.
    """

    recordings: tyro.conf.Positional[Path]
    """A recording, or a folder of them."""
    output: Path
    """Folder to create."""
    overwrite: bool = False
    """Replace an older folder of the same kind."""
    json: bool = False
    """Print what was written as JSON."""

    def run(self) -> None:
        """Write the tables, all or none."""
        need_packages("pyarrow", purpose="Parquet tables")
        from taxel.exchange.parquet_tables import write_tables

        paths = list_recordings(self.recordings)
        with counted("exporting", len(paths)) as progress:
            found = write_tables(paths, self.output, overwrite=self.overwrite, progress=progress)
        if self.json:
            print_json({"output": str(self.output), "tables": found})
            return
        for name, tables in found.items():
            held = ", ".join(f"{count} {kind}" for kind, count in tables.items())
            say(f"{self.output / name}: {held or 'nothing'}")
