"""The end of the last grasp of a station that waits for a last verdict."""

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
    monkeypatch.setattr(station._processes, "close", lambda: clock.advance(9.0))
    station.person.say("held", 1.5)
    clock.advance(1.0)
    station.close()
    assert [trial.ended_s for trial in station.person.trials] == [2.0]
