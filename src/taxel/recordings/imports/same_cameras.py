"""Cameras of a trial that show the same images, as where one file was named for both.

Knows nothing about files or pixels.
"""

from __future__ import annotations

from collections.abc import Mapping

from taxel.plain_text import number_of, visible

Pair = tuple[str, str]
"""Names of two cameras of one trial."""


def same_notes(found: Mapping[Pair, int], trials: int) -> list[str]:
    """Return a warning for each pair of cameras that show the same images.

    Args:
        found: Pair → in how many trials all of their images are alike.
        trials: How many there are.
    """
    return [
        f"warning: the cameras {visible(first)} and {visible(second)} show the same images in "
        f"{count} of {number_of(trials, 'trial')}; give each the files of its own"
        for (first, second), count in found.items()
    ]
