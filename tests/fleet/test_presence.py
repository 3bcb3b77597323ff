"""Which state of a station a fleet shows where its name has several runs, or strangers send."""

import json

import pytest

from taxel.bus.addresses import parse_mqtt
from taxel.fleet.presence import SILENT_S
from taxel.fleet.reports import Identity, alive_bytes, make_report, read_report
from taxel.fleet.table import fleet_line
from taxel.fleet.watch import MOST_STATIONS, FleetState, FleetWatch, row_values

BROKER = {"connected": True, "why": ""}


def report(boot: str, level: str = "", station: str = "bench") -> bytes:
    alarm = {"kind": "slip", "text": "it slips", "level": level, "since_s": 0.0,
             "acknowledged": False}  # fmt: skip
    state = {"time_s": 1.0, "state": "STABLE", "alarms": [alarm] if level else []}
    identity = Identity(station=station, boot=boot, version="1", bundles=())
    return make_report(identity, 0, state, [], 1.0).as_bytes()


class Rig:
    """A fleet's view of the station `bench`."""

    def __init__(self) -> None:
        self.state = FleetState(0.0)

    def hears(self, boot: str, now_s: float, level: str = "", retained: bool = False) -> None:
        self.state.take("taxel/fleet/1/bench/report", report(boot, level), retained, now_s)

    def lives(self, boot: str, now_s: float) -> None:
        self._sign(alive_bytes(boot, alive=True), False, now_s)

    def ends(self, boot: str, now_s: float, retained: bool = False) -> None:
        self._sign(alive_bytes(boot, alive=False, ended=True), retained, now_s)

    def dies(self, boot: str, now_s: float, retained: bool = False) -> None:
        self._sign(alive_bytes(boot, alive=False), retained, now_s)

    def _sign(self, content: bytes, retained: bool, now_s: float) -> None:
        self.state.take("taxel/fleet/1/bench/alive", content, retained, now_s)

    def shows(self, now_s: float) -> str:
        (row,) = self.state.rows(now_s)
        return row.presence


@pytest.fixture
def rig() -> Rig:
    return Rig()


def test_a_station_in_danger_is_not_shown_as_ended_by_another_of_its_name(rig: Rig) -> None:
    """Before, ENDED stood over all later reports: dim, and at the bottom."""
    for now_s in (1.0, 2.0):
        rig.hears("a", now_s)
        rig.lives("b", now_s + 0.2)
        rig.hears("b", now_s + 0.3)
    assert rig.shows(2.4) == "NAME TWICE"
    rig.ends("b", 3.0)
    rig.hears("a", 3.0, "danger")
    assert rig.shows(3.5) == "DANGER"
    for now_s in range(4, 60):
        rig.hears("a", float(now_s))
    assert rig.shows(59.5) == "NAME TWICE"  # the other one may be started again
    rig.dies("b", 60.0)
    rig.hears("a", 60.0, "danger")
    assert rig.shows(60.5) == "DANGER"


def test_of_two_under_one_name_the_one_in_danger_is_shown(rig: Rig) -> None:
    rig.hears("a", 1.0, "danger")
    rig.hears("b", 1.5)
    rig.hears("a", 2.0, "danger")
    rig.hears("b", 2.5)
    (row,) = rig.state.rows(2.6)
    assert (row.presence, row.report.boot) == ("DANGER", "a")


def test_a_new_view_is_not_misled_by_what_the_broker_kept(rig: Rig) -> None:
    rig.ends("b", 0.1, retained=True)
    rig.hears("a", 0.1, "danger", retained=True)
    assert rig.shows(0.2) == "ENDED"
    rig.hears("a", 1.0, "danger")
    assert rig.shows(1.1) == "DANGER"
    rig.ends("b", 2.0, retained=True)  # the view connected again: the broker gives it anew
    assert rig.shows(2.1) == "DANGER"


@pytest.mark.parametrize("report_first", [True, False])
def test_a_run_that_ended_before_it_reported_is_ended_whatever_comes_first(
    rig: Rig, report_first: bool
) -> None:
    if report_first:
        rig.hears("a", 0.1, retained=True)
    rig.ends("b", 0.1, retained=True)
    rig.hears("a", 0.1, retained=True)
    assert rig.shows(9.0) == "ENDED"


def test_a_restart_that_overlaps_the_old_run_ends_when_the_new_one_does(rig: Rig) -> None:
    rig.lives("a", 1.0)
    rig.hears("a", 1.1)
    rig.lives("b", 2.0)
    rig.hears("a", 2.1)  # its last
    rig.ends("a", 2.2)
    rig.hears("b", 2.3)
    assert rig.shows(2.4) == "LIVE"
    rig.ends("b", 3.0)
    assert rig.shows(3.1) == rig.shows(99.0) == "ENDED"


def test_an_old_run_that_was_killed_does_not_outlive_the_new_one(rig: Rig) -> None:
    rig.hears("a", 1.0, "danger")
    rig.lives("b", 2.0)
    assert rig.shows(2.1) == "LIVE"  # nobody has to fear a run that is gone
    rig.hears("b", 3.0)
    rig.ends("b", 4.0)
    rig.dies("a", 4.5)  # its will is late: its network was cut
    assert rig.shows(5.0) == "ENDED"


def test_a_second_station_that_falls_silent_after_the_first_ended_is_silent(rig: Rig) -> None:
    rig.hears("a", 1.0)
    rig.hears("b", 1.5)
    rig.hears("a", 2.0)
    rig.ends("b", 2.5)
    assert rig.shows(2.0 + SILENT_S + 0.1) == "SILENT"


def test_many_starts_of_one_name_are_bounded(rig: Rig) -> None:
    rig.hears("a", 1.0)
    for number in range(1000):
        rig.dies(f"x{number}", 1.1)
    rig.hears("a", 2.0, "danger")
    assert rig.shows(2.1) == "DANGER"
    assert len(rig.state._stations["bench"]._runs) < 20


def test_rubbish_takes_no_place_and_a_full_table_says_so() -> None:
    """Before, 1,000 names with rubbish filled the table, and a real station was not shown."""
    state = FleetState(0.0)
    for number in range(MOST_STATIONS):
        state.take(f"taxel/fleet/1/x{number}/alive", b"rubbish", False, 1.0)
    state.take("taxel/fleet/1/bench/report", report("a", "danger"), False, 2.0)
    assert [row.presence for row in state.rows(2.1)] == ["DANGER"]
    assert (state.refused, state.beyond) == (MOST_STATIONS, 0)
    shown = {"stations": [row_values(row) for row in state.rows(2.1)], "broker": BROKER}
    line = fleet_line(shown | {"refused": state.refused, "beyond": state.beyond})
    assert line == "1 station: 1 DANGER; messages refused: 1,000"
    for number in range(MOST_STATIONS):
        sign = alive_bytes("a", alive=True)
        state.take(f"taxel/fleet/1/x{number}/alive", sign, False, 3.0)
    line = fleet_line({"stations": [], "broker": BROKER, "beyond": state.beyond})
    assert line == "0 stations; TABLE FULL: further stations are not shown"


@pytest.mark.parametrize("name", ["x" * 60_000, "x" * 65, "a\x1b[31m", "a b", "", "-a", "bänk"])
def test_what_is_no_stations_name_is_refused(name: str) -> None:
    state = FleetState(0.0)
    sign = alive_bytes("a", alive=True)
    state.take(f"taxel/fleet/1/{name}/alive", sign, False, 1.0)
    state.take(f"taxel/fleet/1/{name}/report", report("a", station=name), False, 1.0)
    assert (state.rows(1.1), state.refused) == ([], 2)


@pytest.mark.parametrize("level", ["DANGER", "Danger", "", "fatal", "warning "])
def test_an_alarm_of_no_known_level_is_refused_rather_than_shown_as_live(level: str) -> None:
    content = json.loads(report("a", "danger"))
    content["alarms"][0]["level"] = level
    with pytest.raises(ValueError, match="warning or danger"):
        read_report(json.dumps(content).encode())


def test_the_page_and_json_say_what_is_left_out() -> None:
    pytest.importorskip("paho")
    watch = FleetWatch(parse_mqtt("mqtt://127.0.0.1:9/x"))
    watch.state.take("taxel/fleet/1/x/alive", b"", False, 1.0)
    found = watch.snapshot()
    assert (found["refused"], found["beyond"]) == (1, 0)
