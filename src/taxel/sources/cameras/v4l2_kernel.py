"""The system calls under V4L2, as a small protocol: the real ones, or a test's emulated driver.

Knows nothing about what the calls mean.
"""

from __future__ import annotations

import ctypes
import fcntl
import mmap
import os
import select
from typing import Any, Protocol


class Mapping(Protocol):
    """Memory that a driver fills."""

    def __getitem__(self, part: slice, /) -> bytes: ...

    def close(self) -> None: ...


class Kernel(Protocol):
    """What capturing needs of the kernel; failures are `OSError` with their number."""

    def open(self, path: str) -> int:
        """Return a file descriptor, for reading and writing, that never blocks."""
        ...

    def close(self, fd: int) -> None: ...

    def ioctl(self, fd: int, request: int, argument: ctypes.Structure | ctypes.c_int32) -> None:
        """Do a request; the argument is changed in place."""
        ...

    def map(self, fd: int, length: int, offset: int) -> Mapping:
        """Map a buffer of the driver, `length` bytes from `offset` on, into memory."""
        ...

    def wait(self, fd: int, timeout_s: float) -> bool:
        """Return whether there is something to dequeue, or an error, within the time."""
        ...


class LinuxKernel:
    """The calls themselves."""

    def open(self, path: str) -> int:
        return os.open(path, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)

    def close(self, fd: int) -> None:
        os.close(fd)

    def ioctl(self, fd: int, request: int, argument: Any) -> None:
        fcntl.ioctl(fd, request, argument)

    def map(self, fd: int, length: int, offset: int) -> Mapping:
        return mmap.mmap(fd, length, mmap.MAP_SHARED, mmap.PROT_READ, offset=offset)

    def wait(self, fd: int, timeout_s: float) -> bool:
        poll = select.poll()
        poll.register(fd, select.POLLIN)
        return bool(poll.poll(max(0.0, timeout_s) * 1000))
