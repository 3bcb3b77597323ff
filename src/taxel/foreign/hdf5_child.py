"""The child of `hdf5_trial`: let HDF5's own library read a file, under limits of the system.

Run as a script, so that nothing of taxel is loaded. It reads what a file says of itself: groups,
attributes, shapes, texts, and of large arrays the first and last rows. The path is its only
argument; it ends with 0 where the library came to the file's end. With two arguments, the number
of its parent and that of an open file, it takes paths from its input, and answers each in that
file. Knows nothing about what is taken of a file.

Background of our choices: docs/decisions/0033.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
from typing import Any, NoReturn

import h5py

CPU_S = 60
"""Processor time; a file of 100,000 arrays takes half of it. Source: our choice."""
MEMORY = 1024 * 2**20
"""Bytes beside what the libraries hold. Source: our choice."""
WALL_S = 120
"""Time until a process that sleeps is ended, also where nobody waits for it. Source: our choice."""
_WHOLE = 2**20
"""Bytes of an array that is read as a whole."""
_MOST, _DEEPEST = 100_000, 16
_KNOWN = (1, 2, 3, 4, 5, 6, 32000)
"""Filters that come with HDF5 and h5py; another would be loaded as code."""


def limit() -> None:
    """Let the system end this process where it takes more."""
    try:
        import resource
    except ModuleNotFoundError:  # no such limits on this system: the parent's clock remains
        return

    def at_most(kind: int, most: int) -> None:
        _, highest = resource.getrlimit(kind)  # a lower one of the system's stays
        most = most if highest == resource.RLIM_INFINITY else min(most, highest)
        resource.setrlimit(kind, (most, most))

    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.setitimer(signal.ITIMER_REAL, WALL_S)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    at_most(resource.RLIMIT_CPU, CPU_S)
    try:
        with open("/proc/self/status") as status:
            held = next(int(line.split()[1]) for line in status if line.startswith("VmData:"))
    except (OSError, StopIteration):
        return
    at_most(resource.RLIMIT_DATA, held * 1024 + MEMORY)


def read(item: Any) -> None:
    """Read an array, or its ends."""
    made = item.id.get_create_plist()
    outside = item.is_virtual or made.get_external_count()
    filters = [made.get_filter(n)[0] for n in range(made.get_nfilters())]
    if outside or item.shape is None or not item.size or any(n not in _KNOWN for n in filters):
        return
    if item.chunks is not None:
        item.id.get_num_chunks()
    if item.nbytes <= _WHOLE:
        item[()]
        return
    item[(slice(0, 1),) * item.ndim]
    item[(slice(-1, None),) * item.ndim]


def walk(group: Any, depth: int, left: list[int]) -> None:
    """Read what lies in a group, by hard links only."""
    for name in group:
        left[0] -= 1
        if left[0] < 0 or depth > _DEEPEST:
            return
        if not isinstance(group.get(name, getlink=True), h5py.HardLink):
            continue
        item = group[name]
        for own in getattr(item, "attrs", ()):
            quiet(lambda item=item, own=own: item.attrs[own])
        if isinstance(item, h5py.Dataset):
            quiet(lambda item=item: read(item))
        elif isinstance(item, h5py.Group):
            walk(item, depth + 1, left)


def quiet(act: Any) -> None:
    """Do something whose errors the parent finds by itself: they end nothing.

    But memory that is spent ends this process, for the parent has no limit to stop at.
    """
    try:
        act()
    except Exception as error:  # h5py raises what it likes
        if isinstance(error, MemoryError) or "alloc" in str(error):
            raise SystemExit(1) from None


def read_file(path: str) -> None:
    """Read a file, under limits for the rest of this process."""
    limit()

    def all_of_it() -> None:
        with h5py.File(path, "r", locking=False) as file:
            walk(file, 0, [_MOST])

    quiet(all_of_it)


def end_with(parent: int) -> None:
    """Let the system end this process when its parent ends, as `processes.signal_at_parents_end`.

    Linux only. A process that waits, or sleeps in the library, would not see by itself.
    """
    zero = ctypes.c_ulong(0)
    death_signal = 1  # PR_SET_PDEATHSIG of prctl(2)
    ctypes.CDLL(None).prctl(death_signal, ctypes.c_ulong(signal.SIGKILL), zero, zero, zero)
    if os.getppid() != parent:
        os._exit(1)


def answer_each(parent: int, answers: int) -> None:
    """Read each file whose path comes in, in a copy of this process; write y or n for each.

    A copy begins with all of its time and memory, and what a file does to it is gone with it.
    Linux only. Each path is a line of hexadecimal digits.

    Args:
        parent: Process number of the parent.
        answers: Number of the open file that answers are written to.
    """
    end_with(parent)
    own = os.getpid()
    for line in sys.stdin.buffer:
        path = os.fsdecode(bytes.fromhex(line.decode("ascii")))
        copy = os.fork()
        if copy == 0:
            _read_in_copy(path, own, answers)
        _, status = os.waitpid(copy, 0)
        os.write(answers, b"n" if status else b"y")


def _read_in_copy(path: str, parent: int, answers: int) -> NoReturn:
    """Read a file and end this copy; what the library prints is no answer."""
    status = 1
    try:
        end_with(parent)
        os.close(answers)
        nothing = os.open(os.devnull, os.O_RDWR)
        os.dup2(nothing, 0)
        os.dup2(nothing, 1)
        read_file(path)
        status = 0
    finally:
        os._exit(status)


if __name__ == "__main__":
    if len(sys.argv) > 2:
        answer_each(int(sys.argv[1]), int(sys.argv[2]))
    else:
        read_file(sys.argv[1])
