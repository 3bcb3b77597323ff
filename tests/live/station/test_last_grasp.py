"""What is logged where a station waits for a last verdict: when the grasp ended, what is lost."""

import pytest

from taxel.clock import ManualClock
from taxel.live.station.station import Station
from taxel.live.station.wiring import StationConfig


def test_the_last_grasp_ends_with_its_source_not_with_the_verdict_that_is_waited_for(
    monkeypatch: pytest.MonkeyPatch,
):
    """Beside a recogniser the log gave the last grasp's end up to 10 s too late."""
    clock = ManualClock(1.0)
    monkeypatch.setattr("taxel.live.station.station.monotonic", clock.now_s)
    station = Station(StationConfig(sources=(), bundles=()))

    def wait() -> list[str]:
        clock.advance(9.0)
        return ["recogniser 1"]

    monkeypatch.setattr(station._processes, "close", wait)
    station.person.say("held", 1.5)
    clock.advance(1.0)
    station.close()
    assert [trial.ended_s for trial in station.person.trials] == [2.0]
    assert [text for _, _, text in station.events] == [
        "recogniser 1 did not end in time: what it had not sent yet is lost"
    ]
