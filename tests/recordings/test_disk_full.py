"""Claims about a disk that refuses: it is said for good, and nothing written before is lost."""

import contextlib
import errno
import io
import os
import subprocess
import sys
import threading
from functools import partial
from pathlib import Path

import pytest

from taxel.errors import RecordingFailed
from taxel.recordings import recovery
from taxel.recordings.part_file import part_path
from taxel.recordings.reader import read_recording
from taxel.recordings.recovery import recover
from taxel.recordings.writer import Recorder
from taxel.signals import Mark


class SmallDisk(io.FileIO):
    """A real file on a disk with a given room; it takes what fits, then refuses."""

    def __init__(self, path: Path, room: int) -> None:
        super().__init__(path, "wb")
        self.room = room

    def write(self, content) -> int:
        fits = memoryview(content)[: self.room]
        if len(content) and not len(fits):
            raise OSError(errno.ENOSPC, "No space left on device")
        written = super().write(fits)
        self.room -= written
        return written


def fill(recorder: Recorder, numbered) -> None:
    for first in range(0, 20_000, 100):
        recorder.write(numbered(first, 100))
        recorder.flush()


@pytest.mark.data
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs Linux's /dev/full")
def test_a_full_disk_is_an_error_at_the_start(tmp_path, manifest):
    """A real ENOSPC, from the first byte on."""

    def opener(path: Path) -> io.FileIO:
        return io.FileIO("/dev/full", "wb")

    with pytest.raises(RecordingFailed, match="the disk is full") as caught:
        Recorder(tmp_path / "a.mcap", manifest, opener=opener)
    assert "\n" not in str(caught.value)


@pytest.mark.data
def test_the_first_refusal_is_latched(tmp_path, manifest, numbered):
    """Every later write, mark, flush and close says the same; room coming back changes nothing."""
    disk: list[SmallDisk] = []

    def opener(path: Path) -> SmallDisk:
        disk.append(SmallDisk(path, 20_000))
        return disk[0]

    recorder = Recorder(tmp_path / "a.mcap", manifest, opener=opener)
    with pytest.raises(RecordingFailed, match="taxel recover"):
        fill(recorder, numbered)
    assert recorder.failed
    disk[0].room = 1 << 30
    for again in (
        lambda: recorder.write(numbered(0, 1)),
        lambda: recorder.mark(Mark(start_s=0.0, end_s=1.0, labels={})),
        recorder.flush,
        recorder.close,
        recorder.close,
    ):
        with pytest.raises(RecordingFailed, match="the disk is full"):
            again()
    assert not (tmp_path / "a.mcap").exists()


@pytest.mark.data
def test_what_fitted_on_the_full_disk_can_be_recovered(tmp_path, manifest, numbered):
    """All chunks that were written whole are there, from the first scan on."""
    path = tmp_path / "a.mcap"
    recorder = Recorder(path, manifest, opener=lambda part: SmallDisk(part, 20_000))
    with pytest.raises(RecordingFailed):
        fill(recorder, numbered)
    with pytest.raises(RecordingFailed):
        recorder.close()
    report = recover(part_path(path), tmp_path / "saved.mcap")
    numbers = read_recording(tmp_path / "saved.mcap").samples.values[:, 0]
    assert report.scans >= 100
    assert numbers.tolist() == list(range(report.scans))


@pytest.mark.data
@pytest.mark.parametrize("short_of", [30_000, 10])
def test_a_recovery_onto_a_full_disk_leaves_nothing(
    short_of, tmp_path, manifest, numbered, monkeypatch
):
    """Also where all but the summary fits: what was to be recovered stays as the way back."""
    with Recorder(tmp_path / "a.mcap", manifest) as recorder:
        for first in range(0, 2000, 100):
            recorder.write(numbered(first, 100))
            recorder.flush()
    recover(tmp_path / "a.mcap", tmp_path / "fits.mcap")
    room = (tmp_path / "fits.mcap").stat().st_size - short_of
    opened = partial(Recorder, opener=lambda path: SmallDisk(path, room))
    monkeypatch.setattr(recovery, "Recorder", opened)
    output = tmp_path / "new" / "b.mcap"

    with pytest.raises(RecordingFailed, match=r"room to write .*new/b\.mcap; the disk is full"):
        recover(tmp_path / "a.mcap", output)
    assert list(output.parent.iterdir()) == []


@pytest.mark.data
def test_a_full_disk_at_the_very_end_is_an_error_too(tmp_path, manifest, numbered):
    """The summary did not fit: the file does not get its name, and nothing measured is lost."""
    whole = tmp_path / "whole.mcap"
    with Recorder(whole, manifest) as recorder:
        recorder.write(numbered(0, 100))
    path = tmp_path / "a.mcap"
    room = whole.stat().st_size - 100
    recorder = Recorder(path, manifest, opener=lambda part: SmallDisk(part, room))
    recorder.write(numbered(0, 100))
    with pytest.raises(RecordingFailed, match="the disk is full"):
        recorder.close()
    assert not path.exists()
    assert recover(part_path(path), tmp_path / "saved.mcap").scans == 100


LIMITED = """
import resource, signal, sys
from pathlib import Path
import numpy as np
from taxel.errors import RecordingFailed
from taxel.recordings.manifest import Manifest
from taxel.recordings.writer import Recorder
from taxel.signals import Samples, SensorInfo

resource.setrlimit(resource.RLIMIT_FSIZE, (2_000_000, 2_000_000))
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
sensor = SensorInfo(name="t", channels=("a",), units=("V",), rate_hz=1000.0)
try:
    with Recorder(Path(sys.argv[1]), Manifest(sensor=sensor)) as recorder:
        for first in range(0, 1_000_000, 1000):
            number = np.arange(first, first + 1000)
            recorder.write(Samples.from_values(number[:, None], number / 1000.0))
except RecordingFailed as error:
    print(error)
    sys.exit(2)
"""


@pytest.mark.data
@pytest.mark.skipif(os.name != "posix", reason="needs a limit on the size of files")
def test_a_real_limit_of_the_system_ends_the_recording_loudly(tmp_path):
    """The kernel's own refusal, in a process of its own; the part is readable up to it."""
    path = tmp_path / "a.mcap"
    done = subprocess.run(
        [sys.executable, "-c", LIMITED, str(path)], capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 2, done.stderr
    assert "the disk is full" in done.stdout
    assert part_path(path).stat().st_size == 2_000_000
    report = recover(part_path(path), tmp_path / "saved.mcap")
    assert report.scans > 0


def test_a_folder_that_cannot_be_made_is_one_plain_line(tmp_path, manifest):
    """A file stands where the folder should be."""
    (tmp_path / "file").write_text("")
    with pytest.raises(RecordingFailed, match="choose another folder"):
        Recorder(tmp_path / "file" / "a.mcap", manifest)


@pytest.mark.data
@pytest.mark.parametrize("end", [Recorder.close, Recorder.discard])
def test_a_file_is_not_closed_under_the_thread_that_still_writes_to_it(
    tmp_path, manifest, numbered, end
):
    """Its descriptor's number could be the next recording's by then."""
    freed, closed, open_yet = threading.Event(), threading.Event(), []

    class Stuck(io.FileIO):
        def write(self, content) -> int:
            if threading.current_thread() is not threading.main_thread():
                freed.wait(30)
                open_yet.append(not self.closed)
            return super().write(content)

        def close(self) -> None:
            super().close()
            closed.set()

    recorder = Recorder(
        tmp_path / "a.mcap", manifest, stall_s=0.05, opener=lambda part: Stuck(part, "wb")
    )
    recorder.write(numbered(0, 100))
    with contextlib.suppress(RecordingFailed):
        end(recorder)
    freed.set()

    assert closed.wait(10)
    assert open_yet
    assert all(open_yet)
