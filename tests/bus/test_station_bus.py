"""A whole station with a live bus: a subscriber that stands still changes nothing in it."""

import importlib.util
import signal

import pytest

from taxel.bundles.shipped import CUP_POUR, shipped_bundle
from taxel.live.station.station import Station
from taxel.live.station.wiring import StationConfig

if importlib.util.find_spec("zenoh") is None:
    pytest.skip("needs eclipse-zenoh: pip install 'taxel[bus]'", allow_module_level=True)

from taxel.bench.faults.bus import Subscriber
from taxel.bench.faults.quiet_station import STILL
from taxel.bench.real_mosquitto import free_port
from taxel.cli.live.bus import check_bus, open_bus
from taxel.errors import BadInput


@pytest.mark.slow
def test_a_stopped_subscriber_and_an_absent_broker_change_nothing_in_the_station() -> None:
    """A real subscriber is stopped by SIGSTOP, and the broker is not there at all: every frame
    reaches the monitor, nobody is started again, and no alarm is raised about a publisher.
    """
    urls = [f"zenoh://127.0.0.1:{free_port()}/bench", f"mqtt://127.0.0.1:{free_port()}/bench",
            "foxglove"]  # fmt: skip
    config = StationConfig(sources=(STILL,), bundles=(shipped_bundle(CUP_POUR),))
    with Station(config) as station:
        lines = list(open_bus(station, urls))
        assert [line.partition(":")[0] for line in lines] == [
            "publishing", "reporting", "for Foxglove"]  # fmt: skip
        with Subscriber(urls[0]) as subscriber:
            station.run(30.0, subscriber.hears)
            subscriber.signal(signal.SIGSTOP)
            station.run(4.0)
        shown = station.guard.shown[0]
        alarms = [alarm.text for alarm in station.guard.alarms.alarms]
    ledger = station.ledger()
    assert shown == "STABLE"
    assert not any("publisher" in text or "foxglove" in text for text in alarms)
    assert ledger["monitor"]["dropped"] == 0
    assert ledger["publisher 1"]["produced"] > 100
    assert {row["starts"] for row in ledger.values()} == {1}


@pytest.mark.parametrize(
    ("urls", "needed"),
    [
        (["tcp://127.0.0.1:1"], "zenoh://, mqtt://"),
        (["zenoh://127.0.0.1:7447", "zenoh://127.0.0.1:7447"], "once"),
        (["zenoh://0.0.0.0:7447"], "on this machine"),
        (["mqtt://"], "HOST:PORT"),
    ],
)
def test_a_wrong_address_is_refused_before_anything_starts(urls: list[str], needed: str) -> None:
    with pytest.raises(BadInput, match=needed):
        check_bus(urls)
