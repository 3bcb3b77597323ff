"""Read a text that somebody else wrote line by line, packed by gzip or not, in constant memory.

Text is UTF-8, or UTF-16 that says so; no other encoding is certain, so none is guessed. Knows
nothing about cells.

Background of our choices: docs/decisions/0033.
"""

from __future__ import annotations

import codecs
import gzip
import io
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from taxel.errors import BadFile
from taxel.foreign.files import MIB, in_words, open_file, refuse_larger, size_of
from taxel.foreign.sheets import is_sheet, sheet_lines

if TYPE_CHECKING:
    from _typeshed import WriteableBuffer

LONGEST_LINE = MIB
"""Characters. Source: our choice; a scan of 10,000 channels has some 100,000."""
FREE = 2 * MIB
"""Bytes that any packed text may have, however small the file. Source: our choice."""
MOST_PACKED = 100.0
"""Beyond them, how many times as large as its file a packed text may be. Tables of touch pack 3
to 20 times; deflate's limit is 1032. Source: our choice."""


def lines_of(path: Path, most: int) -> Iterator[str]:
    r"""Yield a text's lines with their ends, which are \n, \r\n or \r.

    \r\r\n, as Windows writes where a program ends lines in \r\n itself, is one end, not two.

    Args:
        path: The file; one whose name ends in .gz or .GZ is unpacked. Of a workbook (.xlsx) it is
            the sheet that the path names, or the first (sheets.py).
        most: Bytes that the text may have, unpacked.

    Raises:
        BadFile: It is no plain file, too large, packed too well, damaged, in another encoding,
            or has a line too long.
        MissingExtra: openpyxl is needed and not installed.
        OSError: It is not there, or may not be read.
    """
    if is_sheet(path):
        yield from (f"{line}\n" for line in sheet_lines(path, most))
        return
    number, torn = 0, False
    with open_file(path) as file:
        refuse_larger(path, size_of(file), most)
        raw = _Bounded(path, file, most)
        try:
            text = io.TextIOWrapper(buffer := io.BufferedReader(raw), newline="",
                                    encoding=_encoding(buffer))  # fmt: skip
            while line := text.readline(LONGEST_LINE):
                torn, rest = line.endswith("\r"), torn and line == "\r\n"
                if rest:  # of the end of the line before it
                    continue
                number += 1
                if len(line) >= LONGEST_LINE:
                    raise BadFile(
                        f"lines of less than {LONGEST_LINE:,} characters",
                        f"a longer one in {path}, line {number}", "check the file",
                    )  # fmt: skip
                if "\0" in line:
                    raise BadFile(
                        "text in UTF-8", f"zero bytes in {path}, as of UTF-16 without its mark",
                        "save it as UTF-8 (in Excel: CSV UTF-8)",
                    )  # fmt: skip
                yield line
        except UnicodeDecodeError as error:
            before = bytes(error.object[: error.start]).count(b"\n")
            wide = error.encoding.startswith("utf-16")
            what = "broken UTF-16" if wide else "another encoding, such as Latin-1 or Windows-1252"
            raise BadFile(
                "text in UTF-8",
                f"{what} in {path}, line {number + before + 1} "
                f"(byte 0x{error.object[error.start]:02x})",
                "save it as UTF-8 (in Excel: CSV UTF-8)",
            ) from error
        except (EOFError, zlib.error, gzip.BadGzipFile) as error:
            raise BadFile("a whole gzip file", f"{path}: {error}", "copy it again") from error


def _encoding(buffer: io.BufferedReader[_Bounded]) -> str:
    marked = buffer.peek(2)[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
    return "utf-16" if marked else "utf-8-sig"


class _Bounded(io.RawIOBase):
    """A file's bytes, unpacked where packed, and no more of them than are allowed."""

    def __init__(self, path: Path, file: BinaryIO, most: int) -> None:
        self._path = path
        self._packed = path.name.lower().endswith(".gz")
        self._file = file
        self._from: BinaryIO | gzip.GzipFile = gzip.GzipFile(fileobj=file) if self._packed else file
        self._most = most
        self._count = 0

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: WriteableBuffer, /) -> int:
        view = memoryview(buffer)
        content = self._from.read(len(view))
        view[: len(content)] = content
        self._count += len(content)
        if self._count > self._most:
            raise BadFile(
                f"a text of at most {in_words(self._most)}", f"more in {self._path}",
                "check that it is the file that you mean",
            )  # fmt: skip
        if self._packed and self._count > FREE + MOST_PACKED * self._file.tell():
            raise BadFile(
                f"a text packed at most {MOST_PACKED:g} times",
                f"{in_words(self._count)} from the first {in_words(self._file.tell())} of "
                f"{self._path}", "check the file, or unpack it yourself",
            )  # fmt: skip
        return len(content)
