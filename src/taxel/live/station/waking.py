"""Sleep until a word in shared memory changes, without a lock.

The kernel compares the word and puts the caller to sleep in one step, so that no change is
missed; whoever changes it wakes every sleeper with one call that never waits. Nothing is held:
a process killed while it sleeps or wakes leaves nothing behind. Where the system has no such
call (futex(2), Linux on 64 bits) the word is looked at every half millisecond. Knows nothing
about rings.

Background of our choices: docs/decisions/0019.
"""

from __future__ import annotations

import ctypes
import errno
import platform
import sys
from collections.abc import Sequence
from time import monotonic, sleep

LOOK_S = 0.0005
"""How often a word is looked at where the kernel cannot wait for it: a twentieth of what a model
takes. Our choice."""
_FUTEX = {"x86_64": 202, "aarch64": 98, "riscv64": 98}
"""Machine → number of the system call. Source: Linux, arch/*/include/asm/unistd."""
_FUTEX_WAITV = 449
"""The same on every machine, from Linux 5.16 on. Source: as above."""
_WAIT, _WAKE = 0, 1
_EVERY = 2**31 - 1
_SIZE_32 = 2
_MONOTONIC = 1
_WORD = 2**32
_FUTEX_CALL = (
    _FUTEX.get(platform.machine())
    if sys.platform == "linux" and ctypes.sizeof(ctypes.c_void_p) == 8
    else None
)
_ANSWERS = (0, errno.EAGAIN, errno.ETIMEDOUT, errno.EINTR)
"""Woken, changed already, the time is over, a signal; all else is a refusal, as of a sandbox."""


class _Moment(ctypes.Structure):
    _fields_ = (("s", ctypes.c_long), ("ns", ctypes.c_long))


class _Waiter(ctypes.Structure):
    _fields_ = (
        ("value", ctypes.c_uint64),
        ("address", ctypes.c_uint64),
        ("flags", ctypes.c_uint32),
        ("reserved", ctypes.c_uint32),
    )


if _FUTEX_CALL is not None:
    _syscall = ctypes.CDLL(None, use_errno=True).syscall
    _syscall.restype = ctypes.c_long
    _syscall.argtypes = [ctypes.c_long] * 7


class Word:
    """The lower half of eight bytes in shared memory, to sleep on or to wake sleepers of.

    Args:
        memory: The shared memory; `close` must be called before it is closed.
        offset: Where the eight bytes begin, a multiple of 8.
    """

    def __init__(self, memory: memoryview, offset: int) -> None:
        low = 0 if sys.byteorder == "little" else 4
        self._value = ctypes.c_uint32.from_buffer(memory, offset + low)
        self.address = ctypes.addressof(self._value)

    @property
    def value(self) -> int:
        """The lower 32 bits as they stand now."""
        return self._value.value

    def wake(self) -> None:
        """Wake all who sleep on the word; it was changed before. Never waits."""
        if _FUTEX_CALL is not None:
            _syscall(_FUTEX_CALL, self.address, _WAKE, _EVERY, 0, 0, 0)

    def close(self) -> None:
        """Let go of the memory; the word is not to be used any more."""
        self.address = 0
        del self._value


def sleep_on(words: Sequence[tuple[Word, int]], longest_s: float) -> bool:
    """Sleep until one of several words differs from what was seen of it, or the time is over.

    A change that was seen already may still wake: look at the words again.

    Args:
        words: Each with what was seen of it; of larger numbers the lower 32 bits count.
        longest_s: How long at most, seconds.

    Returns:
        False where a signal came.
    """
    until_s = monotonic() + longest_s
    if _FUTEX_CALL is not None and words:
        asleep = _sleep_on_one if len(words) == 1 else _sleep_on_many
        ended = asleep(words, longest_s, until_s)
        if ended in _ANSWERS:
            return ended != errno.EINTR
    while (left_s := until_s - monotonic()) > 0:
        if any(word.value != seen % _WORD for word, seen in words):
            break
        sleep(min(LOOK_S, left_s) if words else left_s)
    return True


def _sleep_on_one(words: Sequence[tuple[Word, int]], longest_s: float, _: float) -> int:
    """Sleep on a word; return 0 when woken, else the system's error number."""
    ((word, seen),) = words
    most = _moment(max(0.0, longest_s))
    return _error(
        _syscall(_FUTEX_CALL, word.address, _WAIT, seen % _WORD, ctypes.addressof(most), 0, 0)
    )


def _sleep_on_many(words: Sequence[tuple[Word, int]], _: float, until_s: float) -> int:
    """Sleep on several words; return 0 when woken, else the system's error number."""
    every = (_Waiter * len(words))(
        *(_Waiter(seen % _WORD, word.address, _SIZE_32, 0) for word, seen in words)
    )
    end = _moment(until_s)
    return _error(
        _syscall(_FUTEX_WAITV, ctypes.addressof(every), len(words), 0, ctypes.addressof(end),
                 _MONOTONIC, 0)
    )  # fmt: skip


def _moment(seconds: float) -> _Moment:
    whole = int(seconds)
    return _Moment(whole, int((seconds - whole) * 1e9))


def _error(returned: int) -> int:
    return 0 if returned >= 0 else ctypes.get_errno()
