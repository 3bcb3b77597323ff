"""The person beside a station: what they are advised to do, what they do, what came of each grasp.

Runs on times passed in. Knows nothing about processes, pages or files.

Background of our choices: docs/decisions/0046.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Any

from taxel.decisions.advice import Advice, Adviser, advise
from taxel.live.reactions import Reactions
from taxel.live.station.guard import NO_GRASP, STOP, Guard
from taxel.recordings.trial_log import GraspTrial

_KEPT = 10_000
"""Grasps kept for the summary. Source: our choice; a day of one each eight seconds."""


class Person:
    """Advice and log of one session.

    Args:
        guard: What is decided and ordered.
        now_s: When the session began, monotonic seconds.
        on_trial: Called with each grasp in which anything happened, when it is over.
    """

    def __init__(
        self, guard: Guard, now_s: float, on_trial: Callable[[GraspTrial], None] = lambda _: None
    ) -> None:
        self._guard = guard
        self._on_trial = on_trial
        self._adviser = Adviser()
        self._watchers: dict[str, tuple[str, ...]] = {"": ()}
        self.begin(now_s)
        self.trials: deque[GraspTrial] = deque(maxlen=_KEPT)
        """Grasps that are over and in which anything happened, oldest first."""

    def watch(self, watchers: Mapping[str, tuple[str, ...]], now_s: float) -> None:
        """Follow the grasps of several sources, each by itself.

        Args:
            watchers: Names of a source's cameras → those of its grasp monitors.
            now_s: Monotonic seconds.
        """
        self._watchers = dict(watchers) or self._watchers
        self.begin(now_s)

    def begin(self, now_s: float) -> None:
        """Begin the first grasp now, once everything runs."""
        self._reactions = {cameras: Reactions(now_s, cameras) for cameras in self._watchers}

    def tick(self, now_s: float) -> None:
        """Weigh what to say, after the guard has weighed what to order."""
        word, reason, _ = self._guard.shown
        if word == NO_GRASP:
            return
        interlock, decision = self._guard.interlock, self._guard.decision
        if word == STOP:
            given = self._adviser.push(Advice.HOLD_STILL, now_s, reason)
        else:
            at_limit = interlock.force_n >= interlock.config.max_n
            state = self._guard.alarms.shown(decision.state)
            advice = advise(state, raises=interlock.armed, at_limit=at_limit)
            given = self._adviser.push(advice, now_s)
        for cameras, watchers in self._watchers.items():
            state = self._guard.state_of(watchers) if watchers else decision.state
            self._reactions[cameras].watch(state, given.advice.value, now_s)

    def say(self, what: str, now_s: float) -> None:
        """Log the person's reaction to the grasp, or its outcome.

        Raises:
            ValueError: It is neither.
        """
        self._foremost().say(what, now_s)

    def marked(self, what: str, time_s: float, who: str = "") -> None:
        """Hear a word that the source of a monitor has marked; any other is none."""
        with suppress(ValueError):
            for reactions in self._of(who):
                reactions.say(what, time_s)

    def acknowledged(self, now_s: float) -> None:
        """Hear that the person has acknowledged the alarms."""
        for reactions in self._reactions.values():
            reactions.acknowledged(now_s)

    def new_grasp(self, now_s: float, outcome: str = "", who: str = "") -> None:
        """End the trial of a monitor's grasp, of every grasp unless named; the next begins."""
        self._adviser.reset(now_s)
        for reactions in self._of(who):
            trial = reactions.end(now_s, outcome)
            if trial is not None:
                self.trials.append(trial)
                self._on_trial(trial)

    def _of(self, who: str) -> list[Reactions]:
        """Return the grasp that a monitor watches; every grasp where none is named."""
        own = [cameras for cameras, names in self._watchers.items() if who in names]
        return [self._reactions[cameras] for cameras in own or self._watchers]

    def _foremost(self) -> Reactions:
        """Return the grasp that a person speaks of: that of the last alarm, else the latest."""
        return max(
            self._reactions.values(),
            key=lambda own: (own.trial.alarm_s or -math.inf, own.trial.began_s),
        )

    def advice(self, answers: Sequence[dict[str, Any]]) -> dict[str, Any] | None:
        """Return the advice that the page shows, or the recognisers' actions; None for neither.

        Args:
            answers: The newest of each recogniser: where no grasp is watched, their actions.
        """
        if self._guard.shown[0] != NO_GRASP:
            given = self._adviser.given
            return {"word": given.advice.value, "why": given.why, "since_s": given.since_s}
        own = [answer for answer in answers if answer["action"]]
        if not own:
            return None
        why = ", ".join(f"{answer['target']} {answer['label']}" for answer in own)
        return {"word": ", ".join(answer["action"] for answer in own), "why": why, "since_s": None}

    def trial(self) -> dict[str, Any] | None:
        """Return the grasp that is watched as the page shows it; None where none is.

        Of several grasps it is the one that a person speaks of, named by its cameras.
        """
        if self._guard.shown[0] == NO_GRASP:
            return None
        foremost = self._foremost()
        named = {"cameras": foremost.trial.cameras} if len(self._reactions) > 1 else {}
        return foremost.snapshot() | named
