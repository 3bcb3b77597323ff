"""Shared memory under names that say who owns it, and a sweep of what dead owners left.

    taxel_<pid namespace>_<pid>_<start>_<number>     in /dev/shm, all but the namespace decimal

`start` is the owner's start time in the kernel's ticks since boot: a process number that was
given again is another owner. A name of another namespace (a container that shares /dev/shm) is
left alone, since from here nobody can say whether its owner lives. Where there is no /proc, both
are 0 and nothing is swept. Knows nothing about what the memory holds.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import re
import resource
from multiprocessing import shared_memory
from pathlib import Path

from taxel.errors import BadInput
from taxel.foreign.files import in_words

SHARED = Path("/dev/shm")
_NAME = re.compile(r"taxel_([0-9a-f]+)_(\d+)_(\d+)_\d+")
_START_FIELD = 19
"""Of /proc/PID/stat behind the name in brackets. Source: proc_pid_stat(5), field 22."""
_numbers = itertools.count()


def create_shared(size: int) -> shared_memory.SharedMemory:
    """Return new shared memory of this process, named as above.

    Args:
        size: Bytes.

    Raises:
        BadInput: The system or this process's limits refuse it.
    """
    # Asked before: where the file cannot grow, Python's tracker of resources prints a traceback.
    most, _ = resource.getrlimit(resource.RLIMIT_FSIZE)
    if most != resource.RLIM_INFINITY and size > most:
        raise BadInput(
            f"{in_words(size)} of shared memory",
            f"a limit of {in_words(most)} on the size of a file (ulimit -f)",
            "raise it with ulimit -f unlimited, or start this from another shell",
        )
    owner = f"{_namespace():x}_{os.getpid()}_{_started(os.getpid()) or 0}"
    while True:
        name = f"taxel_{owner}_{next(_numbers)}"
        try:
            return shared_memory.SharedMemory(name, create=True, size=size)
        except FileExistsError:
            continue
        except OSError as error:
            raise BadInput(
                f"{in_words(size)} of shared memory", error.strerror or str(error),
                f"look at {SHARED} and at this process's limits (ulimit -a)",
            ) from error  # fmt: skip


def sweep(folder: Path = SHARED) -> list[str]:
    """Remove the shared memory whose owner is dead; return the names removed.

    Processes that still use it keep it until they end. Never raises.

    Args:
        folder: Where shared memory has its names.
    """
    namespace, removed = _namespace(), []
    if not namespace or not folder.is_dir():
        return []
    for path in sorted(folder.glob("taxel_*")):
        found = _NAME.fullmatch(path.name)
        if found is None or int(found[1], 16) != namespace:
            continue
        if _started(int(found[2])) != int(found[3]):
            with contextlib.suppress(OSError):  # another's, or gone meanwhile
                path.unlink()
                removed.append(path.name)
    return removed


def _namespace() -> int:
    """Return the number of this process's pid namespace; 0 where it cannot be known."""
    try:
        return os.stat("/proc/self/ns/pid").st_ino
    except OSError:
        return 0


def _started(pid: int) -> int | None:
    """Return when a process that lives was started, kernel ticks; None where none does."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        return None if fields[0] in "ZX" else int(fields[_START_FIELD])
    except (OSError, IndexError, ValueError):
        return None
