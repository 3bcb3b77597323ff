"""A station and its operator's page: what is shown, what may be asked, and what may not."""

from __future__ import annotations

import math
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from time import monotonic, sleep

import numpy as np
import pytest
from station_rig import WAIT_S, Idle, until

from taxel.calibration.characterise import characterise
from taxel.calibration.presses import script_of_marks
from taxel.calibration.results import PressedRecording
from taxel.calibration.stored import document_of, write_calibration
from taxel.errors import BadInput
from taxel.frame_codec import encode_jpeg
from taxel.live.station.packets import pack
from taxel.live.station.page_link import StationView
from taxel.live.station.ring import RingWriter
from taxel.live.station.station import Station
from taxel.live.station.wiring import StationConfig
from taxel.recordings.manifest import NO_ARRAY, Manifest
from taxel.recordings.reader import read_recording
from taxel.recordings.writer import Recorder
from taxel.signals import CameraInfo, Frame, Samples
from taxel.sim.teng.force_gauge import ForceGauge, GaugeConfig
from taxel.sim.teng.hand import TengHandConfig


def test_a_request_that_is_none_is_counted_and_changes_nothing():
    with Station(StationConfig(sources=("sim://teng",), bundles=())) as station:
        station.run(0.0)
        with RingWriter(station.view_config().requests) as page:
            for request in (b"N{", b"Nnull", b'N{"do":"record"}', b'N{"do":["x"]}', b"S", b"F1"):
                page.put(request)
        until(station, lambda: station.refused_requests >= 5)
        assert not station.recording["on"]


def test_a_supervisor_that_stands_still_is_a_stop_on_the_page_although_it_reports_nothing():
    """It is this process, which simply does not tick."""
    with (
        Station(StationConfig(sources=("sim://teng",), bundles=())) as station,
        closing(StationView(station.view_config())) as view,
    ):
        until(station, lambda: view.snapshot()["time_s"] > 0)
        stood_s = monotonic()
        while (shown := view.snapshot())["state"] != "STOP":
            assert monotonic() < stood_s + WAIT_S
            sleep(0.001)
        assert shown["reason"].startswith("the supervisor has stood still for 0.")
        assert (shown["alarms"][0]["kind"], shown["alarms"][0]["level"]) == ("supervisor", "danger")
        assert shown["time_s"] - shown["since_s"] > 0.08
        until(station, lambda: view.snapshot()["state"] == "NONE")
        assert any(alarm.kind == "supervisor" for alarm in station.guard.alarms.alarms)


def write_calibration_of_seed_4(path: Path) -> None:
    """Calibrate `sim://teng?seed=4&rate_hz=250` on a simulated gauge."""
    hand = TengHandConfig(seed=4, rate_hz=250.0)
    gauge = ForceGauge(hand, GaugeConfig(forces_n=(0.5, 1.0, 2.0), rounds=1))
    parts, marks = [], []
    for samples, own in gauge.script():
        parts.append(samples)
        marks += own
    script = script_of_marks(marks, gauge.info)
    taken = PressedRecording(samples=Samples.join(parts), script=script, rate_hz=250.0)
    write_calibration(path, document_of(characterise([taken], gauge.info), [], {}))


@pytest.mark.slow
def test_with_a_calibration_the_page_shows_newtons_and_other_sensors_are_refused(tmp_path: Path):
    """Nothing else changes: what is recorded and judged stays in volts."""
    path = tmp_path / "c.json"
    write_calibration_of_seed_4(path)
    config = StationConfig(sources=("sim://teng?seed=4&rate_hz=250",), bundles=(), calibration=path)
    with Station(config) as station, closing(StationView(station.view_config())) as view:
        station.run(WAIT_S, lambda: len(view.traces(-math.inf)["sensors"]["t"]) > 20)
        assert view.snapshot()["array"]["unit"] == "N"
        assert station.wiring.feeds[0].sensor.units[0] == "V"
        shown = np.array(view.traces(-math.inf)["sensors"]["values"], np.float64)
        assert np.nanmin(shown) == 0.0
    other = replace(config, sources=("sim://teng?seed=5&rate_hz=250",))
    with pytest.raises(BadInput, match="the sensors that were calibrated"), Station(other):
        pass


@pytest.mark.slow
def test_a_calibration_beside_tactile_cameras_only_is_refused(tmp_path: Path):
    calibration, path = tmp_path / "c.json", tmp_path / "cameras.mcap"
    write_calibration_of_seed_4(calibration)
    left = CameraInfo(name="left", width=32, height=24, rate_hz=60.0)
    recorder = Recorder(path, Manifest.started_now(NO_ARRAY, {}, {}, cameras=(left,)))
    image = encode_jpeg(np.full((24, 32, 3), 90, np.uint8))
    for number in range(3):
        recorder.frame(
            Frame(camera=0, jpeg=image, counter=number, device_s=float("nan"),
                  arrival_s=number / 60, fitted_s=number / 60)
        )  # fmt: skip
    recorder.close()
    config = StationConfig(sources=(f"replay://{path}",), bundles=(), calibration=calibration)
    with pytest.raises(BadInput, match="an array beside a calibration"), Station(config):
        pass


@pytest.mark.slow
def test_of_two_arrays_the_calibrated_one_is_shown_in_newtons_wherever_it_stands(tmp_path: Path):
    path, own, other = tmp_path / "c.json", "sim://teng?seed=4&rate_hz=250", "sim://teng?seed=5"
    write_calibration_of_seed_4(path)
    for sources in ((own, other), (other, own)):
        config = StationConfig(sources=sources, bundles=(), calibration=path)
        with Station(config) as station:
            seen = {source.url: source.calibration for source in station.view_config().sources}
        assert seen == {own: path, other: None}


def test_the_page_disarms_and_cannot_arm():
    with (
        Station(StationConfig(sources=("sim://teng",), bundles=())) as station,
        closing(StationView(station.view_config())) as view,
    ):
        station.drive(Idle())
        until(station, lambda: station.arm() == ())
        view.disarm()
        until(station, lambda: not station.guard.interlock.armed)
        assert "disarmed by a person at the page" in [text for _, _, text in station.events]
        with RingWriter(station.view_config().requests) as page:
            page.put(pack({"do": "arm"}))
        station.tick(monotonic())
        station.tick(monotonic())
        assert not station.guard.interlock.armed


def test_a_recording_begun_on_the_page_keeps_the_groups_and_labels_given_at_start(tmp_path: Path):
    config = StationConfig(
        sources=("sim://teng",), bundles=(), recordings=tmp_path,
        labels={"shape": "ball", "operator": "a"}, groups={"day": "3", "session": "7"},
    )  # fmt: skip
    with Station(config) as station:
        station.run(0.0)
        with RingWriter(station.view_config().requests) as page:
            page.put(pack({"do": "record", "labels": {"operator": "b", "session": "8"}}))
        until(station, lambda: station.recording["on"] and station.recording["kept"] > 5)
    (path,) = tmp_path.glob("*.mcap")
    manifest = read_recording(path).manifest
    assert manifest.labels == {"shape": "ball", "operator": "b"}
    assert manifest.groups == {"day": "3", "session": "8"}
