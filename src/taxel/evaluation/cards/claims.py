"""What a claim of a paper is, and the names of the stored rows that answer claims.

Figures that the papers cite of others, dimensions of parts and settings are no claims. Knows the
rows' names only; knows nothing about where rows are stored.

Sources: Balapan, thesis, 2025 (TENG hand); Zhao, Zheng and Chen, Sensors 2024, 24, 5080 (grasps).
"""

from __future__ import annotations

from dataclasses import dataclass

TABLE_4_1 = "Table 4.1"
"""Begins the names of rows that `table_row` gives."""
TRIVIAL = ("trivial baselines", "best")
"""Model and row under which the best trivial baseline is stored."""
ABOVE_GATE = "simulated hand: share of scans above 1.55 V"
"""Name of the row of the threshold."""
NOT_YET = "no row is stored yet"
ONE_CUP, EVERY_CUP = "one cup held out", "every cup held out"
STEP = "a streaming step"
STEP_SHARE = "a streaming step, share of the measured matrix-product limit"
RANDOM, SESSION = "random windows (leaks)", "session held out"


@dataclass(frozen=True, slots=True)
class Link:
    """A stored row that answers a claim."""

    row: str
    """The row's name in any of the stored benches; "*" stands for any words."""
    label: str = ""
    """Printed before the value, such as "shape"."""
    percent: bool = False
    """Print a share as per cent, as the claim is."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Claim:
    """One claimed number."""

    where: str
    """Section or table."""
    what: str
    claimed: str
    """As printed in the paper, with its unit."""
    theirs: tuple[Link, ...] = ()
    """Rows measured under the paper's own split."""
    honest: tuple[Link, ...] = ()
    """Rows measured with whole sessions, objects or cups held out."""
    ours: str = ""
    """An answer that depends on no data and no split, such as a parameter count."""
    why: str = ""
    """Why nothing is measured, where none of the rows is stored."""
    command: str = ""
    """What measures it; the part's own command unless given."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ClaimsOfPart:
    """Claims that stand in one table of the card."""

    title: str
    about: str
    """What a reader must know of both splits."""
    command: str
    """What measures its rows, where a row does not say so itself."""
    claims: tuple[Claim, ...]


def table_row(preset: str, task: str, split: str, model: str, row: str) -> str:
    """Return the name of a stored row of Table 4.1."""
    return f"{TABLE_4_1}, {preset} recordings, {task}, {split}, {model}: {row}"


def grasp_row(model: str, frames: int, what: str) -> str:
    """Return the name of a stored row of Tables 1 to 3."""
    return f"Tables 1 to 3, {model}, k = {frames}: {what}"
