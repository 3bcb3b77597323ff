"""From a window's probabilities to an answer, or to UNKNOWN with its reason.

Knows nothing about models, sources or screens.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from taxel.decisions.joining import MEAN, Joining
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

    @staticmethod
    def of(windows: Windows, index: int) -> Quality:
        """Return that of one of several windows."""
        span_s = float(windows.start_s[index]), float(windows.end_s[index])
        usable, saturated = float(windows.usable[index]), float(windows.saturated[index])
        return Quality(usable, saturated, span_s, float(windows.filled[index]))


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
    reason = _fault(probabilities, quality.usable + quality.filled, quality.saturated, config)
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
        label, confidence, probabilities, reason, start_s, end_s, novelty, quality.filled
    )


def unlike(p: float) -> str:
    """Return why touch is UNKNOWN that known touch is as novel as this with probability p."""
    return f"novel touch (p = {p:.2g})"


def _fault(
    probabilities: NDArray[np.float32],
    usable: float,
    saturated: float,
    config: RecogniseConfig,
) -> str:
    if not isfinite(float(probabilities.sum())):  # NaN and infinity survive a sum
        return "the model gave NaN"
    if usable < config.least_usable:
        return f"{1 - usable:.0%} of the values are missing, stale or NaN"
    if saturated > config.most_saturated:
        return "a channel stands at the converter's limit"
    return ""


class GraspVote:
    """Join the windows of one contact: the mean of their log-probabilities decides, and how many
    there are says how surely.

    Windows further apart than `gap_s` belong to different contacts. UNKNOWN
    windows do not vote, unless all are. Where the bundle knows the unknown, the
    mean novelty score of all windows may make the whole contact UNKNOWN; a window whose
    novelty score is no number stays out of that mean and counts as one of p = 0.

    Args:
        classes: The answers' names.
        gap_s: Longest pause within a contact, seconds.
        test: The bundle's test for the unknown, if it has one.
        joining: How sure windows are together; the mean unless the bundle says more.
    """

    def __init__(
        self,
        classes: tuple[str, ...],
        gap_s: float,
        test: NoveltyTest | None = None,
        joining: Joining = MEAN,
    ) -> None:
        self._classes = classes
        self._gap_s = gap_s
        self._sum = np.zeros(len(classes))
        self._count = 0
        self._end_s: float | None = None
        self._test = test
        self._joining = joining
        self._novelty = [0.0] * (len(test.labels) if test is not None else 0)
        self._tested = self._unmeasured = 0
        self.p_known = float("nan")
        """How often a known contact scores at least as high, 0…1; NaN where that is not tested."""

    @property
    def classes(self) -> tuple[str, ...]:
        """What may be answered, beside UNKNOWN."""
        return self._classes

    @property
    def windows(self) -> int:
        """How many windows have voted in this contact."""
        return self._count

    def emptied(self) -> GraspVote:
        """Return such a vote in which no window has voted."""
        return GraspVote(self.classes, self._gap_s, self._test, self._joining)

    def add(self, decision: Decision) -> tuple[str, float]:
        """Take in one decision; return the contact's answer so far and its confidence, 0…1."""
        if self._end_s is not None and decision.start_s - self._end_s > self._gap_s:
            self._sum[:], self._count = 0.0, 0
            self._novelty = [0.0] * len(self._novelty)
            self._tested = self._unmeasured = 0
            self.p_known = float("nan")
        self._end_s = decision.end_s
        if decision.label != UNKNOWN:
            self._sum += np.log(np.maximum(decision.probabilities, 1e-7))
            self._count += 1
        if self._test is not None and decision.novelty is not None:
            if isfinite(sum(decision.novelty)):
                self._novelty = [
                    a + b for a, b in zip(self._novelty, decision.novelty, strict=True)
                ]
                self._tested += 1
            else:
                self._unmeasured += 1
            self.p_known = self._p_contact(self._test)
        # A contact of which no window was tested has p = NaN: it is not known either.
        if not self._count or (self._test is not None and not self.p_known > self._test.rejected):
            return UNKNOWN, float("nan")
        mean = self._sum[None] / self._count
        (found,) = self._joining.of_means(mean, np.array([float(self._count)]))
        best = int(found.argmax())
        return self._classes[best], float(found[best])

    def _p_contact(self, test: NoveltyTest) -> float:
        """Return p of the windows measured, times their share of all."""
        if not self._tested:
            return 0.0
        mean = [total / self._tested for total in self._novelty]
        p = test.p_contact(mean, self._tested)
        return p * self._tested / (self._tested + self._unmeasured)
