"""`taxel export foxglove`: a layout for the viewers."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import tyro

from taxel.cli.printing import print_json, say
from taxel.plain_text import number_of
from taxel.recordings.reader import list_recordings, read_manifest


@dataclass(frozen=True)
class Foxglove:
    """Write a layout for Foxglove and Lichtblick: channels by name, images, map and states.

    The recording itself opens as it is; the layout arranges it. It suits every recording of the
    same array and cameras.
    """

    recordings: tyro.conf.Positional[Path]
    """A recording, or a folder of them, of which the first is used."""
    output: Path
    """The layout (.json)."""
    overwrite: bool = False
    """Replace an older file."""
    json: bool = False
    """Print what was written as JSON."""

    def run(self) -> None:
        """Write the layout, whole or not at all."""
        from taxel.exchange.foxglove_layout import write_layout

        path = list_recordings(self.recordings)[0]
        found = write_layout(self.output, read_manifest(path), overwrite=self.overwrite)
        if self.json:
            print_json({"layout": str(self.output), "shows": found.shows})
            return
        say(f"{self.output}: {number_of(found.panels, 'panel')}; in the viewer: Layout > Import")
