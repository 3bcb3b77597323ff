"""What a station's recogniser reports beside its answers, with no process and no model."""

from contextlib import ExitStack
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from taxel.actions.alarm import Level
from taxel.actions.rule_table import Rule, RuleTable
from taxel.clock import ManualClock
from taxel.errors import BadSource
from taxel.live.station import array_watcher
from taxel.live.station.answers import Answers
from taxel.live.station.packets import unpack
from taxel.live.station.station import Station
from taxel.live.station.wiring import Wiring, _check_pace
from taxel.live.station.worker import Rank
from taxel.signals import Mark
from taxel.windows.level_follow import LevelNow


class Writer:
    """Keeps what is put."""

    def __init__(self) -> None:
        self.notes: list[Any] = []

    def put(self, content: bytes) -> None:
        self.notes.append(unpack(content))


@pytest.fixture
def recogniser(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """A recogniser that answers nothing and has no news; tests give it some."""
    found = SimpleNamespace(new_vote=lambda: None, flush=list, push=lambda _: [])
    for news in ("gate_moves", "still_channels", "other_scales", "rate_changes"):
        setattr(found, news, list)
    found.untouched = found.waiting = str
    found.touches = 0
    monkeypatch.setattr(array_watcher, "Recogniser", lambda *_: found)
    window = SimpleNamespace(max_gap_s=0.5, pad=False)
    contract = SimpleNamespace(target="shape", classes=("ball", "cube"), window=window)
    bundle = SimpleNamespace(contract=contract)
    monkeypatch.setattr(array_watcher, "read_bundle", lambda *_, **__: bundle)
    return found


def watch(levels: dict[str, Any]) -> Any:
    job = SimpleNamespace(
        trust=None, device="cpu", place=SimpleNamespace(name="monitor"), least_confidence=0.5,
        sensor=None, levels=levels,
    )  # fmt: skip
    return array_watcher.ArrayWatcher(Path("b.taxel"), cast("Any", job), cast("Any", Writer()), 0)


@pytest.fixture
def watcher(recogniser: SimpleNamespace) -> Any:
    return watch({})


def test_a_table_with_alarms_is_named_among_what_needs_several_processes() -> None:
    """Without any of the options named in the message, --rules alone had started a station."""
    with pytest.raises(BadSource, match="and no column alarm in --rules"):
        _check_pace("replay://a.mcap?speed=max")


def test_another_unit_is_news_and_at_the_end_that_nothing_was_touched(
    watcher: Any, recogniser: SimpleNamespace
) -> None:
    recogniser.other_scales = lambda: [SimpleNamespace(words=lambda: "about 1,000 times as much")]
    recogniser.untouched = lambda: "nothing was touched"
    watcher.end()
    assert [(note["kind"], note["text"]) for note in watcher._writer.notes] == [
        ("news", "shape: about 1,000 times as much"), ("news", "shape: nothing was touched")
    ]  # fmt: skip


def test_what_the_first_window_waits_for_is_said_once_a_second_and_only_if_it_is_new(
    watcher: Any, recogniser: SimpleNamespace
) -> None:
    words = ["nothing above the gate yet, 0.1 at most"]
    recogniser.waiting = lambda: words[0]
    watcher.silent(1.0)
    watcher.silent(2.5)
    words[0] = ""
    watcher.silent(3.0)
    watcher.silent(3.6)
    notes = watcher._writer.notes
    assert [note["kind"] for note in notes] == ["waiting", "waiting"]
    assert [note["text"] for note in notes] == ["nothing above the gate yet, 0.1 at most", ""]


@pytest.mark.parametrize(
    "message", [{"do": "new grasp"}, Mark(start_s=0.2, end_s=0.3, labels={"outcome": "held"})]
)
def test_the_key_n_and_a_mark_that_ends_a_grasp_end_a_touch_for_levels_too(
    watcher: Any, recogniser: SimpleNamespace, message: Any
) -> None:
    ended: list[str] = []
    watcher._vote = SimpleNamespace(over=lambda: ended.append("vote"))
    recogniser.new_touch = lambda: ended.append("level")
    watcher.take([message], {}, cast("Any", None))
    watcher.take([Mark(start_s=0.2, end_s=0.3, labels={"shape": "cube"})], {}, cast("Any", None))
    assert ended == ["vote", "level"]


def test_where_a_level_stands_is_sent_after_each_touch(
    watcher: Any, recogniser: SimpleNamespace
) -> None:
    watcher.take([], {}, cast("Any", None))
    state = {"level": [2.0], "weight": 11.0, "touches": 1}
    recogniser.touches = 1
    recogniser.level_state = lambda: state
    recogniser.level = lambda: LevelNow(touches=1, least=0.5, most=2.0)
    watcher.take([], {}, cast("Any", None))
    watcher.take([], {}, cast("Any", None))
    (note,) = watcher._writer.notes
    assert (note["kind"], note["who"], note["state"]) == ("level", "monitor/0", state)
    assert note["text"].startswith("levels followed over 1 touch")


def test_a_process_that_follows_a_dead_one_goes_on_with_its_level(
    recogniser: SimpleNamespace,
) -> None:
    """The session was a new one then, and as wrong as in its first touches."""
    resumed: list[Any] = []
    recogniser.resume_level = resumed.append
    watch({"monitor/1": "another's"})
    watch({"monitor/0": "its own"})
    assert resumed == ["its own"]


def test_a_monitor_that_is_started_again_is_given_the_levels_of_now() -> None:
    jobs: list[Any] = []
    with ExitStack() as stack:
        wiring = object.__new__(Wiring)
        wiring._stack, wiring._checksums, wiring.levels, wiring.monitors = stack, {}, {}, []
        config = {"least_confidence": 0.5, "drill": False, "trust": None, "device": "cpu"}
        wiring._config = cast("Any", SimpleNamespace(**config))
        feed = SimpleNamespace(sensor=None, cameras=(), ring="", worker=SimpleNamespace(row=0))
        wiring.feeds = cast("Any", [feed])
        add = lambda _name, _entry, job: jobs.append(job)  # noqa: E731
        wiring._processes = cast("Any", SimpleNamespace(add=add))
        wiring._start_monitor(cast("Any", feed), (), "monitor", Rank.MODEL)
        assert jobs[0](None).levels == {}
        wiring.levels["monitor/0"] = {"touches": 3}
        assert jobs[0](None).levels == {"monitor/0": {"touches": 3}}


@pytest.mark.parametrize("kind", ["waiting", "level"])
def test_a_station_keeps_what_a_recogniser_waits_for_and_where_its_level_stands(kind: str) -> None:
    kept: list[Any] = []
    station = object.__new__(Station)
    station.answers = cast("Any", SimpleNamespace(keep=kept.append))
    note = {"kind": kind, "who": "monitor/0", "text": ""}
    station._take_in(note, 1.0)
    assert kept == [note]


def test_a_contact_after_a_restart_begins_anew_so_that_its_alarm_sounds(
    recogniser: SimpleNamespace, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Both were contact 1 of their process: an acknowledged alarm silenced the second, too."""
    clock = ManualClock(5.0)
    monkeypatch.setattr(array_watcher, "monotonic", clock.now_s)
    decision = SimpleNamespace(label="ball", confidence=0.9, reason="", end_s=1.0)
    recogniser.flush = lambda: [SimpleNamespace(decision=decision)]
    recogniser.new_vote = lambda: SimpleNamespace(contacts=1, add=lambda _: ("ball", 0.9))
    rule = Rule(label="ball", least=0.5, action="let go", alarm=Level.DANGER)
    own = {"who": "monitor/0", "target": "shape", "bundle": "b.taxel"}
    answers, begins = Answers([own], RuleTable((rule,))), []
    for _ in range(2):
        clock.advance(1.0)
        watcher = watch({})
        watcher._outages = SimpleNamespace(look=lambda _: None)
        watcher.end()
        watcher.end()
        begins += [answers.add(note)[0]["begins"] for note in watcher._writer.notes]
    assert begins == [True, False, True, False]
