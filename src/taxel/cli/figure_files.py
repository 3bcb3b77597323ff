"""Where verbs put figures: a name that fits, and what draws them."""

from __future__ import annotations

from pathlib import Path

from taxel.errors import BadInput, MissingExtra
from taxel.recordings.whole import check_place


def need_figures(path: Path) -> None:
    """Check, before anything is read, that a figure can be drawn, named so and written there.

    Raises:
        MissingExtra: There is no matplotlib.
        BadInput: The name does not end in .png, or no file can be made there.
    """
    if path.suffix.lower() != ".png":
        raise BadInput("a name that ends in .png for the figure", str(path), "rename it")
    check_place(path)
    try:
        import matplotlib  # noqa: F401
    except ModuleNotFoundError as error:
        raise MissingExtra("matplotlib", "train", "figures") from error
