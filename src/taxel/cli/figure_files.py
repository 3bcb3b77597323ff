"""Where verbs put figures: a name that fits, and a file that is there as a whole or not at all."""

from __future__ import annotations

import os
from pathlib import Path

from taxel.errors import BadInput, MissingExtra, RecordingFailed


def need_figures(path: Path) -> None:
    """Check, before anything is read, that a figure can be drawn and named so.

    Raises:
        MissingExtra: There is no matplotlib.
        BadInput: The name does not end in .png.
    """
    if path.suffix.lower() != ".png":
        raise BadInput("a name that ends in .png for the figure", str(path), "rename it")
    try:
        import matplotlib  # noqa: F401
    except ModuleNotFoundError as error:
        raise MissingExtra("matplotlib", "train", "figures") from error


def write_whole(path: Path, data: bytes) -> None:
    """Write a file so that it is there as a whole or not at all.

    Raises:
        RecordingFailed: The disk refused.
    """
    part = path.with_name(path.name + ".part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part.write_bytes(data)
        os.replace(part, path)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise RecordingFailed(
            f"needed to write {path}; got {error.strerror or error}; choose another place."
        ) from error
