"""The child of `sheets`: read a sheet of a workbook (.xlsx) under limits of the system.

Run as a script, so that nothing of taxel is loaded. Its arguments are a path, and the name of a
sheet, which may be empty, or nothing else to list the sheets. Rows go to standard output, cells
separated by tabs, empty rows as empty lines; what was found, or why not, as JSON to standard error.
XML is read by Python's own parser, which follows no external entity. Knows nothing about tables.

Background of our choices: docs/decisions/0033.
"""

from __future__ import annotations

import json
import os
import sys
import zipfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from datetime import date, datetime, time, timedelta
from typing import Any, BinaryIO

if __name__ == "__main__":
    os.environ["OPENPYXL_LXML"] = "False"  # whatever is installed, the same parser
    sys.modules["numpy"] = None  # type: ignore[assignment]  # loaded for nothing

import openpyxl
from openpyxl.worksheet import _reader

MEMORY = 1024 * 2**20
"""Bytes beside what the libraries hold. Source: our choice."""
LARGEST = 1024 * 2**20
"""Bytes of the workbook's XML, unpacked, and of the rows as text. Source: our choice."""
FREE, MOST_PACKED = 16 * 2**20, 100.0
"""Bytes that any workbook may unpack to, and how many times as large as its file it may be beyond
them. Workbooks of numbers pack 3 to 10 times. Source: our choice."""
LEAST_CPU_S, BYTES_A_SECOND = 60, 2 * 2**20
"""Processor time for any workbook, and XML for which there is another second; three times what is
needed. Source: our choice."""
MOST_MEMBERS = 10_000
MOST_ROWS, MOST_COLUMNS, LONGEST_CELL = 1_048_576, 16_384, 32_767
"""Of a sheet, and characters of a cell, as Excel's own limits."""
MOST_CELLS = 128 * 2**20
"""Of the rectangle that holds all rows, empty ones too. Source: our choice."""
LONGEST_LINE = 2**20
"""Bytes of a row as text."""
_MOST_NAMES = 64
_OLE = b"\xd0\xcf\x11\xe0"
"""What old .xls files and those with a password begin with."""


class Refused(Exception):
    """What was needed, what was got, and how to mend it."""


def limit(cpu_s: int) -> None:
    """Let the system end this process where it takes more; the first call sets the memory."""
    try:
        import resource
    except ModuleNotFoundError:  # no such limits on this system: the parent's clock remains
        return
    hard = resource.getrlimit(resource.RLIMIT_CPU)[1]
    soft = cpu_s if hard == resource.RLIM_INFINITY else min(cpu_s, hard)
    resource.setrlimit(resource.RLIMIT_CPU, (soft, hard))
    if cpu_s > LEAST_CPU_S:
        return
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with suppress(OSError, StopIteration), open("/proc/self/status") as status:
        held = next(int(line.split()[1]) for line in status if line.startswith("VmData:"))
        resource.setrlimit(resource.RLIMIT_DATA, (held * 1024 + MEMORY,) * 2)


def check_zip(path: str) -> None:
    """Refuse what is no workbook, unpacks to too much, or is packed in a way without a bound."""
    with open(path, "rb") as file:
        size = file.seek(0, os.SEEK_END)
        file.seek(0)
        begins = file.read(4)
    if begins == _OLE:
        raise Refused("a workbook (.xlsx)", "an old one (.xls), or one with a password",
                      "save it as .xlsx without a password, or as CSV")  # fmt: skip
    if begins[:2] != b"PK":
        raise Refused("a workbook (.xlsx)", "another kind of file", "save it as .xlsx, or as CSV")
    with zipfile.ZipFile(path) as archive:
        members = archive.infolist()
    if len(members) > MOST_MEMBERS:
        raise Refused(f"a workbook of at most {MOST_MEMBERS:,} parts", f"{len(members):,}",
                      "save the sheet as CSV")  # fmt: skip
    texts = [info for info in members if info.filename.lower().endswith((".xml", ".rels"))]
    for info in texts:
        if info.flag_bits & 1 or info.compress_type not in (
            zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED,
        ):  # fmt: skip
            raise Refused("a workbook whose parts are stored or deflated, without a password",
                          f"{info.filename[:80]!r} in another way", "save it again")  # fmt: skip
    unpacked = sum(info.file_size for info in texts)
    if unpacked > min(LARGEST, FREE + MOST_PACKED * size):
        raise Refused(
            f"a workbook that unpacks to {LARGEST // 2**20:,} MiB at most, and to {MOST_PACKED:g} "
            "times its size", f"{unpacked / 2**20:,.0f} MiB from {size / 2**20:,.1f} MiB",
            "save the sheet as CSV",
        )  # fmt: skip
    limit(LEAST_CPU_S + 1 + unpacked // BYTES_A_SECOND)


def refuse_unknown_formulas() -> None:
    """Let openpyxl refuse a formula without a stored value, which it takes for an empty cell."""
    own: Callable[[Any, Any], dict[str, Any]] = _reader.WorkSheetParser.parse_cell

    def parse_cell(parser: Any, element: Any) -> dict[str, Any]:
        found = own(parser, element)
        if (
            found["value"] is None
            and element.get("t") != "str"  # the empty text is a value
            and element.find(_reader.FORMULA_TAG) is not None
        ):
            raise Refused("formulas with stored values", f"none in cell {element.get('r')}",
                          "open the file in a spreadsheet program and save it, or save the sheet "
                          "as CSV")  # fmt: skip
        return found

    _reader.WorkSheetParser.parse_cell = parse_cell


def text_of(value: Any) -> str:
    """Return a cell as a text that holds it: numbers in full, times as ISO 8601."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return "TRUE" if value else "FALSE"
    if isinstance(value, float):
        return str(int(value)) if value.is_integer() and abs(value) < 1e15 else repr(value)
    if isinstance(value, timedelta) and timedelta(0) <= value < timedelta(days=1):
        hours, rest = divmod(value, timedelta(hours=1))
        minutes, rest = divmod(rest, timedelta(minutes=1))
        return time(hours, minutes, rest.seconds, rest.microseconds).isoformat()
    if isinstance(value, datetime):
        text = value.isoformat(" ")
    else:
        text = value.isoformat() if isinstance(value, date | time) else str(value)
    if len(text) > LONGEST_CELL:
        raise Refused(f"cells of at most {LONGEST_CELL:,} characters", f"one of {len(text):,}",
                      "save the sheet as CSV")  # fmt: skip
    text = " ".join(text.split()) if any(sign in text for sign in "\t\r\n") else text
    return '"' + text.replace('"', '""') + '"' if '"' in text else text


def lines_of(sheet: Any) -> Iterator[tuple[int, list[str]]]:
    """Yield the number of each row that holds something, from 1, and its cells up to the last."""
    sheet.reset_dimensions()  # what a file says of them may be false
    for number, row in enumerate(sheet.iter_rows(values_only=True), start=1):
        if number > MOST_ROWS or len(row) > MOST_COLUMNS:
            raise Refused(f"a sheet of at most {MOST_ROWS:,} rows and {MOST_COLUMNS:,} columns",
                          "more", "save the sheet as CSV")  # fmt: skip
        cells = [text_of(value) for value in row]
        while cells and not cells[-1].strip():
            cells.pop()
        if cells:
            yield number, cells


def write_rows(sheet: Any, out: BinaryIO) -> tuple[int, int]:
    """Write all rows down to the last that holds something; return their number and width."""
    rows = width = size = 0
    for number, cells in lines_of(sheet):
        line = "\t".join(cells).encode(errors="replace") + b"\n"
        empty = number - rows - 1
        rows, width, size = number, max(width, len(cells)), size + empty + len(line)
        if size > LARGEST or rows * width > MOST_CELLS or len(line) > LONGEST_LINE:
            raise Refused(
                f"a sheet of at most {MOST_CELLS:,} cells and {LARGEST // 2**20:,} MiB of text",
                f"more by row {number:,}", "cut it into several, or save it as CSV",
            )  # fmt: skip
        out.write(b"\n" * empty + line)
    return rows, width


def answer(path: str, wanted: str | None, out: BinaryIO) -> dict[str, Any]:
    """Return what a workbook holds; write a sheet's rows where one is wanted.

    Raises:
        Refused: It is none, or holds what cannot be taken. openpyxl raises what it likes.
    """
    check_zip(path)
    with open(path, "rb") as file:
        return from_book(file, wanted, out)


def from_book(file: BinaryIO, wanted: str | None, out: BinaryIO) -> dict[str, Any]:
    """Return what an open workbook holds; write a sheet's rows where one is wanted.

    Raises:
        Refused: It has no such sheet, or holds what cannot be taken.
    """
    book = openpyxl.load_workbook(file, read_only=True, data_only=True, keep_links=False)
    sheets = book.worksheets
    names = [sheet.title for sheet in sheets]
    found: dict[str, Any] = {"names": [name[:80] for name in names[:_MOST_NAMES]],
                             "count": len(names)}  # fmt: skip
    if wanted is None:
        return found
    shown = [sheet for sheet in sheets if sheet.sheet_state == "visible"] or sheets
    own = next((sheet for sheet in sheets if sheet.title == wanted), None) if wanted else (
        shown[0] if shown else None
    )  # fmt: skip
    if own is None:
        some = ", ".join(repr(name[:40]) for name in names[:6]) + " …" * (len(names) > 6)
        raise Refused(f"the sheet {wanted!r}" if wanted else "a sheet of cells", some or "none",
                      "correct the name" if wanted else "save it again")  # fmt: skip
    rows, width = write_rows(own, out)
    return {**found, "name": own.title[:80], "rows": rows, "width": width}


def reply(path: str, wanted: str | None, out: BinaryIO) -> dict[str, Any]:
    """Return the answer, or what was needed, what was got, and how to mend it."""
    try:
        return answer(path, wanted, out)
    except Refused as error:
        return dict(zip(("needed", "got", "mend"), error.args, strict=True))
    except MemoryError:
        raise SystemExit(1) from None
    except Exception as error:  # openpyxl raises what it likes
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        return {"needed": "a whole workbook (.xlsx)", "got": f"one with an error ({reason[:200]})",
                "mend": "copy it again, or save the sheet as CSV"}  # fmt: skip


def main() -> None:
    """Do as the arguments say."""
    replies = os.dup(2)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)  # what a library prints is no answer
    limit(LEAST_CPU_S)
    refuse_unknown_formulas()
    path, *wanted = sys.argv[1:]
    found = reply(path, wanted[0] if wanted else None, sys.stdout.buffer)
    sys.stdout.buffer.flush()
    os.write(replies, json.dumps(found).encode())


if __name__ == "__main__":
    main()
