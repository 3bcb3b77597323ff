"""What a station reports, and what a fleet makes of it; no broker, a clock by hand."""

import json

import pytest

from taxel.fleet.presence import SILENT_S
from taxel.fleet.reports import (
    LARGEST,
    Identity,
    alive_bytes,
    make_report,
    read_alive,
    read_report,
)
from taxel.fleet.table import ago, fleet_line, fleet_table
from taxel.fleet.watch import MOST_STATIONS, FleetState, row_values
from taxel.views.console import PlainConsole

STATE = {
    "time_s": 100.0, "state": "WARNING", "reason": "slip", "since_s": 98.0,
    "alarms": [{"kind": "slip", "text": "the cup slips", "level": "warning", "since_s": 99.0,
                "acknowledged": False}],
    "consumers": [{"name": "recorder", "state": "running", "dropped": 2}],
    "recording": {"on": True},
}  # fmt: skip
SOURCES = [{"name": "teng", "state": "live", "lost": 3, "url": "sim://teng"}]


def report(boot: str = "a", number: int = 0, station: str = "bench", state=STATE) -> bytes:
    identity = Identity(station=station, boot=boot, version="0.1.0", bundles=("cup 12ab",))
    return make_report(identity, number, state, SOURCES, 1.8e9).as_bytes()


def topic(what: str = "report", station: str = "bench") -> str:
    return f"taxel/fleet/1/{station}/{what}"


def presence(state: FleetState, now_s: float) -> str:
    (row,) = state.rows(now_s)
    return row.presence


def test_a_report_comes_back_as_it_was() -> None:
    found = read_report(report(number=7))
    assert (found.station, found.number, found.state) == ("bench", 7, "WARNING")
    assert (found.age_s, found.alarms[0].age_s) == (2.0, 1.0)
    assert found.lost == 5
    assert found.recording
    assert read_report(found.as_bytes()) == found


def test_a_station_that_has_reported_nothing_yet_reports_too() -> None:
    found = read_report(report(state={}))
    assert (found.state, found.alarms) == ("UNKNOWN", ())


@pytest.mark.parametrize(
    "content",
    [
        b"", b"\xff", b"[]", b"null", b"{}", b"[" * 5000, b" " * (LARGEST + 1),
        report().replace(b'"lost":3', b'"lost":-1'), report().replace(b'"lost":3', b'"lost":1e99'),
        report().replace(b'"age_s":2.0', b'"age_s":NaN'),
        report().replace(b'"recording":true', b'"recording":1'),
        report().replace(b'"reason"', b'"more"'),
    ],
)  # fmt: skip
def test_what_is_no_report_is_refused(content: bytes) -> None:
    with pytest.raises(ValueError):  # noqa: PT011  # whatever is wrong, in whatever words
        read_report(content)


def test_a_station_lives_falls_silent_and_comes_back() -> None:
    state = FleetState(0.0)
    state.take(topic(), report(), False, 1.0)
    assert presence(state, 1.5) == "WARNING"
    assert presence(state, 1.0 + SILENT_S + 0.1) == "SILENT"
    state.take(topic(), report(number=1), False, 9.0)
    assert presence(state, 9.1) == "WARNING"


def test_the_last_will_shows_at_once_and_a_clean_end_is_no_alarm() -> None:
    state = FleetState(0.0)
    state.take(topic(), report(), False, 1.0)
    state.take(topic("alive"), alive_bytes("a", alive=False), False, 1.2)
    assert presence(state, 1.3) == "GONE"
    state.take(topic("alive"), alive_bytes("a", alive=False, ended=True), False, 1.4)
    assert presence(state, 1.5) == "ENDED"


def test_the_will_of_an_old_start_does_not_bury_a_new_one() -> None:
    state = FleetState(0.0)
    state.take(topic(), report("old"), False, 1.0)
    state.take(topic("alive"), alive_bytes("new", alive=True), False, 2.0)
    state.take(topic("alive"), alive_bytes("old", alive=False), False, 2.1)
    state.take(topic(), report("new"), False, 2.2)
    assert presence(state, 2.3) == "WARNING"


def test_a_retained_report_is_not_taken_for_a_sign_of_life() -> None:
    """A fleet view that is opened long after a station's death must not show it as live."""
    state = FleetState(0.0)
    state.take(topic(), report(), True, 0.1)
    assert state.rows(0.2)[0].age_s is None
    assert presence(state, SILENT_S + 0.1) == "SILENT"


def test_two_stations_of_one_name_are_reported() -> None:
    state = FleetState(0.0)
    calm = STATE | {"alarms": []}
    for number, boot in enumerate("abab"):
        state.take(topic(), report(boot, number, state=calm), False, 1.0 + number / 10)
    assert presence(state, 1.5) == "NAME TWICE"


def test_a_restart_is_no_second_station() -> None:
    state = FleetState(0.0)
    calm = STATE | {"alarms": []}
    for number, boot in enumerate("abc"):
        state.take(topic(), report(boot, 0, state=calm), False, 1.0 + number / 10)
    assert presence(state, 1.4) == "LIVE"


def test_what_a_person_must_see_is_on_top() -> None:
    state = FleetState(0.0)
    danger = STATE | {"alarms": [STATE["alarms"][0] | {"level": "danger"}]}
    for name, content in (("a", STATE | {"alarms": []}), ("b", STATE), ("c", danger)):
        state.take(topic(station=name), report(station=name, state=content), False, 1.0)
    assert [(r.station, r.presence) for r in state.rows(1.1)] == [
        ("c", "DANGER"), ("b", "WARNING"), ("a", "LIVE")]  # fmt: skip


def test_strangers_are_counted_and_bounded() -> None:
    state = FleetState(0.0)
    state.take(topic(station="other"), report(), False, 1.0)  # says it is another station
    state.take("taxel/fleet/1/bench/order", b"{}", False, 1.0)
    state.take("something/else", b"", False, 1.0)
    assert (state.refused, state.rows(1.0)[1:]) == (3, [])
    for number in range(MOST_STATIONS + 5):
        name = f"s{number}"
        state.take(topic("alive", name), alive_bytes("a", alive=True), False, 1.0)
    assert len(state.rows(1.0)) == MOST_STATIONS


def test_a_table_shows_names_literally() -> None:
    state = FleetState(0.0)
    alarm = STATE["alarms"][0] | {"text": "\x1b[31m[red]"}
    state.take(topic(), report(state=STATE | {"alarms": [alarm]}), False, 1.0)
    rows = [row_values(row) for row in state.rows(1.1)]
    console = PlainConsole(width=120)
    with console.capture() as shown:
        console.print(fleet_table(rows))
    assert "\\x1b[31m[red]" in shown.get()
    assert "\x1b[31m[red]" not in shown.get()
    away = {"stations": rows, "broker": {"connected": False, "why": "nobody answers there"}}
    assert fleet_line(away) == "1 station: 1 WARNING; no broker: nobody answers there"


def test_signs_of_life_are_read_to_the_letter() -> None:
    assert read_alive(alive_bytes("a", alive=True)) == ("a", True, False)
    with pytest.raises(ValueError, match="alive"):
        read_alive(json.dumps({"boot": "a", "alive": "yes", "ended": False}).encode())


@pytest.mark.parametrize(
    ("age_s", "words"),
    [
        (0.4, "0 s ago"), (119.4, "119 s ago"), (120.0, "2 min ago"), (7199.0, "119 min ago"),
        (108_000.0, "30 h ago"), (172_800.0, "2 d ago"), (4_320_000.0, "50 d ago"),
    ],
)  # fmt: skip
def test_how_long_ago_a_station_was_heard_is_said_in_its_unit(age_s: float, words: str) -> None:
    """A station that was switched off on Friday was, on Monday, heard "216000 s ago"."""
    assert ago(age_s) == words


@pytest.mark.parametrize("sign", ["ä", "\U0001f590", "\udce4", "\x07"])
def test_a_report_of_many_long_texts_is_not_refused(sign: str) -> None:
    """A station in DANGER would be shown as silent; half a letter comes from a file's name."""
    many = [{"kind": sign * 400, "text": sign * 400, "level": "danger", "since_s": 1.0,
             "acknowledged": False}] * 20  # fmt: skip
    parts = [{"name": sign * 400, "state": sign * 400, "lost": 1, "dropped": 1}] * 20
    identity = Identity(
        station="grip-1", boot="b" * 32, version="1.0", bundles=(sign * 70,) * 20
    )  # fmt: skip
    state = {"state": "DANGER", "reason": sign * 400, "time_s": 2.0, "alarms": many,
             "consumers": parts}  # fmt: skip
    content = make_report(identity, 0, state, parts, 1.8e9).as_bytes()

    found = read_report(content)
    assert (found.station, found.boot, found.state) == ("grip-1", "b" * 32, "DANGER")
    assert [alarm.level for alarm in found.alarms] == ["danger"] * 16
    assert len(found.alarms[0].text) >= 12
