"""Let a process of its own read an HDF5 file first: the library is large, and in C.

A changed byte can let it wait for ever or end the process, and Python cannot interrupt it. So a
child (`hdf5_child.py`) reads all but the bulk of the numbers before; it is ended by the system
when its time or memory is spent. Knows nothing about what is taken of a file.

Background of our choices: docs/decisions/0033.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from taxel.errors import BadFile

_CHILD = Path(__file__).with_name("hdf5_child.py")
_WALL_S = 120.0
"""A trial that sleeps is ended, too."""
_tried: set[tuple[str, int, int]] = set()
"""Path, size and time of change of files that were read to their end."""


def try_hdf5(path: Path) -> None:
    """Read a file in a process of its own; the same file once only.

    Raises:
        BadFile: The library does not come to its end, or takes too much time or memory.
        OSError: It is not there, or may not be read.
    """
    found = path.stat()
    key = (str(path.resolve()), found.st_size, found.st_mtime_ns)
    if key in _tried or not sys.executable:
        return
    # -P: the folder that the user stands in is nobody's package.
    child = subprocess.Popen(
        [sys.executable, "-P", str(_CHILD), os.path.abspath(path)],
        stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        ended = child.wait(_WALL_S)
    except subprocess.TimeoutExpired:
        ended = -1
    finally:
        child.kill()
        child.wait()
    if ended != 0:
        raise BadFile(
            "an HDF5 file that its library reads to its end",
            f"{path}, where it breaks off or takes more than a minute or 1 GiB of memory",
            "copy it again",
        )  # fmt: skip
    _tried.add(key)
