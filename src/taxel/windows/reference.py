"""Reference touches: a session's first touches of a known object, which set its channels' level.

Gain, humidity and wear change from session to session far more than shapes and
materials differ. A few touches of one known object show a session's level; brought to
the level of the others, its windows mean what theirs mean. Nothing but those
touches is used, and no model ever trains or is tested on them. Knows nothing
about files, labels to predict, splits or models.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadDataset, BadInput
from taxel.labels.trials import Trial, order_in_time
from taxel.windows.windower import Windows

NOTHING = 0.02
"""Below this share of its usual level a channel gives nothing but noise. Source: our choice,
docs/decisions/0028."""


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

    The root of the mean square over all measured rows; 0 for a channel that gives nothing.

    Args:
        values: Shape (n, steps, channels), n ≥ 1.
        mask: Shape (n, steps), False where a row is padding.
    """
    level = np.sqrt(np.square(values[mask], dtype=np.float64).mean(axis=0))
    return np.asarray(level, np.float32)


def usual_of(levels: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the geometric mean over the sessions that measured a channel; 1 where none did.

    Args:
        levels: Shape (trials, channels): of each trial's session; 0 or NaN where it has none.
    """
    each = np.unique(np.nan_to_num(levels), axis=0)  # a row that holds NaN is like no other
    known = each > 0
    logs = np.where(known, np.log(np.where(known, each, 1.0)), 0.0)
    return np.asarray(np.exp(logs.sum(axis=0) / np.maximum(known.sum(axis=0), 1)), np.float32)


def to_usual(level: NDArray[np.float32], usual: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return what values at a level are multiplied by; 1 where a channel gives nothing.

    Args:
        level: Shape (…, channels); 0 or NaN where it is not known.
        usual: Shape (channels,).
    """
    known = level > NOTHING * usual
    return np.where(known, usual / np.where(known, level, 1.0), 1.0).astype(np.float32)


def session_levels(
    values: NDArray[np.float32],
    mask: NDArray[np.bool_],
    owner: NDArray[np.intp],
    trials: Sequence[Trial],
    touches: ReferenceTouches,
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Return each trial's session level, and which trials are reference touches.

    A session may span several recordings, whose clocks are their own: its touches are taken
    recording by recording, as `order_in_time` has them. A channel that gives nothing in a
    session's touches (below `NOTHING` of its usual level) has no level there: NaN.

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
            (i for i in inside if touches.matches(trials[i])),
            key=lambda i: order_in_time(trials[i]),
        )
        if len(found) < touches.count:
            raise BadDataset(
                f"{touches.count} touches of {touches.key}={touches.value} in each session",
                f"{len(found)} in {name}",
                "record them at the start of the session; taxel adapt takes them from another "
                "recording with --touches",
            )
        first = found[: touches.count]
        own = np.isin(owner, first)
        level[inside] = touch_level(values[own], mask[own])
        used[first] = True
    return _without_silent(level), used


def brought_to_level(
    windows: Windows, trial: NDArray[np.intp], trials: tuple[Trial, ...], text: str
) -> tuple[Windows, NDArray[np.intp], tuple[Trial, ...], Reference, NDArray[np.float32]]:
    """Bring each session to one level; leave out the touches that it was measured on.

    Args:
        windows: All of them.
        trial: Each window's trial, shape (n,).
        trials: All trials, each with at least one window.
        text: As `WindowConfig.reference` has it.

    Returns:
        The windows left, the trial of each, those trials, the level, and what each trial's values
        were multiplied by, shape (trials, channels).

    Raises:
        BadDataset: A session has fewer reference touches, or nothing else.
    """
    touches = parse_reference(text)
    levels, used = session_levels(windows.values, windows.mask, trial, trials, touches)
    usual = usual_of(levels)
    left = ~used[trial]
    if not left.any():
        raise BadDataset(
            "windows beside the reference touches", "none", "record grasps to learn from too"
        )
    factor = to_usual(levels, usual)
    values = windows.values[left] * factor[trial[left], None, :]
    kept, owner = np.unique(trial[left], return_inverse=True)
    return (
        replace(windows[left], values=values),
        owner.astype(np.intp),
        tuple(trials[index] for index in kept),
        Reference(touches=text, level=usual),
        factor[kept],
    )


def _without_silent(level: NDArray[np.float32]) -> NDArray[np.float32]:
    each = np.unique(level, axis=0)
    return np.where(level < NOTHING * np.median(each, axis=0), np.nan, level).astype(np.float32)
