"""Follow one grasp after another: the alarm, what the person does about it, what comes of it.

A grasp's trial begins with the grasp before it over, or with the session, and ends with a new
grasp or the session. Runs on times passed in. Knows nothing about keys, pages or files.

Background of our choices: docs/decisions/0046.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from taxel.decisions.stability import Stability
from taxel.recordings.trial_log import LEVELS, OUTCOMES, REACTIONS, GraspTrial

_OF_SOURCE = {"hold": "held", "gross slip": "slipped", "slip": "slipped", "drop": "dropped"}
"""A simulator's outcome → ours."""
_LEVEL = {Stability.WARNING: "warning", Stability.UNSTABLE: "danger"}
NAMED = (*REACTIONS, *OUTCOMES)
"""What a person may say."""


class Reactions:
    """The grasp that is watched now, and what happened in it.

    Args:
        now_s: When the session began, monotonic seconds.
        cameras: Names of those that watch the grasps.
    """

    def __init__(self, now_s: float, cameras: str = "") -> None:
        self._trial = GraspTrial(number=1, began_s=now_s, ended_s=now_s, cameras=cameras)
        self._begun = False
        """True once a state was heard that cannot be the grasp's before."""

    @property
    def trial(self) -> GraspTrial:
        """The grasp that is watched now, as far as it is."""
        return self._trial

    def watch(self, state: Stability, advice: str, now_s: float) -> None:
        """Take in the state of the grasp: the first that warns is the alarm.

        What warns from the start is the last word about the grasp before, and counts for none.

        Args:
            state: Of all its monitors together.
            advice: What the person is advised to do.
            now_s: Monotonic seconds.
        """
        level = _LEVEL.get(state, "")
        if not level:
            self._begun = True
        if not level or not self._begun:
            return
        trial = self._trial
        if trial.alarm_s is None:
            trial = replace(trial, alarm_s=now_s, advice=advice)
        if LEVELS.index(level) > LEVELS.index(trial.alarm):
            trial = replace(trial, alarm=level)
        self._trial = trial

    def acknowledged(self, now_s: float) -> None:
        """Hear that a person has acknowledged the alarms; the first time counts."""
        if self._trial.alarm_s is not None and self._trial.acknowledged_s is None:
            self._trial = replace(self._trial, acknowledged_s=now_s)

    def say(self, what: str, now_s: float) -> None:
        """Log a person's reaction, of which the first counts, or the grasp's outcome, the last.

        Raises:
            ValueError: It is neither a reaction nor an outcome.
        """
        if what in OUTCOMES:
            self._trial = replace(self._trial, outcome=what, outcome_by="person")
        elif what not in REACTIONS:
            raise ValueError(f"needed one of {', '.join(NAMED)}; got {what!r}")
        elif not self._trial.reaction:
            self._trial = replace(self._trial, reaction=what, reaction_s=now_s)

    def end(self, now_s: float, outcome: str = "") -> GraspTrial | None:
        """End this grasp and begin the next; return it where anything happened in it.

        Args:
            now_s: Monotonic seconds.
            outcome: What the source says came of it; a person's word goes first.
        """
        trial = replace(self._trial, ended_s=max(now_s, self._trial.began_s))
        known = _OF_SOURCE.get(outcome, outcome)
        if known in OUTCOMES and not trial.outcome:
            trial = replace(trial, outcome=known, outcome_by="source")
        happened = trial.alarm_s is not None or trial.reaction or trial.outcome
        number, self._begun = trial.number + bool(happened), False
        self._trial = GraspTrial(
            number=number, began_s=trial.ended_s, ended_s=trial.ended_s, cameras=trial.cameras
        )
        return trial if happened else None

    def snapshot(self) -> dict[str, Any]:
        """Return the grasp as the page shows it."""
        trial = self._trial
        return {"number": trial.number, "alarm_s": trial.alarm_s, "reaction": trial.reaction,
                "reaction_time_s": trial.reaction_time_s, "outcome": trial.outcome}  # fmt: skip
