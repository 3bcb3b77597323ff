"""What a recovery saved and what was lost. Knows nothing about files.

Background of our choices: docs/decisions/0004.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any


@dataclass(slots=True, kw_only=True)
class RecoveryReport:
    """What was saved and what was lost."""

    scans: int = 0
    """Scans in the recovered recording."""
    marks: int = 0
    frames: int = 0
    """Frames of all cameras."""
    chunks: int = 0
    """Sound chunks."""
    damaged_stretches: int = 0
    """Places that held something else than sound records, a cut end included."""
    bytes_skipped: int = 0
    """Bytes in them."""
    time_lost_s: float = 0.0
    """Fitted time missing between the scans (without an array: the frames) on both sides of a
    damaged stretch, seconds; what followed the last sound chunk cannot be known and is at most
    the recorder's flush time."""
    was_complete: bool = False
    """True where the recording ended as a finished one does."""
    notes: list[str] = field(default_factory=list)
    """Lines for a person."""

    def as_dict(self) -> dict[str, Any]:
        """Return the report as plain values."""
        return asdict(self)
