"""Levels that follow: each touch's channels are scaled by their session's level over earlier ones.

Gain, humidity and wear change from session to session far more than shapes and materials differ.
What a session has touched so far shows its level, whatever it was, as long as it was a mixture like
that of other sessions. The usual level counts as much as some first touches, so that a session
begins as it would without this. Nothing of a touch itself, of later ones or of labels is used.
Knows nothing about files, labels to predict, splits or models.

Background of our choices: docs/decisions/0061.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadDataset, BadInput
from taxel.labels.trials import Trial, order_in_time
from taxel.plain_text import number_of
from taxel.windows.windower import Windows

TOUCHES = 10
"""Touches of a session that count as much as the usual level. Source: our choice, 0061."""
MOST_CHANGE = 3.0
"""Largest factor by which a channel's level may differ from the usual one, either way. Source: our
choice, 0061; gains of pads differ by 0.5 to 2."""
QUIET_PERCENT, QUIET_SHARE = 5.0, 0.5
"""A window shows a level only where its loudest channel reaches so large a share of what this
percentile of training windows reach: without a gate, windows at rest come too. Source: our choice,
0061."""
_SEED = 0
_LARGEST = 10**6
_LARGEST_SQUARE = float(np.finfo(np.float32).max) ** 2
_SHOWN = 60
"""Characters of a text that messages show."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LevelFollow:
    """How levels follow."""

    key: str
    """A group of trials, such as "session"; live, a session is a run of `taxel live`."""
    touches: int
    """How many touches count as much as the usual level."""


@dataclass(frozen=True, slots=True, kw_only=True)
class UsualLevel:
    """The level that sessions are followed from."""

    squares: tuple[float, ...]
    """Each channel's mean square, in the channels' units squared: the geometric mean over the
    sessions; 0 for a channel that gave nothing."""
    quietest: float
    """What the loudest channel of a window must reach to show a level, as a share of its `squares`;
    windows at rest do not."""

    def __post_init__(self) -> None:
        possible = all(0 <= own <= _LARGEST_SQUARE for own in self.squares)
        if not (possible and 0 <= self.quietest < np.inf):
            raise ValueError("a usual level below 0, or beyond what 32 bits hold")

    @property
    def array(self) -> NDArray[np.float64]:
        """Return `squares` as an array, shape (channels,)."""
        return np.array(self.squares)

    def shows(self, squares: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which windows show a level, shape (n,).

        Args:
            squares: As `mean_squares` gives them, shape (n, channels).
        """
        return np.asarray(_loudest(squares, self.array) >= self.quietest)


@dataclass(frozen=True, slots=True, kw_only=True)
class WatchedLevel:
    """A usual level with the windows that show none although they are loud."""

    usual: UsualLevel
    hung: Callable[[NDArray[np.float32]], bool]
    """Whether a window's measured rows, shape (n, channels), are of an array that hangs."""

    def shows(self, windows: Windows, squares: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which windows show a level, shape (n,).

        Args:
            windows: As measured, shape (n, steps, channels).
            squares: As `mean_squares` gives them, shape (n, channels).
        """
        shown = self.usual.shows(squares)
        for i in np.flatnonzero(shown):
            shown[i] = not self.hung(windows.values[i][windows.mask[i]])
        return shown


KnownLevel = UsualLevel | WatchedLevel
"""What a bundle learned; with what hangs, where its training shows that."""


def parse_level_follow(text: str) -> LevelFollow:
    """Return what a text names, "KEY:TOUCHES".

    Raises:
        BadInput: The text names none.
    """
    key, _, touches = text.rpartition(":")
    whole = touches.isascii() and touches.isdecimal() and len(touches) <= len(str(_LARGEST))
    if not (key and whole and 0 < int(touches) <= _LARGEST):
        raise BadInput(
            f"a group and a number of touches, 1 to {_LARGEST}, as KEY:TOUCHES",
            repr(text[:_SHOWN] + "…" * (len(text) > _SHOWN)), "such as session:10",
        )  # fmt: skip
    if key == "trial":
        raise BadInput("a group of many touches to follow the levels of", "single trials",
                       "name one such as session:10")  # fmt: skip
    return LevelFollow(key=key, touches=int(touches))


def mean_squares(values: NDArray[np.float32], mask: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return each channel's mean square in each window, shape (n, channels).

    Args:
        values: Shape (n, steps, channels).
        mask: Shape (n, steps), False where a row is padding.
    """
    rows = np.maximum(mask.sum(axis=1), 1)[:, None]
    squares = np.square(values, dtype=np.float64)
    return np.asarray((squares * mask[:, :, None]).sum(axis=1) / rows)


def _loudest(squares: NDArray[np.float64], usual: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the largest of each window's mean squares over the usual ones, shape (n,)."""
    if not (usual > 0).any():
        return np.zeros(len(squares))
    return np.asarray((squares[:, usual > 0] / usual[usual > 0]).max(axis=1))


def factor_of(usual: NDArray[np.float64], level: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return what values at a level are multiplied by, shape as `level`; 1 where nothing is usual.

    Args:
        usual: Mean squares, shape (channels,), in the channels' units squared.
        level: Likewise, shape (…, channels).
    """
    known = (usual > 0) & (level > 0)
    ratio = np.sqrt(np.where(known, usual, 1.0) / np.where(known, level, 1.0))
    return np.asarray(np.clip(ratio, 1 / MOST_CHANGE, MOST_CHANGE), np.float32)


@dataclass(frozen=True, slots=True, kw_only=True)
class Followed:
    """What each trial's channels are multiplied by."""

    learned_from: NDArray[np.float32]
    """Where models learn from the trial, shape (trials, channels)."""
    tested: NDArray[np.float32]
    """Where they are tested on it, likewise."""
    usual: UsualLevel


def followed_factors(
    windows: Windows,
    trial: NDArray[np.intp],
    trials: Sequence[Trial],
    follow: LevelFollow,
    known: KnownLevel | None = None,
) -> Followed:
    """Return what each trial's channels are multiplied by, and the usual level.

    To learn from, each trial's earlier touches are some of its session drawn at random, so that
    no model learns in which order a protocol goes through the classes; tested, they are those
    before it in time, as live. The usual level is that of the other sessions alone. Where the usual
    level is known, nothing is learned: both are those before it in time.

    Args:
        windows: All of them, as measured.
        trial: Each window's trial, shape (n,).
        trials: All trials; one without a window that may be used shows no level.
        follow: How levels follow.
        known: What a bundle learned; None to learn it.

    Raises:
        BadDataset: A trial to learn from lacks the group. Others that lack it are one session.
    """
    usual = known.usual if isinstance(known, WatchedLevel) else known
    lacking = [own for own in trials if follow.key not in own.groups]
    if lacking and usual is None:
        raise BadDataset(
            f"the group {follow.key!r} on every trial, whose levels are followed",
            f"none on {lacking[0].groups.get('trial', lacking[0].recording)}",
            f"import with the column group:{follow.key}",
        )
    ready = windows[windows.ready]
    owner, squares = trial[windows.ready], mean_squares(ready.values, ready.mask)
    if usual is not None:
        watched = known if isinstance(known, WatchedLevel) else None
        shown = watched.shows(ready, squares) if watched else usual.shows(squares)
        owner, squares = owner[shown], squares[shown]
    count = np.bincount(owner, minlength=len(trials))
    sums = [np.bincount(owner, own, minlength=len(trials)) for own in squares.T]
    each = np.stack(sums, axis=1) / np.maximum(count, 1)[:, None]
    sessions = np.array([own.groups.get(follow.key, "") for own in trials])
    names = sorted(set(sessions))
    touched = count > 0
    logs = np.stack([_log(each[(sessions == name) & touched]) for name in names])
    learned = _learned(logs, squares) if usual is None else usual
    random = np.random.default_rng(_SEED)
    mixed, in_time = np.empty_like(each), np.empty_like(each)
    for place, name in enumerate(names):
        own = np.flatnonzero(sessions == name)
        before = learned.array
        if usual is None:
            others = _mean_of_logs(np.delete(logs, place, axis=0))
            before = np.where(others > 0, others, before)  # what no other session measured
            drawn = random.permutation(own)
            mixed[drawn] = _levels(each[drawn], touched[drawn], before, follow.touches)
        own = np.array(sorted(own, key=lambda i: order_in_time(trials[i])), np.intp)
        in_time[own] = _levels(each[own], touched[own], before, follow.touches)
    tested = factor_of(learned.array, in_time)
    learned_from = factor_of(learned.array, mixed) if usual is None else tested
    return Followed(learned_from=learned_from, tested=tested, usual=learned)


def _levels(
    each: NDArray[np.float64], touched: NDArray[np.bool_], before: NDArray[np.float64], weight: int
) -> NDArray[np.float64]:
    """Return a session's level at each of its touches, shape (touches, channels).

    Args:
        each: Their mean squares, in the order in which they come, likewise; 0 of those without any.
        touched: Which show a level, shape (touches,).
        before: Where the session begins, shape (channels,).
        weight: How many touches that counts as much as.
    """
    past = np.cumsum(each, axis=0) - each
    number: NDArray[np.intp] = (np.cumsum(touched) - touched)[:, None]
    return np.asarray((weight * before + past) / (weight + number))


def _learned(logs: NDArray[np.float64], squares: NDArray[np.float64]) -> UsualLevel:
    """Return the usual level of sessions, shape (sessions, channels), and of their windows."""
    usual = _mean_of_logs(logs)
    loudest = _loudest(squares, usual)
    quiet = float(np.percentile(loudest, QUIET_PERCENT)) if len(loudest) else 0.0
    return UsualLevel(squares=tuple(usual.tolist()), quietest=QUIET_SHARE * quiet)


def _log(squares: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the logarithm of each channel's mean over touches, shape (channels,); NaN of 0."""
    mean = squares.sum(axis=0) / max(1, len(squares))
    return np.asarray(np.log(np.where(mean > 0, mean, np.nan)))


def _mean_of_logs(logs: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the geometric mean over sessions that measured a channel; 0 where none did."""
    known = np.isfinite(logs)
    total = np.where(known, logs, 0.0).sum(axis=0)
    count = known.sum(axis=0)
    return np.asarray(np.where(count > 0, np.exp(total / np.maximum(count, 1)), 0.0))


@dataclass(frozen=True, slots=True, kw_only=True)
class LevelNow:
    """Where a session's level stands."""

    touches: int
    """How many have shown it."""
    least: float
    """The smallest of the channels' levels, as a multiple of the usual one."""
    most: float
    """The largest."""

    def words(self) -> str:
        """In a few words, for a person."""
        return (
            f"levels followed over {number_of(self.touches, 'touch')}: channels stand at "
            f"{self.least:.2f} to {self.most:.2f} of the usual level"
        )


class LevelFollower:
    """Follows the level of a live stream, touch by touch.

    A touch ends with a pause; where nothing parts touches, after as many windows as a usual trial
    of training has.

    Args:
        usual: What training learned.
        touches: How many touches count as much.
        gap_s: Rows further apart belong to two touches, seconds.
        most_windows: Windows of a touch at most; None: however many a pause ends.
    """

    def __init__(
        self, usual: UsualLevel, touches: int, gap_s: float, most_windows: int | None
    ) -> None:
        self._gap_s, self._most = gap_s, most_windows
        self._usual, self._level = usual.array, usual.array
        self._weight, self._end_s = float(touches), -np.inf
        self._sum, self._windows = np.zeros_like(self._usual), 0
        least = np.where(self._usual > 0, usual.quietest * self._usual, np.inf)
        self._least = np.asarray(least, np.float64)
        self.factor = factor_of(self._usual, self._usual)
        """Shape (channels,): what the next window's values are multiplied by."""
        self.touches = 0
        """How many have ended."""

    def now(self) -> LevelNow:
        """Return where the level stands."""
        return LevelNow(touches=self.touches, least=float(1.0 / self.factor.max()),
                        most=float(1.0 / self.factor.min()))  # fmt: skip

    def state(self) -> dict[str, Any]:
        """Return the level over the touches that have ended, as `resume` takes it, for JSON."""
        return {"level": self._level.tolist(), "weight": self._weight, "touches": self.touches}

    def resume(self, state: dict[str, Any]) -> None:
        """Go on from another follower's state, as where its process died.

        Raises:
            ValueError: It is of other channels.
        """
        level = np.array(state["level"], np.float64)
        if level.shape != self._level.shape:
            raise ValueError(f"a level of {len(level)} channels for {len(self._level)}")
        self._level, self._weight = level, float(state["weight"])
        self.touches = int(state["touches"])
        self.factor = factor_of(self._usual, self._level)

    def over(self) -> None:
        """End the touch, as where a recording ends."""
        if self._windows:
            self._take_in()
        self._end_s = -np.inf

    def begin(self, window: Windows) -> None:
        """Note that a window comes, shape (1, steps, channels), before it is scaled."""
        pause = float(window.start_s[0]) - self._end_s > self._gap_s
        if self._windows and (pause or self._windows == self._most):
            self._take_in()
        self._end_s = float(window.end_s[0])

    def add(self, window: Windows) -> None:
        """Take in what was measured in that window, as it came; `mean_squares`, but quick."""
        rows = window.values[0]
        if not window.mask.all():
            rows = rows[window.mask[0]]
        if not (window.ready[0] and len(rows)):
            return
        values = rows.astype(np.float64)
        squares = np.einsum("sc,sc->c", values, values) / len(values)
        if (squares >= self._least).any():  # as `UsualLevel.shows`
            self._sum += squares
            self._windows += 1

    def _take_in(self) -> None:
        """Take the touch that is over into the level."""
        self._level += (self._sum / self._windows - self._level) / (self._weight + 1.0)
        self._weight += 1.0
        self.touches += 1
        self.factor = factor_of(self._usual, self._level)
        self._sum, self._windows = np.zeros_like(self._usual), 0
