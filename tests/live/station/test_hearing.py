"""What a supervisor makes of notes: of monitors, recognisers, the recorder and the page.

No process runs: the rings are real, and the tests write what the processes would.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from taxel.actions.alarm import Level
from taxel.actions.rule_table import Rule, RuleTable
from taxel.gel.slip_signal import Slip
from taxel.live.station.answers import Answers
from taxel.live.station.packets import pack, unpack
from taxel.live.station.ring import Ring, RingReader, RingWriter
from taxel.live.station.station import Station
from taxel.live.station.wiring import MonitorLink, StationConfig, Wiring
from taxel.recordings.trial_log import log_of, read_trial_log
from taxel.signals import CameraInfo

WHO = "monitor/0"
RECOGNISER = {"kind": "answer", "who": "monitor/1", "target": "shape", "bundle": "b.taxel"}
SLIP = {"slip_mm": 0.2}
PAIR = ("left", "right")


class Rig:
    """A station whose monitors, recorder and page are this test."""

    def __init__(self, stack: ExitStack, config: StationConfig) -> None:
        self.heard_notes: list[dict[str, Any]] = []
        self.station = Station(config, on_note=self.heard_notes.append)
        self._stack = stack
        self.monitor, heard = self._ring()
        self.recorder, news = self._ring()
        self.page, requests = self._ring()
        to_recorder, self.recorder_orders = self._ring()
        to_monitor, self.monitor_orders = self._ring()
        watch = SimpleNamespace(name="monitor", row=0)
        monitor = MonitorLink(cast("Any", watch), "", heard, to_monitor, cast("Any", None),
                    [{"kind": "grasp", "who": WHO}, RECOGNISER])  # fmt: skip
        self.station.wiring = cast("Wiring", SimpleNamespace(
            monitors=[monitor], feeds=[],
            send_to=lambda name: to_monitor if name == "monitor" else None,
        ))  # fmt: skip
        self.station._recorder.wire(to_recorder, news)
        self.station._requests = requests
        self.station.answers = Answers([RECOGNISER], config.rules)
        self.station.guard.expect(WHO, 0.0)
        stack.callback(self.station.close)  # before the rings that it reads

    def _ring(self) -> tuple[RingWriter, RingReader]:
        name = self._stack.enter_context(Ring(2**16)).name
        reader = self._stack.enter_context(RingReader(name))
        return self._stack.enter_context(RingWriter(name)), reader

    def grasp(self, now_s: float, state: str = "STABLE", **more: Any) -> None:
        note = {"kind": "grasp", "who": WHO, "state": state, "reason": "", "since_s": now_s,
                "p": 0.1, "skipped": 0, "decided_s": now_s, **more}  # fmt: skip
        self.monitor.put(pack(note))

    def hear(self, now_s: float) -> None:
        """One turn of the supervisor, without acting."""
        for note in self.station._hear(now_s):
            self.station._on_note(note)
        self.station.guard.beat(WHO, now_s)
        self.station.guard.tick(now_s)
        self.station.person.tick(now_s)

    def recording(self, **news: Any) -> None:
        self.recorder.put(pack({"kind": "recording", "on": True, "path": "a.mcap", **news}))

    def ordered(self) -> list[Any]:
        return [unpack(content) for content in self.recorder_orders.take()]

    @property
    def words(self) -> list[str]:
        return [text for _, _, text in self.station.events]

    def alarm(self, kind: str) -> Any:
        return next((a for a in self.station.guard.alarms.alarms if a.kind == kind), None)


@pytest.fixture
def make() -> Iterator[Any]:
    with ExitStack() as stack:
        yield lambda **more: Rig(stack, StationConfig(sources=(), bundles=(), **more))


def test_a_slipping_grasp_is_logged_with_its_outcome_where_a_recording_is_on(
    make: Any, tmp_path: Path
):
    rig = make()
    rig.station.person.begin(1.0)
    rig.recording(path=str(tmp_path / "a.mcap"))
    rig.hear(1.0)
    rig.grasp(1.1)
    rig.hear(1.1)
    rig.grasp(1.2, "WARNING")
    rig.hear(1.2)
    rig.monitor.put(pack({"kind": "reaction", "what": "put down", "time_s": 1.7}))
    rig.monitor.put(pack({"kind": "new grasp", "outcome": "held"}))
    rig.hear(2.0)

    (order,) = rig.ordered()
    trial = order["trial"]
    assert order["do"] == "trial"
    assert (trial["alarm"], trial["alarm_s"], trial["advice"]) == ("warning", 1.2, "GRIP HARDER")
    assert (trial["reaction"], trial["reaction_s"]) == ("put down", 1.7)
    assert (trial["outcome"], trial["outcome_by"], trial["ended_s"]) == ("held", "source", 2.0)


def test_without_a_recording_a_grasp_is_kept_and_sent_to_nobody(make: Any):
    rig = make()
    rig.station.person.begin(1.0)
    for now_s, state in ((1.0, "STABLE"), (1.1, "WARNING")):
        rig.grasp(now_s, state)
        rig.hear(now_s)
    rig.monitor.put(pack({"kind": "new grasp"}))
    rig.hear(2.0)

    assert rig.ordered() == []
    assert len(rig.station.person.trials) == 1


def test_a_grasp_that_ends_with_the_station_is_still_logged_beside_its_recording(
    make: Any, tmp_path: Path
):
    """No process is left then that could do it."""
    rig = make()
    path = tmp_path / "a.mcap"
    rig.station.person.begin(1.0)
    rig.recording(path=str(path))
    rig.hear(1.0)
    rig.grasp(1.1, "UNSTABLE")
    rig.hear(1.1)
    rig.recording(path=str(path), on=False)
    rig.station.close()

    (trial,) = read_trial_log(log_of(path))
    assert (trial.number, trial.alarm, trial.alarm_s) == (1, "danger", 1.1)
    assert not rig.station.recording.get("error")


def test_slip_is_recorded_while_a_recording_is_on_and_only_then(make: Any):
    rig = make()
    rig.grasp(1.0, slip=SLIP, time_s=0.9)
    rig.hear(1.0)
    assert rig.ordered() == []

    rig.recording()
    rig.hear(1.1)
    rig.grasp(1.2, slip=SLIP, time_s=1.15)
    rig.grasp(1.21, time_s=1.16)
    rig.hear(1.2)
    assert rig.ordered() == [{"do": "slip", "time_s": 1.15, "who": WHO, "slip": SLIP}]


def test_a_late_camera_is_a_warning_until_its_frames_are_in_time_again(make: Any):
    rig = make()
    rig.grasp(1.0, time_s=0.9, late={"left": 0.25, "right": 0.031})
    rig.hear(1.0)
    alarm = rig.alarm("late camera")
    assert (alarm.on, str(alarm.level)) == (True, "warning")
    assert alarm.text == "left is 250 ms late, right is 31 ms late"

    rig.grasp(1.1)  # told without a frame: it says nothing about the cameras
    rig.hear(1.1)
    assert rig.alarm("late camera").on
    rig.grasp(1.2, time_s=1.1)
    rig.hear(1.2)
    assert not rig.alarm("late camera").on


@pytest.mark.parametrize(
    ("news", "text"),
    [
        ({"error": "the disk is full"}, "the disk is full"),
        ({"lost": 3}, "the recorder lost 3 messages"),
        ({"error": "the disk is full", "lost": 3}, "the disk is full"),
    ],
)
def test_a_recording_that_misses_anything_is_alarmed(make: Any, news: dict[str, Any], text: str):
    rig = make()
    rig.recording(lost=0)
    rig.hear(1.0)
    assert rig.alarm("recording") is None
    rig.recording(**news)
    rig.hear(1.1)
    assert (rig.alarm("recording").text, str(rig.alarm("recording").level)) == (text, "danger")
    assert rig.heard_notes[-1]["kind"] == "recording"


def test_the_most_sets_that_any_monitor_has_skipped_are_kept(make: Any):
    rig = make()
    for now_s, skipped in ((1.0, 2), (1.1, 7), (1.2, 4)):
        rig.grasp(now_s, skipped=skipped)
    rig.hear(1.2)
    assert rig.station.skipped == 7


def answer(label: str, sure: float | None, touch: int = 1) -> bytes:
    return pack(RECOGNISER | {"label": label, "grasp": label, "grasp_confidence": sure,
                              "reason": "", "touch": touch})  # fmt: skip


def test_an_action_is_an_event_once_until_another_answer(make: Any):
    rules = RuleTable((Rule(label="ball", least=0.5, action="left bin"),))
    rig = make(rules=rules)
    for label, sure in (("ball", 0.9), ("ball", 0.95), ("cube", 0.9), ("ball", None)):
        rig.monitor.put(answer(label, sure))
        rig.hear(1.0)
    assert [text for text in rig.words if "bin" in text] == ["shape ball 0.90: left bin"]
    assert rig.station.answers.newest()[0]["action"] == ""
    assert rig.station.answers.summary()[0]["answers"] == {"ball": 3, "cube": 1}


def test_a_rules_alarm_is_on_while_its_answer_is_the_newest_and_waits_for_a_person(make: Any):
    """Acknowledged and over, the next such answer is a new alarm: it must be heard again."""
    rules = RuleTable((Rule(label="ball", least=0.5, action="stop", alarm=Level.DANGER),))
    rig, kind = make(rules=rules), f"answer of {RECOGNISER['who']}: ball"

    def hear(label: str, now_s: float) -> Any:
        rig.monitor.put(answer(label, 0.9 if label != "UNKNOWN" else None))
        rig.hear(now_s)
        return rig.alarm(kind)

    assert hear("cube", 1.0) is None
    first = hear("ball", 2.0)
    assert (first.level, first.text, first.on) == (Level.DANGER, "shape ball: stop", True)
    over = hear("UNKNOWN", 3.0)
    assert (over.on, over.acknowledged) == (False, False)
    rig.station.acknowledge()
    assert rig.alarm(kind) is None
    assert hear("ball", 4.0).number > first.number


def test_who_acknowledges_a_rules_alarm_silences_neither_another_class_nor_the_next_trial(
    make: Any,
):
    """Two classes of one recogniser had one alarm; so had two trials of one class in a row."""
    rules = RuleTable((Rule(label="*", least=0.5, action="stop", alarm=Level.DANGER),))
    rig = make(rules=rules)

    def hear(label: str, touch: int = 1) -> list[tuple[str, bool]]:
        rig.monitor.put(answer(label, 0.9, touch))
        rig.hear(1.0)
        alarms = rig.station.guard.alarms.alarms
        own = [alarm for alarm in alarms if alarm.kind.startswith("answer of ")]
        return [(alarm.text, alarm.on) for alarm in own if not alarm.acknowledged]

    hear("ball")
    both = hear("cube")
    assert both == [("shape cube: stop", True), ("shape ball: stop", False)]
    rig.station.acknowledge()
    assert hear("cube") == []
    assert hear("ball") == [("shape ball: stop", True)]
    rig.station.acknowledge()
    assert hear("ball") == []
    assert hear("ball", touch=2) == [("shape ball: stop", True)]


def test_cameras_of_another_grasp_that_are_in_time_do_not_end_the_alarm_of_a_late_one(make: Any):
    """Acknowledged, it was ended by one monitor and raised anew by the other, 60 times a second."""
    rig, other = make(), "monitor 2/0"
    rig.station.guard.expect(other, 0.0)
    rig.grasp(1.0, time_s=0.9, late={"left": 0.25})
    rig.hear(1.0)
    rig.station.acknowledge()
    for number in range(1, 4):
        now_s = 1.0 + number / 60
        rig.grasp(now_s, time_s=now_s, late={"left": 0.25})
        rig.grasp(now_s, time_s=now_s, who=other, late={})
        rig.hear(now_s)
    alarm = rig.alarm("late camera")
    assert (alarm.on, alarm.acknowledged, alarm.since_s) == (True, True, 1.0)
    rig.grasp(2.0, time_s=1.9, late={})
    rig.hear(2.0)
    assert all(found.kind != "late camera" for found in rig.station.guard.alarms.alarms)


def test_a_gate_that_moved_is_an_event(make: Any):
    rig = make()
    rig.monitor.put(pack({"kind": "news", "who": RECOGNISER["who"], "text": "shape: gate up"}))
    rig.hear(1.0)
    assert "shape: gate up" in rig.words


def test_the_page_reacts_acknowledges_and_ends_a_recording(make: Any):
    rig = make()
    rig.station.person.begin(1.0)
    rig.grasp(1.0, "UNSTABLE")
    rig.hear(1.0)
    assert not rig.alarm("grasp").acknowledged
    seen = {"do": "acknowledge", "seen": [rig.alarm("grasp").key]}
    for request in ({"do": "react", "what": "pour stopped"}, seen, {"do": "end"}):
        rig.page.put(pack(request))
    rig.hear(1.1)

    assert rig.alarm("grasp").acknowledged
    assert "the person: pour stopped" in rig.words
    trial = rig.station.person.trial()
    assert trial is not None
    assert trial["reaction"] == "pour stopped"
    assert rig.ordered() == [{"do": "end"}]
    assert rig.station.refused_requests == 0


def test_a_reaction_that_is_no_known_word_is_refused_and_no_event(make: Any):
    rig = make()
    rig.page.put(pack({"do": "react", "what": "danced"}))
    rig.page.put(pack({"do": "dance"}))
    rig.hear(1.0)
    assert rig.station.refused_requests == 1
    assert not [text for text in rig.words if "danced" in text]
    assert rig.ordered() == []


def test_orders_reach_the_process_that_is_named_and_no_other(make: Any):
    rig = make()
    rig.station.order("monitor", {"do": "mute", "on": True})
    rig.station.order("nobody", {"do": "mute", "on": True})
    rig.station.new_grasp()
    assert [unpack(order) for order in rig.monitor_orders.take()] == [
        {"do": "mute", "on": True}, {"do": "new grasp", "all": True},
    ]  # fmt: skip


def test_how_long_the_state_was_unknown_is_said_when_it_is_known_again(make: Any):
    rig = make()
    for now_s, state in ((1.0, "UNKNOWN"), (1.1, "UNKNOWN"), (3.5, "STABLE")):
        rig.grasp(now_s, state)
        rig.hear(now_s)
        rig.station._log_state(now_s)
    assert rig.words == ["UNKNOWN", "STABLE: after 2.5 s of UNKNOWN"]


def test_a_warning_is_logged_with_how_far_and_how_fast_it_slips(make: Any):
    rig = make()
    slip = Slip(0.114, 0.41, 0.2, 0.01, 0.02, 0.1, True).as_dict()
    for now_s, state in ((1.0, "STABLE"), (1.1, "WARNING")):
        rig.grasp(now_s, state, slip=slip)
        rig.hear(now_s)
        rig.station._log_state(now_s)

    assert rig.words == ["STABLE", "WARNING: slip 0.11 mm, 0.4 mm/s"]


def test_a_new_grasp_is_ordered_of_every_monitor_and_reported_by_one(make: Any):
    rig = make()
    (first,) = rig.station.wiring.monitors
    to, orders = rig._ring()
    entry = {"kind": "grasp", "who": "monitor 2/0"}
    rig.station.guard.expect("monitor 2/0", 0.0)
    rig.station.wiring.monitors.append(
        MonitorLink(first.worker, "", first.heard, to, first.feed, [entry])
    )
    rig.station.new_grasp()
    assert [unpack(order) for order in orders.take()] == [{"do": "new grasp", "report": False}]
    (order,) = rig.monitor_orders.take()
    assert unpack(order) == {"do": "new grasp", "all": True}


def test_each_watched_pair_of_cameras_has_the_names_that_the_recording_gives_them():
    left, right = (CameraInfo(name=name, width=8, height=8, rate_hz=30.0) for name in PAIR)
    feeds = [SimpleNamespace(cameras=cameras) for cameras in ((), (left, right), (left, right))]
    monitors = [
        SimpleNamespace(feed=feed, watchers=[f"monitor {number}/0"][: len(feed.cameras)])
        for number, feed in enumerate(feeds, 1)
    ]
    wiring = cast("Wiring", SimpleNamespace(feeds=feeds, monitors=monitors))
    assert Wiring.watchers_by_cameras(wiring) == {
        "left + right": ("monitor 2/0",), "left-2 + right-2": ("monitor 3/0",),
    }  # fmt: skip


def test_the_page_acknowledges_no_alarm_that_it_has_not_shown(make: Any):
    """A word that waited, as while the supervisor stood still, is not of what came meanwhile."""
    rig = make()
    rig.station.person.begin(0.5)
    rig.station.guard.trouble("late camera", "left is 40 ms late", 1.0, danger=False)
    seen = rig.alarm("late camera").key
    rig.grasp(2.0, "UNSTABLE")
    rig.hear(2.0)
    rig.page.put(pack({"do": "acknowledge", "seen": [seen]}))
    rig.hear(2.1)
    assert rig.alarm("late camera").acknowledged
    assert not rig.alarm("grasp").acknowledged
    refused = rig.station.refused_requests
    for wrong in (None, "9", {}, 2, [None], [2.0], [True]):
        rig.page.put(pack({"do": "acknowledge", "seen": wrong}))
    rig.hear(2.2)
    assert rig.station.refused_requests == refused + 7
    assert not rig.alarm("grasp").acknowledged
