"""What recognisers told: each by itself, named so that a person can tell them apart."""

from typing import Any

from taxel.actions.alarm import Level
from taxel.actions.interlock import Interlock, InterlockConfig
from taxel.actions.rule_table import Rule, RuleTable
from taxel.live.station.answers import Answers, end_alarms, weigh_alarm
from taxel.live.station.guard import Guard


def note(who: str, label: str) -> dict[str, Any]:
    return {"who": who, "target": "shape", "label": label, "grasp": label,
            "grasp_confidence": 0.9, "reason": ""}  # fmt: skip


def test_the_page_shows_one_bundle_on_two_hands_as_two() -> None:
    answers = Answers(
        [{"target": "shape", "bundle": "a.taxel", "who": f"monitor {n}/0"} for n in (1, 2)]
    )
    answers.add(note("monitor 2/0", "cube"))
    answers.add(note("monitor 1/0", "ball"))

    shown = [(answer["target"], answer["label"]) for answer in answers.newest()]
    assert shown == [
        ("shape (a.taxel, monitor 1/0)", "ball"),
        ("shape (a.taxel, monitor 2/0)", "cube"),
    ]


def test_the_page_says_of_what_each_number_is():
    """63 % of the contact stood above a window's own 0.49 is below 0.50, and neither said so."""
    answers = Answers([{"target": "material", "bundle": "a.taxel", "who": "monitor/0"}])
    unsure = note("monitor/0", "aluminium") | {
        "target": "material", "label": "UNKNOWN", "grasp_confidence": 0.63,
        "reason": "confidence 0.49 is below 0.50",
    }  # fmt: skip
    answers.add(unsure)
    (shown,) = answers.newest()
    assert shown["confidence"] == 0.63
    assert shown["reason"] == (
        "this contact's windows together; the newest window alone is UNKNOWN: "
        "confidence 0.49 is below 0.50"
    )
    answers.add(unsure | {"reason": ""})
    assert answers.newest()[0]["reason"] == "this contact's windows together"
    answers.add(unsure | {"grasp_confidence": None, "reason": "saturated"})
    assert answers.newest()[0]["reason"] == "the newest window alone is UNKNOWN: saturated"


def test_the_last_answer_of_a_recogniser_that_was_given_up_is_not_shown_as_the_present():
    answers = Answers([{"target": "shape", "bundle": "a.taxel", "who": "monitor/0"}])
    answers.add(note("monitor/0", "ball"))
    (shown,) = answers.newest({"monitor/0"})
    assert (shown["label"], shown["confidence"], shown["action"]) == ("UNKNOWN", None, "")
    assert shown["reason"] == "the monitor has ended"
    assert answers.newest({"monitor/1"})[0]["label"] == "ball"


def test_a_recogniser_that_was_given_up_before_its_first_answer_is_not_waited_for():
    """The page would say NO ANSWER YET for as long as the station runs."""
    answers = Answers([{"target": "shape", "bundle": "a.taxel", "who": "monitor/0"}])
    assert answers.newest() == []
    (shown,) = answers.newest({"monitor/0"})
    assert (shown["label"], shown["reason"]) == ("UNKNOWN", "the monitor has ended")


def test_before_its_first_answer_a_recogniser_says_what_it_waits_for():
    answers = Answers([{"target": "shape", "bundle": "a.taxel", "who": "monitor/0"}])
    why = "nothing above the gate of 1.55 V yet, 0.2 at most"
    answers.keep({"kind": "waiting", "who": "monitor/0", "text": why})
    (shown,) = answers.newest()
    assert (shown["label"], shown["confidence"], shown["action"]) == ("", None, "")
    assert shown["reason"] == why
    answers.add(note("monitor/0", "ball") | {"decided_s": 7.5})
    (shown,) = answers.newest()
    assert (shown["label"], shown["time_s"]) == ("ball", 7.5)
    # On a machine that is too busy minutes of scans may wait: decided now is not of now.
    answers.add(note("monitor/0", "ball") | {"decided_s": 90.0, "as_of_s": 50.0})
    assert answers.newest()[0]["time_s"] == 50.0


def test_where_a_level_stands_is_kept_for_the_summary_and_for_a_process_that_follows():
    answers = Answers([{"target": "shape", "bundle": "a.taxel", "who": "monitor/0"}])
    assert answers.summary()[0]["level"] is None
    state = {"level": [1.0], "weight": 11.0, "touches": 1}
    words = "levels followed over 1 touch: channels stand at 0.50 to 1.00 of the usual level"
    answers.keep({"kind": "level", "who": "monitor/0", "state": state, "text": words})
    assert answers.levels == {"monitor/0": state}
    assert answers.summary()[0]["level"] == words


def test_the_alarm_of_a_recogniser_that_is_given_up_ends_and_waits_for_a_person() -> None:
    """Its last answer is of no touch that is there now; another recogniser's alarm stays on."""
    rules = RuleTable((Rule(label="ball", least=0.5, action="stop", alarm=Level.DANGER),))
    rows = [{"target": "shape", "bundle": "a.taxel", "who": who} for who in ("one/0", "two/0")]
    guard, answers = Guard(Interlock(InterlockConfig(min_n=1.0, max_n=2.0))), Answers(rows, rules)
    for row in rows:
        answer, _ = answers.add(note(str(row["who"]), "ball"))
        weigh_alarm(guard, answer, 1.0)
    end_alarms(guard, ("one/0",), 2.0)
    end_alarms(guard, (), 3.0)

    on = {alarm.kind: (alarm.on, alarm.acknowledged) for alarm in guard.alarms.alarms}
    assert on == {"answer of one/0: ball": (False, False), "answer of two/0: ball": (True, False)}


def test_an_alarm_that_is_raised_anew_is_said_though_its_action_is_not_new() -> None:
    """The next contact of the same class raised an alarm that the terminal never printed."""
    rules = RuleTable((Rule(label="ball", least=0.5, action="stop", alarm=Level.DANGER),))
    answers = Answers([{"target": "shape", "bundle": "a.taxel", "who": "one/0"}], rules)
    touches = [answers.add(note("one/0", "ball") | {"touch": touch})[1] for touch in (1, 1, 2, 2)]
    assert touches == ["shape ball 0.90: stop", "", "shape ball 0.90: stop", ""]
