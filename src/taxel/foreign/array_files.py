"""Open a file of arrays by what its first bytes and its ending say: NumPy, MATLAB or HDF5.

Knows nothing about what the arrays mean.

Background of our choices: docs/decisions/0011.
"""

from __future__ import annotations

from pathlib import Path

from taxel.foreign.files import open_file
from taxel.foreign.hdf5_file import MATLAB_BLOCK, SIGN, Hdf5File
from taxel.foreign.held_arrays import ArrayFile
from taxel.foreign.mat4_file import Mat4File, is_version_4, not_matlab
from taxel.foreign.mat_file import MatFile
from taxel.foreign.npz_file import NpyFile, NpzFile

NAMED_ENDINGS = (".npz", ".mat", ".h5", ".hdf5")
"""Endings of files that hold named arrays, in capitals or not."""
ARRAY_ENDINGS = (".npy", *NAMED_ENDINGS)
"""The same and .npy, whose single array has no name."""


def open_arrays(path: Path) -> ArrayFile:
    """Open a file of arrays; close it at the end.

    Raises:
        BadFile: It is no whole file of its kind.
        MissingExtra: h5py is needed and not installed.
        OSError: It is not there, or may not be read.
    """
    ending = path.name.lower()
    if ending.endswith(".npy"):
        return NpyFile(path)
    if ending.endswith(".npz"):
        return NpzFile(path)
    if ending.endswith((".h5", ".hdf5")):
        return Hdf5File(path)
    with open_file(path) as file:
        head = file.read(MATLAB_BLOCK + len(SIGN))
    if head.endswith(SIGN):
        return Hdf5File(path)
    if is_version_4(head):
        return Mat4File(path)
    if head[126:128] in (b"IM", b"MI"):
        return MatFile(path)
    raise not_matlab()
