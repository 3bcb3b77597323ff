"""Which channels have stopped changing, though in training they hardly ever did.

A broken wire gives one value for ever: the windows stay complete, and the model answers as if all
were well. Training keeps how often each channel did not change within a window; live, a run of
such windows that would be rare among the windows of training is reported, once. It changes no
decision. An array that hangs gives one scan for ever: a window of it is UNKNOWN, if training shows
that scans hardly ever repeat. Knows nothing about models, sources or screens.

Background of our choices: docs/decisions/0010.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.foreign.json_text import Fields
from taxel.windows.windower import Windows

CHANCE = 1e-6
"""Live: of a million windows as in training at most so many begin a run that is reported, over
all channels. Source: our choice, docs/decisions/0010."""
CHANCE_ONCE = 0.01
"""The same for a set of recordings, which is looked at once. Source: our choice, 0010."""
MOST_STILL = 0.5
"""A channel that was still in a larger share of a class's training windows is not watched.
Source: our choice, docs/decisions/0010."""
NO_CHANGE = 1e-5
"""A range below this share of the channel's usual range is no change: a wavelet leaves rounding
errors. Source: our choice, docs/decisions/0010."""
FROZEN = 3
"""A window is frozen if its rows are all alike and so many times as many as were in training.
Source: our choice, docs/decisions/0010."""
FEWEST_ROWS = 100
"""Of fewer rows nobody can say how long they may be alike. Source: our choice, 0010."""
LOWER_GAIN = 2.0
"""By so much may a day's gains be lower than in training before its windows count as rest, when
channels are looked for that have not changed at all. Source: our choice, docs/decisions/0010."""
_LOUDEST = 99.0
"""Percentile of the windows that are not louder. Source: our choice, docs/decisions/0010."""
_MORE = ("longest", "loudest")
"""Figures that older bundles lack."""
_NEVER = np.iinfo(np.int64).max


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Motion:
    """How much each channel changed within the windows of training."""

    windows: int
    """How many windows the shares below are of: none overlaps another of its trial, and each moves
    by at least `least`."""
    usual: NDArray[np.float64]
    """Shape (channels,): median range within a window, in the channels' units, of the windows in
    which it changed; 0 where it never did."""
    least: float
    """How much a window must move to count, above 0: the largest of its channels' ranges, each as
    a multiple of `usual`. Windows at rest, as without a gate, move less."""
    still: NDArray[np.float64]
    """Shape (channels,): share of windows in which it did not change, 0…1."""
    worst: NDArray[np.float64]
    """Shape (channels,): the same within the class with the largest share, plus one window that
    did and one that did not: above 0 and below 1."""
    again: NDArray[np.float64]
    """Shape (channels,): share of windows without change after one without, within a trial, of the
    class with the largest, counted likewise; at least `worst`."""
    longest: int | None = None
    """How many successive rows of a window were alike in all channels at most, 1 where none was
    like the one before; None where that is not known, as in older bundles."""
    loudest: float | None = None
    """How much the channels of a window change at most, as `loudest_of` gives it: a multiple of
    `usual`; None where that is not known, as in older bundles."""

    def at_level(self, old: NDArray[np.float32], new: NDArray[np.float32]) -> Motion:
        """Return the figures for reference touches of another level, shape (channels,)."""
        factor = np.divide(new, old, out=np.ones(len(old)), where=old > 0)
        return replace(self, usual=self.usual * factor)

    def needed(self, chance: float) -> NDArray[np.int64]:
        """Return how many windows in a row without change are rare, shape (channels,).

        Args:
            chance: How likely such a run may begin at a window as in training, all channels
                together, 0…1.
        """
        each = chance / len(self.still)
        more = np.ceil(np.log(np.minimum(each / self.worst, 1.0)) / np.log(self.again))
        return np.where(self.worst > MOST_STILL, _NEVER, 1 + more.astype(np.int64))

    def unchanged(self, ranges: NDArray[np.floating]) -> NDArray[np.bool_]:
        """Return which channels did not change in which windows, shape (n, channels).

        Args:
            ranges: Of each channel within each window, as `ranges_of` gives them.
        """
        return np.asarray(ranges <= self.usual * NO_CHANGE)

    def knows_frozen(self, rows: int) -> bool:
        """Return whether so many rows that are alike are more than touch ever gave in training."""
        return self.longest is not None and rows >= FROZEN * self.longest

    def frozen(self, rows: NDArray[np.floating]) -> bool:
        """Return whether a window's rows are all alike, and too many for that to be touch.

        Args:
            rows: Its measured rows, shape (n, channels), in the channels' units.
        """
        if not self.knows_frozen(len(rows)):
            return False
        least = self.usual * NO_CHANGE
        if (np.abs(rows[-1] - rows[0]) > least).any():  # the usual case, kept short
            return False
        return bool((rows.max(axis=0) - rows.min(axis=0) <= least).all())

    def moving(self, ranges: NDArray[np.floating]) -> NDArray[np.bool_]:
        """Return which windows move enough to count, shape (n,); `ranges` as above."""
        known = self.usual > 0
        return np.asarray((ranges[:, known] >= self.least * self.usual[known]).any(axis=1))


@dataclass(frozen=True, slots=True, kw_only=True)
class StillChannel:
    """A channel that has stopped changing."""

    time_s: float
    """End of the window in which it was noticed, fitted clock, seconds."""
    channel: str
    still_s: float
    """How long it had not changed then, seconds."""
    windows: int
    """How many windows in a row, not overlapping."""
    usable: bool
    """False where the newest window holds values that are missing, stale or NaN."""
    changed: float
    """Share of training windows in which it changed, 0…1."""

    def words(self) -> str:
        """Return it as a line of a log."""
        same = "has not changed" if self.usable else "has given no value, or the same one,"
        return (
            f"channel {self.channel} {same} for {self.still_s:.1f} s; {changed_words(self.changed)}"
        )


class StillWatch:
    """Counts, for each channel, the windows in a row in which it did not change.

    Windows that overlap the last one counted, that hold one row only, or in which nothing moves as
    in training are left out. Of a channel that has not changed at all yet, windows with half of
    that motion count too: the gains of a day may be lower.

    Args:
        motion: What was usual in training.
        channels: Their names.
    """

    def __init__(self, motion: Motion, channels: tuple[str, ...]) -> None:
        self._motion, self._channels = motion, channels
        self._needed = motion.needed(CHANCE)
        self._no_change = (motion.usual * NO_CHANGE).astype(np.float32)
        moving = np.where(motion.usual > 0, motion.least * motion.usual, inf)
        self._moving = moving.astype(np.float32)
        self._moving_less = (moving / LOWER_GAIN).astype(np.float32)
        self._never = np.ones(len(channels), np.bool_)
        self._never_count, self._first_s = 0, 0.0
        self._count = np.zeros(len(channels), np.int64)
        self._since_s = np.zeros(len(channels))
        self._counting = self._next = False
        self._start_s = self._end_s = -inf
        self._found: list[StillChannel] = []

    def next_recording(self) -> None:
        """Go on counting in another recording, whose clock need not follow that of the last one.

        What passed between the two is no time in which a channel did not change.
        """
        self._next = self._end_s > -inf

    def look(self, window: Windows) -> NDArray[np.float32] | None:
        """Take in one window, shape (1, steps, channels), in the order of time.

        Returns:
            How much each channel changes in it, shape (channels,); None of a window left out as it
            overlaps the last one or holds one row only.
        """
        start_s = float(window.start_s[0])
        if self._start_s <= start_s <= self._end_s and not self._next:
            return None
        rows = window.values[0]
        if not window.mask.all():
            rows = rows[window.mask[0]]
        if len(rows) < 2:
            return None
        if self._next:
            self._next = False
            self._first_s += start_s - self._end_s
            self._since_s += start_s - self._end_s
        elif start_s < self._start_s:  # a clock was set
            self._count[:] = self._never_count = 0
        if not self._never_count:
            self._first_s = start_s
        self._start_s, self._end_s = start_s, float(window.end_s[0])
        moved = rows.max(axis=0) - rows.min(axis=0)
        still = moved <= self._no_change
        if self._counting or still.any():
            self._tally(window, moved, still, start_s)
        else:
            self._never[:] = False
        return np.asarray(moved)

    def take(self) -> list[StillChannel]:
        """Return the channels found since the last call; each is found once."""
        if not self._found:
            return []
        found, self._found = self._found, []
        return found

    def _tally(
        self,
        window: Windows,
        moved: NDArray[np.float32],
        still: NDArray[np.bool_],
        start_s: float,
    ) -> None:
        self._count[~still] = 0
        self._never &= still
        self._counting = bool(self._count.any())
        if not (moved >= self._moving_less).any():
            return
        self._never_count += 1
        if (moved >= self._moving).any():
            self._since_s[still & (self._count == 0)] = start_s
            self._count += still
            self._counting = True
        count = np.where(self._never, self._never_count, self._count)
        due = count >= self._needed
        if due.any():
            self._report(np.flatnonzero(due), count, bool(window.usable[0] >= 1.0))

    def _report(self, due: NDArray[np.intp], count: NDArray[np.int64], usable: bool) -> None:
        for index in due:
            since_s = self._first_s if self._never[index] else float(self._since_s[index])
            self._needed[index] = _NEVER
            self._found.append(
                StillChannel(
                    time_s=self._end_s, channel=self._channels[index],
                    still_s=self._end_s - since_s,
                    windows=int(count[index]), usable=usable,
                    changed=1.0 - float(self._motion.still[index]),
                )
            )  # fmt: skip


def ranges_of(values: NDArray[np.float32], mask: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Return each channel's range within each window, shape (n, channels), in its unit.

    Args:
        values: Shape (n, steps, channels).
        mask: Shape (n, steps): padding, which is left out, stands behind measured rows.
    """
    if not mask.all():
        values = np.where(mask[:, :, None], values, values[:, :1])
    return np.asarray(values.max(axis=1) - values.min(axis=1))


def longest_alike(
    values: NDArray[np.float32], mask: NDArray[np.bool_], usual: NDArray[np.float64]
) -> int | None:
    """Return how many successive rows of a window are alike in all channels at most.

    Args:
        values: Shape (n, steps, channels).
        mask: Shape (n, steps): padding, which is left out, stands behind measured rows.
        usual: Shape (channels,): as in `Motion`.

    Returns:
        1 or more; None of fewer than `FEWEST_ROWS` measured rows.
    """
    if mask.sum() < FEWEST_ROWS:
        return None
    longest = run = np.zeros(len(values), np.int64)
    for step in range(1, values.shape[1]):
        same = np.abs(values[:, step] - values[:, step - 1]) <= usual * NO_CHANGE
        run = np.where(same.all(axis=1) & mask[:, step], run + 1, 0)
        longest = np.maximum(longest, run)
    return 1 + int(longest.max())


def loudest_of(ranges: NDArray[np.floating], usual: NDArray[np.float64]) -> float:
    """Return how much the middle channel of a window changes, in all windows but one of a hundred.

    Args:
        ranges: Of each channel within each window, as `ranges_of` gives them.
        usual: Shape (channels,): as in `Motion`, not all 0.

    Returns:
        A multiple of what is usual.
    """
    known = usual > 0
    return float(np.percentile(np.median(ranges[:, known] / usual[known], axis=1), _LOUDEST))


def looked_at(windows: Windows, trial: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return the windows of two rows or more that overlap no other of their trial, by time.

    Args:
        windows: n of them.
        trial: Each window's trial, shape (n,).
    """
    order = np.lexsort((windows.start_s, trial))
    order = order[windows.mask[order].sum(axis=1) >= 2]
    kept, last_s, last = [], -inf, -1
    for index in order.tolist():
        if trial[index] != last or windows.start_s[index] > last_s:
            kept.append(index)
            last, last_s = trial[index], windows.end_s[index]
    return np.array(kept, np.intp)


def changed_words(changed: float) -> str:
    """Return in which share of training windows, 0…1, a channel changed, and what to do now."""
    share = "every window" if changed >= 1.0 else f"{min(100 * changed, 99.9):.3g} % of the windows"
    return f"in training it changed in {share}: check its cable"


def motion_to_json(motion: Motion) -> dict[str, Any]:
    """Return the figures as JSON holds them."""
    arrays = {name: getattr(motion, name).tolist() for name in ("usual", "still", "worst", "again")}
    more = {name: getattr(motion, name) for name in _MORE if getattr(motion, name) is not None}
    return {"windows": motion.windows, "least": motion.least, **arrays, **more}


def motion_from_json(given: Fields, channels: int) -> Motion:
    """Return the figures that a contract holds.

    Args:
        given: The fields as `motion_to_json` gives them.
        channels: How many channels the contract has.

    Raises:
        ValueError: A field is missing, unknown, or of another kind, length or range.
    """
    known = {"windows", "least", "usual", "still", "worst", "again"}
    given.only(known | {name for name in _MORE if name in given})
    usual, still, worst, again = (
        given.array(name, (channels,)) for name in ("usual", "still", "worst", "again")
    )
    shares = np.stack([worst, again])
    if (usual < 0).any() or not ((still >= 0) & (still <= 1)).all():
        raise ValueError("a channel's usual range is below 0, or its share not within 0 and 1")
    if not ((shares > 0) & (shares < 1)).all():
        raise ValueError("a share is not above 0 and below 1")
    return Motion(
        windows=given.count("windows", 1, 2**53),
        usual=usual,
        least=given.number("least", NO_CHANGE),
        still=still,
        worst=worst,
        again=again,
        longest=given.count("longest", 1, 2**53) if "longest" in given else None,
        loudest=given.number("loudest", 0.0) if "loudest" in given else None,
    )
