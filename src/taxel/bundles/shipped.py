"""Bundles that come with taxel, so that every command has something to run.

Knows nothing about what they predict.
"""

from __future__ import annotations

from difflib import get_close_matches
from pathlib import Path

from taxel.errors import BadBundle

_FOLDER = Path(__file__).with_name("ready")
CUP_POUR = "cup-pour"
"""Watches two tactile cameras: a forecast of slip, made by `taxel train-slip`. How, and what it is
worth: docs/decisions/0036."""
BOTH_GELS = "slip-both-gels"
"""The same forecast, learned on rigid gels and on gels that shear as layers, by
`taxel train-slip --gel both`. What it is worth: docs/decisions/0037."""
DEFAULT_WARNING = BOTH_GELS
"""What taxel itself starts on two tactile cameras, and what its pages run: nobody knows how a real
gel shears, and `cup-pour` is silent on gels that do (docs/decisions/0037)."""
FORMER = {"slip-forecast": CUP_POUR}
"""Name that a bundle had before → its name."""


def shipped_bundle(name: str) -> Path:
    """Return the file of a bundle that comes with taxel.

    Raises:
        BadBundle: There is none of that name.
    """
    if name in FORMER:
        raise _renamed(name)
    path = _FOLDER / f"{name}.taxel"
    if not path.exists():
        known = ", ".join(sorted(path.stem for path in _FOLDER.glob("*.taxel"))) or "none"
        raise BadBundle(f"a bundle that comes with taxel ({known})", repr(name), "name a file")
    return path


def find_bundle(path: Path) -> Path:
    """Return the file that a user names: their own, or one that comes with taxel by its bare name.

    A file that exists goes first; a name that is neither is returned as it is, so that reading
    it says what is wrong.

    Raises:
        BadBundle: It is a name that a bundle of taxel's had before.
    """
    ready = _FOLDER / f"{path.name}.taxel"
    bare = path.parent == Path() and not path.suffix and not path.exists()
    if bare and path.name in FORMER:
        raise _renamed(path.name)
    return ready if bare and ready.exists() else path


def shipped_like(path: Path) -> str:
    """Return the bare name of a bundle of taxel's that a name is close to; empty if none is."""
    names = sorted(ready.stem for ready in _FOLDER.glob("*.taxel"))
    return next(iter(get_close_matches(path.stem, names, n=1, cutoff=0.8)), "")


def _renamed(name: str) -> BadBundle:
    return BadBundle(FORMER[name], f"the former name {name}", "write it so")
