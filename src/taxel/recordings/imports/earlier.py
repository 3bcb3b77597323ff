"""The folder that an import fills, and which files of an earlier import it may replace.

Knows nothing about what is imported.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path

from taxel.recordings.reader import how_ended
from taxel.recordings.whole import new_folder

IMPORTED = "imported"
"""How a recording ends that an import wrote."""


@contextmanager
def import_folder(path: Path, names: Collection[str], *, overwrite: bool) -> Iterator[Path]:
    """Give a folder to fill, which gets its name when the block ends well, and else goes.

    Args:
        path: The name.
        names: Files that will be in it.
        overwrite: Replace a folder that holds nothing but files of those names, and recordings of
            earlier imports.

    Raises:
        BadTable: There is something of that name already that is not to be replaced.
        RecordingFailed: The disk refused.
    """
    with new_folder(path, names, overwrite=overwrite, earlier=was_imported) as made:
        yield made


def was_imported(path: Path) -> bool:
    """Return whether a file is a whole recording that an import wrote, and nothing changed since.

    What `taxel record` recorded and `taxel label` labelled is none.
    """
    try:
        return path.suffix == ".mcap" and how_ended(path) == IMPORTED
    except ValueError:  # damaged, unfinished or no recording
        return False
