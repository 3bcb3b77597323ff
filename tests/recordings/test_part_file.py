"""Claims about two that want to write one recording: the second is refused, nothing is harmed."""

import errno
import os
from pathlib import Path

import pytest

from taxel import held
from taxel.errors import BadInput, BadRecording, RecordingFailed
from taxel.recordings.manifest import Manifest
from taxel.recordings.part_file import check_output, let_go, open_part, part_path
from taxel.recordings.reader import read_recording
from taxel.recordings.recovery import recover
from taxel.recordings.writer import Recorder


@pytest.mark.parametrize("overwrite", [False, True])
def test_a_second_recorder_is_refused_before_it_harms_the_first(
    tmp_path: Path, manifest: Manifest, numbered, overwrite: bool
):
    """With --overwrite too; the first then completes its own recording."""
    path = tmp_path / "a.mcap"
    words = "another taxel that is recording to it; wait until it has ended, or choose another name"
    with Recorder(path, manifest) as first:
        first.write(numbered(0, 100))
        first.flush()
        for begin in (
            lambda: check_output(path, overwrite),
            lambda: Recorder(path, manifest, overwrite=overwrite),
        ):
            with pytest.raises(BadInput, match=words):
                begin()
        first.write(numbered(100, 100))

    assert len(read_recording(path).samples) == 200
    assert os.listdir(tmp_path) == ["a.mcap"]


def test_a_part_that_is_being_written_is_not_recovered(
    tmp_path: Path, manifest: Manifest, numbered
):
    """What is still to come would be missing, and the first would replace it."""
    path = tmp_path / "a.mcap"
    with Recorder(path, manifest) as first:
        first.write(numbered(0, 100))
        first.flush()
        with pytest.raises(BadRecording, match="another taxel is recording; wait until it has"):
            recover(part_path(path), tmp_path / "b.mcap")

    assert os.listdir(tmp_path) == ["a.mcap"]


def test_a_killed_recorders_part_is_made_anew(tmp_path: Path, manifest: Manifest, finished: Path):
    """It is another file then: whoever still has the old one open writes nowhere else."""
    path = tmp_path / "new.mcap"
    finished.rename(part_path(path))
    with part_path(path).open("r+b") as old:
        with Recorder(path, manifest, overwrite=True):
            assert not os.path.samestat(os.fstat(old.fileno()), part_path(path).stat())
        old.write(b"x" * 1000)

    assert len(read_recording(path).samples) == 0


def test_a_link_in_the_parts_place_is_replaced_and_what_it_leads_to_stays(
    tmp_path: Path, manifest: Manifest
):
    (tmp_path / "kept").write_text("kept")
    part_path(tmp_path / "a.mcap").symlink_to(tmp_path / "kept")
    Recorder(tmp_path / "a.mcap", manifest, overwrite=True).close()

    assert (tmp_path / "kept").read_text() == "kept"
    assert not (tmp_path / "a.mcap").is_symlink()


def test_a_descriptor_that_a_forked_process_kept_holds_no_lock(tmp_path: Path):
    """A recorder that gave up lets go of its part, and nobody else keeps it locked."""
    raw = open_part(tmp_path / "a.mcap", overwrite=False)
    kept = os.dup(raw.fileno())  # what a fork gives a child
    with pytest.raises(BadInput, match="another taxel"):
        open_part(tmp_path / "a.mcap", overwrite=True)
    let_go(raw)

    let_go(open_part(tmp_path / "a.mcap", overwrite=True))
    os.close(kept)


def test_without_locks_a_recorder_does_not_take_anothers_part(
    tmp_path: Path, manifest: Manifest, numbered, monkeypatch: pytest.MonkeyPatch
):
    """On a disk that has none, both begin; the one whose part was replaced says so at its end."""
    import fcntl

    def none(*_: object) -> None:
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(fcntl, "flock", none)
    assert held.lock_file(0)
    assert not held.lock_file(0, without=False)
    first = Recorder(tmp_path / "a.mcap", manifest, overwrite=True)
    with Recorder(tmp_path / "a.mcap", manifest, overwrite=True) as second:
        with pytest.raises(RecordingFailed, match="removed or replaced meanwhile"):
            first.close()
        second.write(numbered(0, 50))

    assert len(read_recording(tmp_path / "a.mcap").samples) == 50


def test_a_part_that_was_removed_fails_the_recording_at_once_and_not_at_its_end(
    tmp_path: Path, manifest: Manifest, numbered, monkeypatch: pytest.MonkeyPatch
):
    """A page counted seconds and bytes of a file that was gone, for as long as it ran."""
    monkeypatch.setattr("taxel.recordings.writer.LOOK_S", 0.0)
    recorder = Recorder(tmp_path / "a.mcap", manifest)
    recorder.write(numbered(0, 50))
    recorder.flush()
    part_path(tmp_path / "a.mcap").unlink()

    def go_on() -> None:
        recorder.write(numbered(50, 50))
        recorder.flush()

    with pytest.raises(RecordingFailed, match="removed or replaced meanwhile"):
        go_on()
    with pytest.raises(RecordingFailed, match="removed or replaced meanwhile"):
        recorder.close()


def test_a_name_that_was_taken_meanwhile_is_not_replaced_unasked(
    tmp_path: Path, manifest: Manifest, numbered
):
    """The recording stays in its part, complete."""
    path = tmp_path / "a.mcap"
    recorder = Recorder(path, manifest)
    recorder.write(numbered(0, 50))
    path.write_text("another's")
    with pytest.raises(RecordingFailed, match="made meanwhile"):
        recorder.close()

    assert path.read_text() == "another's"
    assert recover(part_path(path), tmp_path / "b.mcap").scans == 50


def test_a_part_that_somebody_only_looks_at_is_taken_a_moment_later(
    tmp_path: Path, manifest: Manifest, finished: Path, monkeypatch: pytest.MonkeyPatch
):
    """A look at a part takes a lock for a moment: that refuses nobody."""
    path = tmp_path / "new.mcap"
    finished.rename(part_path(path))
    looking = os.open(part_path(path), os.O_RDONLY)
    assert held.lock_file(looking, shared=True)
    pauses: list[float] = []

    def pause(seconds: float) -> None:
        pauses.append(seconds)
        held.unlock_file(looking)

    monkeypatch.setattr("taxel.recordings.part_file.time.sleep", pause)
    Recorder(path, manifest, overwrite=True).close()
    os.close(looking)
    assert len(pauses) == 1
