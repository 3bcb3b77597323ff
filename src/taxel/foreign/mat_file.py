"""Open MATLAB's .mat files of version 5 (saved with -v6 or -v7, MATLAB's own default).

A reader of our own, since what a packed variable unpacks to is bounded here, cells within cells
are counted, and no package is needed. Numbers, texts, cells of both, and structures of them
(data.force) are taken; sparse arrays, objects and functions are refused by name. Version 7.3 is
HDF5 (hdf5_file.py). Knows nothing about what the arrays mean.

Source:
    MathWorks, "MAT-File Format", version 5.

Background of our choices: docs/decisions/0011.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, BinaryIO, NoReturn

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadFile
from taxel.foreign.archives import LARGEST_ARRAYS
from taxel.foreign.files import MIB, in_words, open_file, refuse_larger, size_of
from taxel.foreign.held_arrays import MOST_NAMES, Cells, Held, Numbers, Texts
from taxel.foreign.npz_file import plain_text_of
from taxel.plain_text import number_of

LARGEST_MAT = LARGEST_ARRAYS
"""Bytes of a file, and of what a variable unpacks to; the format itself ends at twice as much."""
HEAD = 128
"""Bytes before the first variable."""
MOST_VARIABLES = 4096
_DEEPEST = 16
"""Structures within structures that a name may lead through. Source: our choice."""
_MATRIX, _PACKED = 14, 15
_STORED = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8",
           13: "u8"}  # fmt: skip
"""Kind of an element → NumPy's letters."""
_TEXT = {1: "latin-1", 2: "latin-1", 4: "utf-16", 16: "utf-8", 17: "utf-16", 18: "utf-32"}
_CELL, _STRUCT, _OBJECT, _CHAR, _SPARSE = 1, 2, 3, 4, 5
_CLASSES = {6: "f8", 7: "f4", 8: "i1", 9: "u1", 10: "i2", 11: "u2", 12: "i4", 13: "u4", 14: "i8",
            15: "u8"}  # fmt: skip
_OTHERS = {_OBJECT: "an object", _SPARSE: "a sparse array", 16: "a function",
           17: "an object (a string array, a table or a categorical array)"}  # fmt: skip
_COMPLEX, _LOGICAL = 0x08, 0x02
_HEAD_BYTES = 65_536
"""Unpacked of a variable to know its name and shape, and 1,000 fields of a structure."""


@dataclass(frozen=True, slots=True)
class _Variable:
    """Where one variable lies in the file: offset and size in bytes, packed by zlib or not."""

    place: int
    size: int
    packed: bool


@dataclass(frozen=True, slots=True)
class _Matrix:
    """A matrix's class, flags, shape and name, and the bytes of its values."""

    kind: int
    flags: int
    shape: tuple[int, ...]
    name: str
    rest: memoryview


class MatFile:
    """A .mat file of version 5."""

    def __init__(self, path: Path) -> None:
        self._file = open_file(path)
        self._kept: tuple[str, _Matrix] | None = None
        try:
            size = size_of(self._file)
            refuse_larger(path, size, LARGEST_MAT)
            head = self._file.read(HEAD)
            self._order = {b"IM": "<", b"MI": ">"}.get(head[126:128], "")
            if len(head) < HEAD or not self._order:
                _no_mat("another kind of file", "save it with save(…, '-v7')")
            self._variables: dict[str, _Variable] = {}
            self._heads: dict[str, _Matrix] = {}
            self._shown: dict[str, list[str]] = {}
            for variable in self._walk(self._file, size):
                found, fields = self._peek(variable)
                if found.name:
                    self._variables[found.name] = variable
                    self._heads[found.name] = replace(found, rest=memoryview(b""))
                    self._shown[found.name] = fields
        except BadFile:
            self._file.close()
            raise
        except _BROKEN as error:
            self._file.close()
            raise _broken(error) from error

    def names(self) -> Sequence[str]:
        """Return the variables' names; of a structure, its fields' as data.force."""
        return [
            f"{name}.{field}" if field else name
            for name, fields in self._shown.items()
            for field in fields or [""]
        ]

    def get(self, name: str) -> Held:
        """Return a variable, or a field of a structure: data.force.

        Raises:
            KeyError: There is none of that name.
            BadFile: It is damaged, or of a kind that is not taken.
        """
        variable, _, field = name.partition(".")
        if variable not in self._variables or field.count(".") > _DEEPEST:
            raise KeyError(name)
        try:
            head = self._heads[variable]
            if head.kind in _CLASSES and not head.flags & _COMPLEX and not field:
                return Numbers(head.shape, _dtype_of(head), lambda at: self._array(name)[at])
            matrix = self._matrix(variable)
            if matrix.kind == _STRUCT:
                return self._field(matrix, field, name)
            if field:
                raise _no_field(matrix, name)
            return self._held(matrix)
        except BadFile as error:
            raise BadFile(error.needed, f"{name}: {error.got}", error.mend) from error
        except KeyError:
            raise
        except _BROKEN as error:
            raise _broken(error) from error

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def _array(self, name: str) -> NDArray[Any]:
        """Return a variable of numbers; the last one is kept, for its next piece."""
        try:
            return self._numbers(self._matrix(name))
        except BadFile as error:
            raise BadFile(error.needed, f"{name}: {error.got}", error.mend) from error
        except _BROKEN as error:
            raise _broken(error) from error

    def _walk(self, file: BinaryIO, size: int) -> Iterator[_Variable]:
        place = HEAD
        while place + 8 <= size:
            file.seek(place)
            kind, length = self._words(file.read(8))
            place += 8
            if kind not in (_MATRIX, _PACKED) or length > size - place:
                _no_mat(
                    f"a part of the kind {kind} with {number_of(length, 'byte', ',')} of "
                    f"{size - place:,}"
                )
            yield _Variable(place, length, kind == _PACKED)
            place += length if kind == _PACKED else -(-length // 8) * 8

    def _peek(self, variable: _Variable) -> tuple[_Matrix, list[str]]:
        """Return a variable's head, and the names of its fields if it is a structure."""
        if len(self._variables) > MOST_VARIABLES:
            raise BadFile(f"at most {MOST_VARIABLES:,} variables", "more", "split the file")
        self._file.seek(variable.place)
        if variable.packed:
            packed = self._file.read(min(variable.size, _HEAD_BYTES))
            content = zlib.decompressobj().decompress(packed, _HEAD_BYTES)[8:]
        else:
            content = self._file.read(min(variable.size, _HEAD_BYTES))
        matrix = self._head(memoryview(content))
        return matrix, self._fields(matrix)[0] if matrix.kind == _STRUCT else []

    def _matrix(self, name: str) -> _Matrix:
        if self._kept is not None and self._kept[0] == name:
            return self._kept[1]
        variable = self._variables[name]
        self._file.seek(variable.place)
        content = self._file.read(variable.size)
        if variable.packed:
            unpacker = zlib.decompressobj()
            content = unpacker.decompress(content, LARGEST_MAT + 1)
            if len(content) > LARGEST_MAT:
                raise BadFile(
                    f"variables of at most {in_words(LARGEST_MAT)}", "a larger one",
                    "save it with save(…, '-v7.3')",
                )  # fmt: skip
            if not unpacker.eof:  # its check sum stands at the end
                _no_mat("a variable that is cut short")
            kind, length = self._words(content[:8])
            if kind != _MATRIX or length > len(content) - 8:
                _no_mat("a variable that is cut short")
            content = content[8 : 8 + length]
        matrix = self._head(memoryview(content))
        self._kept = (name, matrix)
        return matrix

    def _words(self, content: bytes | memoryview) -> tuple[int, int]:
        kind, length = np.frombuffer(content, f"{self._order}u4", 2).tolist()
        return kind, length

    def _part(self, content: memoryview) -> tuple[int, memoryview, memoryview]:
        """Return an element's kind, its bytes, and what follows."""
        kind, length = self._words(content)
        if kind >> 16:  # a small one: both words in the first, its bytes in the second
            kind, length = kind & 0xFFFF, kind >> 16
            if length > 4:
                _no_mat("a small part of more than four bytes")
            return kind, content[4 : 4 + length], content[8:]
        body = content[8 : 8 + length]
        if len(body) < length:
            _no_mat("a part that is cut short")
        return kind, body, content[8 + -(-length // 8) * 8 :]

    def _head(self, content: memoryview) -> _Matrix:
        _, flags, content = self._part(content)
        word = int(np.frombuffer(flags, f"{self._order}u4", 1)[0])
        kind = word & 0xFF
        if kind == 17:  # an object that only MATLAB reads; its name stands first
            _, name, content = self._part(content)
            return _Matrix(kind, 0, (), _name(name), content)
        _, sides, content = self._part(content)
        shape = tuple(np.frombuffer(sides, f"{self._order}i4").tolist())
        if min(shape, default=-1) < 0 or len(shape) > 16:
            _no_mat(f"a shape of {shape}")
        _, name, content = self._part(content)
        return _Matrix(kind, word >> 8 & 0xFF, shape, _name(name), content)

    def _held(self, matrix: _Matrix) -> Held:
        if matrix.kind == _CELL:
            return Cells(tuple(self._single(item) for item in self._items(matrix)))
        return self._single(matrix)

    def _single(self, matrix: _Matrix) -> Numbers | Texts:
        """Return what holds no other arrays."""
        if matrix.kind == _CHAR:
            return self._texts(matrix)
        if matrix.kind not in _CLASSES:
            got = _OTHERS.get(matrix.kind, "cells or a structure within others")
            raise BadFile("numbers, texts, or cells of them", got, "save it as one of them; texts "
                          "as cellstr(…)")  # fmt: skip
        return Numbers.of(self._numbers(matrix))

    def _numbers(self, matrix: _Matrix) -> NDArray[Any]:
        kind, body, _ = self._part(matrix.rest)
        if matrix.flags & _COMPLEX:
            raise BadFile("real numbers", "complex ones", "save their real part or their amplitude")
        if kind not in _STORED:
            _no_mat(f"numbers of the kind {kind}")
        stored = np.frombuffer(body, f"{self._order}{_STORED[kind]}")
        if stored.size != math.prod(matrix.shape):
            _no_mat(f"a shape of {matrix.shape} with {number_of(stored.size, 'number', ',')}")
        return stored.astype(_dtype_of(matrix), copy=False).reshape(matrix.shape, order="F")

    def _texts(self, matrix: _Matrix) -> Texts:
        count = math.prod(matrix.shape)
        if count == 0:
            return Texts(("",))
        kind, body, _ = self._part(matrix.rest)
        if kind not in _TEXT or len(body) > MIB * 64:
            _no_mat(f"texts of the kind {kind} of {len(body):,} bytes")
        coding = _TEXT[kind]
        if coding in ("utf-16", "utf-32"):
            coding += "-le" if self._order == "<" else "-be"
        text = bytes(body).decode(coding)
        if matrix.shape[0] == 1:
            return Texts((plain_text_of(text),))
        if len(text) != count or matrix.shape[0] > MOST_NAMES:
            _no_mat(f"{number_of(len(text), 'letter', ',')} for a shape of {matrix.shape}")
        rows = matrix.shape[0]  # letters go down the columns
        return Texts(tuple(plain_text_of(text[row::rows]) for row in range(rows)))

    def _items(self, matrix: _Matrix) -> list[_Matrix]:
        count = math.prod(matrix.shape)
        if count > MOST_NAMES or count * 8 > len(matrix.rest):
            _no_mat(
                f"{number_of(count, 'cell', ',')} in {number_of(len(matrix.rest), 'byte', ',')}"
            )
        found, rest = [], matrix.rest
        for _ in range(count):
            kind, body, rest = self._part(rest)
            if kind != _MATRIX:
                _no_mat(f"a cell of the kind {kind}")
            found.append(self._head(body) if len(body) else _EMPTY)
        return found

    def _fields(self, matrix: _Matrix) -> tuple[list[str], memoryview]:
        _, word, rest = self._part(matrix.rest)
        length = int(np.frombuffer(word, f"{self._order}i4", 1)[0])
        _, letters, rest = self._part(rest)
        if not 0 < length <= 64 or len(letters) % length:
            _no_mat(f"fields of {length} letters")
        raw = bytes(letters)
        words = (raw[at : at + length] for at in range(0, len(raw), length))
        return [word.split(b"\0")[0].decode("latin-1") for word in words], rest

    def _field(self, matrix: _Matrix, path: str, name: str) -> Held:
        """Return a field: as it is of a single structure, as cells of an array of them.

        Args:
            matrix: The structure.
            path: Names of fields, each within the one before: trial.force.
            name: Of all of it, for messages.
        """
        fields, rest = self._fields(matrix)
        field, _, inner = path.partition(".")
        if not field:
            shown = ", ".join(fields[:8])
            raise BadFile(
                "numbers, texts or cells", f"a structure of {shown or 'nothing'}",
                "name one of its fields, as in data.force",
            )  # fmt: skip
        if field not in fields:
            raise KeyError(name)
        count = math.prod(matrix.shape) * len(fields)
        as_cells = _Matrix(_CELL, 0, (count,), name, rest)
        items = self._items(as_cells)[fields.index(field) :: len(fields)]
        if len(items) != 1:
            if inner:
                raise KeyError(name)
            return Cells(tuple(self._single(item) for item in items))
        if items[0].kind == _STRUCT:
            return self._field(items[0], inner, name)
        if inner:
            raise _no_field(items[0], name)
        return self._held(items[0])


def _no_field(matrix: _Matrix, name: str) -> Exception:
    """Return why something other than a structure has no such field."""
    if matrix.kind != _CELL:
        return KeyError(name)
    return BadFile(
        "an array of structures", "cells, whose fields are not read",
        "join cells of structures into one array of them before saving: trials = [trials{:}]",
    )  # fmt: skip


def _dtype_of(matrix: _Matrix) -> np.dtype[Any]:
    return np.dtype(bool) if matrix.flags & _LOGICAL else np.dtype(_CLASSES[matrix.kind])


def _name(letters: memoryview) -> str:
    raw = bytes(letters)
    try:
        return raw.decode("utf-8")
    except UnicodeDecodeError:
        return raw.decode("latin-1")


_EMPTY = _Matrix(_CHAR, 0, (0,), "", memoryview(b""))
"""A cell without content."""
_BROKEN = (zlib.error, ValueError, IndexError, OverflowError, OSError, UnicodeDecodeError)


def _broken(error: Exception) -> BadFile:
    return BadFile("a whole .mat file", f"a damaged one ({error})", "copy it again")


def _no_mat(got: str, mend: str = "copy it again") -> NoReturn:
    raise BadFile("a whole .mat file of MATLAB's version 5 or 7.3", got, mend)
