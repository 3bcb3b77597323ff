"""`taxel recover`: save what is sound in a damaged or unfinished recording."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import tyro

from taxel.cli.printing import print_json, progress, say
from taxel.plain_text import number_of
from taxel.recordings.recovery import recover


@dataclass(frozen=True)
class Recover:
    """Save the intact part of a recording that was cut short or damaged.

    Every chunk whose check sum holds is kept (the recorder makes one every
    0.05 s); nothing is guessed. The damaged file is left as it is.
    """

    file: tyro.conf.Positional[Path]
    """The damaged recording, or the .mcap.part of one that was not finished."""
    output: Path
    """The new recording, ending in .mcap."""
    overwrite: bool = False
    """Replace an existing output."""
    json: bool = False
    """Print the report as JSON."""

    def run(self) -> None:
        """Recover, then print what was saved and what was lost."""
        with progress() as bars:
            bar = bars.add_task(f"recovering {self.file.name}, %", total=100)
            report = recover(
                self.file,
                self.output,
                overwrite=self.overwrite,
                progress=lambda share: bars.update(bar, completed=int(100 * share)),
            )
        if self.json:
            print_json({"recording": str(self.output), **report.as_dict()}, indent=None)
            return
        say(
            f"{self.output}: {number_of(report.scans, 'scan')}, "
            f"{number_of(report.frames, 'frame')} and {number_of(report.marks, 'mark')} "
            f"saved; {number_of(report.damaged_stretches, 'damaged stretch')}, "
            f"{number_of(report.bytes_skipped, 'byte')} skipped, {report.time_lost_s:.3f} s "
            "lost between them"
        )
        for note in report.notes:
            say(note)
