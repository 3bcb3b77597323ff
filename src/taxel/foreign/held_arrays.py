"""What a file of arrays holds: numbers that are read a piece at a time, texts, and cells of both.

Knows nothing about how any file is written (array_files.py opens them) or what its arrays mean.

Background of our choices: docs/decisions/0011.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from taxel.plain_text import number_of

MOST_NAMES = 100_000
"""Arrays in one file, and texts or cells in one array. Source: our choice."""
_MOST_SHOWN = 8
"""Arrays that a message names. Source: our choice."""
LONGEST_TEXT = 4096
"""Characters of a text in an array. Source: our choice."""


@dataclass(frozen=True, slots=True)
class Numbers:
    """An array of real numbers in a file."""

    shape: tuple[int, ...]
    """In the order in which the file's own program shows it."""
    dtype: np.dtype[Any]
    cut: Callable[[tuple[slice, ...]], NDArray[Any]]
    """Read what a slice for each axis takes."""

    @staticmethod
    def of(array: NDArray[Any]) -> Numbers:
        """Wrap an array, be it in memory or a map of a file."""
        return Numbers(array.shape, array.dtype, lambda places: array[places])

    def part(self, axis: int, start: int, stop: int) -> NDArray[Any]:
        """Return the piece from start to stop along an axis, and all of the others.

        Raises:
            BadFile: The file is damaged there.
        """
        places = [slice(None)] * len(self.shape)
        places[axis] = slice(start, stop)
        return self.cut(tuple(places))

    def whole(self) -> NDArray[Any]:
        """Return all of it, of `shape`.

        Raises:
            BadFile: The file is damaged.
        """
        return self.cut((slice(None),) * len(self.shape))

    def __str__(self) -> str:
        return f"{sides_of(self.shape)} {self.dtype.name}"


@dataclass(frozen=True, slots=True)
class Texts:
    """An array of texts in a file."""

    values: tuple[str, ...]

    def __str__(self) -> str:
        return f"{len(self.values)} texts" if len(self.values) != 1 else "a text"


@dataclass(frozen=True, slots=True)
class Cells:
    """An array of arrays in a file, as MATLAB's cells are."""

    items: tuple[Numbers | Texts, ...]

    def __str__(self) -> str:
        return number_of(len(self.items), "cell")


Held = Numbers | Texts | Cells


class ArrayFile(Protocol):
    """An open file of named arrays."""

    def names(self) -> Sequence[str]:
        """Return the names of all arrays, in the file's order."""

    def get(self, name: str) -> Held:
        """Return an array.

        Raises:
            KeyError: There is none of that name.
            BadFile: It is of a kind that is not taken.
        """

    def close(self) -> None:
        """Close the file; what was read of it before stays."""


def sides_of(shape: Sequence[int]) -> str:
    """Return a shape in words: 600 × 50 × 16."""
    return " × ".join(map(str, shape)) or "a single number"


def bytes_of(shape: Sequence[int], dtype: np.dtype[Any]) -> int:
    """Return what an array takes, bytes."""
    return math.prod(shape) * dtype.itemsize


def table_of(file: ArrayFile) -> str:
    """Return what a file holds, in words: X (600 × 50 × 16 float32), y (600 int64)."""
    names = list(file.names())
    shown = [f"{name or 'an array'} ({_word(file, name)})" for name in names[:_MOST_SHOWN]]
    more = f" and {len(names) - _MOST_SHOWN} more" if len(names) > _MOST_SHOWN else ""
    return (", ".join(shown) or "no array") + more


def _word(file: ArrayFile, name: str) -> str:
    try:
        return str(file.get(name))
    except ValueError as error:  # BadFile: of a kind that is not taken
        return str(getattr(error, "got", error))


def attributes_in(name: str) -> tuple[str, str]:
    """Return the two parts of a name such as trial_1@object; the second is empty without an @."""
    path, _, attribute = name.partition("@")
    return path, attribute
