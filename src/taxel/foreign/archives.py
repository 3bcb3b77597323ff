"""Read arrays (.npy) and chosen members of a zip that somebody else wrote.

Sizes are compared before anything is unpacked, and the unpacking stops where a size was a lie. A
head of an array is read as text, never evaluated, and must agree with the bytes that follow.
Nothing is unpickled. Knows nothing about what the arrays mean.

Background of our choices: docs/decisions/0033.
"""

from __future__ import annotations

import math
import re
import struct
import zipfile
import zlib
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, BinaryIO, NoReturn

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadFile
from taxel.foreign.files import MIB, in_words, open_file, refuse_larger, size_of
from taxel.plain_text import number_of

FREE = 16 * MIB
"""Bytes that any archive may unpack to, however small it is. Source: our choice."""
LARGEST_ARRAYS = 1024 * MIB
"""Bytes of a .npz file, and of each of its arrays. Source: our choice."""
_MOST_PACKED = 64.0
"""Class and fold numbers of windows pack 20 times or so. Source: our choice."""
_LAST_LETTER, _SURROGATES = 0x10FFFF, 0x1B
"""Unicode's last code point, and what those that are none begin with."""
_MAGIC = b"\x93NUMPY"
_LONGEST_HEAD = 4096
"""Bytes; numpy's own head has 118."""
LONGEST_START = _LONGEST_HEAD + 12
"""Bytes of a .npy file that `read_head` may need."""
_MOST_AXES = 8
_DESCR = re.compile(r"""['"]descr['"]\s*:\s*['"]([<>|=]?)([biufcUS])(\d{1,4})['"]""")
_OBJECTS = re.compile(r"""['"]descr['"]\s*:\s*['"]\|?O['"]""")
_OTHERS = (
    (re.compile(r"""['"]descr['"]\s*:\s*\["""), "one of records with named fields",
     "write each field as an array of its own, as y = records['object']"),
    (re.compile(r"""['"]descr['"]\s*:\s*['"][<>]?[mM]8"""), "one of dates or times",
     "write them as texts, y.astype(str), or as seconds"),
)  # fmt: skip
"""What else a head may say, what that is, and what to do."""
_ORDER = re.compile(r"""['"]fortran_order['"]\s*:\s*(True|False)""")
_SHAPE = re.compile(r"""['"]shape['"]\s*:\s*\(([\d\s,L]{0,200})\)""")
_ZIP_END = struct.Struct("<4s4H2LH")
_ZIP_END_SIGN = b"PK\5\6"
_ZIP64_SIGN = b"PK\6\7"
_ZIP64_PLACE = 20
"""Bytes before the end where a zip of 64 bits says where its real end is."""
_MOST_MEMBERS = 256
_LARGEST_DIRECTORY = 64 * 1024
_PACKERS = {zipfile.ZIP_BZIP2: "bzip2", zipfile.ZIP_LZMA: "LZMA"}
"""Other ways of packing that Python knows."""


def read_members(file: BinaryIO, wanted: Mapping[str, int], ratio: float) -> dict[str, bytes]:
    """Return those of the wanted members that a zip holds; nothing else of it is unpacked.

    Args:
        file: The zip, which may stand behind something else, open at any place.
        wanted: Member's name → bytes that it may have.
        ratio: How many times as large as the file the wanted members may be together, beside
            the `FREE` ones.

    Raises:
        BadFile: It is no whole zip, or a wanted member is larger, encrypted, packed in another
            way than stored or deflated, damaged or there twice.
    """
    _check_end(file)
    try:
        with zipfile.ZipFile(file) as archive:
            present = [info for info in archive.infolist() if info.filename in wanted]
            names = [info.filename for info in present]
            if len(set(names)) < len(names):
                _no_zip("a member that is there twice")
            allowed = FREE + ratio * size_of(file)
            for info in present:
                most = wanted[info.filename]
                if info.file_size > most:
                    _no_zip(
                        f"{info.filename} of {in_words(info.file_size)}, above {in_words(most)}"
                    )
                if info.flag_bits & 1:
                    _no_zip(f"{info.filename}, which is encrypted")
                refuse_packing(info)
            if sum(info.file_size for info in present) > allowed:
                _no_zip(f"members packed more than {ratio:g} times")
            members = {}
            for info in present:
                with archive.open(info) as member:
                    content = member.read(info.file_size + 1)
                if len(content) != info.file_size:
                    _no_zip(f"{info.filename} of another size than it says")
                members[info.filename] = content
            return members
    except BadFile:
        raise
    except (zipfile.BadZipFile, zlib.error, struct.error, EOFError, LookupError, ValueError,
            NotImplementedError, RuntimeError, OverflowError, OSError) as error:  # fmt: skip
        _no_zip(f"another ({' '.join(str(error).split())})", error)


def refuse_packing(info: zipfile.ZipInfo) -> None:
    """Refuse a member that Python's zipfile would unpack without a bound.

    Only of deflated members does it unpack as much as is asked for. Of those packed by bzip2 or
    LZMA it unpacks all that it has read: a kilobyte may become gigabytes.

    Raises:
        BadFile: It is packed in another way than stored or deflated.
    """
    if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        packed = _PACKERS.get(info.compress_type, f"way {info.compress_type}")
        raise BadFile(
            "a zip whose members are stored or deflated", f"{info.filename}, packed by {packed}",
            "pack it again with deflate, as zip and np.savez_compressed do",
        )  # fmt: skip


def read_arrays(path: Path, names: Collection[str]) -> dict[str, NDArray[Any]]:
    """Return those of the named arrays that a .npz file holds, to be changed if need be.

    Numbers, truth values and texts are taken.

    Args:
        path: The file, as np.savez writes it.
        names: Names of arrays.

    Raises:
        BadFile: It is no whole archive, too large, or packs too well.
        OSError: It is not there, or may not be read.
    """
    with open_file(path) as file:
        refuse_larger(path, size_of(file), LARGEST_ARRAYS)
        wanted = {f"{name}.npy": LARGEST_ARRAYS for name in names}
        found = read_members(file, wanted, _MOST_PACKED)
    return {name.removesuffix(".npy"): array_of(content, "biufU").copy()
            for name, content in found.items()}  # fmt: skip


def read_kinds(path: Path, kinds: Mapping[str, str]) -> dict[str, NDArray[Any]]:
    """Return named arrays of a .npz file; all must be there, each of its kinds.

    Args:
        path: The file, as np.savez writes it.
        kinds: Name → NumPy's letters for the kinds that are taken.

    Raises:
        BadFile: As `read_arrays`.
        ValueError: One is not there, or of another kind.
        OSError: The file is not there, or may not be read.
    """
    arrays = read_arrays(path, kinds)
    for name, letters in kinds.items():
        if name not in arrays or arrays[name].dtype.kind not in letters:
            raise ValueError(f"{name} is not there, or of another kind")
    return arrays


def array_of(content: bytes, kinds: str = "biuf") -> NDArray[Any]:
    """Return the array that a .npy file's bytes hold, in its own shape; it shares their memory.

    Args:
        content: The whole file.
        kinds: NumPy's letters for the kinds of numbers that are taken.

    Raises:
        BadFile: Its head cannot be right, or the bytes behind it are more or fewer.
    """
    start, dtype, shape, by_columns = read_head(content[:LONGEST_START])
    if dtype.kind not in kinds:
        _no_array(f"values of the kind {dtype}")
    count = math.prod(shape)
    if count * dtype.itemsize != len(content) - start:
        _no_array(f"a shape of {_sides(shape)} with {number_of(len(content) - start, 'byte', ',')}")
    if dtype.kind == "U":
        letters = np.frombuffer(content, f"{dtype.byteorder}u4".replace("=", "<"), -1, start)
        if ((letters > _LAST_LETTER) | (letters >> 11 == _SURROGATES)).any():
            _no_array("texts that are no Unicode")
    flat = np.frombuffer(content, dtype, count, start)
    return flat.reshape(shape, order="F" if by_columns else "C")


def read_head(content: bytes) -> tuple[int, np.dtype[Any], tuple[int, ...], bool]:
    """Return where an array's values start, their kind, its shape, and whether columns go first.

    Args:
        content: The first bytes of a .npy file, 4 KiB and 12 bytes at most.

    Raises:
        BadFile: It is no head of an array of plain numbers or texts.
    """
    if len(content) < 12 or content[:6] != _MAGIC or content[6] not in (1, 2, 3):
        _no_array("another kind of file")
    wide = content[6] > 1
    length = int.from_bytes(content[8 : 12 if wide else 10], "little")
    start = (12 if wide else 10) + length
    if length > _LONGEST_HEAD or start > len(content):
        _no_array(f"a head of {number_of(length, 'byte', ',')}")
    head = content[start - length : start].decode("latin-1")
    if _OBJECTS.search(head):
        raise BadFile(
            "an array of numbers or texts", "one of objects, which only pickle could read",
            "write texts as y.astype(str), and trials that differ in length padded with NaN or as "
            "arrays of their own",
        )  # fmt: skip
    for pattern, got, mend in _OTHERS:
        if pattern.search(head):
            raise BadFile("an array of numbers or texts", got, mend)
    descr, order, shape = _DESCR.search(head), _ORDER.search(head), _SHAPE.search(head)
    if descr is None or order is None or shape is None:
        _no_array("a head without the kind and shape of plain numbers")
    try:
        dtype = np.dtype("".join(descr.groups()))
        sides = tuple(int(side.strip(" L")) for side in shape[1].split(",") if side.strip())
    except (TypeError, ValueError) as error:
        _no_array(f"a head that cannot be right ({error})", error)
    if len(sides) > _MOST_AXES or dtype.itemsize == 0:
        _no_array(f"{len(sides)} axes of {dtype}")
    return start, dtype, sides, order[1] == "True"


def _check_end(file: BinaryIO) -> None:
    """Refuse a list of members that is itself too long to be read."""
    file.seek(max(0, size_of(file) - _ZIP_END.size - _ZIP64_PLACE))
    tail = file.read(_ZIP_END.size + _ZIP64_PLACE)
    end = tail[-_ZIP_END.size :]
    if len(end) < _ZIP_END.size or not end.startswith(_ZIP_END_SIGN):
        _no_zip("contents that are no zip, or one cut short")
    if tail.startswith(_ZIP64_SIGN):
        _no_zip("one of the kind for more than 4 GiB")
    _, _, _, _, members, directory, _, comment = _ZIP_END.unpack(end)
    if comment or members > _MOST_MEMBERS or directory > _LARGEST_DIRECTORY:
        _no_zip(f"one of {members:,} members, listed in {directory:,} bytes")


def _sides(shape: tuple[int, ...]) -> str:
    return " × ".join(map(str, shape)) or "one value"


def _no_zip(got: str, cause: Exception | None = None) -> NoReturn:
    raise BadFile("a whole zip", got, "copy it again, or write it again") from cause


def _no_array(got: str, cause: Exception | None = None) -> NoReturn:
    raise BadFile("a .npy file of numbers", got, "write it again") from cause
