"""Where verbs put figures: a name that fits, and what draws them."""

from __future__ import annotations

from pathlib import Path

from taxel.errors import BadInput, MissingExtra


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
