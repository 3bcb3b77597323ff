"""Stations, a real mosquitto and a fleet's view: killed, restarted, shown on the page."""

import importlib.util
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from socket import socket

import httpx
import pytest

from taxel.bench.real_mosquitto import MOSQUITTO, Mosquitto
from taxel.fleet.page import FleetPage

if importlib.util.find_spec("paho") is None:
    pytest.skip("needs paho-mqtt: pip install 'taxel[bus]'", allow_module_level=True)

from taxel.bus.addresses import parse_mqtt
from taxel.fleet.broker import Broker
from taxel.fleet.reporter import Reporter
from taxel.fleet.watch import FleetWatch

STATIONS = """
import sys, time
from contextlib import ExitStack
from taxel.bus.addresses import parse_mqtt
from taxel.fleet.reporter import Reporter
with ExitStack() as stack:
    every = [stack.enter_context(Reporter(parse_mqtt(url))) for url in sys.argv[1:]]
    while True:
        for one in every:
            now_s = time.monotonic()
            one.take_in("/state", {"time_s": now_s, "state": "STABLE", "alarms": []}, now_s)
            one.report(now_s)
        time.sleep(0.05)
"""


def stations(broker: Mosquitto, *names: str) -> subprocess.Popen:
    urls = [f"mqtt://127.0.0.1:{broker.port}/{name}" for name in names]
    return subprocess.Popen(
        [sys.executable, "-c", STATIONS, *urls],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )


def until(holds: Callable[[], bool], longest_s: float = 10.0) -> float:
    began_s = time.monotonic()
    while not holds():
        assert time.monotonic() < began_s + longest_s
        time.sleep(0.02)
    return time.monotonic() - began_s


def presence(watch: FleetWatch) -> dict[str, str]:
    return {row.station: row.presence for row in watch.rows()}


@pytest.fixture
def watch(mosquitto: Mosquitto):
    with FleetWatch(parse_mqtt(f"mqtt://127.0.0.1:{mosquitto.port}")) as watch:
        until(lambda: watch.broker.connected)
        yield watch


@pytest.mark.slow
def test_fifty_stations_one_killed_and_the_broker_started_again(
    mosquitto: Mosquitto,
    watch: FleetWatch,
) -> None:
    """The killed one is GONE within its keep-alive; after the broker's restart all others are
    LIVE again by themselves, although nothing was kept on disk.
    """
    many = stations(mosquitto, *(f"s{number:02}" for number in range(49)))
    alone = stations(mosquitto, "alone")
    try:
        until(lambda: list(presence(watch).values()) == ["LIVE"] * 50, 30.0)
        alone.kill()
        alone.wait()
        took_s = until(lambda: presence(watch)["alone"] == "GONE")
        assert took_s <= 4.5
        mosquitto.kill()
        until(lambda: not watch.broker.connected)
        until(lambda: "SILENT" in presence(watch).values())
        mosquitto.start()
        until(lambda: list(presence(watch).values()).count("LIVE") == 49, 30.0)
    finally:
        for process in (many, alone):
            process.kill()
            process.wait()


def test_a_station_that_ends_is_no_alarm_and_a_later_view_still_knows_it(
    mosquitto: Mosquitto,
    watch: FleetWatch,
) -> None:
    url = f"mqtt://127.0.0.1:{mosquitto.port}/bench"
    with Reporter(parse_mqtt(url), ("cup 12ab",)) as station:
        until(lambda: station._broker.connected)
        station.report(time.monotonic())
        until(lambda: presence(watch) == {"bench": "LIVE"})
    until(lambda: presence(watch) == {"bench": "ENDED"})
    with FleetWatch(parse_mqtt(url)) as later:
        until(lambda: presence(later) == {"bench": "ENDED"})
        until(lambda: later.rows()[0].report is not None)
        assert later.rows()[0].report.bundles == ("cup 12ab",)


def test_a_broker_that_is_away_holds_no_station_up() -> None:
    with Reporter(parse_mqtt("mqtt://127.0.0.1:9/bench")) as station:
        began_s = time.monotonic()
        for number in range(5):
            station.report(float(number))
        assert time.monotonic() - began_s < 0.5
        assert station.sent == 0


def test_the_page_shows_the_fleet_to_those_with_the_key(
    mosquitto: Mosquitto,
    watch: FleetWatch,
) -> None:
    with (
        Reporter(parse_mqtt(f"mqtt://127.0.0.1:{mosquitto.port}/bench")) as station,
        FleetPage(watch.snapshot) as page,
        httpx.Client() as browser,
    ):
        until(lambda: station._broker.connected)
        station.report(time.monotonic())
        until(lambda: presence(watch) == {"bench": "LIVE"})
        address, _, key = page.url.partition("/#")
        assert browser.get(f"{address}/").text.startswith("<!doctype html>")
        assert browser.get(f"{address}/fleet.json").status_code == 401
        entered = browser.post(f"{address}/enter", content=key, headers={"origin": address})
        assert entered.status_code == 204
        shown = browser.get(f"{address}/fleet.json").json()
        assert shown["stations"][0]["presence"] == "LIVE"
        assert shown["broker"]["connected"]
        assert browser.post(f"{address}/fleet.json", headers={"origin": address}).status_code == 405


@pytest.mark.parametrize("mine", [True, False])
def test_the_compose_files_access_rules_let_a_station_write_only_its_own_reports(
    tmp_path, mine: bool
) -> None:
    """With the rules that come with the compose file, nobody can send a station anything, and a
    station can write under its own name only.
    """
    if MOSQUITTO is None or not os.access("/usr/bin/mosquitto_passwd", os.X_OK):
        pytest.skip("needs mosquitto and mosquitto_passwd: apt-get install mosquitto")
    (tmp_path / "password").write_text("secret\n")
    users = tmp_path / "users"
    users.touch(mode=0o600)
    for name in ("bench", "fleet"):
        subprocess.run(["mosquitto_passwd", "-b", str(users), name, "secret"], check=True)
    rules = os.path.abspath("deploy/fleet/access.conf")
    os.chmod(tmp_path, 0o755)
    broker = Mosquitto(tmp_path, f"user root\npassword_file {users}\nacl_file {rules}\n")
    broker.start()
    place = f"mqtt://127.0.0.1:{broker.port}"
    who = f"password_file={tmp_path / 'password'}"
    try:
        with (
            FleetWatch(parse_mqtt(f"{place}?user=fleet&{who}")) as watch,
            Reporter(
                parse_mqtt(f"{place}/{'bench' if mine else 'other'}?user=bench&{who}")
            ) as reporter,
        ):
            until(lambda: watch.broker.connected and reporter._broker.connected)
            reporter.report(time.monotonic())
            if mine:
                until(lambda: presence(watch) == {"bench": "LIVE"})
            heard: list[str] = []
            with Broker(
                parse_mqtt(f"{place}?user=bench&{who}"), "listener", subscribe=("#",),
                on_message=lambda topic, *_: heard.append(topic),
            ) as listener:  # fmt: skip
                until(lambda: listener.connected)
                watch.broker.publish("taxel/fleet/1/bench/report", b"{}")
                watch.broker.publish("taxel/fleet/1/bench/order", b"{}")
                time.sleep(0.5)
            assert heard == []
            assert watch.state.refused == 0
            assert list(presence(watch)) == (["bench"] if mine else [])
    finally:
        broker.kill()


def test_json_is_what_the_page_shows(
    mosquitto: Mosquitto,
    capsys: pytest.CaptureFixture[str],
) -> None:
    from taxel.cli.main import main

    place = f"mqtt://127.0.0.1:{mosquitto.port}"
    with Reporter(parse_mqtt(f"{place}/bench")) as station:
        until(lambda: station._broker.connected)
        station.report(time.monotonic())
        main(["fleet", place, "--seconds", "0.6", "--json"])
    found = json.loads(capsys.readouterr().out)
    assert [row["station"] for row in found["stations"]] == ["bench"]
    assert found["broker"]["connected"]


def test_a_fleet_whose_broker_never_answered_is_bad_input(
    capsys: pytest.CaptureFixture[str],
) -> None:
    from taxel.cli.main import main

    with socket() as taken:
        taken.bind(("127.0.0.1", 0))  # bound and never listening: nobody answers there
        place = f"127.0.0.1:{taken.getsockname()[1]}"
        with pytest.raises(SystemExit) as ended:
            main(["fleet", f"mqtt://{place}", "--seconds", "0.2", "--json"])
    printed = capsys.readouterr()
    assert ended.value.code == 2
    assert json.loads(printed.out)["broker"]["connected"] is False
    assert f"needed a broker at {place}; got" in printed.err


def test_a_station_says_where_its_broker_is_and_whether_one_answers(mosquitto: Mosquitto) -> None:
    with Reporter(parse_mqtt(f"mqtt://127.0.0.1:{mosquitto.port}/bench")) as station:
        assert station.where(5.0) == f"127.0.0.1:{mosquitto.port} as bench"
    with socket() as taken:
        taken.bind(("127.0.0.1", 0))  # bound and never listening
        place = f"127.0.0.1:{taken.getsockname()[1]}"
        with Reporter(parse_mqtt(f"mqtt://{place}/bench")) as station:
            assert station.where(0.2).startswith(f"{place} as bench; no broker yet: n")
