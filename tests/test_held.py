"""What a killed process leaves behind is removed by the next; what is not taxel's stays."""

import errno
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import BinaryIO

import pytest
from forked import Forked

from taxel.errors import BadInput, RecordingFailed
from taxel.held import REPLACED, only_writer, scratch_folder, sweep
from taxel.recordings.manifest import Manifest
from taxel.recordings.whole import new_folder
from taxel.recordings.writer import Recorder
from taxel.signals import SensorInfo

WAITING = """
import sys
from pathlib import Path
from taxel.held import only_writer, scratch_folder
hold = {"scratch": scratch_folder, "write": only_writer}[sys.argv[1]]
with hold(Path(sys.argv[2])) as held:
    if held is not None:
        (held / "half").write_bytes(b"x" * 1000)
    print("ready", flush=True)
    sys.stdin.read()
"""


class Holder:
    """A process that holds something until it is told to end, or killed."""

    def __init__(self, what: str, output: Path) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-c", WAITING, what, str(output)],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        assert self.process.stdout is not None
        assert self.process.stdout.readline() == "ready\n"

    def kill(self) -> None:
        self.process.kill()
        self.process.communicate(timeout=30)

    def end(self) -> None:
        self.process.communicate("", timeout=30)


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize("name", ["x", "x/y"])
def test_a_file_in_the_way_of_an_output_is_named(tmp_path: Path, name: str):
    """No room has to be made; what is in the way is not the output itself."""
    file = tmp_path / "notes"
    file.touch()
    with (
        pytest.raises(RecordingFailed, match=rf"got {file}, which is no folder; choose another"),
        only_writer(file / name),
    ):
        pass


def test_a_scratch_folder_goes_with_its_block(tmp_path: Path):
    def fail() -> None:
        with scratch_folder(tmp_path / "new" / "set") as scratch:
            (scratch / "half").write_bytes(b"x")
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    assert names(tmp_path / "new") == []


def test_what_a_killed_process_left_is_removed_by_the_next_and_not_what_a_living_one_holds(
    tmp_path: Path,
):
    killed, living = Holder("scratch", tmp_path / "a"), Holder("scratch", tmp_path / "b")
    killed.kill()
    assert len(names(tmp_path)) == 2
    with scratch_folder(tmp_path / "c") as own:
        left = names(tmp_path)
        assert len(left) == 2
        assert own.name in left
        assert not any(name.startswith(".taxel-a-") for name in left)
    living.end()
    assert names(tmp_path) == []


def test_nothing_is_removed_that_taxel_did_not_make(tmp_path: Path):
    """Folders of its names without its sign, with another's, a link, and a plain file."""
    (tmp_path / ".taxel-a-1").mkdir()
    (tmp_path / ".taxel-b-2").mkdir()
    (tmp_path / ".taxel-b-2" / ".owner").write_text("me")
    (tmp_path / ".taxel-c-3").write_text("a file")
    (tmp_path / "data").mkdir()
    killed = Holder("scratch", tmp_path / "elsewhere" / "set")
    killed.kill()
    (target,) = (tmp_path / "elsewhere").iterdir()
    (tmp_path / ".taxel-d-4").symlink_to(target)
    before = names(tmp_path)
    assert sweep(tmp_path) == []
    assert names(tmp_path) == before
    assert (target / "half").exists()


REPLACING = """
import os, signal, sys
from pathlib import Path
from taxel.recordings.whole import new_folder
real, calls = os.replace, []
def replace(source, target):
    calls.append(target)
    if len(calls) == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    real(source, target)
os.replace = replace
with new_folder(Path(sys.argv[1]), ["a.mcap"], overwrite=True) as made:
    (made / "a.mcap").write_text("newer")
"""


def test_a_kill_between_the_old_output_s_going_and_the_new_one_s_coming_loses_neither(
    tmp_path: Path,
):
    (tmp_path / "set").mkdir()
    (tmp_path / "set" / "a.mcap").write_text("older")
    done = subprocess.run([sys.executable, "-c", REPLACING, str(tmp_path / "set")], check=False)
    assert done.returncode == -signal.SIGKILL
    assert not (tmp_path / "set").exists()
    sweep(tmp_path)
    assert names(tmp_path) == ["set"]
    assert (tmp_path / "set" / "a.mcap").read_text() == "newer"


def test_where_no_output_can_take_its_place_both_stay_until_the_next_sweep(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """A disk that answers no rename any more gets neither the older nor the newer removed."""
    (tmp_path / "set").mkdir()
    (tmp_path / "set" / "a.mcap").write_text("older")
    real, calls = os.replace, list[Path]()

    def first_alone(source: Path, target: Path) -> None:
        calls.append(target)
        if len(calls) > 1:
            raise OSError(errno.EIO, "Input/output error")
        real(source, target)

    monkeypatch.setattr(os, "replace", first_alone)
    with (
        pytest.raises(OSError, match="Input/output"),
        new_folder(tmp_path / "set", ["a.mcap"], overwrite=True) as made,
    ):
        (made / "a.mcap").write_text("newer")
    monkeypatch.undo()
    assert not (tmp_path / "set").exists()
    sweep(tmp_path)
    assert names(tmp_path) == ["set"]
    assert (tmp_path / "set" / "a.mcap").read_text() == "newer"


def test_a_second_writer_of_one_output_is_refused_by_the_first_one_s_number(tmp_path: Path):
    first = Holder("write", tmp_path / "run")
    words = f"run for this process alone; got another that writes it, process {first.process.pid}"
    with pytest.raises(BadInput, match=words), only_writer(tmp_path / "run"):
        pass
    with only_writer(tmp_path / "other"):
        pass
    first.kill()
    assert names(tmp_path) == [".run.lock"]
    with only_writer(tmp_path / "run"):
        assert (tmp_path / ".run.lock").read_text() == f"{os.getpid()}\n"
    assert names(tmp_path) == []


def test_a_link_in_the_lock_s_place_is_refused_and_what_it_leads_to_stays(tmp_path: Path):
    """In a folder that others may write to, it could lead to any file of this user's."""
    (tmp_path / "thesis").write_text("three years")
    (tmp_path / ".run.lock").symlink_to(tmp_path / "thesis")
    with pytest.raises(RecordingFailed, match="needed to write"), only_writer(tmp_path / "run"):
        pass
    assert (tmp_path / "thesis").read_text() == "three years"


@pytest.mark.parametrize("number", [errno.ENOSYS, errno.EOPNOTSUPP, errno.ENOLCK])
def test_a_disk_without_locks_can_be_written_to_and_nothing_of_others_is_removed_there(
    number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    killed = Holder("scratch", tmp_path / "killed")
    killed.kill()

    def refuse(*_: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr("fcntl.flock", refuse)
    with only_writer(tmp_path / "run"), scratch_folder(tmp_path / "run") as own:
        assert set(names(tmp_path)) == {".run.lock", own.name, *names_of_killed(tmp_path)}
    assert names(tmp_path) == names_of_killed(tmp_path)


def names_of_killed(folder: Path) -> list[str]:
    return [name for name in names(folder) if name.startswith(".taxel-killed-")]


def test_what_was_begun_in_another_folder_by_a_relative_path_is_finished_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """Killed when both renames were done: the newer output stays, and the older one goes."""
    (tmp_path / "there").mkdir()
    monkeypatch.chdir(tmp_path / "there")
    killed = Holder("scratch", Path("set"))
    killed.kill()
    (scratch,) = (tmp_path / "there").iterdir()
    for folder, content in ((tmp_path / "there" / "set", "newer"), (scratch / REPLACED, "older")):
        folder.mkdir()
        (folder / "a").write_text(content)
    monkeypatch.chdir(tmp_path)
    assert sweep(tmp_path / "there") == [scratch]
    assert names(tmp_path / "there") == ["set"]
    assert (tmp_path / "there" / "set" / "a").read_text() == "newer"


@pytest.mark.slow
def test_a_killed_simulate_leaves_nothing_after_the_next(tmp_path: Path, forked: Forked):
    words = "simulate teng --output set --scans-per-class 20000 --json"
    process = forked.start(words.split(), tmp_path, Path(os.devnull), Path(os.devnull))
    while not list(tmp_path.glob(".*/**/*.mcap*")):  # until a first recording is begun
        assert process.poll() is None
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(0.01)
    process.kill()
    process.wait(30)
    (left,) = names(tmp_path)
    until_s = time.monotonic() + 30
    while names(tmp_path) != ["next"]:  # a killed run's workers take a second to end
        assert time.monotonic() < until_s, names(tmp_path)
        with new_folder(tmp_path / "next", [], overwrite=True) as made:
            assert made.parent.name != left


def test_a_full_disk_is_blamed_on_the_output_and_not_of_a_folder_that_is_gone(tmp_path: Path):
    manifest = Manifest.started_now(
        SensorInfo(name="a", channels=("x",), units=("V",), rate_hz=1.0)
    )
    with (
        pytest.raises(RecordingFailed) as failed,
        new_folder(tmp_path / "set", ["a.mcap"], overwrite=False) as made,
    ):
        Recorder(made / "a.mcap", manifest, opener=_full)
    assert str(failed.value) == (
        f"needed room to write {tmp_path / 'set'}; the disk is full; "
        "free space or choose another folder, then start again."
    )
    assert names(tmp_path) == []


def _full(path: Path) -> BinaryIO:
    path.touch()
    raise OSError(errno.ENOSPC, "No space left on device")
