"""A folder of files and folders that is there as a whole or not at all.

Knows nothing about what is in it.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path

from taxel.errors import BadInput, RecordingFailed
from taxel.recordings.whole import whole_folder


@contextmanager
def new_tree(path: Path, sign: str, kinds: Collection[str], *, overwrite: bool) -> Iterator[Path]:
    """Give a folder to fill, which gets its name when the block ends well, and else goes.

    Args:
        path: The name.
        sign: A file that every such folder has; a folder without it is never replaced.
        kinds: Names, or their endings, of all files that such a folder is made of; a folder with
            others is not replaced, as they are somebody's own.
        overwrite: Replace an older folder of the same kind.

    Raises:
        BadInput: There is something of that name that is not to be replaced.
        RecordingFailed: The disk refused.
    """
    if path.exists() and (not path.is_dir() or any(path.iterdir())):
        if not overwrite:
            raise BadInput("a new folder for what is exported", f"{path}, which exists",
                           "choose another --output, or add --overwrite")  # fmt: skip
        if not (path / sign).is_file():
            raise BadInput(f"a folder with {sign}, to replace", f"{path}, which is another",
                           "choose another --output")  # fmt: skip
        known = {sign, *kinds}
        others = [
            name for name, file in _files_in(path) if not {name, file.name, file.suffix} & known
        ]
        if others:
            raise BadInput(
                "a folder that holds only what was exported, to replace",
                f"{path} with {others[0]}" + (f" and {len(others) - 1} more" if others[1:] else ""),
                "move what you need, or choose another --output",
            )  # fmt: skip
    try:
        with whole_folder(path) as made:
            yield made
    except RecordingFailed:
        raise
    except OSError as error:
        raise RecordingFailed(
            f"needed room to write {path}; got {error.strerror or error}; "
            "free space or choose another folder, then start again."
        ) from error


def _files_in(folder: Path) -> list[tuple[str, Path]]:
    """Return all files in a folder and those below, with their names relative to it, in order."""
    return [
        (file.relative_to(folder).as_posix(), file)
        for file in sorted(folder.rglob("*"))
        if file.is_symlink() or not file.is_dir()
    ]
