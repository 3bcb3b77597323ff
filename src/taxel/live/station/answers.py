"""The answers of each recogniser of a station. Knows nothing about processes or windows."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Sequence
from typing import Any

from taxel.actions.alarm import Level
from taxel.actions.rule_table import RuleTable
from taxel.decisions.reasons import REASONS, in_words
from taxel.decisions.recognition import UNKNOWN
from taxel.live.station.guard import Guard

_NO_RULES = RuleTable(())


def titles(rows: Sequence[dict[str, Any]]) -> list[str]:
    """Return what each recogniser is called: its target, where two share one also its bundle.

    Args:
        rows: For each its target, bundle and, in a station, its name: one bundle may run twice.
    """
    targets = Counter(row["target"] for row in rows)
    own = [", ".join(row[key] for key in ("bundle", "who") if key in row) for row in rows]
    return [
        row["target"] if targets[row["target"]] == 1 else f"{row['target']} ({name})"
        for row, name in zip(rows, own, strict=True)
    ]


class Answers:
    """Counts each recogniser's answers and keeps its newest.

    Args:
        recognisers: For each its target, bundle and who it is.
        rules: What is to be done about an answer.
    """

    def __init__(self, recognisers: Sequence[dict[str, Any]], rules: RuleTable = _NO_RULES) -> None:
        self._recognisers, self._rules = recognisers, rules
        self._actions: dict[str, Counter[str]] = {
            recogniser["who"]: Counter() for recogniser in recognisers
        }
        self._counts: dict[str, Counter[str]] = {
            recogniser["who"]: Counter() for recogniser in recognisers
        }
        self._marked: dict[str, Counter[bool]] = {own["who"]: Counter() for own in recognisers}
        """Recogniser → how many camera trials that the source labels it had right, and wrong."""
        self._newest: dict[str, dict[str, Any]] = {}
        self._waiting: dict[str, str] = {}
        self._level_words: dict[str, str] = {}
        self.levels: dict[str, dict[str, Any]] = {}
        """Recogniser → where its session's level stands, for a process that follows a dead one."""

    def add(self, note: dict[str, Any]) -> tuple[dict[str, Any], str]:
        """Take in one window's answer.

        Returns:
            The answer with its action and the level of its alarm, empty without one, and whether it
            is the first of its trial or contact; and where the action is a new one, or its alarm is
            raised anew, words for a person.
        """
        sure = note["grasp_confidence"]
        rule = self._rules.rule(note["target"], note["grasp"], sure)
        level = "" if rule is None or rule.alarm is None else str(rule.alarm)
        newest = self._newest.get(note["who"], {})
        begins = note.get("touch") != newest.get("touch")
        action = "" if rule is None else rule.action
        note = note | {"action": action, "alarm": level, "begins": begins}
        before = newest.get("action", "")
        self._newest[note["who"]] = note
        if note.get("last", True):  # of a camera trial the last verdict alone counts
            self._counts[note["who"]][note["label"]] += 1
            if note["action"]:
                self._actions[note["who"]][note["action"]] += 1
            if note.get("truth") is not None:
                self._marked[note["who"]][note["truth"] == note["label"]] += 1
        answer = note["grasp"] if sure is None else f"{note['grasp']} {sure:.2f}"
        news = f"{note['target']} {answer}: {note['action']}"
        raised = bool(level) and (begins or not newest.get("alarm"))
        return note, news if action and (action != before or raised) else ""

    def keep(self, note: dict[str, Any]) -> None:
        """Take in what a recogniser's first answer waits for, or where its level stands."""
        if note["kind"] == "level":
            self.levels[note["who"]], self._level_words[note["who"]] = note["state"], note["text"]
        else:
            self._waiting[note["who"]] = note["text"]

    def newest(self, given_up: Collection[str] = ()) -> list[dict[str, Any]]:
        """Return the newest answers as the page's link gives them.

        Args:
            given_up: Recognisers whose process is not started again: what they answered last is
                not of what is in the hand now.
        """
        found = []
        for recogniser, title in zip(self._recognisers, titles(self._recognisers), strict=True):
            who = recogniser["who"]
            if who in given_up:  # also where it never answered: no window will be complete
                found.append(_ended(title, who))
            elif who in self._newest:
                found.append(_as_shown(title, self._newest[who]))
            elif self._waiting.get(who):
                found.append(_waits(title, self._waiting[who]))
        return found

    def summary(self) -> list[dict[str, Any]]:
        """Return how many windows or camera trials of each recogniser had which answer."""
        return [self._summed(recogniser, recogniser["who"]) for recogniser in self._recognisers]

    def _summed(self, recogniser: dict[str, Any], who: str) -> dict[str, Any]:
        counts, marked = self._counts[who], self._marked[who]
        many: dict[str, Any] = {"windows": counts.total()}
        if recogniser.get("of") == "trial":
            many = {"trials": counts.total(), "marked": marked.total(), "right": marked[True]}
        return {
            **{key: recogniser[key] for key in ("target", "bundle", "who")}, **many,
            "answers": dict(counts.most_common()),
            "actions": dict(self._actions[who].most_common()),
            "level": self._level_words.get(who),
        }  # fmt: skip


def weigh_alarm(guard: Guard, answer: dict[str, Any], now_s: float) -> None:
    """Let a rule's alarm be on while its answer is the newest; then it waits for a person.

    Each class has an alarm of its own, and each trial or contact raises it anew: that somebody
    acknowledged another must not silence this one.

    Args:
        guard: Holds the alarms.
        answer: As `Answers.add` gives it.
        now_s: Monotonic seconds.
    """
    whose = _alarms_of(answer["who"])
    kind = f"{whose}{answer['grasp']}"
    for alarm in guard.alarms.alarms:
        other = alarm.kind != kind or answer["begins"] or not answer["alarm"]
        if alarm.kind.startswith(whose) and other:
            guard.over(alarm.kind, now_s)
    if answer["alarm"]:
        text = f"{answer['target']} {answer['grasp']}: {answer['action']}"
        guard.trouble(kind, text, now_s, danger=answer["alarm"] == Level.DANGER)


def end_alarms(guard: Guard, given_up: Collection[str], now_s: float) -> None:
    """Let the alarms of recognisers end whose process is not started again: nobody answers now.

    Args:
        guard: Holds the alarms; what nobody acknowledged still waits for a person.
        given_up: Names of such recognisers.
        now_s: Monotonic seconds.
    """
    ended = tuple(map(_alarms_of, given_up))
    for alarm in guard.alarms.alarms if ended else ():
        if alarm.kind.startswith(ended):
            guard.over(alarm.kind, now_s)


def _alarms_of(who: str) -> str:
    """Return how the kinds of a recogniser's alarms begin."""
    return f"answer of {who}: "


def _as_shown(title: str, note: dict[str, Any]) -> dict[str, Any]:
    """Return an answer for the page; it is as old as its scans, where a recogniser lags behind."""
    return {"target": title, "label": note["grasp"], "confidence": note["grasp_confidence"],
            "reason": _what_it_is_of(note), "action": note["action"],
            "time_s": note.get("as_of_s", note.get("decided_s"))}  # fmt: skip


def _waits(title: str, why: str) -> dict[str, Any]:
    """Return what stands in the place of an answer that has not come yet: no label."""
    return {"target": title, "label": "", "confidence": None, "reason": why, "action": "",
            "time_s": None}  # fmt: skip


def _ended(title: str, who: str) -> dict[str, Any]:
    """Return what stands in an answer's place where its process has ended for good."""
    return {"target": title, "label": UNKNOWN, "confidence": None,
            "reason": REASONS["monitor ended"].say(who=in_words(who)), "action": "",
            "time_s": None}  # fmt: skip


def _what_it_is_of(note: dict[str, Any]) -> str:
    """Return of what the answer is, and why the newest window alone would be UNKNOWN."""
    if "of" in note:  # of a camera trial
        return "; ".join(filter(None, (note["reason"], note["of"])))
    whole = "this contact's windows together" if note["grasp_confidence"] is not None else ""
    alone = f"the newest window alone is UNKNOWN: {note['reason']}" if note["reason"] else ""
    return "; ".join(filter(None, (whole, alone)))
