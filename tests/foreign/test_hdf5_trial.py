"""Claims about the process that lets HDF5's library read a file first."""

import struct
import subprocess
import sys
import time

import h5py
import numpy as np
import pytest

from taxel.errors import BadFile
from taxel.foreign import hdf5_child, hdf5_trial
from taxel.foreign.array_files import open_arrays
from taxel.foreign.hdf5_trial import try_hdf5


@pytest.fixture
def honest(tmp_path):
    """A file of what the child reads: pieces, texts, attributes, links that lead nowhere."""
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("X", data=np.ones((600, 50, 16), "f4"), compression="gzip")
        file["g/y"] = ["cup", "ball"]
        file["g"].attrs["day"] = 3
        file["gone"] = h5py.ExternalLink("gone.h5", "/X")
        file["ring"] = h5py.SoftLink("/ring")
        file["g/up"] = file["g"]
    return tmp_path / "a.h5"


def test_an_honest_file_is_tried_once(honest, monkeypatch):
    """A second opening of the same file takes no second process."""
    file = open_arrays(honest)
    assert file.names() == ("X", "g/y")
    file.close()
    monkeypatch.setattr(hdf5_trial.subprocess, "Popen", None)
    try_hdf5(honest)
    honest.touch()
    with pytest.raises(TypeError):
        try_hdf5(honest)


@pytest.mark.slow
@pytest.mark.parametrize(
    "child",
    ["import os; os.abort()", "while True: pass", "import time; time.sleep(60)"],
    ids=["breaks off", "reads for ever", "sleeps"],
)
def test_a_file_that_its_library_does_not_survive_is_refused(honest, monkeypatch, tmp_path, child):
    """In one line, and soon: not by the process that asked."""
    script = tmp_path / "child.py"
    limit = "import resource\nresource.setrlimit(resource.RLIMIT_CPU, (1, 1))\n"
    script.write_text(limit + child)
    monkeypatch.setattr(hdf5_trial, "_CHILD", script)
    monkeypatch.setattr(hdf5_trial, "_WALL_S", 2.0)
    begun = time.monotonic()
    with pytest.raises(BadFile, match="where it breaks off or takes more than a minute"):
        open_arrays(honest)
    assert time.monotonic() - begun < 30


@pytest.mark.skipif(sys.platform != "linux", reason="the system keeps no such limit")
def test_texts_that_are_one_and_the_same_take_no_more_memory_than_the_child_has(
    monkeypatch, tmp_path
):
    """4,000 references to one text of 1 MB: 4 GB of a small file. The child has 64 MiB here."""
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["X"] = np.zeros(3)
        texts = np.array(["a" * 1_000_000] + ["b"] * 3999, object)
        file["X"].attrs.create("day", texts, dtype=h5py.string_dtype())
    content = bytearray((tmp_path / "a.h5").read_bytes())
    first = content.find(struct.pack("<I", 1_000_000))
    while content[first + 16 : first + 20] != struct.pack("<I", 1):
        first = content.find(struct.pack("<I", 1_000_000), first + 1)
    content[first : first + 16 * 4000] = content[first : first + 16] * 4000
    (tmp_path / "a.h5").write_bytes(content)
    script = tmp_path / "child.py"
    whole = hdf5_trial._CHILD.read_text()
    script.write_text(whole.replace("MEMORY = 1024 * 2**20", "MEMORY = 64 * 2**20"))
    assert script.read_text() != whole
    monkeypatch.setattr(hdf5_trial, "_CHILD", script)
    with pytest.raises(BadFile, match="1 GiB of memory"):
        open_arrays(tmp_path / "a.h5")


@pytest.mark.parametrize("error", [MemoryError(), OSError("memory allocation failed")])
def test_only_spent_memory_ends_the_child(error):
    """Other errors are found by the parent itself, for the array that is asked for."""

    def fail(raised):
        raise raised

    hdf5_child.quiet(lambda: fail(OSError("a wrong check sum")))
    with pytest.raises(SystemExit) as ended:
        hdf5_child.quiet(lambda: fail(error))
    assert ended.value.code == 1


def test_a_lower_limit_of_the_systems_stays() -> None:
    """As of a batch system: the child could not raise it, and every file was refused as damaged."""
    code = (
        "import resource; from taxel.foreign import hdf5_child; "
        "resource.setrlimit(resource.RLIMIT_CPU, (20, 30)); hdf5_child.limit(); "
        "print(resource.getrlimit(resource.RLIMIT_CPU))"
    )
    run = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False
    )
    assert run.stdout == "(30, 30)\n", run.stderr
