"""The files of the page: ours, and uPlot; all held in memory.

uPlot's files are its npm package's, unchanged; `static/vendor/vendored.json` says which version,
under which licence, and their digests. Nothing comes from the network. Knows nothing about
servers.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

_OWN = Path(__file__).parent / "static"
VENDORED = _OWN / "vendor"
"""What others wrote, as they published it."""
_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
}


@dataclass(frozen=True, slots=True)
class Asset:
    """One file as it is served."""

    content: bytes
    media_type: str


def load_assets() -> dict[str, Asset]:
    """Return the page's files by name, such as "page.html"."""
    return load_folder(_OWN) | load_folder(VENDORED)


def load_folder(folder: Path) -> dict[str, Asset]:
    """Return a folder's files of a page, by name."""
    return {
        file.name: Asset(file.read_bytes(), _TYPES[file.suffix])
        for file in sorted(folder.iterdir())
        if file.suffix in _TYPES
    }
