"""Recordings of format 1 still open: files that the writer of commit dadfc34 made.

`version_1/` holds 200 scans of 3 channels, 5 frames a camera, a mark and three notes of slip; the
same of a recording that was never closed; and one of a camera alone.
"""

from pathlib import Path

import numpy as np
import pytest

from taxel.recordings.manifest import FORMAT_VERSION
from taxel.recordings.reader import iterate_frames, iterate_slips, read_manifest, read_recording
from taxel.recordings.recovery import recover
from taxel.recordings.summary import summarise
from taxel.signals import Mark
from taxel.sources.opening import open_source
from taxel.views.page.replay_index import read_index

KEPT = Path(__file__).parent / "version_1"
NUMBER = np.arange(200)


def check(path: Path) -> None:
    """Everything that the old writer was given is there, bit by bit."""
    recording = read_recording(path)
    samples = recording.samples
    assert recording.manifest.sensor.channels == ("thumb-1", "index-1", "middle-1")
    assert recording.manifest.groups == {"session": "7"}
    np.testing.assert_array_equal(samples.values[:, 0], (NUMBER / 1000).astype(np.float32))
    np.testing.assert_array_equal(samples.counter, NUMBER)
    np.testing.assert_array_equal(samples.fitted_s, 50 + NUMBER / 1000)
    np.testing.assert_array_equal(samples.validity[:, 1], NUMBER % 50 == 3)
    assert recording.marks == [
        Mark(start_s=50.0, end_s=50.1, labels={"grasp": "stable"}, groups={"cup": "ä"})
    ]
    frames = list(iterate_frames(path))
    order = [(camera, number) for number in range(5) for camera in (0, 1)]
    assert [(frame.camera, frame.counter) for frame in frames] == order
    assert frames[0].arrival_s == 50.0123456789
    assert np.isnan(frames[1].device_s)
    assert {(frame.jpeg[:2], frame.jpeg[-2:]) for frame in frames} == {(b"\xff\xd8", b"\xff\xd9")}
    notes = list(iterate_slips(path))
    assert [note.values["slip_mm"] for note in notes] == [0.0, 0.01, 0.02]
    assert notes[0].values["slip_rate_mm_s"] is None


def test_a_recording_of_format_1_is_read_whole():
    path = KEPT / "array-and-cameras.mcap"
    assert read_manifest(path).version == "1"
    check(path)
    assert summarise(path)["check_sums"] == "hold"


def test_cameras_alone_are_read_too():
    frames = list(iterate_frames(KEPT / "cameras-only.mcap"))
    assert [frame.counter for frame in frames] == [0, 1, 2]


def test_an_unfinished_recording_of_format_1_is_recovered_as_format_2(tmp_path):
    """What was never closed by the old writer is saved by today's, bit by bit."""
    report = recover(KEPT / "cut-short.mcap.unfinished", tmp_path / "a.mcap")
    assert (report.scans, report.frames, report.marks) == (200, 10, 1)
    assert read_manifest(tmp_path / "a.mcap").version == FORMAT_VERSION == "2"
    check(tmp_path / "a.mcap")


def test_format_1_replays_and_shows_on_the_page():
    """The live path and the page's index read it, too."""
    path = KEPT / "array-and-cameras.mcap"
    index = read_index(path, read_manifest(path))
    assert [len(times) for times in index.frame_s] == [5, 5]
    with open_source(f"replay://{path}?speed=max") as source:
        count = 0
        while not source.ended:
            count += len(source.read())
    assert count == 200


@pytest.mark.parametrize("name", ["array-and-cameras.mcap", "cameras-only.mcap"])
def test_a_flipped_bit_of_format_1_is_refused(name, tmp_path):
    """Old files are checked as strictly as new ones."""
    content = bytearray((KEPT / name).read_bytes())
    content[len(content) // 2] ^= 1
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ValueError, match="taxel recover"):
        read_recording(tmp_path / name)
