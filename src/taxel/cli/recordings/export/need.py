"""What exports share: the packages that they need, and what their format cannot hold."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

from taxel.errors import MissingExtra
from taxel.recordings.reader import read_manifest
from taxel.signals import DEPTH_PNG


def need_packages(*names: str, purpose: str) -> None:
    """Refuse a format whose packages are not installed.

    Raises:
        MissingExtra: One is not.
    """
    for name in names:
        try:
            import_module(name)
        except ModuleNotFoundError as error:
            raise MissingExtra(name, "export", purpose) from error


def depth_cameras(paths: Sequence[Path]) -> list[str]:
    """Return the names of all cameras of depth, which formats of 8 bits a colour leave out.

    Raises:
        BadRecording: One is damaged or cut short.
    """
    seen = [camera for path in paths for camera in read_manifest(path).cameras]
    return list(dict.fromkeys(camera.name for camera in seen if camera.coding == DEPTH_PNG))


def depth_line(names: Sequence[str]) -> str:
    """Return a note on depth cameras, which are left out."""
    return f"left out: {', '.join(names)}: depth has 16 bits; export ros2 and parquet keep it"
