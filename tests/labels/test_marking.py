"""Claims about labelling afterwards: copies with marks, raw recordings as they were."""

from pathlib import Path

import numpy as np
import pytest

from taxel.errors import BadInput, BadTable
from taxel.labels.marking import mark_recordings
from taxel.recordings.manifest import Manifest
from taxel.recordings.reader import iterate_frames, iterate_slips, list_recordings, read_recording
from taxel.recordings.writer import Recorder
from taxel.signals import Mark, Samples, SensorInfo, SlipNote
from taxel.windows.config import WindowConfig
from taxel.windows.dataset import load_dataset

PAD = SensorInfo(name="pad", channels=("a", "b"), units=("N", "N"), rate_hz=100.0)
TABLE = (
    "file,start_s,end_s,label:object\n"
    "one,0,1,cup\none,1,2,egg\none.csv,2.5,3.5,cup\ntwo.mcap,1,2,egg\ntwo,2,3,cup\n"
)


@pytest.fixture
def raw(tmp_path: Path) -> Path:
    """Three recordings of 4 s that began at 1000 s on their own clock; one has a mark."""
    folder = tmp_path / "raw"
    values = np.random.default_rng(0).normal(size=(400, 2))
    for name in ("one", "two", "three"):
        manifest = Manifest(sensor=PAD, groups={"session": name})
        with Recorder(folder / f"{name}.mcap", manifest) as recorder:
            recorder.write(Samples.from_values(values, 1000.0 + np.arange(400) / 100.0))
            if name == "two":
                recorder.mark(Mark(start_s=1000.0, end_s=1003.0, labels={"object": "old"}))
    (tmp_path / "table.csv").write_text(TABLE)
    return folder


def test_copies_hold_the_same_scans_and_the_marks_while_the_raw_files_stay(raw, tmp_path):
    before = {path: path.read_bytes() for path in raw.iterdir()}

    made = mark_recordings(raw, tmp_path / "table.csv", tmp_path / "out")

    assert {path: path.read_bytes() for path in raw.iterdir()} == before
    assert [path.name for path in made.recordings] == ["one.mcap", "two.mcap"]
    assert list_recordings(tmp_path / "out") == list(made.recordings)
    assert (len(made.marks), made.replaced) == (5, 1)
    assert [path.name for path in made.left_out] == ["three.mcap"]
    old, new = (read_recording(folder / "one.mcap") for folder in (raw, tmp_path / "out"))
    assert new.manifest == old.manifest
    np.testing.assert_array_equal(new.samples.values, old.samples.values)
    np.testing.assert_array_equal(new.samples.fitted_s, old.samples.fitted_s)
    assert [(m.start_s, m.end_s) for m in new.marks] == [
        (1000.0, 1000.99), (1001.0, 1001.99), (1002.5, 1003.49)
    ]  # fmt: skip


def test_each_interval_is_a_trial_of_windows_of_its_own(raw, tmp_path):
    mark_recordings(raw, tmp_path / "table.csv", tmp_path / "out")

    config = WindowConfig(steps=20, stride=10, grid_hz=None, gate=None)
    data = load_dataset(tmp_path / "out", config, target="object")

    assert [trial.labels["object"] for trial in data.trials] == ["cup", "egg", "cup", "egg", "cup"]
    assert sorted(set(data.group("session"))) == ["one", "two"]
    for window, trial in enumerate(data.trial):
        assert data.windows.start_s[window] >= data.trials[trial].start_s - 1e-6
        assert data.windows.end_s[window] <= data.trials[trial].end_s + 1e-6
    assert np.bincount(data.trial).min() >= 8


def test_an_interval_outside_leaves_nothing(raw, tmp_path):
    (tmp_path / "table.csv").write_text(TABLE + "three,3,5,cup\n")
    before = sorted(tmp_path.iterdir())
    with pytest.raises(BadTable, match=r"within 0 and 4 s.*line 7"):
        mark_recordings(raw, tmp_path / "table.csv", tmp_path / "out")
    assert sorted(tmp_path.iterdir()) == before


def test_the_raw_recordings_are_never_replaced(raw, tmp_path):
    for output in (raw, tmp_path):
        with pytest.raises(BadInput, match="another folder"):
            mark_recordings(raw, tmp_path / "table.csv", output, overwrite=True)
    assert len(list_recordings(raw)) == 3


def test_cameras_beside_the_array_come_along(pour, tmp_path):
    table = tmp_path / "table.csv"
    table.write_text("start_s,end_s,label:object\n0.5,1.5,cup\n")

    made = mark_recordings(pour, table, tmp_path / "out")

    old, new = (list(iterate_frames(path)) for path in (pour, *made.recordings))
    assert [(f.camera, f.fitted_s, f.jpeg) for f in new] == [
        (f.camera, f.fitted_s, f.jpeg) for f in old
    ]
    assert [mark.labels for mark in read_recording(made.recordings[0]).marks] == [{"object": "cup"}]


def test_slip_that_a_monitor_measured_comes_along(raw, tmp_path):
    note = SlipNote(time_s=1000.7, who="left", values={"slip_mm": 0.25, "slip_seen": True})
    with Recorder(raw / "four.mcap", Manifest(sensor=PAD)) as recorder:
        recorder.write(Samples.from_values(np.ones((200, 2)), 1000.0 + np.arange(200) / 100.0))
        recorder.slip(note)
    (tmp_path / "table.csv").write_text("file,start_s,end_s,label:object\nfour,0,1,cup\n")

    made = mark_recordings(raw, tmp_path / "table.csv", tmp_path / "out")

    (same,) = iterate_slips(made.recordings[0])
    assert (same.time_s, same.who, same.values["slip_mm"]) == (1000.7, "left", 0.25)
    assert [same] == list(iterate_slips(raw / "four.mcap"))
