"""Which axis of an array is which: trials, rows (scans), channels, or the sides of a grid.

Stated in words, or found where one reading only is possible; never guessed. Knows nothing about
files, labels or recordings.

Background of our choices: docs/decisions/0011.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadTable
from taxel.foreign.held_arrays import sides_of
from taxel.plain_text import number_of

TRIALS, ROWS, CHANNELS, HEIGHT, WIDTH, ONE = "trials", "rows", "channels", "height", "width", "1"
PARTS = "parts"
"""A second axis of channels, such as x, y and z of each taxel; no side of a grid."""
WORDS = (TRIALS, ROWS, CHANNELS, HEIGHT, WIDTH, PARTS)
"""What an axis may be called, beside the 1 of an axis of that length."""
_TAXELS = (HEIGHT, WIDTH, CHANNELS, PARTS)
"""Axes that become channels, in the order of the channels' numbers: the last moves fastest."""
_USUAL: dict[bool, dict[int, tuple[tuple[str, ...], ...]]] = {
          True: {2: ((TRIALS, ROWS), (TRIALS, CHANNELS)), 3: ((TRIALS, ROWS, CHANNELS),),
                 4: ((TRIALS, ROWS, HEIGHT, WIDTH),)},
          False: {1: ((ROWS,),), 2: ((ROWS, CHANNELS),), 3: ((ROWS, HEIGHT, WIDTH),)}}  # fmt: skip
"""Whether an array holds many trials → how many axes → what these may be, in some order."""


@dataclass(frozen=True, slots=True)
class Axes:
    """The meaning of each axis of an array, such as trials, rows and channels, in order."""

    words: tuple[str, ...]

    @property
    def trials(self) -> int | None:
        """The axis of the trials; None in an array of a single one."""
        return self.words.index(TRIALS) if TRIALS in self.words else None

    def size(self, shape: Sequence[int], word: str) -> int:
        """Return the length of an axis; 1 where there is none of that name."""
        return shape[self.words.index(word)] if word in self.words else 1

    def channels(self, shape: Sequence[int]) -> int:
        """Return how many channels an array of this shape holds."""
        return math.prod(self.size(shape, word) for word in _TAXELS)

    def names(self, shape: Sequence[int]) -> tuple[str, ...]:
        """Return the channels' names: numbers from 1; in a grid r1c1, r1c2 … by row and column.

        With parts, that of the part follows: 1_1, 1_2 …
        """
        sides = [range(1, self.size(shape, word) + 1) for word in _TAXELS]
        grid, parts = {HEIGHT, WIDTH} & set(self.words), PARTS in self.words
        return tuple(
            "_".join(filter(None, (
                (f"r{row}" if HEIGHT in self.words else "")
                + (f"c{column}" if WIDTH in self.words else ""),
                str(number) if CHANNELS in self.words or not (grid or parts) else "",
                str(part) if parts else "",
            )))
            for row, column, number, part in product(*sides)
        )  # fmt: skip

    def table(self, trial: NDArray[np.generic]) -> NDArray[np.generic]:
        """Return one trial's array in the shape (rows, channels).

        Args:
            trial: Its axis of trials cut to length 1.
        """
        order = [self.words.index(word) for word in (ROWS, *_TAXELS) if word in self.words]
        others = [axis for axis in range(len(self.words)) if axis not in order]
        rows = self.size(trial.shape, ROWS)  # 1 where each trial is a single scan
        return trial.transpose(*others, *order).reshape(rows, self.channels(trial.shape))

    def in_words(self, shape: Sequence[int]) -> str:
        """Return what these axes make of a shape, in words."""
        rows, channels = self.size(shape, ROWS), self.channels(shape)
        trials = (
            f"{number_of(self.size(shape, TRIALS), 'trial')} of " if TRIALS in self.words else ""
        )
        scans = number_of(rows, "scan")
        return f"{trials}{scans} of {number_of(channels, 'channel')}"

    def __str__(self) -> str:
        return " ".join(self.words)


def parse_axes(text: str, where: str) -> Axes:
    """Return the axes of a text such as "trials rows channels".

    Raises:
        BadTable: A word is unknown or is there twice; or rows are missing, though no axis of
            trials and another of channels say that each trial is a single scan.
    """
    words = tuple(text.replace(",", " ").lower().split())
    own = [word for word in words if word != ONE]
    scans = ROWS in own or (TRIALS in own and any(word in own for word in _TAXELS))
    if any(word not in WORDS for word in own) or len(set(own)) < len(own) or not scans:
        raise BadTable(
            f"each axis as one of {', '.join(WORDS)} (or 1, where it has that length), each once, "
            "and rows among them unless each trial is a single scan (trials channels)",
            f"{text[:80]!r} in {where}",
            f"write {PARTS} for the second axis of channels, such as x, y and z of each"
            if own.count(CHANNELS) > 1 and PARTS not in own else "correct the column 'axes'",
        )  # fmt: skip
    return Axes(words)


def check_axes(axes: Axes, shape: Sequence[int], what: str) -> None:
    """Refuse axes that an array of this shape does not have.

    Raises:
        BadTable: They are more or fewer, or the 1 has another length.
    """
    wrong = len(axes.words) != len(shape) or any(
        word == ONE and side != 1 for word, side in zip(axes.words, shape, strict=True)
    )
    if wrong:
        raise BadTable(
            f"as many axes as {what} has", f"'{axes}' for a shape of {sides_of(shape)}",
            "correct the column 'axes'",
        )  # fmt: skip


def find_axes(
    shapes: Sequence[Sequence[int]],
    what: str,
    *,
    many: bool,
    trials: int | None,
    channels: range,
    one_label: bool = False,
) -> Axes:
    """Return the only reading of arrays.

    Args:
        shapes: Of one array of many trials, or of several of one trial each, which have equally
            many channels.
        what: The arrays, for messages.
        many: Whether an array holds many trials.
        trials: How many there are, where labels say so.
        channels: How many channels there may be.
        one_label: Whether the file has one label, so that an array that seems to hold many trials
            may be a single one.

    Raises:
        BadTable: None or several are possible.
    """
    shape = shapes[0]
    possible = _all_readings(shapes, trials, channels, many=many)
    single = (
        _all_readings(shapes, None, channels, many=False)
        if one_label and many and trials is None and len(possible) != 1
        else []
    )
    if len(possible) == 1 or (not possible and len(single) == 1):
        return (possible or single)[0]
    if single:
        readings = f"{_or(single, shape)} if the file is one trial, as its one label suggests"
        if possible:
            readings += f"; {_or(possible[:2], shape)} if it holds many"
        raise _several(what, shape, readings)
    if not possible:
        labels = (
            f", with labels of {number_of(trials, 'trial')}" if trials is not None and many else ""
        )
        raise BadTable(
            f"{'trials, ' if many else ''}rows and channels in {what}",
            f"the shape {sides_of(shape)}{labels}{_wanted(channels)}",
            "say in the column 'axes' what its axes are, as in 'trials rows channels'",
        )
    # The two of most sense first: the trials outermost, as NumPy's users write them.
    raise _several(what, shape, _or(possible[:2], shape))


def _or(found: Sequence[Axes], shape: Sequence[int]) -> str:
    return " or ".join(f"'{axes}' ({axes.in_words(shape)})" for axes in found)


def _several(what: str, shape: Sequence[int], readings: str) -> BadTable:
    return BadTable(
        f"one reading of {what} of shape {sides_of(shape)}", readings,
        "write the right one in the column 'axes'",
    )  # fmt: skip


def _all_readings(
    shapes: Sequence[Sequence[int]], trials: int | None, channels: range, *, many: bool
) -> list[Axes]:
    """Return all readings of arrays, those of most sense first."""
    usual = _USUAL[many].get(len(shapes[0]), ())
    alike = all(len(other) == len(shapes[0]) for other in shapes)
    return [axes for words in usual if alike
            for axes in _readings(words, shapes, trials, channels)]  # fmt: skip


def _wanted(channels: range) -> str:
    if len(channels) == 1:
        return f" and {number_of(channels[0], 'channel')}"
    return f" and at least {number_of(channels[0], 'channel')}" if channels[0] > 1 else ""


def _readings(
    usual: Sequence[str], shapes: Sequence[Sequence[int]], trials: int | None, channels: range
) -> Iterator[Axes]:
    for words in permutations(usual):
        if HEIGHT in words and words.index(HEIGHT) > words.index(WIDTH):
            continue
        axes = Axes(words)
        if trials is not None and TRIALS in words and axes.size(shapes[0], TRIALS) != trials:
            continue
        counts = {axes.channels(shape) for shape in shapes}
        if len(counts) == 1 and counts.pop() in channels:
            yield axes
