"""Slip that was measured live is kept beside the frames, and survives a recovery."""

import struct

import numpy as np
import pytest

from taxel.errors import BadInput
from taxel.recordings.manifest import NO_ARRAY, Manifest
from taxel.recordings.part_file import part_path
from taxel.recordings.reader import iterate_blocks, iterate_frames, iterate_slips
from taxel.recordings.recovery import recover
from taxel.recordings.writer import Recorder
from taxel.signals import CameraInfo, Frame, SlipNote

CAMERAS = tuple(
    CameraInfo(name=name, width=320, height=240, rate_hz=60.0) for name in ("left", "right")
)


def note(i, who="monitor/0"):
    values = {
        "slip_mm": i / 100, "slip_sd_mm": 0.008, "slip_rate_mm_s": None if i == 0 else 0.3,
        "slip_rate_sd_mm_s": 0.03, "slip_compliance": 0.4, "slip_compliance_sd": 0.05,
        "slip_seen": i > 2,
    }  # fmt: skip
    return SlipNote(time_s=1.0 + i / 60, who=who, values=values)


def frame(i):
    return Frame(camera=i % 2, jpeg=b"\xff\xd8%d\xff\xd9" % i, counter=i, device_s=float("nan"),
                 arrival_s=1.0 + i / 60, fitted_s=1.0 + i / 60)  # fmt: skip


def write(path, notes, close=True):
    manifest = Manifest.started_now(NO_ARRAY, now_s=0.0, cameras=CAMERAS)
    recorder = Recorder(path, manifest)
    for i in range(6):
        recorder.frame(frame(i))
    for note in notes:
        recorder.slip(note)
    recorder.flush()
    if close:
        recorder.close()
    return recorder


def test_what_was_measured_is_read_back_beside_the_frames(tmp_path):
    path = tmp_path / "a.mcap"
    write(path, [note(i) for i in range(20)])

    assert list(iterate_slips(path)) == [note(i) for i in range(20)]
    assert len(list(iterate_frames(path))) == 6
    assert sum(len(block.frames) for block in iterate_blocks(path)) == 6


def test_a_recording_without_slip_is_as_it_was(tmp_path):
    path = tmp_path / "a.mcap"
    write(path, [])

    assert list(iterate_slips(path)) == []
    assert b"/slip" not in path.read_bytes()


def test_other_tools_find_the_topic(tmp_path):
    from mcap.reader import make_reader

    path = tmp_path / "a.mcap"
    write(path, [note(i) for i in range(3)])
    with path.open("rb") as file:
        found = [m for _, c, m in make_reader(file).iter_messages() if c.topic == "/slip"]

    assert len(found) == 3
    assert struct.unpack_from("<d", found[2].data, 4 + 8) == (0.02,)


def test_recovery_keeps_slip(tmp_path):
    path = tmp_path / "a.mcap"
    recorder = write(path, [note(i) for i in range(5)], close=False)
    part, copy = part_path(path), tmp_path / "killed.mcap.part"
    copy.write_bytes(part.read_bytes())
    recorder.close()
    recover(copy, tmp_path / "mended.mcap")

    assert list(iterate_slips(tmp_path / "mended.mcap")) == [note(i) for i in range(5)]


def test_slip_without_a_time_is_refused(tmp_path):
    recorder = write(tmp_path / "a.mcap", [], close=False)
    with pytest.raises(BadInput, match="finite"):
        recorder.slip(SlipNote(time_s=np.nan, who="", values={}))
    recorder.close()
