"""The files of the page: ours, and uPlot from the installed package; all held in memory.

Nothing comes from the network. Knows nothing about servers.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from taxel.errors import MissingExtra

_OWN = Path(__file__).parent / "static"
_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
}
_UPLOT = ("uPlot.iife.js", "uPlot.min.css")
"""uPlot 1.6 (MIT) as the PyPI package uplot-python carries it; its Python part is not imported."""


@dataclass(frozen=True, slots=True)
class Asset:
    """One file as it is served."""

    content: bytes
    media_type: str


def load_assets() -> dict[str, Asset]:
    """Return the page's files by name, such as "page.html".

    Raises:
        MissingExtra: uPlot is not installed.
    """
    files = [*sorted(_OWN.iterdir()), *(_uplot_folder() / name for name in _UPLOT)]
    return {
        file.name: Asset(file.read_bytes(), _TYPES[file.suffix])
        for file in files
        if file.suffix in _TYPES
    }


def _uplot_folder() -> Path:
    spec = find_spec("uplot")
    for place in (spec.submodule_search_locations if spec else None) or ():
        folder = Path(place) / "static"
        if all((folder / name).is_file() for name in _UPLOT):
            return folder
    raise MissingExtra("uplot-python", "page", "the operator's page")
