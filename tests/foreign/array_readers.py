"""Read one array of a file. Not a test itself."""

from contextlib import suppress
from pathlib import Path

import numpy as np

from taxel.errors import BadFile
from taxel.foreign.array_files import open_arrays
from taxel.foreign.held_arrays import Held, Numbers

STACK = np.arange(2 * 3 * 4, dtype=np.float32).reshape(2, 3, 4) / 3


def held(path: Path, name: str) -> Held:
    """Return one array of a file, which is closed again."""
    file = open_arrays(path)
    try:
        return file.get(name)
    finally:
        file.close()


def values(path: Path, name: str) -> np.ndarray:
    """Return the numbers of one array."""
    file = open_arrays(path)
    try:
        found = file.get(name)
        assert isinstance(found, Numbers)
        whole = np.array(found.whole())
        assert (found.shape, found.dtype) == (whole.shape, whole.dtype)
        axis = len(found.shape) - 1
        np.testing.assert_array_equal(found.part(axis, 0, 1), whole[..., :1])
        return whole
    finally:
        file.close()


def ask_for_all(path: Path) -> None:
    """Ask for every array of a file that may be broken; only `BadFile` may come of it."""
    try:
        file = open_arrays(path)
    except BadFile:
        return
    try:
        for name in file.names():
            with suppress(BadFile):
                found = file.get(name)
                if isinstance(found, Numbers):
                    np.array(found.whole())
    finally:
        file.close()
