"""Claims about the process that lets HDF5's library read a file first."""

import time

import h5py
import numpy as np
import pytest

from taxel.errors import BadFile
from taxel.foreign import hdf5_trial
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
