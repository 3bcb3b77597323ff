"""Claims about the one process that reads many HDF5 files, a copy of itself each."""

import os
import select
import signal
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from array_writers import write_mat73

from taxel.errors import BadFile
from taxel.foreign import hdf5_trial
from taxel.foreign.array_files import open_arrays
from taxel.foreign.hdf5_trial import many_hdf5, try_hdf5
from taxel.recordings.imports.importing import ImportOptions, import_table

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="elsewhere a process for each")
_READ = "    limit()\n"
"""Where the child begins to read a file, with `path`."""


@pytest.fixture
def started(monkeypatch):
    """Return the processes that were started to read HDF5, as they are started."""
    found = []

    class Noted(subprocess.Popen):
        def __init__(self, words, **more):
            super().__init__(words, **more)
            found.append(self)

    monkeypatch.setattr(hdf5_trial.subprocess, "Popen", Noted)
    return found


@pytest.fixture
def files(tmp_path):
    """Five files, the third called bad."""
    names = ["a", "b", "bad", "c", "d"]
    for name in names:
        with h5py.File(tmp_path / f"{name}.h5", "w") as file:
            file["X"] = np.ones((1, 5, 2), "f4")
    return [tmp_path / f"{name}.h5" for name in names]


def spoil(monkeypatch, folder: Path, lines: str, begins: str = "", **numbers: str) -> None:
    """Let the child do more before it reads a file (BAD: the bad one), or as it begins, or change
    its limits.
    """
    text = hdf5_trial._CHILD.read_text()
    assert text.count(_READ) == 1
    lines = lines.replace("BAD", "path.endswith('bad.h5')")
    text = text.replace(_READ, _READ + "".join(f"    {line}\n" for line in lines.splitlines()))
    for name, number in numbers.items():
        start = text.index(f"\n{name} = ") + 1
        text = text[:start] + f"{name} = {number}" + text[text.index("\n", start) :]
    assert text.count("import h5py\n") == 1
    script = folder / "child.py"
    script.write_text(text.replace("import h5py\n", f"import h5py\n{begins}\n"))
    monkeypatch.setattr(hdf5_trial, "_CHILD", script)


def refused(files: list[Path]) -> list[str]:
    """Return the files that are refused, by their names."""
    return [file.stem for file in files if not _survives(file)]


def _survives(file: Path) -> bool:
    try:
        try_hdf5(file)
    except BadFile:
        return False
    return True


def test_many_files_take_one_process_that_ends_with_them(files, started):
    """Also within a block of its own, such as that of a part of the work."""
    with many_hdf5():
        assert not started
        assert refused(files[:2]) == []
        with many_hdf5():
            assert refused(files[2:]) == []
        assert started[0].poll() is None
    assert len(started) == 1
    assert started[0].returncode is not None
    files[0].touch()
    assert refused(files[:1]) == []
    assert len(started) == 2  # as before: a process of its own


@pytest.mark.parametrize(
    "harm",
    [
        pytest.param("if BAD: os.abort()", id="breaks off"),
        pytest.param("while BAD: pass", id="reads for ever", marks=pytest.mark.slow),
        pytest.param("if BAD: bytearray(200 * 2**20)", id="takes more memory"),
        pytest.param("if BAD: print('yyy', flush=True) or os.write(1, b'y') and os.abort()",
                     id="answers"),
    ],
)  # fmt: skip
def test_a_file_that_its_library_does_not_survive_is_refused_alone(
    files, started, monkeypatch, tmp_path, harm
):
    """The files before and after it are read, by the same process."""
    spoil(monkeypatch, tmp_path, harm, CPU_S="1", MEMORY="100 * 2**20")
    with many_hdf5():
        assert refused(files) == ["bad"]
    assert len(started) == 1


def test_a_file_at_which_the_library_sleeps_is_refused_and_the_next_has_a_new_process(
    files, started, monkeypatch, tmp_path
):
    """The process that waits is ended, with the copy of it that sleeps."""
    copies = tmp_path / "copies"
    spoil(monkeypatch, tmp_path,
          "import pathlib, time\n"
          f"if BAD: pathlib.Path({str(copies)!r}).write_text(str(os.getpid()))\n"
          "if BAD: time.sleep(1000)")  # fmt: skip
    with many_hdf5():
        assert refused(files[:2]) == []
        monkeypatch.setattr(hdf5_trial, "_WALL_S", 0.5)
        assert refused(files[2:3]) == ["bad"]
        monkeypatch.setattr(hdf5_trial, "_WALL_S", 120.0)
        assert refused(files[3:]) == []
    assert len(started) == 2
    status = Path(f"/proc/{copies.read_text() if copies.exists() else 'none'}/stat")
    assert not status.exists() or status.read_text().split()[2] in "ZX"


def test_a_file_at_which_the_library_sleeps_is_ended_by_the_system_too(
    files, started, monkeypatch, tmp_path
):
    """By a clock of the copy itself, also where nobody waits; here it is 10,000 times faster."""
    spoil(monkeypatch, tmp_path,
          "import time\n"
          "left = signal.getitimer(signal.ITIMER_REAL)[0]\n"
          "if BAD: signal.setitimer(signal.ITIMER_REAL, left / 10_000)\n"
          "if BAD: time.sleep(1000)")  # fmt: skip
    monkeypatch.setattr(hdf5_trial, "_WALL_S", 20.0)
    with many_hdf5():
        assert refused(files) == ["bad"]
    assert len(started) == 1


def test_nothing_that_is_printed_is_an_answer(files, started, monkeypatch, tmp_path):
    """Such as by a package that each start of Python loads."""
    spoil(monkeypatch, tmp_path, "if BAD: os.abort()", "print('ny' * 99, flush=True)")
    with many_hdf5():
        assert refused(files) == ["bad"]
    assert len(started) == 1


def test_an_answer_that_is_none_is_nothing_against_the_file(files, started, monkeypatch, tmp_path):
    """The file then has a process of its own, and the next one a new one."""
    spoil(monkeypatch, tmp_path, "", "os.write(int(sys.argv[2]), b'?') if sys.argv[2:] else None")
    with many_hdf5():
        assert refused(files[:2]) == []
    assert [len(child.args) for child in started] == [5, 4, 5, 4]


def test_no_process_outlives_the_one_that_asked(files, monkeypatch, tmp_path):
    """However that ends: both the child and its copy that reads a file hold a pipe open."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    spoil(monkeypatch, tmp_path,
          "import time\nos.write(held, str(os.getppid()).encode())\ntime.sleep(1000)",
          f"held = os.open({str(pipe)!r}, os.O_WRONLY)")  # fmt: skip
    asks = (
        "from pathlib import Path\n"
        "from taxel.foreign import hdf5_trial\n"
        f"hdf5_trial._CHILD = Path({str(hdf5_trial._CHILD)!r})\n"
        f"with hdf5_trial.many_hdf5(): hdf5_trial.try_hdf5(Path({str(files[0])!r}))\n"
    )
    held = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    parent = subprocess.Popen([sys.executable, "-c", asks])
    child = 0
    try:
        assert select.select([held], [], [], 30)[0]
        child = int(os.read(held, 20))
        parent.kill()
        assert select.select([held], [], [], 30)[0], "one of them lives"
        assert os.read(held, 20) == b""
        child = 0
    finally:
        parent.kill()
        parent.wait()
        os.close(held)
        if child:
            os.killpg(child, signal.SIGKILL)


def test_matlabs_files_of_version_7_3_are_read_so_too(started, tmp_path):
    """They are HDF5; older ones need no child."""
    with many_hdf5():
        for number in range(3):
            write_mat73(tmp_path / f"{number}.mat", {"X": np.ones((2, 3))})
            file = open_arrays(tmp_path / f"{number}.mat")
            assert file.names() == ("X",)
            file.close()
    assert len(started) == 1


def test_each_file_has_the_whole_memory(files, monkeypatch, tmp_path):
    """What one has taken is not counted against the next."""
    spoil(monkeypatch, tmp_path, "sys.kept = getattr(sys, 'kept', []) + [bytearray(60 * 2**20)]",
          MEMORY="100 * 2**20")  # fmt: skip
    with many_hdf5():
        assert refused(files) == []


def test_a_process_that_is_lost_is_nothing_against_the_file(files, started, monkeypatch, tmp_path):
    """The file that was being read then has a process of its own, and the next one a new one."""
    spoil(monkeypatch, tmp_path,
          "if BAD and len(sys.argv) == 3: os.kill(os.getppid(), 9)")  # fmt: skip
    with many_hdf5():
        assert refused(files) == []
    assert [len(child.args) for child in started] == [5, 4, 5]


def test_a_process_that_ended_while_it_waited_is_nothing_against_the_next_file(files, started):
    """Such as one that the system ended for want of memory."""
    with many_hdf5():
        assert refused(files[:1]) == []
        started[0].kill()
        os.waitid(os.P_PID, started[0].pid, os.WEXITED | os.WNOWAIT)
        assert refused(files[1:]) == []
    assert [len(child.args) for child in started] == [5, 4, 5]


def test_an_import_of_many_files_starts_one_process(files, started, monkeypatch, tmp_path):
    """Of those of its files that are damaged, each is left out by itself."""
    spoil(monkeypatch, tmp_path, "if BAD: os.abort()")
    (tmp_path / "table.csv").write_text(
        "file,trials,axes,channels,time\n*.h5,X,trials rows channels,a[N] b[N],rate:100Hz\n"
    )
    facts: list = []
    made = import_table(tmp_path / "table.csv", tmp_path / "out", on_file=facts.append,
                        options=ImportOptions(skip_unreadable=True))  # fmt: skip
    assert [path.name for path in made] == [f"{name}.mcap" for name in "abcd"]
    assert [fact.file for fact in facts if fact.left_out] == ["bad.h5"]
    assert len(started) == 1
