"""Open MATLAB's .mat files of version 4 (saved with -v4; PhysioNet and older programs write them).

A file is nothing but matrices of two axes, one after another: a head of 20 bytes, a name, and the
values as they are. So a reader of our own, which holds each head against the file's size, needs no
child process and no package. Numbers and texts are taken; sparse and complex matrices, and those of
computers that are no longer built, are refused by name. Knows nothing about what the arrays mean.

Source:
    MathWorks, "MAT-File Format", version 4.

Background of our choices: docs/decisions/0033.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadFile
from taxel.foreign.files import MIB, open_file, refuse_larger, size_of
from taxel.foreign.held_arrays import MOST_NAMES, Held, Numbers, Texts
from taxel.foreign.mat_file import LARGEST_MAT, MOST_VARIABLES
from taxel.foreign.npz_file import plain_text_of

HEAD = 20
"""Bytes before a matrix's name: kind, rows, columns, whether it is complex, letters of its name."""
_LONGEST_NAME = 256
"""Bytes, the zero at its end among them; MATLAB itself writes at most 64. Source: our choice."""
_STORED = {0: "f8", 1: "f4", 2: "i4", 3: "i2", 4: "u2", 5: "u1"}
"""Digit of tens in a kind → NumPy's letters."""
_TEXT, _SPARSE = 1, 2
_MOST_TEXT = 64 * MIB
_MENDS = {
    "a sparse array": "save full(…) of it",
    "complex numbers": "save their real part or their amplitude",
}
"""What is not taken → what to do."""
_ORDERS = {0: "<", 1: ">"}
"""Digit of thousands → the order of bytes; 2 to 4 are VAX and Cray."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Matrix:
    """Where one matrix lies, and how it is stored."""

    place: int
    """Of its first value, bytes from the file's start."""
    rows: int
    columns: int
    stored: np.dtype[Any]
    is_text: bool
    refused: str
    """What it is where it is not taken; or empty."""

    @property
    def count(self) -> int:
        return self.rows * self.columns


class Mat4File:
    """A .mat file of version 4."""

    def __init__(self, path: Path) -> None:
        self._file = open_file(path)
        self._kept: tuple[str, NDArray[Any]] | None = None
        try:
            size = size_of(self._file)
            refuse_larger(path, size, LARGEST_MAT)
            self._matrices = _walk(self._file, size)
        except BaseException:
            self._file.close()
            raise

    def names(self) -> Sequence[str]:
        """Return the names of the matrices."""
        return list(self._matrices)

    def get(self, name: str) -> Held:
        """Return a matrix of numbers, or texts.

        Raises:
            KeyError: There is none of that name.
            BadFile: It is of a kind that is not taken.
        """
        matrix = self._matrices[name]
        if matrix.refused:
            raise BadFile("real numbers or texts", f"{name}: {matrix.refused}",
                          _MENDS[matrix.refused])  # fmt: skip
        if matrix.is_text:
            return self._texts(name, matrix)
        shape = (matrix.rows, matrix.columns)
        return Numbers(shape, matrix.stored.newbyteorder("="), lambda at: self._array(name)[at])

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def _array(self, name: str) -> NDArray[Any]:
        """Return a matrix of numbers; the last one is kept, for its next piece."""
        if self._kept is None or self._kept[0] != name:
            self._kept = (name, self._read(self._matrices[name]))
        return self._kept[1]

    def _read(self, matrix: _Matrix) -> NDArray[Any]:
        """Return a matrix's values, which go down the columns."""
        self._file.seek(matrix.place)
        content = self._file.read(matrix.count * matrix.stored.itemsize)
        if len(content) < matrix.count * matrix.stored.itemsize:  # it shrank meanwhile
            raise _damaged("a matrix that is cut short")
        stored = np.frombuffer(content, matrix.stored)
        native = stored.astype(matrix.stored.newbyteorder("="), copy=False)
        return native.reshape((matrix.rows, matrix.columns), order="F")

    def _texts(self, name: str, matrix: _Matrix) -> Texts:
        """Return a text for each row of a matrix of letters, which are stored as numbers."""
        if matrix.rows > MOST_NAMES or matrix.count * matrix.stored.itemsize > _MOST_TEXT:
            raise _damaged(f"{name} of {matrix.rows:,} texts of {matrix.columns:,} letters")
        letters = self._read(matrix)
        if not ((letters >= 0) & (letters <= 0xFFFF)).all():  # NaN is not, either
            raise _damaged(f"{name} with a number that is no letter")
        words = (bytes(row.astype("<u2")).decode("utf-16-le", "replace") for row in letters)
        return Texts(tuple(map(plain_text_of, words)) or ("",))


def is_version_4(head: bytes) -> bool:
    """Return whether a .mat file begins as one of version 4 does.

    Version 4 has no sign of its own. By the format, a zero among the first four bytes distinguishes
    it from version 5, whose version and order of bytes stand at 124.
    """
    return 0 in head[:4] and head[124:128] not in (b"\0\1IM", b"\1\0MI")


def _walk(file: BinaryIO, size: int) -> dict[str, _Matrix]:
    """Return where each matrix lies, by its name; of two of a name, the later one."""
    found: dict[str, _Matrix] = {}
    place = order = count = 0
    while place < size:
        count += 1
        if count > MOST_VARIABLES:  # however few names they have
            raise BadFile(f"at most {MOST_VARIABLES:,} variables", "more", "split the file")
        file.seek(place)
        head = file.read(HEAD)
        if len(head) < HEAD:
            raise _damaged("a matrix that is cut short") if place else not_matlab()
        if not place:
            order = _order_of(head)
        kind, rows, columns, is_complex, letters = np.frombuffer(
            head, f"{_ORDERS[order]}i4"
        ).tolist()
        thousands, hundreds, tens, ones = (kind // 10**power % 10 for power in (3, 2, 1, 0))
        if not (
            0 <= kind < 10_000 and thousands == order and hundreds == 0 and tens in _STORED
            and ones <= _SPARSE and rows >= 0 and columns >= 0 and is_complex in (0, 1)
            and 0 < letters <= _LONGEST_NAME
        ):  # fmt: skip
            got = f"a matrix of the kind {kind}, {rows} × {columns}"
            raise _damaged(got) if place else not_matlab()
        stored = np.dtype(f"{_ORDERS[order]}{_STORED[tens]}")
        name = file.read(letters).split(b"\0")[0].decode("latin-1")
        place += HEAD + letters
        length = rows * columns * stored.itemsize * (1 + is_complex)
        if length > size - place:
            raise _damaged(f"{name or 'a matrix'} of {length:,} bytes of {max(size - place, 0):,}")
        refused = "a sparse array" if ones == _SPARSE else "complex numbers" if is_complex else ""
        found[name] = _Matrix(place=place, rows=rows, columns=columns, stored=stored,
                              is_text=ones == _TEXT, refused=refused)  # fmt: skip
        place += length
    found.pop("", None)
    return found


def _order_of(head: bytes) -> int:
    """Return the digit that says in which order a file's bytes are, from its first kind."""
    for order, letter in _ORDERS.items():
        kind = int(np.frombuffer(head, f"{letter}i4", 1)[0])
        if kind // 1000 == order and 0 <= kind < 10_000:
            return order
        if 2 <= kind // 1000 <= 4 and kind % 1000 < 100:
            raise BadFile("a .mat file of a computer with IEEE numbers", "one of a VAX or a Cray",
                          "load and save it anew, with scipy.io.loadmat and savemat")  # fmt: skip
    raise not_matlab()


def not_matlab() -> BadFile:
    """Return the refusal of a file that only its ending calls MATLAB's."""
    return BadFile("a .mat file of MATLAB's version 4, 5 or 7.3", "another kind of file",
                   "save it with save(…, '-v7')")  # fmt: skip


def _damaged(got: str) -> BadFile:
    return BadFile("a whole .mat file of MATLAB's version 4", got, "copy it again")
