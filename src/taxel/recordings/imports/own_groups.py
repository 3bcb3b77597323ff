"""Groups that taxel gives each trial itself, so that no column may be called like them.

Knows nothing about tables' other columns.
"""

from __future__ import annotations

from collections.abc import Iterable

from taxel.errors import BadTable

OWN_GROUPS = ("recording", "trial")
"""Groups that a trial has when it is read, whatever its recording says (labels/trials.py)."""
CUT_FROM = "cut_from"
"""Group of pieces (pieces.py): the recording, or stretch of it, that a piece was cut from."""
PIECE = "piece_number"
"""Group of pieces: which of the whole's pieces it is, from 1."""


def refuse_own_groups(columns: Iterable[str], where: str) -> None:
    """Refuse columns whose values would be overwritten.

    Args:
        columns: Names of columns, or of a pattern's parts, such as group:session.
        where: Table and line, for messages.

    Raises:
        BadTable: One is group:recording or group:trial.
    """
    for column in columns:
        kind, _, name = column.partition(":")
        own = OWN_GROUPS if name in OWN_GROUPS else (CUT_FROM, PIECE)
        if kind == "group" and name in own:
            raise BadTable(
                f"groups but {' and '.join(own)}, which taxel fills in itself",
                f"{column!r} in {where}",
                f"call it group:{not_own_group(name)}, or leave it out",
            )


def not_own_group(name: str) -> str:
    """Return what a group may be called: its name, with a word behind one that taxel fills in."""
    return f"{name}_number" if name in (*OWN_GROUPS, CUT_FROM, PIECE) else name
