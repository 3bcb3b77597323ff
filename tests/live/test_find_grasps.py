"""Claims about a monitor that finds the start of each grasp by itself."""

from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from taxel.bundles.grasp import read_grasp_bundle
from taxel.bundles.shipped import shipped_bundle
from taxel.clock import ManualClock
from taxel.decisions.reasons import kind_of
from taxel.decisions.stability import Stability, StabilityDecision
from taxel.live import grasp_session
from taxel.live.grasp_monitor import GraspAnswer, GraspMonitor
from taxel.live.grasp_session import GraspTally, run_grasp_session
from taxel.signals import Mark
from taxel.sim.pour.cups import draw_cup
from taxel.sources.opening import open_source
from taxel.sources.simulated.pour import PourChoice, draw_choice
from taxel.windows.pairs import FramePairer

ADDRESS = "sim://cup-pour?speed=max&runs=1&cup=7&approach=yes&kind=lift&force_n=15&duration_s=3.6"


@pytest.fixture(scope="module")
def answers() -> list[tuple[GraspAnswer, bool]]:
    found: list[tuple[GraspAnswer, bool]] = []
    bundle = read_grasp_bundle(shipped_bundle("slip-rule"))
    with open_source(ADDRESS, ManualClock()) as source:
        tally = run_grasp_session(source, bundle, on_answer=lambda a, c: found.append((a, c)))
    assert tally.starts == [round(a.time_s - found[0][0].time_s, 3) for a, _ in found if a.began]
    return found


def test_nothing_is_held_until_the_grasp_is_found_soon_after_both_gels_press(
    answers: list[tuple[GraspAnswer, bool]],
) -> None:
    choice = PourChoice(cup=7, approach=True, kind="lift", force_n=15.0, duration_s=3.6)
    approach = draw_choice(choice, 0).approach
    assert approach is not None
    (began,) = (number for number, (answer, _) in enumerate(answers) if answer.began)
    first_s = answers[0][0].time_s
    delay_s = answers[began][0].time_s - first_s - approach.settled_s
    assert 0.0 < delay_s < 0.4
    assert {a.decision.state.name for a, _ in answers[:began]} == {"NO_GRASP"}
    assert {kind_of(a.decision.reason) for a, _ in answers[:began]} == {"no grasp yet"}
    assert answers[began][0].decision.state.name == "UNKNOWN"
    later = {a.decision.state.name for a, _ in answers[began + 20 : began + 30]}
    assert later == {"STABLE"}, "the moments that stood still are the settled grasp's first"


def test_a_key_begins_a_grasp_that_is_not_waited_for() -> None:
    bundle = read_grasp_bundle(shipped_bundle("slip-rule"))
    address = ADDRESS.replace("approach=yes", "approach=no").replace("3.6", "1")
    with open_source(address, ManualClock()) as source:
        monitor = GraspMonitor(bundle, source.cameras, find=True)
        pairer, states = FramePairer(2), []
        monitor.reset()
        while not source.ended:
            source.read()
            for frame in source.frames():
                pair = pairer.push(frame)
                if pair is not None:
                    states.append(monitor.push(pair).decision.state.name)
    assert states[0] == "UNKNOWN"
    assert "STABLE" in states
    assert "NO_GRASP" not in states


def test_a_grasp_has_ended_only_where_one_had_begun() -> None:
    bundle = read_grasp_bundle(shipped_bundle("slip-rule"))
    with open_source(ADDRESS, ManualClock()) as source:
        monitor = GraspMonitor(bundle, source.cameras)
    assert kind_of(monitor.at(0.0).reason) == "no grasp yet"
    assert kind_of(monitor.over(0.1).reason) == "grasp over"
    assert kind_of(monitor.at(0.2).reason) == "grasp over"
    begun_by_hand = GraspMonitor(bundle, source.cameras)
    begun_by_hand.reset()
    assert kind_of(begun_by_hand.at(0.0).reason) != "no grasp yet"


def test_another_cup_is_another_approach() -> None:
    choice = PourChoice(approach=True)
    first, second = (draw_choice(choice, number).approach for number in (0, 1))
    assert first != second
    assert draw_choice(replace(choice, cup=3), 0).cup == draw_cup(0, 3)


def _tally_of(
    states: list[str | Mark], starts: set[int], monkeypatch: pytest.MonkeyPatch
) -> GraspTally:
    """Return a session's tally: a state each second, and marks between them."""
    overs: list[float] = []

    class Monitor:
        def __init__(self, *_: Any) -> None:
            self.moments = iter([state for state in states if isinstance(state, str)])
            self.number = -1

        def see(self, frame: Any) -> None:
            pass

        def over(self, time_s: float) -> StabilityDecision:
            overs.append(time_s)
            return StabilityDecision(Stability.NO_GRASP, "", time_s, 0.0)

        def push(self, found: Any) -> GraspAnswer:
            self.number += 1
            decision = StabilityDecision(Stability[next(self.moments)], "", 0.0, 0.5)
            return GraspAnswer(decision, 0.5, found.time_s, 0.0, (), self.number in starts)

    def moments(*_: Any) -> Iterator[Any]:
        number = 0
        for state in states:
            if isinstance(state, Mark):
                yield state
                continue
            yield SimpleNamespace(time_s=float(number))
            number += 1

    monkeypatch.setattr(grasp_session, "GraspMonitor", Monitor)
    monkeypatch.setattr(grasp_session, "moments_and_marks", moments)
    source: Any = SimpleNamespace(cameras=(None, None))
    tally = run_grasp_session(source, bundle=None)  # type: ignore[arg-type]
    assert len(overs) == len(tally.grasps)
    return tally


def test_the_alarm_of_each_grasp_is_counted_where_cameras_find_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """No mark ends such a grasp: of all alarms of a session the first grasp's alone was counted."""
    first, second = ["STABLE", "WARNING", "UNSTABLE"], ["STABLE", "STABLE", "WARNING"]
    states = [*first, "NO_GRASP", *second, "NO_GRASP", "STABLE"]
    tally = _tally_of([*states], {0, 4, 8}, monkeypatch)
    assert (tally.alarms, tally.starts) == (2, [0.0, 4.0, 8.0])


def test_a_gel_that_looks_untouched_inside_a_marked_grasp_hides_no_alarm(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The first alarm of a marked grasp stands, though the images seemed to begin another one."""
    before = ["STABLE", "WARNING", "NO_GRASP"]  # a grasp that no mark ended
    inside = ["STABLE", "WARNING", "NO_GRASP", "STABLE", "STABLE", "UNSTABLE"]
    mark = Mark(start_s=3.0, end_s=8.0, labels={"outcome": "drop"})
    tally = _tally_of([*before, *inside, mark], {0, 3, 6}, monkeypatch)
    assert [grasp["first_alarm_s"] for grasp in tally.grasps] == [1.0]


def test_a_warning_that_stands_when_a_marked_grasp_begins_counts_from_there(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    mark = Mark(start_s=1.5, end_s=3.0, labels={"outcome": "hold"})
    tally = _tally_of(["STABLE", "WARNING", "WARNING", "STABLE", mark], set(), monkeypatch)
    assert [grasp["first_alarm_s"] for grasp in tally.grasps] == [0.0]


def test_only_a_mark_with_an_outcome_ends_a_grasp_in_the_terminal(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As on the page: a hand's mark in the same file, or a person's reaction, ends none."""
    hand = Mark(start_s=0.0, end_s=0.5, labels={"shape": "ball"})
    reaction = Mark(start_s=1.0, end_s=1.0, labels={"reaction": "stop"})
    end = Mark(start_s=0.0, end_s=3.0, labels={"outcome": "drop"}, groups={"run": "0"})
    states: list[str | Mark] = ["STABLE", hand, "WARNING", reaction, "STABLE", "STABLE", end]
    tally = _tally_of(states, set(), monkeypatch)
    assert tally.grasps == [{"outcome": "drop", "first_alarm_s": 1.0, "run": "0"}]
