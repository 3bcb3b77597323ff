"""What a station's report says of its sources, without a broker."""

import importlib.util
import json
from contextlib import nullcontext, suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

if importlib.util.find_spec("paho") is None:
    pytest.skip("needs paho-mqtt: pip install 'taxel[bus]'", allow_module_level=True)

from taxel.bus.addresses import parse_mqtt
from taxel.cli.live import bus
from taxel.fleet.broker import Broker
from taxel.fleet.reporter import Reporter, report


def _source(number: int, lost: int) -> dict[str, object]:
    return {"kind": "source", "source": number, "url": "sim://teng", "name": "teng",
            "state": "live", "lost": lost}  # fmt: skip


def test_two_sources_of_one_address_and_one_that_fell_silent(monkeypatch: pytest.MonkeyPatch):
    """The second replaced the first with its losses; one that was killed stayed "live"."""
    sent: list[bytes] = []
    monkeypatch.setattr(Broker, "publish", lambda _, topic, payload: sent.append(payload) or True)
    reporter = Reporter(parse_mqtt("mqtt://127.0.0.1:1883/bench-1"))
    reporter.take_in("/state", {"time_s": 10.0, "state": "STABLE"}, 10.0)
    reporter.take_in("/sources", _source(1, 40), 5.0)
    reporter.take_in("/sources", _source(2, 2), 9.9)
    reporter.report(10.0)
    report = json.loads(sent[0])
    assert [(s["state"], s["lost"]) for s in report["sources"]] == [("silent", 40), ("live", 2)]
    assert report["lost"] == 42


@pytest.mark.parametrize(
    ("killed", "error", "ended"), [(False, False, True), (False, True, False), (True, False, False)]
)
def test_only_a_station_that_ended_by_itself_is_said_to_have_ended(
    monkeypatch: pytest.MonkeyPatch, killed: bool, error: bool, ended: bool
):
    """A reporter that failed left its station ENDED: dim, at the bottom, while it went on."""
    sent: list[bytes] = []
    monkeypatch.setattr(Broker, "__enter__", lambda self: self)
    monkeypatch.setattr(Broker, "__exit__", lambda *_: None)
    monkeypatch.setattr(Broker, "finish", lambda _, topic, payload: sent.append(payload))
    with suppress(RuntimeError), Reporter(parse_mqtt("mqtt://127.0.0.1:1883/b")) as reporter:
        reporter.killed = killed
        if error:
            raise RuntimeError
    last = json.loads(sent[0])
    assert (last["alive"], last["ended"]) == (False, ended)


def test_a_reporter_that_is_started_again_names_the_bundles_that_run(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    """It read the file anew: replaced, it named what did not run; removed, it never came back."""
    jobs: list[Any] = []
    path = tmp_path / "cup.taxel"
    path.write_bytes(b"as the station began")
    monkeypatch.setattr(bus, "_added", lambda _, __, ___, job: jobs.append(job) or "there")
    station = SimpleNamespace(config=SimpleNamespace(bundles=(path,)), view_config=lambda: None)
    bus._open_reports(cast("Any", station), "publisher", "mqtt://127.0.0.1:1883/b")
    before = jobs[0](None).bundles
    path.unlink()
    assert jobs[0](None).bundles == before
    monkeypatch.setattr("taxel.fleet.reporter.Following", lambda _: nullcontext())
    began: list[tuple[str, ...]] = []

    def reporter(_: object, bundles: tuple[str, ...]) -> Any:
        began.append(bundles)
        raise RuntimeError

    monkeypatch.setattr("taxel.fleet.reporter.Reporter", reporter)
    monkeypatch.setattr("taxel.fleet.reporter.at_work", lambda _: nullcontext())
    with pytest.raises(RuntimeError):
        report(jobs[0](None))
    assert began == [before]
    assert before[0].startswith("cup.taxel ")
