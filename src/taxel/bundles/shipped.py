"""Bundles that come with taxel, so that every command has something to run.

Knows nothing about what they predict.
"""

from __future__ import annotations

from pathlib import Path

from taxel.errors import BadBundle

_FOLDER = Path(__file__).with_name("ready")
CUP_POUR = "cup-pour"
"""Watches `sim://cup-pour`; how it was made stands in docs/decisions/0017."""


def shipped_bundle(name: str) -> Path:
    """Return the file of a bundle that comes with taxel.

    Raises:
        BadBundle: There is none of that name.
    """
    path = _FOLDER / f"{name}.taxel"
    if not path.exists():
        known = ", ".join(sorted(path.stem for path in _FOLDER.glob("*.taxel"))) or "none"
        raise BadBundle(f"a bundle that comes with taxel ({known})", repr(name), "name a file")
    return path


def find_bundle(path: Path) -> Path:
    """Return the file that a user names: their own, or one that comes with taxel by its bare name.

    A file that exists goes first; a name that is neither is returned as it is, so that reading
    it says what is wrong.
    """
    ready = _FOLDER / f"{path.name}.taxel"
    bare = path.parent == Path() and not path.suffix
    return ready if bare and not path.exists() and ready.exists() else path
