"""From a window's probabilities to an answer, or to UNKNOWN with its reason.

Knows nothing about models, sources or screens.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from math import inf, isfinite

import numpy as np
from numpy.typing import NDArray

from taxel.decisions.joining import MEAN, Joining
from taxel.decisions.still_channels import Motion
from taxel.decisions.unknown import NoveltyTest
from taxel.labels.class_order import RESERVED
from taxel.windows.windower import Windows

UNKNOWN = RESERVED
"""The answer when the input or the confidence does not allow one."""
UNMEASURED = "how unlike the learned it is cannot be measured"
"""The reason where the test for the unknown gives no number: what is not tested is not known."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RecogniseConfig:
    """When an answer may be given. Source: our choice, docs/decisions/0010."""

    least_confidence: float = 0.5
    """Below this probability the answer is UNKNOWN, 0…1."""
    least_usable: float = 1.0
    """Below this share of usable values the answer is UNKNOWN, 0…1."""
    most_saturated: float = 0.999
    """Above this share of saturated rows in one channel the answer is UNKNOWN, 0…1:
    a channel that stands at the rail for a whole window measures nothing."""


@dataclass(frozen=True, slots=True)
class Decision:
    """One answer."""

    label: str
    """A class, or UNKNOWN."""
    confidence: float
    """Probability of the likeliest class, 0…1; NaN where the input cannot be used."""
    probabilities: NDArray[np.float32]
    """Shape (classes,)."""
    reason: str
    """Why the answer is UNKNOWN; empty otherwise."""
    start_s: float
    """First row of the window, fitted clock, seconds."""
    end_s: float
    """Last row of the window, fitted clock, seconds."""
    novelty: list[float] | None = None
    """How unlike the learned the window is, by each label; None where that is not tested, or
    the input cannot be used; NaN or infinite where it cannot be measured."""
    filled: float = 0.0
    """Share of the window's values that were missing, stale or NaN and were filled in, 0…1."""
    usable: bool = True
    """False where nothing was measured by which to answer: values are missing, a channel stands at
    the converter's limit, all channels repeat one scan, or the model gave NaN."""
    empty: bool = False
    """True where none of its values may be used."""


@dataclass(frozen=True, slots=True)
class Quality:
    """How much of a window may be used."""

    usable: float = 1.0
    """Share of its values that may be used, 0…1."""
    saturated: float = 0.0
    """Largest share of saturated rows in any one channel, 0…1."""
    span_s: tuple[float, float] = (0.0, 0.0)
    """Times of its first and last row, seconds."""
    filled: float = 0.0
    """Share of its values that were filled in, 0…1; they count as usable."""
    frozen: bool = False
    """True where all channels repeat one scan, for longer than touch ever did in training."""

    @staticmethod
    def of(windows: Windows, index: int, motion: Motion | None = None) -> Quality:
        """Return that of one of several windows.

        Args:
            windows: Shape (n, steps, channels).
            index: Of the window, from 0.
            motion: How channels changed in training; None where that is not known.
        """
        span_s = float(windows.start_s[index]), float(windows.end_s[index])
        usable, saturated = float(windows.usable[index]), float(windows.saturated[index])
        rows, measured = windows.values[index], windows.mask[index]
        frozen = motion is not None and motion.frozen(rows if measured[-1] else rows[measured])
        return Quality(usable, saturated, span_s, float(windows.filled[index]), frozen)


def decide(
    probabilities: NDArray[np.float32],
    quality: Quality,
    classes: tuple[str, ...],
    config: RecogniseConfig,
    novelty: list[float] | None = None,
    test: NoveltyTest | None = None,
) -> Decision:
    """Return the answer for one window.

    Args:
        probabilities: Shape (classes,).
        quality: How much of the window may be used.
        classes: The answers' names.
        config: When an answer may be given.
        novelty: The window's novelty scores, as `test` gives them; where they are None or
            not finite although there is a test, the answer is UNKNOWN.
        test: What says how rare that is; None where the bundle has no such test.
    """
    best = int(probabilities.argmax())
    confidence = float(probabilities[best])
    reason = _fault(probabilities, quality, config)
    usable = not reason
    if reason or test is None:
        novelty = None
    elif novelty is None or not isfinite(sum(novelty)):
        reason = UNMEASURED
    elif not (p := test.p_window(novelty)) > test.rejected:
        reason = unlike(p)
    if not reason and confidence < config.least_confidence:
        reason = f"confidence {confidence:.2f} is below {config.least_confidence:.2f}"
    label = UNKNOWN if reason else classes[best]
    start_s, end_s = quality.span_s
    return Decision(
        label, confidence, probabilities, reason, start_s, end_s, novelty, quality.filled, usable,
        empty=not quality.usable + quality.filled > 0,
    )  # fmt: skip


def at_limit(windows: Windows) -> NDArray[np.bool_]:
    """Return in which windows a channel stands at the converter's limit in all rows, shape (n,)."""
    return np.asarray(windows.saturated > RecogniseConfig().most_saturated)


def unlike(p: float) -> str:
    """Return why touch is UNKNOWN that known touch is as novel as this with probability p."""
    return f"novel touch (p = {p:.2g})"


def _fault(probabilities: NDArray[np.float32], quality: Quality, config: RecogniseConfig) -> str:
    usable = quality.usable + quality.filled
    if not isfinite(float(probabilities.sum())):  # NaN and infinity survive a sum
        return "the model gave NaN"
    if usable < config.least_usable:
        return f"{1 - usable:.0%} of the values are missing, stale or NaN"
    if quality.saturated > config.most_saturated:
        return "a channel stands at the converter's limit"
    if quality.frozen:
        return "all channels repeat one scan: the array has stopped, or rests without noise"
    return ""


class FaultWatch:
    """Follows decisions, and says when for too long none of them was of a usable window.

    A single row that is missing makes all windows unusable that hold it. So one that shares no row
    with the first unusable one must have come, or one without any value.

    Args:
        gap_s: Longest pause within a contact, seconds.
    """

    def __init__(self, gap_s: float) -> None:
        self._gap_s = gap_s
        self._good_s: float | None = None
        self._over = False
        self.first: Decision | None = None
        """The first unusable window since a usable one; None where the newest is usable."""

    def look(self, decision: Decision) -> bool:
        """Take in one decision; return whether nothing usable has been measured for too long."""
        if decision.usable:
            self._good_s, self.first, self._over = decision.end_s, None, False
            return False
        first = self.first = self.first or decision
        since_s = first.start_s if self._good_s is None else self._good_s
        apart = decision.empty or decision.start_s > first.end_s
        self._over = self._over or (apart and decision.end_s - since_s > self._gap_s)
        return self._over


@dataclass(frozen=True, slots=True)
class _Window:
    """What a window adds to its contact."""

    logarithms: NDArray[np.float64] | None
    """Of its probabilities, shape (classes,); None where it is UNKNOWN."""
    novelty: list[float] | None
    """Its novelty scores; None where there are none, or no number."""
    unmeasured: bool
    """Whether it was tested and gave no number."""


class GraspVote:
    """Join the windows of one contact: the mean of their log-probabilities decides, and how many
    there are says how surely.

    Windows further apart than `gap_s` belong to different contacts, and a contact of which nothing
    usable was measured for longer is over: its answer is UNKNOWN from then on. UNKNOWN
    windows do not vote, unless all are. Where the bundle knows the unknown, the
    mean novelty score of all windows may make the whole contact UNKNOWN; a window whose
    novelty score is no number stays out of that mean and counts as one of p = 0.

    Args:
        classes: The answers' names.
        gap_s: Longest pause within a contact, seconds.
        test: The bundle's test for the unknown, if it has one.
        joining: How sure windows are together; the mean unless the bundle says more.
        most: How many windows count at most, the latest: where no gate parts a contact from the
            next, the answer follows what is held (docs/decisions/0010). None: all.
    """

    def __init__(
        self,
        classes: tuple[str, ...],
        gap_s: float,
        test: NoveltyTest | None = None,
        joining: Joining = MEAN,
        most: int | None = None,
    ) -> None:
        self._classes = classes
        self._gap_s = gap_s
        self._test = test
        self._joining = joining
        self._most = most
        self._faults = FaultWatch(gap_s)
        self.contacts = 0
        """Contacts that have begun."""
        self.over()

    @property
    def classes(self) -> tuple[str, ...]:
        """What may be answered, beside UNKNOWN."""
        return self._classes

    @property
    def windows(self) -> int:
        """How many windows vote in this contact."""
        return self._count

    def emptied(self) -> GraspVote:
        """Return such a vote in which no window has voted, and all will: somebody else says
        where a contact begins and ends.
        """
        return GraspVote(self.classes, inf, self._test, self._joining)

    def over(self) -> None:
        """End the contact: what comes next belongs to another."""
        self.contacts += 1
        self._sum = np.zeros(len(self._classes))
        self._novelty = np.zeros(len(self._test.labels) if self._test is not None else 0)
        self._count = self._tested = self._unmeasured = 0
        self._latest: deque[_Window] = deque()
        self._end_s: float | None = None
        self.p_known = float("nan")
        """How often a known contact scores at least as high, 0…1; NaN where that is not tested."""

    def add(self, decision: Decision) -> tuple[str, float]:
        """Take in one decision; return the contact's answer so far and its confidence, 0…1."""
        end_s = self._end_s
        paused = end_s is not None and decision.start_s - end_s > self._gap_s
        if self._faults.look(decision) or paused:
            self.over()
        if decision.usable:
            self._end_s = decision.end_s
        self._count_in(self._window(decision))
        # A contact of which no window was tested has p = NaN: it is not known either.
        if not self._count or (self._test is not None and not self.p_known > self._test.rejected):
            return UNKNOWN, float("nan")
        mean = self._sum[None] / self._count
        (found,) = self._joining.of_means(mean, np.array([float(self._count)]))
        best = int(found.argmax())
        return self._classes[best], float(found[best])

    def _window(self, decision: Decision) -> _Window:
        novelty, tested = decision.novelty, self._test is not None
        measured = tested and novelty is not None and isfinite(sum(novelty))
        return _Window(
            np.log(np.maximum(decision.probabilities, 1e-7)).astype(np.float64)
            if decision.label != UNKNOWN else None,
            novelty if measured else None,
            unmeasured=tested and novelty is not None and not measured,
        )  # fmt: skip

    def _count_in(self, window: _Window) -> None:
        self._tally(window, 1)
        if self._most is not None:
            self._latest.append(window)
            if len(self._latest) > self._most:
                self._tally(self._latest.popleft(), -1)
        if self._test is not None:
            tested = self._tested + self._unmeasured
            self.p_known = self._p_contact(self._test) if tested else float("nan")

    def _tally(self, window: _Window, times: int) -> None:
        """Add a window to the sums, or take it out again (times = −1)."""
        if window.logarithms is not None:
            self._sum += times * window.logarithms
            self._count += times
        if window.novelty is not None:
            self._novelty += times * np.asarray(window.novelty)
            self._tested += times
        self._unmeasured += times * window.unmeasured

    def _p_contact(self, test: NoveltyTest) -> float:
        """Return p of the windows measured, times their share of all."""
        if not self._tested:
            return 0.0
        mean = (self._novelty / self._tested).tolist()
        p = test.p_contact(mean, self._tested)
        return p * self._tested / (self._tested + self._unmeasured)
