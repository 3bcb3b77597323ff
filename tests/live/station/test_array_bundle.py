"""A recogniser of an array in a station: which source its bundle fits, and that it answers."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from station_rig import until

from taxel.bundles.contract import Contract
from taxel.bundles.envelope import pack
from taxel.bundles.shipped import CUP_POUR, shipped_bundle
from taxel.bundles.writer import write_bundle
from taxel.live.station.fitting import misfit
from taxel.live.station.station import Station
from taxel.live.station.wiring import StationConfig
from taxel.models.cnn2d import Cnn2d
from taxel.signals import CameraInfo, SensorInfo
from taxel.sources.opening import open_source
from taxel.training.loop import new_network
from taxel.windows.config import WindowConfig
from taxel.windows.scaling import fit_scaling

STEPS = 12
URL = "sim://teng?seconds=1"
CAMERAS = tuple(
    CameraInfo(name=name, width=320, height=240, rate_hz=60.0) for name in ("left", "right")
)


@pytest.fixture(scope="module")
def hand() -> SensorInfo:
    with open_source(URL) as source:
        return source.info


@pytest.fixture(scope="module")
def bundle(hand: SensorInfo, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An untrained network that answers each window of the simulated hand."""
    path, width = tmp_path_factory.mktemp("bundle") / "hand.taxel", len(hand.channels)
    values = np.random.default_rng(0).random((10, STEPS, width)).astype(np.float32)
    mask = np.ones((10, STEPS), bool)
    contract = Contract(
        target="shape", classes=("cube", "sphere"), window=WindowConfig(steps=STEPS, stride=STEPS),
        scaling=fit_scaling("full-scale", values, mask, 3.3), channels=hand.channels,
        units=hand.units, rate_hz=hand.rate_hz, model="cnn2d", parameters=1, data_digest="0" * 64,
        accuracy={}, software="taxel test", parity=None,
    )  # fmt: skip
    write_bundle(path, (new_network(lambda: Cnn2d(STEPS, width, 2), 0),), contract, values, mask)
    return path


def test_a_bundle_fits_its_own_sensor_and_says_why_another_does_not(bundle: Path, hand: SensorInfo):
    assert misfit(bundle, hand, ()) is None
    assert misfit(bundle, hand, CAMERAS) is None
    other = replace(hand, channels=hand.channels[:2], units=hand.units[:2])
    assert f"{len(hand.channels)} channels in V" in str(misfit(bundle, other, CAMERAS))
    watcher = shipped_bundle(CUP_POUR)
    assert "2 tactile cameras" in str(misfit(watcher, hand, ()))


@pytest.mark.slow
def test_the_array_is_recognised_and_no_grasp_is_claimed_to_be_watched(bundle: Path):
    heard: list[dict[str, Any]] = []
    config = StationConfig(sources=(URL,), bundles=(bundle,), least_confidence=0.0)
    with Station(config, heard.append) as station:
        station.run(20.0)
        summary = station.answers.summary()
        assert station.guard.shown[0] == "NONE"
    answers = [note for note in heard if note["kind"] == "answer"]
    assert len(answers) > 3
    assert {note["who"] for note in answers} == {"monitor/0"}
    assert summary[0]["windows"] == len(answers)


@pytest.mark.slow
def test_a_monitor_that_died_does_not_come_back_with_another_bundle(
    bundle: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """Its classes would stand under the other's target; an alarm says what was replaced."""
    path = tmp_path / "hand.taxel"
    path.write_bytes(bundle.read_bytes())
    monkeypatch.setattr("taxel.live.station.processes._RESTARTS", 1)
    with Station(StationConfig(sources=(URL,), bundles=(path,))) as station:
        path.write_bytes(pack({"bundle.json": b"{}"}))
        station.workers()["monitor"].kill()
        until(station, lambda: station.failed == "monitor")
        (alarm,) = [alarm for alarm in station.guard.alarms.alarms if alarm.kind == "monitor"]
    assert f"an error (needed {path} as it was when this station began; got another" in alarm.text
