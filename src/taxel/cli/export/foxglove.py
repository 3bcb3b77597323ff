"""`taxel export foxglove`: a layout for the viewers."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import tyro

from taxel.cli.printing import print_json, say
from taxel.errors import BadInput
from taxel.recordings.reader import list_recordings, read_manifest
from taxel.recordings.whole import write_whole


@dataclass(frozen=True)
class Foxglove:
    """Write a layout for Foxglove and Lichtblick: channels by name, images, map and states.

    The recording itself opens as it is; the layout arranges it. It suits every recording of the
    same array and cameras.
    """

    recordings: tyro.conf.Positional[Path]
    """A recording, or a folder of them, of which the first is looked at."""
    output: Path
    """The layout (.json)."""
    overwrite: bool = False
    """Replace an older file."""
    json: bool = False
    """Print what was written as JSON."""

    def run(self) -> None:
        """Write the layout, whole or not at all."""
        from taxel.exchange.foxglove_layout import layout_of, paths_of

        if self.output.exists() and not self.overwrite:
            raise BadInput("a new file for the layout", f"{self.output}, which exists",
                           "add --overwrite")  # fmt: skip
        path = list_recordings(self.recordings)[0]
        layout = layout_of(read_manifest(path))
        write_whole(self.output, json.dumps(layout, indent=1, ensure_ascii=False).encode())
        if self.json:
            print_json({"layout": str(self.output), "shows": paths_of(layout)})
            return
        say(f"{self.output}: {len(layout['configById'])} panels; in the viewer: Layout > Import")
