"""Files that cannot be read as the import table says: which of them may be left out, and when not.

Files stand or fall with those of their lot: the files of one line's pattern, or all that have a
line of their own. Where none of a lot can be read, the table is at fault. Knows nothing about how
files are read.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence

from taxel.errors import BadTable
from taxel.plain_text import number_of

OPTION = "--skip-unreadable"


def lots_of(lines: Sequence[str]) -> list[str]:
    """Return each file's lot: its line where that names several files, else empty.

    Args:
        lines: Table and line that name each file.
    """
    often = Counter(lines)
    return [line if often[line] > 1 else "" for line in lines]


def naming_option(
    fault: BadTable, lines: Sequence[str], place: int, reads: Callable[[int], bool]
) -> BadTable:
    """Return the refusal of a file; where another of its lot can be read, it names the option.

    Args:
        fault: Why the file cannot be read.
        lines: Table and line that name each file; empty where there is no table.
        place: The file's place among them; those before it were read.
        reads: Returns whether the file at a place can be read.
    """
    lots = lots_of(lines)
    lot = [other for other in range(len(lots)) if lots[other] == lots[place]]
    after = [other for other in lot if other > place][:1]
    if lines[place] and (lot[0] < place or any(map(reads, after))):
        return type(fault)(fault.needed, fault.got, f"{fault.mend}; {OPTION} leaves such files out")
    return fault


def refuse_whole_lots(lines: Sequence[str], faults: Mapping[int, BadTable]) -> None:
    """Refuse a table by which no file can be read, or none of the files of a line.

    Args:
        lines: Table and line that name each file.
        faults: The places of files that cannot be read, each with the reason.

    Raises:
        BadTable: Of the first such file.
    """
    lots = lots_of(lines)
    for lot, count in Counter(lots).items():
        unread = [place for place in faults if lots[place] == lot]
        if len(unread) < count or (count == 1 < len(lots) > len(faults)):
            continue
        first = faults[unread[0]]
        if count == 1:
            raise first
        none = f"none of the {number_of(count, 'file')} of {lot or 'the table'} can be read"
        raise type(first)(first.needed, f"{first.got}, and {none}", first.mend)
