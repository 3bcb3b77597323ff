"""Files, and folders of recordings, that are there as a whole or not at all.

Knows nothing about what is in them.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryFile

from taxel.errors import BadInput, BadTable, RecordingFailed, not_written
from taxel.held import MADE, REPLACED, scratch_folder


def write_whole(path: Path | str, data: bytes | str) -> None:
    """Write a file, whole or not at all; an older one is replaced. Text is written as UTF-8.

    Raises:
        RecordingFailed: The disk refused.
    """
    with whole_file(Path(path)) as temporary:
        temporary.write_bytes(data.encode("utf-8") if isinstance(data, str) else data)


def check_place(path: Path) -> None:
    """Refuse, before long work, a file that could not be written at its end; nothing is left.

    Raises:
        BadInput: It is a folder, or the nearest folder above it that is there is none or is closed.
    """
    if path.is_dir():
        raise BadInput(f"a file to write, {path.name}", f"the folder {path}", "name another")
    above = next(place for place in path.absolute().parents if os.path.lexists(place))
    if not above.is_dir() or not _takes_files(above):
        got = "which may not be written" if above.is_dir() else "which is no folder"
        raise BadInput(f"a folder to write {path.name} in", f"{above}, {got}", "name another")


def _takes_files(folder: Path) -> bool:
    """Return whether a file can be made in a folder; tried, since root's permissions mislead."""
    if not os.access(folder, os.W_OK | os.X_OK):
        return False
    try:
        with TemporaryFile(dir=folder):  # without a name, where the system knows such files
            return True
    except OSError:
        return False


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Give a file to fill, which gets its name when the block ends well, and else goes.

    It is filled in a folder of its own, since commands that share a cache may write the same file.

    Raises:
        RecordingFailed: The disk refused.
    """
    try:
        with scratch_folder(path, "") as scratch:
            temporary = scratch / MADE
            yield temporary
            os.replace(temporary, path)
    except RecordingFailed:
        raise
    except OSError as error:
        raise not_written(path, error) from error


@contextmanager
def new_folder(
    path: Path,
    names: Collection[str],
    *,
    overwrite: bool,
    earlier: Callable[[Path], bool] | None = None,
) -> Iterator[Path]:
    """Give a folder to fill, which gets its name when the block ends well, and else goes.

    Args:
        path: The name.
        names: Files that will be in it.
        overwrite: Replace a folder that holds nothing but files of those names.
        earlier: Whether a file of another name may go as well, since the same work wrote it before.

    Raises:
        BadTable: There is something of that name already that is not to be replaced.
        RecordingFailed: The disk refused.
    """
    if path.exists():
        _check_replaceable(path, names, overwrite, earlier)
    with whole_folder(path) as made:
        yield made


@contextmanager
def whole_folder(path: Path) -> Iterator[Path]:
    """Give a folder to fill, which gets its name when the block ends well; an older one goes.

    Raises:
        RecordingFailed: The disk refused.
    """
    with scratch_folder(path) as scratch:
        made = scratch / MADE
        with _refused(path):
            made.mkdir()
        yield made
        with _refused(path):
            if path.exists():
                os.replace(path, scratch / REPLACED)
            os.replace(made, path)


@contextmanager
def _refused(path: Path) -> Iterator[None]:
    """Give what the disk refuses in the block as one plain line."""
    try:
        yield
    except OSError as error:
        raise not_written(path, error) from error


@contextmanager
def fresh_folder(path: Path) -> Iterator[Path]:
    """Give a folder to fill, which gets its name when the block ends well; nothing is replaced.

    Raises:
        BadInput: There is something of that name already.
        RecordingFailed: The disk refused.
    """
    if path.exists():
        raise BadInput("a folder that does not exist yet for --output", str(path), "choose another")
    try:
        with scratch_folder(path) as scratch:
            made = scratch / MADE
            made.mkdir()
            yield made
            os.rename(made, path)
    except RecordingFailed:
        raise
    except OSError as error:
        raise not_written(path, error, "choose another place") from error


def _check_replaceable(
    path: Path,
    names: Collection[str],
    overwrite: bool,
    earlier: Callable[[Path], bool] | None,
) -> None:
    if not path.is_dir():
        raise BadTable("a folder for the recordings", f"{path}, a file", "choose another --output")
    held = sorted(file.name for file in path.iterdir())
    if held and not overwrite:
        raise BadTable(
            "a new folder for the recordings", f"{path}, which is not empty",
            "choose another --output, or add --overwrite",
        )  # fmt: skip
    others = [name for name in held if name not in names and not (earlier and earlier(path / name))]
    if others:
        raise BadTable(
            "a folder that holds only recordings of an earlier import, to replace"
            if earlier
            else "a folder that holds only what is written again, to replace",
            f"{path} with {others[0]}" + (f" and {len(others) - 1} more" if others[1:] else ""),
            "move what you need, or choose another --output",
        )
