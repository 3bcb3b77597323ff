"""Which files a table may name: those of its own folder, unless a person allows others.

A table may come from anybody. What it names is read, its numbers land in recordings that are
passed on, and errors quote its cells; so a table that came with its files has no reason to
reach beyond them (docs/explanation/trust.md). Knows nothing about what the files hold.
"""

from __future__ import annotations

from pathlib import Path

from taxel.errors import BadTable
from taxel.foreign.sheets import file_behind, without_sheet

NO_FILE = "check the path, which is relative to the table, or to --data FOLDER"
"""What to do where a file that a table names is not there, in messages."""


def file_of(cell: str, data_dir: Path, where: str, *, outside: bool = False) -> Path:
    """Return the file that a cell names.

    Args:
        cell: As it stands in the table, relative to the folder.
        data_dir: The table's folder, or the one that was named instead.
        where: Table and line, for the message.
        outside: Also files that are not in the folder: absolute paths, `..`, links that lead out.

    Raises:
        BadTable: The file lies outside the folder, or its name cannot be one.
    """
    try:
        path = data_dir / cell
        file = file_behind(path)
        inside = outside or file.resolve().is_relative_to(data_dir.resolve())
        if inside:
            file.exists()
    except (OSError, ValueError, RuntimeError) as error:  # too long, zero bytes, links in a ring
        raise BadTable("a file's name", f"{cell!r} in {where}", "correct it") from error
    if not inside:
        got = f"{cell!r} in {where}, which lies outside"
        mend = (
            "put the table into a folder that holds all files; taxel import also takes such a "
            "folder with --data, or allows it with --allow-outside"
        )
        if link := _link_out(cell, data_dir):
            got += f", as {link!r} is a link that leads there"
            mend = (
                "copy what it leads to into the folder, or put the table beside the files "
                "themselves; taxel import also takes their folder with --data, or allows it with "
                "--allow-outside"
            )
        raise BadTable(f"a file in the folder {data_dir}", got, mend)
    return path


def _link_out(cell: str, data_dir: Path) -> str:
    """Return the part of a cell, from its beginning, that is a link out of the folder; or empty."""
    parts = Path(without_sheet(cell)).parts
    if Path(cell).is_absolute() or ".." in parts:
        return ""
    inside = data_dir.resolve()
    for number in range(1, len(parts) + 1):
        path = data_dir.joinpath(*parts[:number])
        if path.is_symlink() and not path.resolve().is_relative_to(inside):
            return "/".join(parts[:number])
    return ""
