"""Beside a station: what the guard decides becomes a word to obey, and each grasp is logged."""

from taxel.actions.interlock import Interlock, InterlockConfig
from taxel.live.station.guard import Guard
from taxel.live.station.person import Person
from taxel.live.station.snapshots import stalled_snapshot
from taxel.recordings.trial_log import GraspTrial

ANSWERS = [{"target": "material", "label": "glass", "action": "glass bin"},
           {"target": "shape", "label": "ball", "action": ""}]  # fmt: skip


class Station:
    """A guard with one monitor, driven by hand."""

    def __init__(self) -> None:
        self.guard = Guard(Interlock(InterlockConfig(min_n=10.0, max_n=40.0)))
        self.guard.expect("monitor", 0.0)
        self.trials: list[GraspTrial] = []
        self.person = Person(self.guard, 0.0, self.trials.append)

    def become(self, state: str, now_s: float) -> str:
        self.guard.decide("monitor", {"state": state, "decided_s": now_s, "p": 0.5})
        self.guard.beat("monitor", now_s)
        self.guard.tick(now_s)
        self.person.tick(now_s)
        shown = self.person.advice([])
        assert shown is not None
        return str(shown["word"])


def test_a_slip_is_reported_and_logged_with_the_persons_reaction() -> None:
    station = Station()
    assert station.become("STABLE", 1.0) == "HOLD"
    assert station.become("WARNING", 1.01) == "GRIP HARDER"
    assert station.become("UNSTABLE", 1.02) == "PUT DOWN"
    station.person.say("put down", 1.5)
    assert station.person.trial() == {
        "number": 1, "alarm_s": 1.01, "reaction": "put down", "reaction_time_s": 0.49,
        "outcome": "",
    }  # fmt: skip
    station.person.new_grasp(3.0, "hold")

    (trial,) = station.trials
    assert (trial.alarm, trial.advice, trial.outcome) == ("danger", "GRIP HARDER", "held")
    assert list(station.person.trials) == [trial]


def test_a_silent_monitor_is_hold_still_never_a_word_about_the_grasp() -> None:
    station = Station()
    station.become("STABLE", 1.0)
    station.guard.tick(1.4)
    station.person.tick(1.4)

    shown = station.person.advice([])
    assert shown is not None
    assert shown["word"] == "HOLD STILL"
    assert station.guard.shown[0] == "STOP"


def test_marks_of_the_source_count_as_the_person_and_other_words_do_not() -> None:
    station = Station()
    station.become("STABLE", 0.9)
    station.become("WARNING", 1.0)
    station.person.marked("sneezed", 1.2)
    station.person.marked("grip changed", 1.3)

    assert station.person.trial()["reaction"] == "grip changed"  # type: ignore[index]


def test_where_no_grasp_is_watched_the_action_of_what_is_recognised_is_to_be_done() -> None:
    person = Person(Guard(Interlock(InterlockConfig(min_n=10.0, max_n=40.0))), 0.0)
    person.tick(1.0)

    assert person.advice(ANSWERS) == {"word": "glass bin", "why": "material glass", "since_s": None}
    assert person.advice(ANSWERS[1:]) is None
    assert person.trial() is None


def test_while_the_supervisor_stands_still_the_word_is_hold_still() -> None:
    shown = stalled_snapshot({"do": {"word": "HOLD"}, "alarms": []}, 0.5, 10.0)

    assert shown["do"]["word"] == "HOLD STILL"


def test_grasps_of_two_pairs_of_cameras_are_logged_apart() -> None:
    """One row held the alarm of one pair and was ended by the other's next grasp."""
    guard = Guard(Interlock(InterlockConfig(min_n=10.0, max_n=40.0)))
    trials: list[GraspTrial] = []
    person = Person(guard, 0.0, trials.append)
    person.watch({"left + right": ("monitor 1/0",), "left-2 + right-2": ("monitor 2/0",)}, 0.0)
    states = {"monitor 1/0": "STABLE", "monitor 2/0": "STABLE"}
    for who in states:
        guard.expect(who, 0.0)

    def turn(now_s: float) -> None:
        for who, state in states.items():
            guard.decide(who, {"state": state, "decided_s": now_s, "p": 0.5})
            guard.beat(who, now_s)
        guard.tick(now_s)
        person.tick(now_s)

    turn(0.1)
    states["monitor 2/0"] = "WARNING"
    turn(0.2)
    shown = person.trial()
    assert shown is not None
    assert shown["cameras"] == "left-2 + right-2"  # the page names whose buttons these are
    person.say("put down", 0.5)
    person.new_grasp(1.0, "hold", "monitor 1/0")
    person.new_grasp(2.0, "drop", "monitor 2/0")
    person.new_grasp(3.0)

    assert [(t.cameras, t.number, t.alarm, t.reaction, t.outcome, t.ended_s) for t in trials] == [
        ("left + right", 1, "", "", "held", 1.0),
        ("left-2 + right-2", 1, "warning", "put down", "dropped", 2.0),
    ]


def test_a_mark_of_one_source_is_of_its_own_grasp_and_the_end_of_all_grasps_of_each() -> None:
    trials: list[GraspTrial] = []
    guard = Guard(Interlock(InterlockConfig(min_n=10.0, max_n=40.0)))
    person = Person(guard, 0.0, trials.append)
    person.watch({"a": ("monitor 1/0", "monitor 1/1"), "b": ("monitor 2/0",)}, 0.0)
    person.marked("put down", 0.4, "monitor 2/0")
    person.say("held", 0.5)
    person.new_grasp(1.0)
    assert [(t.cameras, t.reaction, t.outcome) for t in trials] == [
        ("a", "", "held"), ("b", "put down", ""),
    ]  # fmt: skip
