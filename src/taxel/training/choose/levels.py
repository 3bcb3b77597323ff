"""Whose levels may be followed: sessions that are long enough to show their level.

Knows nothing about values or models.

Source: docs/decisions/0061.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from statistics import median

from taxel.labels.trials import SESSIONS
from taxel.training.choose.base import Base
from taxel.training.choose.inner_folds import Held
from taxel.windows.config import WindowConfig
from taxel.windows.level_follow import TOUCHES

FEWEST_SESSIONS = 3
"""Below it nobody can say what is usual. Source: our choice, 0061."""
FEWEST_TOUCHES = 8
"""Of a usual session: a shorter one has ended before its level is known. Source: as above."""
MIXED = 0.5
"""Share of the classes that a usual session has, at least, and two of them: the level of a session
of one class is that class's own. Source: as above."""


def level_to_follow(base: Base, train: Sequence[int], held: Held) -> str | None:
    """Return whose levels may be followed, as `WindowConfig.level_follow` has it; None: nobody's.

    What is held out comes first, if it is a session or the like; else sessions, if there are some.

    Args:
        base: The recordings.
        train: Indices of the trials that may be looked at.
        held: What the inner folds hold out.
    """
    y = base.y
    for key in dict.fromkeys((held.key, "session")):
        if key is None or key.lower() not in SESSIONS:
            continue
        if not all(key in trial.groups for trial in base.trials):
            continue
        counts = Counter(base.trials[i].groups[key] for i in train)
        kinds = Counter(name for name, _ in {(base.trials[i].groups[key], y[i]) for i in train})
        mixed = median(kinds.values()) >= max(2, MIXED * len({y[i] for i in train}))
        if mixed and len(counts) >= FEWEST_SESSIONS and median(counts.values()) >= FEWEST_TOUCHES:
            return f"{key}:{TOUCHES}"
    return None


def level_note(config: WindowConfig) -> tuple[str, ...]:
    """Return what whoever uses a recogniser must know whose levels follow; empty where none do."""
    if config.level_follow is None:
        return ()
    return (
        "each session's level is followed: its touches must be a mixture like those of training; "
        "where one thing is touched again and again, write the bundle with --hold-level",
    )
