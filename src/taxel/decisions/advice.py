"""From the state of a grasp to what a person is to do: hold, grip harder, put down.

One word that can be read from two metres or heard. A milder word follows only once the milder
state has lasted: words that change several times a second cannot be obeyed. Knows nothing about
screens, voices or grippers' drivers.

Background of our choices: docs/decisions/0046.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from taxel.decisions.stability import Stability

CALM_S = 1.5
"""How long a milder state must last before its word is said, seconds. Source: our choice,
docs/decisions/0046: to hear and understand a word takes about a second."""


class Advice(StrEnum):
    """What to do, in the words that are shown."""

    NOTHING = ""
    HOLD = "HOLD"
    HOLD_STILL = "HOLD STILL"
    GRIP_HARDER = "GRIP HARDER"
    PUT_DOWN = "PUT DOWN"


_ORDER = tuple(Advice)
"""From mild to grave."""
_WHY = {
    Advice.NOTHING: "nothing is held",
    Advice.HOLD: "the grasp is stable",
    Advice.HOLD_STILL: "the state of the grasp is unknown: do not go on",
    Advice.GRIP_HARDER: "the grasp begins to slip",
    Advice.PUT_DOWN: "the grasp slips: stop, and put it down",
}
_WAITING = f"until the present state has lasted {CALM_S:g} s"
"""The reason meanwhile: that of the word is no longer true."""


@dataclass(frozen=True, slots=True)
class GivenAdvice:
    """What is said now."""

    advice: Advice
    why: str
    since_s: float
    """Since when this word is said, monotonic seconds."""


def advise(state: Stability, *, raises: bool = False, at_limit: bool = False) -> Advice:
    """Return what is to be done about a state.

    Args:
        state: Of the grasp.
        raises: A gripper is armed: it grips harder by itself.
        at_limit: Its force cannot be raised any more.
    """
    if state is Stability.WARNING and raises:
        return Advice.PUT_DOWN if at_limit else Advice.HOLD_STILL
    return {
        Stability.STABLE: Advice.HOLD,
        Stability.WARNING: Advice.GRIP_HARDER,
        Stability.UNSTABLE: Advice.PUT_DOWN,
        Stability.UNKNOWN: Advice.HOLD_STILL,
        Stability.NO_GRASP: Advice.NOTHING,
    }[state]


class Adviser:
    """Says what to do: what is graver at once, what is milder once it has lasted.

    A grasp that has ended is no milder state of it: then there is nothing to do, at once.
    """

    def __init__(self) -> None:
        self._given = GivenAdvice(Advice.NOTHING, _WHY[Advice.NOTHING], 0.0)
        self._milder: tuple[Advice, float] | None = None
        """The gravest of what was heard since all was milder, and when that began, seconds."""

    @property
    def given(self) -> GivenAdvice:
        """What is said now."""
        return self._given

    def reset(self, now_s: float) -> None:
        """Begin another grasp: nothing is said of the one before."""
        self._milder = None
        self._say(Advice.NOTHING, "", now_s)

    def push(self, advice: Advice, now_s: float, why: str = "") -> GivenAdvice:
        """Take in what is to be done now; return what is said.

        Args:
            advice: By `advise`.
            now_s: Monotonic seconds.
            why: In words; the word's own reason unless given.
        """
        rank = _ORDER.index
        if advice is Advice.NOTHING or rank(advice) >= rank(self._given.advice):
            self._milder = None
            self._say(advice, why, now_s)
        elif self._milder is None or rank(advice) > rank(self._milder[0]):
            self._milder = (advice, now_s)
        elif now_s - self._milder[1] >= CALM_S:
            self._say(self._milder[0], why if advice is self._milder[0] else "", now_s)
            self._milder = None
        if self._milder is not None:
            self._say(self._given.advice, _WAITING, now_s)
        return self._given

    def _say(self, advice: Advice, why: str, now_s: float) -> None:
        since_s = self._given.since_s if advice is self._given.advice else now_s
        self._given = GivenAdvice(advice, why or _WHY[advice], since_s)
