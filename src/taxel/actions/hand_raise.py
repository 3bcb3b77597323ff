"""How the TENG hand grips harder: its contact current rises in steps, up to a bound.

A finger that contact has stopped goes on only for a grip that allows more current than the one
that stopped it (protocol/SPEC.md, firmware/hand_control/hand_logic.c). So each step is a grip with
a higher contact current. Opt-in: nobody knows the force of a current until it is measured. Knows
nothing about decisions or ports.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from taxel.actions.hand_contract import Hand
from taxel.errors import BadInput

MOST_MA = 2400
"""The largest bound, milliamperes: below the firmware's over-current of 2500, decision 20."""
_LASTS_S = 0.2
"""An order runs out so long after it unless it is repeated, seconds."""
_CLOSED_PERMILLE = 1000
"""Fingers are ordered to close all the way: the contact current stops them, per mille."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CurrentRaise:
    """Steps of the contact current. Source: our choice, docs/decisions/0043."""

    step_ma: int
    """Each step, milliamperes."""
    most_ma: int
    """Never more than this, milliamperes."""
    contact_ma: int = 700
    """What the grasp was made with, milliamperes: the first step goes up from here."""
    every_s: float = 0.2
    """From one step to the next, seconds: a motor's start-up peak is over by then."""
    fingers: int = 0b1111
    """Which fingers: bit 0 the first."""

    def __post_init__(self) -> None:
        if not 0 < self.contact_ma < self.most_ma <= MOST_MA or not self.step_ma > 0:
            raise BadInput(
                f"a step above 0 mA and a bound above contact_ma, at most {MOST_MA} mA",
                f"raise_ma {self.step_ma}, contact_ma {self.contact_ma}, most_ma {self.most_ma}",
                "mend the address",
            )


class Raising:
    """The steps taken so far; they only rise, also from one alarm to the next."""

    def __init__(self, config: CurrentRaise) -> None:
        self._config = config
        self._limit_ma = config.contact_ma
        self._stepped_s = -math.inf

    def obey(self, hand: Hand, now_s: float) -> None:
        """Grip harder, or go on gripping as hard as the last step was.

        Args:
            hand: A hand that is well. Where its board is not armed it is asked to arm first: GRIP
                orders come only while a person has armed the interlock.
            now_s: This moment, monotonic seconds.
        """
        config = self._config
        if not hand.status().armed:
            hand.arm()
            return
        if now_s - self._stepped_s >= config.every_s and self._limit_ma < config.most_ma:
            self._limit_ma = min(self._limit_ma + config.step_ma, config.most_ma)
            self._stepped_s = now_s
        hand.grip(config.fingers, _CLOSED_PERMILLE, self._limit_ma, _LASTS_S)
