"""A table of when grasps turned unstable, as a person saw it: one line a recording.

    file,onset_s
    mug-1.mcap,2.4
    mug-2.mcap,

An empty onset says that the grasp was stable throughout. A column `frame`, counted from 0, may
stand in place of `onset_s`; columns `author` and `note` may stand beside. Knows nothing about rules
or images.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadInput, BadTable
from taxel.foreign.files import MIB
from taxel.foreign.text_rows import rows_of
from taxel.labels.corrections import Correction, check_inside

_ONSET, _FRAME = "onset_s", "frame"
_MORE: Final = ("author", "note")


def read_onsets(
    path: Path, rule: str, times: Mapping[str, NDArray[np.float64]]
) -> dict[str, Correction]:
    """Return a table's corrections of one rule, by recording; all of it is checked.

    Args:
        path: The table (CSV).
        rule: Name of the rule that is corrected.
        times: Name of each recording, without its ending → time of its frames, seconds.

    Raises:
        BadTable: Its columns or a cell cannot be used, an onset lies outside its video, or it names
            a recording twice, or one that is not there.
        BadFile: It is no text, or too large.
        OSError: It is not there.
    """
    rows = rows_of(path, MIB)
    header = [cell.strip() for cell in rows[0][1]] if rows else []
    own = [name for name in (_ONSET, _FRAME) if name in header]
    known = {"file", *own, *(name for name in _MORE if name in header)}
    if len(own) != 1 or sorted(header) != sorted(known):
        raise BadTable(
            "a first line file,onset_s (or file,frame), and author and note where wanted",
            f"{','.join(header) or 'nothing'} in {path}", "mend the first line",
        )  # fmt: skip
    found: dict[str, Correction] = {}
    for number, cells in rows[1:]:
        where = f"line {number} of {path}"
        if len(cells) != len(header):
            raise BadTable(f"{len(header)} cells", f"{len(cells)} in {where}", "mend the line")
        row = dict(zip(header, map(str.strip, cells), strict=True))
        name = row["file"].removesuffix(".mcap")
        if name not in times or name in found:
            again = "a second time" if name in found else "which is not there"
            raise BadTable("each recording once", f"{row['file']!r} in {where}, {again}",
                           "mend the line")  # fmt: skip
        found[name] = _correction(row, own[0], rule, times[name], where)
    if not found:
        raise BadTable("at least one line with a recording", f"none in {path}", "add one")
    return found


def _correction(
    row: Mapping[str, str], column: str, rule: str, time_s: NDArray[np.float64], where: str
) -> Correction:
    author, note = (row.get(name, "") for name in _MORE)
    if not row[column]:
        return Correction(rule=rule, onset_s=None, author=author, note=note)
    try:
        value = float(row[column])
    except ValueError:
        value = float("nan")
    whole = column == _ONSET or value.is_integer()
    if not (np.isfinite(value) and whole):
        raise BadTable(
            "seconds after the first frame, or nothing" if column == _ONSET
            else "a frame's number, counted from 0, or nothing",
            f"{row[column]!r} in {where}", "mend the line",
        )  # fmt: skip
    try:
        if column == _FRAME:
            return Correction.at_frame(rule, int(value), time_s, author, note)
        correction = Correction(rule=rule, onset_s=value, author=author, note=note)
        check_inside(correction, float(time_s[-1] - time_s[0]))
    except BadInput as error:
        raise BadTable(error.needed, f"{error.got} in {where}", error.mend) from error
    return correction
