"""The C that `write_c` wrote, compiled for this machine and run here."""

import ctypes
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from taxel.bundles.avr.integers import BoardAnswers

needs_gcc = pytest.mark.skipif(not shutil.which("gcc"), reason="no gcc: apt install gcc")


class _Answer(ctypes.Structure):
    _fields_ = (("best", ctypes.c_uint8), ("confidence", ctypes.c_uint8))


def host_library(folder: Path) -> ctypes.CDLL:
    """Return the folder's C, compiled and loaded; gone from the disk."""
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        library = Path(scratch) / "network.so"
        sources = [folder / name for name in ("taxel_cnn.c", "taxel_window.c")]
        strict = ("-std=gnu11", "-Wall", "-Wextra", "-Werror")
        command = ["gcc", "-O2", *strict, "-shared", "-fPIC", "-o", library, *sources]
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=600)
        assert not done.returncode, done.stderr
        c = ctypes.CDLL(str(library))
    for name in ("taxel_self_check", "taxel_window_push", "taxel_doubt"):
        getattr(c, name).restype = ctypes.c_uint8
    c.taxel_classify.restype = _Answer
    return c


def run_on_host(folder: Path, counts: NDArray[np.uint16], classes: int) -> BoardAnswers:
    """Return the C's answers to windows, shape (n, rows, columns)."""
    c = host_library(folder)
    logits = (ctypes.c_int32 * classes).in_dll(c, "taxel_logits")
    best, confidence = np.zeros(len(counts), np.intp), np.zeros(len(counts), np.uint8)
    every = np.zeros((len(counts), classes), np.int32)
    for number, window in enumerate(np.ascontiguousarray(counts, np.uint16)):
        for row in range(window.shape[0]):
            c.taxel_set_row(ctypes.c_uint8(row), ctypes.c_void_p(window[row].ctypes.data))
        answer = c.taxel_classify()
        best[number], confidence[number], every[number] = answer.best, answer.confidence, logits
    assert not ctypes.c_uint32.in_dll(c, "taxel_overflows").value, "a sum left 24 bits"
    return BoardAnswers(best, confidence, every)
