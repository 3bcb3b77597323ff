"""Facts about a folder: trials that marks part, arrays of several rates, scans that are lost."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from taxel.evaluation.cards.data import data_card
from taxel.labels.trials import trials_of
from taxel.recordings.manifest import Manifest
from taxel.recordings.reader import list_recordings, read_recording
from taxel.recordings.writer import Recorder
from taxel.signals import Mark, Samples, SensorInfo

SENSOR = SensorInfo(name="pad", channels=("a", "b"), units=("N", "N"), rate_hz=100.0)


def record(path: Path, sensor: SensorInfo, marks: tuple[Mark, ...] = (), lost: int = 0) -> None:
    manifest = Manifest.started_now(
        sensor, {"shape": "sphere"}, {"session": "s1", "object": "ball"}, now_s=0.0
    )
    time_s = np.arange(200) / sensor.rate_hz
    samples = Samples.from_values(np.ones((200, 2), np.float32), time_s)
    counter = np.arange(200) + np.where(np.arange(200) < 100, 0, lost)
    with Recorder(path, manifest) as recorder:
        recorder.write(replace(samples, counter=counter.astype(np.int64)))
        for mark in marks:
            recorder.mark(mark)


def mark(start_s: float, **own: dict[str, str]) -> Mark:
    labels, groups = own.get("labels", {}), own.get("groups", {})
    return Mark(start_s=start_s, end_s=start_s + 0.4, labels=labels, groups=groups)


def test_trials_are_counted_as_they_are_learned_from(tmp_path: Path) -> None:
    """Of three marks one names a shape and another an object; the others have the recording's."""
    marks = (
        mark(0.1, labels={"shape": "cube"}), mark(0.6, groups={"object": "box"}), mark(1.2),
    )  # fmt: skip
    record(tmp_path / "a.mcap", SENSOR, marks)
    card = data_card(tmp_path)
    (file,) = list_recordings(tmp_path)
    recording = read_recording(file)
    trials = trials_of(file, recording.manifest, recording.marks, 0.0, 2.0)
    shapes = [trial.labels["shape"] for trial in trials]

    assert card.classes == {"shape": {name: shapes.count(name) for name in ("cube", "sphere")}}
    assert card.groups == {"session": 1, "object": len({t.groups["object"] for t in trials})}


def test_a_group_that_only_marks_name_is_counted(tmp_path: Path) -> None:
    marks = tuple(mark(0.5 * n, groups={"grasp": f"g{n}", "object": f"o{n % 2}"}) for n in range(3))
    record(tmp_path / "a.mcap", SENSOR, marks)
    assert data_card(tmp_path).groups == {"grasp": 3, "object": 2, "session": 1}


def test_each_array_has_its_own_rate(tmp_path: Path) -> None:
    record(tmp_path / "a.mcap", SENSOR)
    record(tmp_path / "b.mcap", SENSOR)
    record(tmp_path / "c.mcap", replace(SENSOR, name="skin", rate_hz=1000.0))
    found = data_card(tmp_path).sensors

    assert "100 scans/s measured, 100 nominal" in found["pad"]
    assert "1000 scans/s measured, 1000 nominal" in found["skin"]


def test_an_array_that_was_read_at_two_rates_has_no_rate_between_them(tmp_path: Path) -> None:
    record(tmp_path / "a.mcap", SENSOR)
    record(tmp_path / "b.mcap", replace(SENSOR, rate_hz=250.0))
    record(tmp_path / "c.mcap", replace(SENSOR, name="ear", rate_hz=44100.0))
    found = data_card(tmp_path).sensors

    assert "100 to 250 scans/s measured, 100 to 250 nominal" in found["pad"]
    assert "44100 scans/s measured, 44100 nominal" in found["ear"]


def test_lost_scans_are_a_part_of_those_that_there_were(tmp_path: Path) -> None:
    record(tmp_path / "a.mcap", SENSOR, lost=300)
    assert data_card(tmp_path).lost.startswith("300 of 500 scans lost")
