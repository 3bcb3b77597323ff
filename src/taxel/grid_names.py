"""Names of channels that say where in a grid they lie: r1c1, left_r1c1, row_1_col_2, r1c1_x.

The one place where such names are read, for imports and for models. Knows nothing about values.

Background of our choices: docs/decisions/0060.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

_ROW_AND_COLUMN = r"r(?:ow)?_?([0-9]{1,4})_?c(?:ol)?_?([0-9]{1,4})((?:[^0-9].*)?)"
_APART = re.compile(r"(|.*?[^a-z])" + _ROW_AND_COLUMN, re.IGNORECASE)
_ANYWHERE = re.compile(r"(.*?)" + _ROW_AND_COLUMN, re.IGNORECASE)


class GridPlace(NamedTuple):
    """Where a channel lies by its name."""

    grid: tuple[str, str]
    """What the name holds before and behind row and column: the same for all of one grid."""
    row: int
    column: int


def grid_place(name: str, *, in_words: bool = False) -> GridPlace | None:
    """Return where a channel lies by its name; None where the name does not say it.

    Args:
        name: The channel's.
        in_words: Take also the r of a word for a row, as in skinr1c1, where no other r is: right
            to refuse what may be out of order, wrong to see a grid in sensor1c1.
    """
    place = _APART.fullmatch(name) or (_ANYWHERE.fullmatch(name) if in_words else None)
    return place and GridPlace((place[1], place[4]), int(place[2]), int(place[3]))


def by_rows(names: Sequence[str]) -> bool:
    """Return whether names that say rows and columns do so row by row, grid by grid."""
    found = [place for name in names if (place := grid_place(name, in_words=True))]
    grids = list(dict.fromkeys(place.grid for place in found))
    order = [(grids.index(place.grid), place.row, place.column) for place in found]
    return order == sorted(order)
