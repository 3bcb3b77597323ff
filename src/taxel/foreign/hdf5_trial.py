"""Let a process of its own read an HDF5 file first: the library is large, and in C.

A changed byte can let it wait for ever or end the process, and Python cannot interrupt it. So a
child (`hdf5_child.py`) reads all but the bulk of the numbers before; it is ended by the system
when its time or memory is spent. Where many files are read, one child copies itself for each of
them, which takes milliseconds, where a start of Python takes a tenth of a second and more. Knows
nothing about what is taken of a file.

Background of our choices: docs/decisions/0033.
"""

from __future__ import annotations

import os
import selectors
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Lock

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
    whole = _shared[-1].whole(path) if _shared else None
    if whole is None:
        whole = _whole(path)
    if not whole:
        raise BadFile(
            "an HDF5 file that its library reads to its end",
            f"{path}, where it breaks off or takes more than a minute or 1 GiB of memory",
            "copy it again",
        )  # fmt: skip
    _tried.add(key)


def _whole(path: Path) -> bool:
    """Return whether the library comes to a file's end, in a process for this file alone."""
    child = subprocess.Popen(
        [*_command(), os.path.abspath(path)],
        stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        return child.wait(_WALL_S) == 0
    except subprocess.TimeoutExpired:
        return False
    finally:
        child.kill()
        child.wait()


def _command() -> list[str]:
    # -P: the folder that the user stands in is nobody's package.
    return [sys.executable, "-P", str(_CHILD)]


class _SharedChild:
    """A child that copies itself for each file; one that is lost is started again."""

    def __init__(self) -> None:
        self._child: subprocess.Popen[bytes] | None = None
        self._answers = -1
        """File number of the pipe that it answers through; -1 where there is none."""
        self._lock = Lock()

    def whole(self, path: Path) -> bool | None:
        """Return whether the library comes to a file's end; None where the child itself is lost.

        That is nothing against the file: it is then read in a process of its own.
        """
        with self._lock:
            answer: bytes | None = b""
            try:
                answer = self._answer(os.fsencode(os.path.abspath(path)))
            except OSError:
                return None
            finally:
                if answer not in (b"y", b"n"):
                    self._end()
            return False if answer is None else {b"y": True, b"n": False}.get(answer)

    def _answer(self, path: bytes) -> bytes | None:
        """Return the child's answer; None where it takes too long, nothing where it has ended."""
        child = self._child = self._child or self._started()
        assert child.stdin is not None
        child.stdin.write(path.hex().encode() + b"\n")
        child.stdin.flush()
        with selectors.DefaultSelector() as waiting:
            waiting.register(self._answers, selectors.EVENT_READ)
            return os.read(self._answers, 1) if waiting.select(_WALL_S) else None

    def _started(self) -> subprocess.Popen[bytes]:
        """Start it; it answers through a pipe of its own, so that nothing printed is an answer."""
        self._answers, answers = os.pipe()
        try:
            return subprocess.Popen(
                [*_command(), str(os.getpid()), str(answers)], pass_fds=(answers,),
                stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                start_new_session=True,
            )  # fmt: skip
        finally:
            os.close(answers)

    def end(self) -> None:
        """End it; a file that comes after all has another."""
        with self._lock:
            self._end()

    def _end(self) -> None:
        if self._answers >= 0:
            os.close(self._answers)
            self._answers = -1
        if self._child is None:
            return
        with suppress(ProcessLookupError):
            os.killpg(self._child.pid, signal.SIGKILL)  # with the copy that reads a file
        assert self._child.stdin is not None
        with suppress(OSError):  # what was not sent yet
            self._child.stdin.close()
        self._child.wait()
        self._child = None


_shared: list[_SharedChild] = []
"""That of `many_hdf5`, or none."""


@contextmanager
def many_hdf5() -> Iterator[None]:
    """Let one child read all HDF5 files that are opened within, each with limits of its own.

    It starts with the first of them and ends with the block. Only on Linux: elsewhere, as outside
    of the block, each file has a process of its own.
    """
    if _shared or sys.platform != "linux":
        yield
        return
    child = _SharedChild()
    _shared.append(child)
    try:
        yield
    finally:
        _shared.remove(child)
        child.end()
