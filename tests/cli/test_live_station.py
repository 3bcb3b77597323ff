"""`taxel live` with a recorder, a gripper or an output: a station, from the command line."""

from __future__ import annotations

import json
import signal
import socket
import threading
from pathlib import Path
from types import SimpleNamespace

import pytest
from rich.text import Text

from taxel.actions.alarm import AlarmLatch, Level
from taxel.actions.interlock import Interlock, InterlockConfig
from taxel.bundles.shipped import CUP_POUR, find_bundle, shipped_bundle
from taxel.cli.live import station as station_verb
from taxel.cli.live import station_screen
from taxel.cli.live.station import StationOptions, _still_to_arm, live_station
from taxel.cli.live.station_screen import EventLines, PrinterThread, press
from taxel.cli.live.summaries import print_station_summary
from taxel.cli.main import main
from taxel.errors import BadBundle, BadSource
from taxel.live.station.wiring import StationConfig
from taxel.recordings.reader import iterate_frames
from taxel.recordings.trial_log import log_of, read_trial_log
from taxel.sim.pour.cup_pour import CupPourConfig, list_runs
from taxel.sources.simulated.pour_sets import CAMERA_HZ, write_run


@pytest.fixture(scope="module")
def pour(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("pour")
    config = CupPourConfig(
        cups=1, first_cup=902, forces_n=(50.0,), positions=("middle",), still=1.0, duration_s=2.0
    )
    (run,) = list_runs(config)
    write_run(folder, run, config, CAMERA_HZ)
    return folder / f"{run.name}.mcap"


@pytest.mark.slow
def test_a_pour_is_watched_recorded_and_sent_to_another_program(
    pour: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    path = tmp_path / "all.mcap"
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ear:
        ear.bind(("127.0.0.1", 0))
        ear.settimeout(5.0)
        port = ear.getsockname()[1]
        main(["live", CUP_POUR, str(pour), "--record", str(path), "--label", "object=cup",
              "--tell", f"udp://127.0.0.1:{port}", "--json"])  # fmt: skip
        action = json.loads(ear.recv(4096))
    result = json.loads(capsys.readouterr().out)
    assert action["schema"] == "taxel-action-1"
    assert action["state"] in ("UNKNOWN", "STABLE", "WARNING", "UNSTABLE")
    made = result["processes"]["source"]["produced"]
    assert result["processes"]["recorder"]["consumed"] == made
    stages = {"capture", "source", "hand over", "wait", "model", "alarm"}
    assert set(result["latency_ms"]) == stages
    assert result["outputs"][f"UDP to 127.0.0.1:{port}"]["sent"] > 0
    assert len(list(iterate_frames(path))) == len(list(iterate_frames(pour)))
    (trial,) = read_trial_log(log_of(path))
    assert (trial.outcome, trial.outcome_by, trial.reaction) == ("held", "source", "")
    assert result["trials"][0]["outcome"] == "held"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["live", CUP_POUR, "sim://cup-pour", "--record", "x.avi"],
         "needed a recording's name that ends in .mcap; got x.avi"),
        (["record", "sim://teng", "--output", "x.avi", "--seconds", "1"],
         "ends in .mcap; got x.avi"),
        (["live", CUP_POUR, "sim://cup-pour", "--record", "cut.mcap"], "unfinished cut.mcap.part"),
        (["record", "sim://teng", "--output", "cut.mcap", "--seconds", "1"],
         "unfinished cut.mcap.part"),
        (["live", CUP_POUR, "sim://cup-pour", "--gripper", "sim", "--force-n", "50", "15"],
         "99 % of the second; got 50 and 15 N; name the smaller one first"),
        (["live", CUP_POUR, "sim://cup-pour", "--gripper", "sim", "--force-n", "15", "15"],
         "99 % of the second; got 15 and 15 N"),
        (["live", CUP_POUR, "sim://cup-pour", "--gripper", "sim", "--force-n", "-1", "15"],
         "a first force of 0 N or more and at most"),
    ],
)  # fmt: skip
def test_what_cannot_be_recorded_or_gripped_is_refused_before_anything_is_opened(
    words: list[str],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
):
    monkeypatch.chdir(tmp_path)
    Path("cut.mcap.part").write_bytes(b"mine")
    monkeypatch.setattr("taxel.live.station.station.Station.__init__", None)
    monkeypatch.setattr("taxel.sources.opening.open_source", None)
    with pytest.raises(SystemExit):
        main(words)
    assert message in " ".join(capsys.readouterr().err.split())
    assert sorted(path.name for path in tmp_path.iterdir()) == ["cut.mcap.part"]


def test_the_key_d_disarms():
    pressed: list[str] = []
    station = SimpleNamespace(disarm=lambda: pressed.append("disarm"))
    press("d", station, frozenset())  # type: ignore[arg-type]
    assert pressed == ["disarm"]


@pytest.mark.parametrize(("key", "event"), [("s", "pour stopped"), ("x", "dropped")])
def test_keys_say_what_the_person_did_and_what_came_of_it(key: str, event: str):
    heard: list[str] = []
    press(key, SimpleNamespace(react=heard.append), frozenset())  # type: ignore[arg-type]
    assert heard == [event]


def test_the_key_a_acknowledges_only_alarms_that_were_shown():
    """One that came since, or has become worse, stays, and the person hears so."""
    alarms, heard = AlarmLatch(), list[str]()
    station = SimpleNamespace(
        acknowledge=lambda seen: alarms.acknowledge_seen(seen, 2.0),
        guard=SimpleNamespace(alarms=alarms), say=heard.append,
    )  # fmt: skip
    shown = alarms.set("camera", Level.WARNING, "the camera is silent", 1.0)
    alarms.set("grasp", Level.DANGER, "the grasp is unstable", 1.5)
    press("a", station, frozenset({shown.key}))  # type: ignore[arg-type]
    assert [(alarm.kind, alarm.acknowledged) for alarm in alarms.alarms] == [
        ("grasp", False), ("camera", True),
    ]  # fmt: skip
    assert "not shown yet" in heard.pop()
    press("a", station, frozenset(alarm.key for alarm in alarms.alarms))  # type: ignore[arg-type]
    assert alarms.sounding is None
    assert heard == []


def test_alarms_count_as_shown_once_their_lines_are_printed(monkeypatch: pytest.MonkeyPatch):
    """While a terminal stands still, a person sees none of them."""
    goes_on, printed = threading.Event(), threading.Event()

    def stand_still(*_: object, **__: object) -> None:
        printed.set()
        goes_on.wait(5.0)

    monkeypatch.setattr(station_screen.console, "print", stand_still)
    printer = PrinterThread()
    printer.say(Text("UNSTABLE"))
    printer.note(frozenset({3}))
    assert printed.wait(5.0)
    assert printer.shown == frozenset()
    goes_on.set()
    printer.close()
    assert printer.shown == {3}


@pytest.mark.parametrize(
    ("error", "line"),
    [
        ("", "recorded: a.mcap: 9 scans"),
        ("needed a.mcap.part; it was removed.", "taken in: 9 scans"),
    ],
)
def test_the_summary_says_what_it_counts_and_calls_nothing_recorded_that_failed(
    capsys: pytest.CaptureFixture[str], error: str, line: str
):
    counts = {"produced": 7, "consumed": 5, "dropped": 2, "starts": 1}
    print_station_summary({
        "answers": [], "alarms": {"counts": {"raised": 0, "acknowledged": 0}}, "state": "NONE",
        "trials": [], "processes": {"monitor": counts}, "latency_ms": {},
        "outputs": {"UDP to 127.0.0.1:5005": {"sent": 9, "lost": 1}},
        "recording": {"path": "a.mcap", "error": error, "ledger": {"scans": 9}},
    })  # fmt: skip
    lines = [line.strip() for line in capsys.readouterr().out.splitlines()]
    assert lines[0] == "monitor: 7 messages produced, 5 received, 2 lost"
    assert lines[1] == "UDP to 127.0.0.1:5005: 9 messages sent, 1 lost"
    assert lines[2:] == ([error, line] if error else [line])


def test_an_event_has_its_time_since_the_station_began(monkeypatch: pytest.MonkeyPatch):
    """A hand's station has no first state: a fault after 40 s was printed at 0.00 s."""
    printed: list[str] = []
    monkeypatch.setattr(station_screen, "monotonic", lambda: 100.0)
    lines = EventLines(SimpleNamespace(say=lambda text: not printed.append(text.plain)))  # type: ignore[arg-type]
    station = SimpleNamespace(events=[])
    lines.print_new(station)  # type: ignore[arg-type]
    station.events.append((1, 140.5, "shape: no usable values"))
    lines.print_new(station)  # type: ignore[arg-type]
    assert printed == ["   40.50 s  shape: no usable values"]


def test_an_event_for_which_a_terminal_that_stands_still_has_no_room_is_printed_later():
    """It was dropped; its alarm counted as shown all the same, and the key a acknowledged it."""
    room, printed = [True, False, True, True], []

    def say(text: Text) -> bool:
        printed.append(text.plain.split()[-1])
        return room.pop(0)

    lines = EventLines(SimpleNamespace(say=say))  # type: ignore[arg-type]
    station = SimpleNamespace(events=[(n, float(n), name) for n, name in enumerate("abc", 1)])
    assert not lines.print_new(station)  # type: ignore[arg-type]
    assert lines.print_new(station)  # type: ignore[arg-type]
    assert printed == ["a", "b", "b", "c"]
    assert lines.print_new(station)  # type: ignore[arg-type]


def test_events_that_are_gone_before_a_terminal_has_room_are_counted_and_alarms_shown():
    """A station holds 200: an alarm of an earlier line counted as shown, and was acknowledged."""
    printed: list[str] = []
    room = iter([True, False, True, True])
    lines = EventLines(
        SimpleNamespace(say=lambda text: not printed.append(text.plain) and next(room))
    )  # type: ignore[arg-type]
    alarms = SimpleNamespace(alarms=SimpleNamespace(alarms=[SimpleNamespace(text="left is late")]))
    station = SimpleNamespace(events=[(1, 1.0, "a")], guard=alarms)
    assert lines.print_new(station)  # type: ignore[arg-type]
    station.events = [(4, 4.0, "d")]

    assert not lines.print_new(station)  # type: ignore[arg-type]
    assert lines.print_new(station)  # type: ignore[arg-type]
    gone = "the terminal stood still: 2 events left out; alarms: left is late"
    assert [line.strip() for line in printed[1:]] == [gone, gone, "3.00 s  d"]


def test_what_a_station_says_while_it_ends_is_printed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    """That nothing was touched is known at the end alone, when the monitor's process ends."""

    class Station:
        def __init__(self, _: object) -> None:
            self.events: list[tuple[int, float, str]] = []
            self.wiring = SimpleNamespace(unwatched=(), watches=False)
            self.failed, self.recording = "", {}

        def __enter__(self) -> Station:
            return self

        def __exit__(self, *_: object) -> None:
            self.close()

        def run(self, *_: object) -> None:
            pass

        def close(self) -> None:
            self.events = [(1, 5.0, "shape: nothing was touched")]

    monkeypatch.setattr("taxel.live.station.station.Station", Station)
    for name in ("_check", "_open_outputs", "print_station_summary", "station_summary"):
        monkeypatch.setattr(station_verb, name, lambda *_: {})
    monkeypatch.setattr(station_verb, "_open_actuators", lambda _: [])
    monkeypatch.setattr(station_verb, "_station_config", lambda *_: None)
    live_station(StationOptions(bundles=(), sources=(), seconds=1.0, least_confidence=0.5))
    assert "0.00 s  shape: nothing was touched" in capsys.readouterr().out


def test_who_disarms_before_it_could_be_armed_is_not_overruled_by_arm():
    """--arm waits for STABLE; a person, the page or the robot's program disarms meanwhile."""
    interlock = Interlock(InterlockConfig(min_n=10.0, max_n=40.0))
    armed: list[str] = []
    guard = SimpleNamespace(interlock=interlock, shown=("UNKNOWN", "", 0.0))
    station = SimpleNamespace(guard=guard, arm=lambda: armed.append("armed") or ())
    assert _still_to_arm(station)  # type: ignore[arg-type]
    interlock.disarm(1.0, "a person at the page")
    guard.shown = ("STABLE", "", 2.0)
    assert not _still_to_arm(station)  # type: ignore[arg-type]
    assert armed == []


@pytest.mark.slow
def test_what_a_person_must_know_stands_beside_the_json_not_in_it(
    pour: Path, capsys: pytest.CaptureFixture[str]
):
    main(["live", CUP_POUR, str(pour), "--beside", str(pour), "--page", "--json", "--seconds", "1"])
    out, err = capsys.readouterr()
    assert json.loads(out)["processes"]["monitor 1"]["consumed"] > 0
    assert "the page: http://127.0.0.1:" in err
    assert f"nothing watches {pour}: name one more bundle" in err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--arm", "--page"], "needed --gripper beside --arm"),
        (["--gripper", "pge:///dev/nothing"], "max_force_n"),
        (["--gripper", "pge:///dev/nothing?max_force_n=50"], "/dev/nothing"),
        (["--gripper", "what://x"], "an actuator's address"),
        (["--gripper", "sim"], "a source sim://cup-pour with --gripper sim"),
        (["--tell", "udp://8.8.8.8:5005"], "an address of this machine"),
        (["--record", "{pour}"], "which exists"),
        (["--record", "{pour}", "--overwrite"], "which is replayed"),
        (["--record", "x.mcap", "--label", "cup"], "--label NAME=VALUE"),
        (
            ["--label", "object=cup", "--group", "session=3"],
            "needed --record or --page beside --label",
        ),
        (["--rules", "x.csv"], "a bundle that names classes beside --rules"),
        (["--page", "127.0.0.1:99999"], "HOST:PORT for --page"),
        (
            ["--calibration", "c.json", "--json"],
            "needed --page, or the terminal's screen beside --calibration",
        ),
        (["--overwrite", "--gripper", "sim"], "needed --record beside --overwrite"),
        (["--beside", "sim://nothing"], "a simulator that exists"),
        (["--gripper", "sim", "--force-n", "60", "50"], "N"),
    ],
)
def test_what_cannot_be_is_reported_in_one_line_before_anything_runs(
    words: list[str],
    message: str,
    pour: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
):
    monkeypatch.chdir(tmp_path)
    given = [word.format(pour=pour) for word in words]
    with pytest.raises(SystemExit) as ended:
        main(["live", CUP_POUR, str(pour), *given, "--seconds", "1"])
    assert ended.value.code == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1
    assert message in lines[0]
    assert list(tmp_path.iterdir()) == []


def test_labels_and_groups_with_a_page_wait_for_the_recordings_that_begin_there(
    pour: Path, monkeypatch: pytest.MonkeyPatch
):
    found: list[StationConfig] = []

    def stop(config: StationConfig) -> None:
        found.append(config)
        raise SystemExit

    monkeypatch.setattr("taxel.live.station.station.Station", stop)
    with pytest.raises(SystemExit):
        main(["live", CUP_POUR, str(pour), "--page", "--label", "object=cup", "--group", "day=3"])
    assert (found[0].labels, found[0].groups) == ({"object": "cup"}, {"day": "3"})


def test_a_bundle_that_comes_with_taxel_is_named_without_a_path_and_a_file_goes_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    assert find_bundle(Path(CUP_POUR)) == shipped_bundle(CUP_POUR)
    assert find_bundle(Path("runs/cup-pour")) == Path("runs/cup-pour")
    monkeypatch.chdir(tmp_path)
    (tmp_path / CUP_POUR).touch()
    assert find_bundle(Path(CUP_POUR)) == Path(CUP_POUR)
    with pytest.raises(BadBundle, match="cup-pour"):
        shipped_bundle("nothing")


@pytest.mark.slow
def test_a_station_that_is_stopped_while_it_starts_reports_no_fault(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    """A signal to the whole group ends its processes, too: that is no fault of theirs."""

    def stopped(*_: object) -> None:
        signal.raise_signal(signal.SIGTERM)
        raise BadSource("the page to start", "it ended without a word", "run: taxel doctor")

    monkeypatch.setattr("taxel.cli.live.station._open_outputs", stopped)
    with pytest.raises(SystemExit) as ended:
        main(["live", "cup-pour", "sim://cup-pour", "--page", "127.0.0.1:0"])
    printed = capsys.readouterr()
    assert ended.value.code == 0
    assert "stopped before the station had started" in printed.err
    assert "needed" not in printed.out + printed.err
