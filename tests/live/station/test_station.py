"""A station in real processes: nothing lost uncounted, faults told, everything ends."""

from __future__ import annotations

import itertools
import os
import signal
import subprocess
import sys
from pathlib import Path
from time import monotonic, sleep
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from gel_monitor import write_gel_monitor
from station_rig import WAIT_S, until

from taxel.bundles.shipped import CUP_POUR, shipped_bundle
from taxel.errors import BadBundle, BadSource
from taxel.live.station import station as supervision
from taxel.live.station.page_link import StationView
from taxel.live.station.station import Station
from taxel.live.station.wiring import StationConfig
from taxel.recordings.part_file import part_path
from taxel.recordings.reader import iterate_frames, read_recording
from taxel.recordings.recovery import recover
from taxel.sim.pour.cup_pour import CupPourConfig, list_runs
from taxel.sources.simulated.pour_sets import CAMERA_HZ, write_run


@pytest.fixture(scope="module")
def pour(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("pour")
    config = CupPourConfig(
        cups=1, first_cup=901, forces_n=(50.0,), positions=("middle",), still=1.0, duration_s=3.0
    )
    (run,) = list_runs(config)
    write_run(folder, run, config, CAMERA_HZ)
    return folder / f"{run.name}.mcap"


def test_on_a_core_too_slow_for_its_ticks_the_supervisor_still_lets_others_run(
    monkeypatch: pytest.MonkeyPatch,
):
    """It runs before all others in real time: one that never sleeps would be alone on one core."""
    station = Station(StationConfig(sources=("sim://teng",), bundles=()))
    now_s = itertools.count(0.0, 0.002)  # a tick takes twice as long as it should
    slept_s: list[float] = []

    def wait(_: object, longest_s: float) -> bool:
        slept_s.append(longest_s)
        return False

    monkeypatch.setattr(supervision, "monotonic", lambda: next(now_s))
    monkeypatch.setattr(supervision, "wait_for_any", wait)
    monkeypatch.setattr(station, "tick", lambda _: None)
    monkeypatch.setattr(station, "_over", lambda _: len(slept_s) == 10)
    feed = SimpleNamespace(worker=None)
    station.wiring = SimpleNamespace(feeds=[feed], monitors=[])  # type: ignore[assignment]
    station.run()
    station._stack.close()
    assert min(slept_s) > 0.0
    assert len(slept_s) == 10


@pytest.mark.slow
@pytest.mark.data
def test_a_pair_of_cameras_is_watched_recorded_and_seen_and_every_message_is_accounted_for(
    pour: Path, tmp_path: Path
):
    path = tmp_path / "all.mcap"
    config = StationConfig(sources=(f"replay://{pour}",), bundles=(shipped_bundle(CUP_POUR),))
    with Station(config) as station:
        view = StationView(station.view_config())
        station.record(path, {"object": "cup"})
        station.run()
        snapshot, traces = view.snapshot(), view.traces(float("-inf"))
        images = [view.frame(camera) for camera in range(2)]
        view.close()
    ledger = station.ledger()
    made = ledger["source"]["produced"]
    for name in ("monitor", "recorder"):
        assert ledger[name]["consumed"] + ledger[name]["dropped"] == made, name
    assert ledger["recorder"]["dropped"] == 0
    sent, kept = (list(iterate_frames(recording)) for recording in (pour, path))
    assert [frame.jpeg for frame in kept] == [frame.jpeg for frame in sent]
    np.testing.assert_allclose(
        np.diff([frame.fitted_s for frame in kept]),
        np.diff([frame.fitted_s for frame in sent]),
        atol=1e-6,
    )
    recording = read_recording(path)
    assert recording.manifest.labels == {"object": "cup"}
    assert len(recording.samples) == len(read_recording(pour).samples)
    assert snapshot["cameras"][0]["name"] == "left"
    assert snapshot["state"] in ("STABLE", "UNKNOWN", "WARNING", "UNSTABLE")
    assert len(traces["probability"]["t"]) > 20
    assert all(image is not None and image[1].startswith(b"\xff\xd8") for image in images)


@pytest.mark.slow
@pytest.mark.data
def test_a_killed_monitor_is_reported_alarmed_and_started_again(pour: Path):
    config = StationConfig(
        sources=("sim://cup-pour?kind=still&force_n=50&duration_s=60",),
        bundles=(shipped_bundle(CUP_POUR),),
    )
    with Station(config) as station:
        station.run(0.0)
        until(station, lambda: station.guard.shown[0] in ("STABLE", "UNKNOWN", "WARNING"))
        before = station.workers()["monitor"].pid
        assert before is not None
        os.kill(before, signal.SIGKILL)
        until(station, lambda: station.guard.shown[0] == "STOP")
        assert any(alarm.kind == "monitor" for alarm in station.guard.alarms.alarms)
        until(station, lambda: station.guard.shown[0] != "STOP")
        assert station.workers()["monitor"].pid != before
        assert station.wiring.levels is station.answers.levels
    assert station.ledger()["monitor"]["starts"] == 2


@pytest.mark.slow
@pytest.mark.data
def test_a_simulator_that_is_started_again_begins_another_grasp():
    """It begins with its first cup: the grasp seen before is no measure of that one's frames."""
    config = StationConfig(
        sources=("sim://cup-pour?kind=still&force_n=50&duration_s=60",),
        bundles=(shipped_bundle(CUP_POUR),),
    )
    notes: list[dict[str, Any]] = []
    with Station(config, notes.append) as station:
        station.run(0.0)
        until(station, lambda: station.guard.shown[0] == "STABLE")
        source = station.workers()["source"].pid
        assert source is not None
        os.kill(source, signal.SIGKILL)
        notes.clear()
        until(station, lambda: any("new grasp" in note["kind"] for note in notes))
        until(station, lambda: any("learning" in note.get("reason", "") for note in notes))
        until(station, lambda: station.guard.shown[0] == "STABLE")
    assert station.ledger()["source"]["starts"] == 2


@pytest.mark.slow
@pytest.mark.data
def test_a_full_disk_is_alarmed_and_the_watch_goes_on(tmp_path: Path):
    config = StationConfig(
        sources=("sim://cup-pour?kind=still&force_n=50&duration_s=60",),
        bundles=(shipped_bundle(CUP_POUR),),
        disk_bytes=300_000,
    )
    with Station(config) as station:
        station.run(0.0)
        station.record(tmp_path / "all.mcap", {})
        until(station, lambda: any(a.kind == "recording" for a in station.guard.alarms.alarms))
        (text,) = [a.text for a in station.guard.alarms.alarms if a.kind == "recording"]
        assert "the disk is full" in text
        assert "taxel recover" in text
        decided = station.ledger()["monitor"]["produced"]
        until(station, lambda: station.ledger()["monitor"]["produced"] > decided + 3)


@pytest.mark.slow
@pytest.mark.data
def test_a_recorder_that_died_is_followed_by_one_that_leaves_finished_recordings_alone(
    tmp_path: Path,
):
    path = tmp_path / "a.mcap"
    path.touch()
    with Station(StationConfig(sources=("sim://teng",), bundles=())) as station:
        station.run(0.0)
        station.record(path, {}, overwrite=True)
        until(station, lambda: station.recording["on"] and station.recording["kept"] > 5)
        station.end_recording()
        until(station, lambda: not station.recording["on"])
        whole = path.read_bytes()
        recorder = station.workers()["recorder"]
        recorder.kill()
        until(station, lambda: station.ledger()["recorder"]["starts"] == 2)
        until(station, lambda: station.ledger()["recorder"]["consumed"] > 20)
        assert any(alarm.kind == "recorder" for alarm in station.guard.alarms.alarms)
    assert path.read_bytes() == whole


@pytest.mark.slow
@pytest.mark.data
def test_a_recording_goes_on_in_a_second_file_where_its_recorder_was_killed(tmp_path: Path):
    """Both files together hold all that came; the first is told at once, and at the end."""
    path, rest, saved = (tmp_path / name for name in ("a.mcap", "a-2.mcap", "saved.mcap"))
    with Station(StationConfig(sources=("sim://teng",), bundles=())) as station:
        station.run(0.0)
        station.record(path, {"object": "cup"}, {"session": "3"})
        until(station, lambda: station.recording["on"] and station.recording["kept"] > 5)
        station.workers()["recorder"].kill()
        until(station, lambda: station.recording["error"] != "")
        assert not station.recording["on"]
        (alarm,) = [a for a in station.guard.alarms.alarms if a.kind == "recording"]
        assert f"taxel recover {path}.part --output {path}" in alarm.text
        until(station, lambda: station.recording["on"] and station.recording["kept"] > 5)
        assert station.recording["path"] == str(rest)
        words = [text for _, _, text in station.events]
        assert [text.partition(":")[0] for text in words if "record" in text.lower()] == [
            "recorder ended by signal 9", "NOT RECORDING", f"the recording goes on in {rest}",
        ]  # fmt: skip
    assert "taxel recover" in station.recording["error"]
    assert station.recording["incomplete"] == [str(path)]
    ledger = station.ledger()
    recorder = ledger["recorder"]
    assert recorder["consumed"] + recorder["dropped"] == ledger["source"]["produced"]
    recover(part_path(path), saved)
    first, second = read_recording(saved), read_recording(rest)
    assert second.manifest.labels == {"object": "cup"}
    assert second.manifest.groups == {"session": "3"}
    assert first.samples.counter[-1] + 1 >= second.samples.counter[0]
    assert recorder["dropped"] == 0


@pytest.mark.data
def test_a_recording_that_its_recorder_did_not_complete_is_reported_as_such(tmp_path: Path):
    with Station(StationConfig(sources=("sim://teng",), bundles=())) as station:
        station.run(0.0)
        station.record(tmp_path / "a.mcap", {})
        until(station, lambda: station.recording["on"] and station.recording["kept"] > 5)
        station.workers()["recorder"].kill()
        station.workers()["recorder"].join()
    assert "taxel recover" in station.recording["error"]


@pytest.mark.slow
@pytest.mark.data
def test_a_process_that_hangs_is_reported_although_it_is_alive():
    with Station(StationConfig(sources=("sim://teng",), bundles=())) as station:
        station.run(0.5)
        pid = station.workers()["recorder"].pid
        assert pid is not None
        os.kill(pid, signal.SIGSTOP)
        until(station, lambda: any(a.kind == "recorder" for a in station.guard.alarms.alarms))
        os.kill(pid, signal.SIGCONT)
        until(station, lambda: not any(a.on for a in station.guard.alarms.alarms))


@pytest.mark.slow
def test_a_damaged_recording_is_replayed_once_and_given_up_in_words(pour: Path, tmp_path: Path):
    """From its beginning again, its frames would be seen against the grasp settled before."""
    path = tmp_path / "cut.mcap"
    whole = bytearray(pour.read_bytes())
    middle = len(whole) // 2
    whole[middle : middle + 64] = bytes(64)
    path.write_bytes(whole)
    with Station(StationConfig(sources=(f"replay://{path}",), bundles=())) as station:
        view = StationView(station.view_config())
        station.run(60.0)
        (shown,) = view.snapshot()["sources"]
        view.close()
    assert (shown["state"], str(path) in shown["note"]) == ("failed", True)
    assert station.failed == "source"
    assert station.ledger()["source"]["starts"] == 1
    (text,) = [text for _, _, text in station.events if "given up" in text]
    assert str(path) in text


_ORPHANS = """
import os, sys, time
from taxel.live.station.ring import RingWriter
from taxel.live.station.station import Station
from taxel.live.station.wiring import StationConfig
if __name__ == "__main__":
    with Station(StationConfig(sources=("sim://teng",), bundles=())) as station:
        print(*[p.pid for p in station.workers().values()], flush=True)
        station.run(60.0)
"""


@pytest.mark.slow
@pytest.mark.data
def test_every_process_ends_when_supervisor_and_source_are_killed(tmp_path: Path):
    script = tmp_path / "orphans.py"
    script.write_text(_ORPHANS)
    with subprocess.Popen(
        [sys.executable, str(script)], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    ) as station:
        assert station.stdout is not None
        pids = [int(word) for word in station.stdout.readline().split()]
        os.kill(pids[0], signal.SIGKILL)
        station.kill()
        station.wait()
    limit_s = monotonic() + WAIT_S
    while any(_lives(pid) for pid in pids):
        assert monotonic() < limit_s, "a process has outlived its supervisor"
        sleep(0.05)


def _lives(pid: int) -> bool:
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"


@pytest.mark.slow
def test_two_monitors_of_one_source_are_told_apart(pour: Path, tmp_path: Path):
    """A forecast of slip, and a head over windows of gel features."""
    other = tmp_path / "other.taxel"
    write_gel_monitor(other)
    config = StationConfig(sources=(f"replay://{pour}",), bundles=(shipped_bundle(CUP_POUR), other))
    heard: dict[str, list[dict[str, Any]]] = {"monitor/0": [], "monitor/1": []}
    with Station(config, lambda note: heard.get(note.get("who", ""), []).append(note)) as station:
        station.run(2.5)
        snapshot = station.snapshot(monotonic())
    for notes, is_score in zip(heard.values(), (True, False), strict=True):
        assert {note["is_score"] for note in notes} == {is_score}
        assert any(note["p"] is not None for note in notes)
    assert snapshot["scored"] is True
    assert set(snapshot["thresholds"]) == {"clear", "warn", "unstable"}


def test_a_source_at_another_speed_is_refused(pour: Path):
    config = StationConfig(sources=(f"replay://{pour}?speed=max",), bundles=())
    with pytest.raises(BadSource, match="speed=1"), Station(config):
        pass


def test_a_folder_is_refused_with_one_of_its_recordings(pour: Path):
    config = StationConfig(sources=(f"replay://{pour.parent}?speed=max",), bundles=())
    with (
        pytest.raises(
            BadSource, match=r"a folder of \d+ recordings?; name one, as in .*\.mcap, or"
        ),
        Station(config),
    ):
        pass


def test_a_source_that_cannot_be_opened_ends_the_start_in_its_own_words():
    with (
        pytest.raises(BadSource, match="a simulator that exists"),
        Station(StationConfig(sources=("sim://nothing",), bundles=())),
    ):
        pass


def test_a_bundle_that_fits_no_source_is_refused(tmp_path: Path):
    config = StationConfig(sources=("sim://teng",), bundles=(shipped_bundle(CUP_POUR),))
    with pytest.raises(BadBundle, match="2 tactile cameras"), Station(config):
        pass


@pytest.mark.slow
def test_nothing_is_left_behind():
    names = set(os.listdir("/dev/shm")) if Path("/dev/shm").exists() else set()
    with Station(StationConfig(sources=("sim://teng?seconds=1",), bundles=())) as station:
        station.run()
        children = station.workers()
    assert all(child.exitcode == 0 for child in children.values())
    if names:
        mine = set(os.listdir("/dev/shm")) - names
        assert not {name for name in mine if str(os.getpid()) in name}
