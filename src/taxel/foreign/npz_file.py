"""Open .npy and .npz files whose arrays may be larger than memory.

What is not packed is mapped; what is packed is unpacked within a bound, an array at a time. Heads
are read as text (archives.py). Nothing is unpickled. Knows nothing about what the arrays mean.

Background of our choices: docs/decisions/0011 and 0033.
"""

from __future__ import annotations

import struct
import zipfile
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadFile
from taxel.foreign.archives import (
    LARGEST_ARRAYS,
    LONGEST_START,
    array_of,
    read_head,
    refuse_packing,
)
from taxel.foreign.files import GIB, MIB, in_words, open_file, refuse_larger, size_of
from taxel.foreign.held_arrays import (
    LONGEST_TEXT,
    MOST_NAMES,
    Held,
    Numbers,
    Texts,
    bytes_of,
)
from taxel.plain_text import number_of

LARGEST_STACK = 256 * GIB
"""Bytes of a file of arrays that is mapped: a month of 1,000 taxels at 100 Hz. Our choice."""
_LARGEST_DIRECTORY = 16 * MIB
"""Of a zip's members: 100,000 arrays."""
_LOCAL = struct.Struct("<4s5H3L2H")
"""What stands before a zip's member."""
_END, _END_SIGN = 22, b"PK\5\6"
_LOCATOR_64, _END_64, _SIGN_64 = 20, 56, b"PK\6\7"
"""The same of a zip of more than 4 GiB, or of 65,535 members; they stand right before it."""
_LARGEST_TEXTS = 64 * MIB
"""Bytes of an array of texts. Source: our choice."""


class NpyFile:
    """A .npy file, as a file with a single array, which has no name."""

    def __init__(self, path: Path) -> None:
        with open_file(path) as file:
            size = size_of(file)
            refuse_larger(path, size, LARGEST_STACK)
            self._held = _held(file, 0, size)

    def names(self) -> Sequence[str]:
        """Return the only name, an empty one."""
        return ("",)

    def get(self, name: str) -> Held:
        """Return the array.

        Raises:
            KeyError: A name was given.
        """
        if name:
            raise KeyError(name)
        return self._held

    def close(self) -> None:
        """Do nothing: the map needs no open file."""


class NpzFile:
    """A .npz file, as np.savez and np.savez_compressed write it."""

    def __init__(self, path: Path) -> None:
        self._whole: set[str] = set()
        self._kept: tuple[zipfile.ZipInfo, NDArray[Any]] | None = None
        self._file = open_file(path)
        try:
            refuse_larger(path, size_of(self._file), LARGEST_STACK)
            _check_directory(self._file)
            self._zip = zipfile.ZipFile(self._file)
            found = [info for info in self._zip.infolist() if info.filename.endswith(".npy")]
            self._members = {info.filename.removesuffix(".npy"): info for info in found}
            if len(self._members) < len(found):
                raise BadFile("arrays of different names", "one that is there twice", "write them")
        except BadFile:
            self._file.close()
            raise
        except _BROKEN as error:
            self._file.close()
            raise _not_whole(error) from error

    def names(self) -> Sequence[str]:
        """Return the arrays' names."""
        return tuple(self._members)

    def get(self, name: str) -> Held:
        """Return an array: a map of the file, or what was unpacked.

        Raises:
            KeyError: There is none of that name.
            BadFile: It is damaged, of another kind than numbers or texts, or too large.
        """
        info = self._members[name]
        try:
            if info.flag_bits & 1:
                raise BadFile("arrays that anybody can read", "an encrypted one", "write it again")
            refuse_packing(info)
            if info.compress_type == zipfile.ZIP_STORED and info.file_size == info.compress_size:
                start = _start_of(self._file, info)
                if name not in self._whole:
                    _check_sum(self._file, start, info)
                    self._whole.add(name)
                return _held(self._file, start, info.file_size)
            return self._unpacked(name, info)
        except BadFile as error:
            raise BadFile(error.needed, f"{name}: {error.got}", error.mend) from error
        except _BROKEN as error:
            raise _not_whole(error) from error

    def _unpacked(self, name: str, info: zipfile.ZipInfo) -> Held:
        if info.file_size > LARGEST_ARRAYS:
            raise BadFile(
                f"packed arrays of at most {in_words(LARGEST_ARRAYS)}", in_words(info.file_size),
                "write it with np.savez, which does not pack, or as HDF5",
            )  # fmt: skip
        with self._zip.open(info) as member:
            _, dtype, shape, _ = read_head(member.read(LONGEST_START))
        if dtype.kind in "US":
            _refuse_long(info.file_size)
        if dtype.kind in "biuf":
            member_of = self._array_of
            return Numbers(shape, dtype, lambda places: member_of(info)[places])
        return _in_memory(self._array_of(info))

    def _array_of(self, info: zipfile.ZipInfo) -> NDArray[Any]:
        """Return an array, unpacked; the last one is kept, for its next piece."""
        if self._kept is not None and self._kept[0] is info:
            return self._kept[1]
        try:
            with self._zip.open(info) as member:
                content = member.read(info.file_size + 1)
        except _BROKEN as error:
            raise _not_whole(error) from error
        if len(content) != info.file_size:
            raise BadFile("a whole zip", "a member of another size than it says", "write it again")
        array = array_of(content, "biufcUS")
        self._kept = (info, array)
        return array

    def close(self) -> None:
        """Close the zip."""
        self._zip.close()
        self._file.close()


_BROKEN = (zipfile.BadZipFile, zlib.error, struct.error, EOFError, LookupError, ValueError,
           NotImplementedError, RuntimeError, OverflowError, OSError)  # fmt: skip


def _not_whole(error: Exception) -> BadFile:
    return BadFile(
        "a whole .npz file", f"another ({' '.join(str(error).split())})", "copy it again"
    )


def _check_directory(file: BinaryIO) -> None:
    """Refuse a list of members that is itself too long to be read."""
    file.seek(max(0, size_of(file) - _END - 65_535 - _LOCATOR_64 - _END_64))
    tail = file.read()
    at = tail.rfind(_END_SIGN)
    if at < 0 or len(tail) - at < _END:
        raise BadFile("a whole .npz file", "contents that are no zip, or one cut short", "copy it")
    (directory,) = struct.unpack_from("<L", tail, at + 12)
    if tail[max(0, at - _LOCATOR_64) : at].startswith(_SIGN_64) and at >= _LOCATOR_64 + _END_64:
        (directory,) = struct.unpack_from("<Q", tail, at - _LOCATOR_64 - _END_64 + 40)
    if directory > _LARGEST_DIRECTORY:
        raise BadFile(f"at most {MOST_NAMES:,} arrays", f"a list of {in_words(directory)}",
                      "split the file")  # fmt: skip


def _start_of(file: BinaryIO, info: zipfile.ZipInfo) -> int:
    """Return where a member's own bytes start."""
    file.seek(info.header_offset)
    head = _LOCAL.unpack(file.read(_LOCAL.size))
    start = info.header_offset + _LOCAL.size + int(head[-2]) + int(head[-1])
    if head[0] != b"PK\3\4" or start + info.file_size > size_of(file):
        raise BadFile("a whole .npz file", "a member that is cut short", "copy it again")
    return start


def _check_sum(file: BinaryIO, start: int, info: zipfile.ZipInfo) -> None:
    """Refuse a member that is not what its check sum says, read block by block."""
    file.seek(start)
    left, found = info.file_size, 0
    while left and (block := file.read(min(left, MIB))):
        found, left = zlib.crc32(block, found), left - len(block)
    if found != info.CRC or left:
        raise BadFile("a whole .npz file", "an array whose check sum fails", "copy it again")


def _held(file: BinaryIO, at: int, size: int) -> Held:
    """Return the array whose .npy bytes start at a place of an open file, mapped if of numbers."""
    file.seek(at)
    start, dtype, shape, by_columns = read_head(file.read(min(size, LONGEST_START)))
    if bytes_of(shape, dtype) != size - start:
        raise BadFile(
            "as many bytes as its shape says",
            f"a shape of {shape} with {number_of(size - start, 'byte', ',')}", "write it again",
        )  # fmt: skip
    if dtype.kind in "biufc" and size > start:
        mapped = np.memmap(file, dtype, "r", at + start, shape, "F" if by_columns else "C")
        return Numbers.of(mapped)
    _refuse_long(size - start)
    file.seek(at)
    return _in_memory(array_of(file.read(size), "biufcUS"))


def _refuse_long(size: int) -> None:
    """Refuse texts of more bytes than are read."""
    if size > _LARGEST_TEXTS:
        raise BadFile(
            f"texts of at most {in_words(_LARGEST_TEXTS)}", in_words(size), "shorten them"
        )


def _in_memory(array: NDArray[Any]) -> Held:
    return texts_of(array) if array.dtype.kind in "US" else Numbers.of(array)


def texts_of(array: NDArray[Any]) -> Texts:
    """Return an array of texts, or of bytes in UTF-8, row by row, without blanks at their ends.

    Raises:
        BadFile: They are too many or too long, or in another encoding.
    """
    if array.size > MOST_NAMES:
        raise BadFile(f"at most {MOST_NAMES:,} texts", f"{array.size:,}", "split the file")
    return Texts(tuple(plain_text_of(value) for value in array.ravel().tolist()))


def plain_text_of(value: str | bytes) -> str:
    """Return a text without blanks and zeros at its end.

    Raises:
        BadFile: It is too long, or not in UTF-8.
    """
    if len(value) > LONGEST_TEXT:
        raise BadFile(
            f"texts of at most {LONGEST_TEXT} characters", f"{len(value):,}", "shorten it"
        )
    try:
        text = value.decode("utf-8") if isinstance(value, bytes) else value
    except UnicodeDecodeError as error:
        raise BadFile("texts in UTF-8", "bytes in another encoding", "write them so") from error
    return text.rstrip("\0").strip()
