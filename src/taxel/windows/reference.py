"""Reference touches: a session's first touches of a known object, which set its channels' level.

Gain, humidity and wear change from session to session far more than shapes and
materials differ. A few touches of one known object show a session's level; brought to
the level of the others, its windows mean what theirs mean. Nothing but those
touches is used, and no model ever trains or is tested on them. Knows nothing
about files, labels to tell, splits or models.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadDataset, BadInput
from taxel.labels.trials import Trial


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferenceTouches:
    """Which touches set a session's level."""

    key: str
    """A label or group of trials, such as "object"."""
    value: str
    """Its value, such as "cylinder-glass"."""
    count: int
    """How many of a session's first such touches are used."""

    def matches(self, trial: Trial) -> bool:
        """Return whether a trial touches the known object."""
        return {**trial.groups, **trial.labels}.get(self.key) == self.value


@dataclass(frozen=True, slots=True, kw_only=True)
class Reference:
    """The level that windows were brought to."""

    touches: str
    """Which touches set it, as in `WindowConfig.reference`."""
    level: NDArray[np.float32]
    """Shape (channels,), in the channels' units: the geometric mean over the sessions."""


def parse_reference(text: str) -> ReferenceTouches:
    """Return the touches that a text names, "KEY=VALUE:COUNT".

    Raises:
        BadInput: The text names none.
    """
    known, _, count = text.rpartition(":")
    key, _, value = known.partition("=")
    if not (key and value and count.isdecimal() and int(count) > 0):
        raise BadInput(
            "reference touches as KEY=VALUE:COUNT", repr(text), "such as object=cylinder-glass:3"
        )
    return ReferenceTouches(key=key, value=value, count=int(count))


def touch_level(values: NDArray[np.float32], mask: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Return each channel's level in windows of reference touches, shape (channels,).

    The root of the mean square over all measured rows; 1 for a channel that gives nothing.

    Args:
        values: Shape (n, steps, channels), n ≥ 1.
        mask: Shape (n, steps), False where a row is padding.
    """
    level = np.sqrt(np.square(values[mask], dtype=np.float64).mean(axis=0))
    return np.where(level > 0, level, 1.0).astype(np.float32)


def session_levels(
    values: NDArray[np.float32],
    mask: NDArray[np.bool_],
    owner: NDArray[np.intp],
    trials: Sequence[Trial],
    touches: ReferenceTouches,
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Return each trial's session level, and which trials are reference touches.

    Args:
        values: All windows, shape (n, steps, channels).
        mask: Shape (n, steps).
        owner: Each window's trial, shape (n,).
        trials: All trials, each with at least one window.
        touches: Which trials set the level.

    Returns:
        Levels of shape (trials, channels), and a flag a trial, shape (trials,).

    Raises:
        BadDataset: A session has fewer reference touches.
    """
    key = "session" if all("session" in trial.groups for trial in trials) else "recording"
    sessions = np.array([trial.groups[key] for trial in trials])
    level = np.zeros((len(trials), values.shape[2]), np.float32)
    used = np.zeros(len(trials), bool)
    for name in sorted(set(sessions)):
        inside = np.flatnonzero(sessions == name)
        found = sorted(
            (i for i in inside if touches.matches(trials[i])), key=lambda i: trials[i].start_s
        )
        if len(found) < touches.count:
            raise BadDataset(
                f"{touches.count} touches of {touches.key}={touches.value} in each session",
                f"{len(found)} in {name}",
                "touch the known object at the start of each session, or ask for fewer",
            )
        first = found[: touches.count]
        own = np.isin(owner, first)
        level[inside] = touch_level(values[own], mask[own])
        used[first] = True
    return level, used
