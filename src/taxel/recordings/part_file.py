"""The file in which a recording is written until it is complete: NAME.mcap.part, of one recorder.

Its recorder holds a lock (`flock`) on it, which the system lets go of when the process ends,
however it ends: a part without a lock is what a killed recorder left behind. So a second recorder
is refused before it harms anything, and `taxel recover` leaves a file alone that is still
growing. Where a system or a network's disk has no such locks, nothing is locked; a recorder then
notices at its end that its part is another's. Knows nothing about what is in the file.

Source: docs/decisions/0004.
"""

from __future__ import annotations

import os
import shlex
import time
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

from taxel.errors import BadInput, BadRecording, RecordingFailed
from taxel.held import lock_file, unlock_file

PART_SUFFIX = ".part"
"""Added to the name of a recording that is not finished."""
_TRIES, _PAUSE_S = 20, 0.01
"""A part that others look at, or begin, at this very moment is tried again so often, so many
seconds apart: they are done in far less. Our choice, docs/decisions/0004."""
_LOOK = (
    getattr(os, "O_NOFOLLOW", 0)
    | getattr(os, "O_NONBLOCK", 0)  # a pipe of that name is not waited for
    | getattr(os, "O_CLOEXEC", 0)
    | getattr(os, "O_BINARY", 0)
)


def part_path(path: Path) -> Path:
    """Return the name under which a recording is written until it is complete."""
    return path.with_name(path.name + PART_SUFFIX)


def recover_command(path: Path) -> str:
    """Return the command that saves what an unfinished recording holds."""
    return shlex.join(["taxel", "recover", str(part_path(path)), "--output", str(path)])


def check_output(path: Path, overwrite: bool) -> None:
    """Refuse a recording to be, before anything is opened for it.

    Args:
        path: Where it is to be; a folder that is missing is made as the recording begins.
        overwrite: Replace an existing recording, and an unfinished one.

    Raises:
        BadInput: Its name does not end in .mcap, there is a recording or an unfinished one, or
            another process is recording to it.
    """
    if path.suffix != ".mcap":
        raise BadInput("a recording's name that ends in .mcap", str(path), "rename it")
    refuse_existing(path, overwrite)


def refuse_existing(path: Path, overwrite: bool) -> None:
    """Refuse a recording to be that is there, unfinished, or being recorded.

    Raises:
        BadInput: It is.
    """
    part = part_path(path)
    if _held_by_another(part):
        raise _busy(path)
    if overwrite:
        return
    if path.exists():
        raise BadInput("a new file to record to", f"{path}, which exists", "add --overwrite")
    if part.exists():
        raise BadInput(
            "a new file to record to",
            f"the unfinished {part}",
            f"run: {recover_command(path)}, or add --overwrite",
        )


def open_part(path: Path, overwrite: bool) -> BinaryIO:
    """Make a recording's part, locked, for unbuffered writing; nothing of another's is harmed.

    Args:
        path: The recording to be; its folder is there.
        overwrite: Remove the part that a killed recorder left.

    Raises:
        BadInput: The recording is there, unfinished, or being recorded.
        OSError: The disk refused.
    """
    part = part_path(path)
    for _ in range(_TRIES):
        refuse_existing(path, overwrite)
        if overwrite and part.exists():
            _remove_stale(part)
        with suppress(FileExistsError):  # another began meanwhile: look again
            held = os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL | _LOOK, 0o666)
            if lock_file(held) and _is_at(held, part):
                return os.fdopen(held, "wb", buffering=0)
            os.close(held)
        time.sleep(_PAUSE_S)
    raise _busy(path)


def take_name(raw: BinaryIO, path: Path, overwrite: bool) -> None:
    """Give a complete part its recording's name.

    Raises:
        RecordingFailed: The part is not ours any more, or the name was taken meanwhile.
        OSError: The disk refused.
    """
    part = part_path(path)
    if not _is_at(raw.fileno(), part):
        raise _lost(part)
    if not overwrite and path.exists():
        raise RecordingFailed(
            f"needed a new file to record to; got {path}, which was made meanwhile; the recording "
            f"is in {part}: move it, then run taxel recover on it."
        )
    os.replace(part, path)


def check_there(raw: BinaryIO, path: Path) -> None:
    """Look whether a part that grows still has its name: what is written to it is lost without.

    Raises:
        RecordingFailed: It was removed, moved or replaced. A disk that does not say is no reason.
    """
    part, there = part_path(path), True
    with suppress(OSError):
        there = _is_at(raw.fileno(), part)
    if not there:
        raise _lost(part)


def remove_part(raw: BinaryIO, path: Path) -> None:
    """Remove a part that is still open, and so locked; another's in its place stays."""
    with suppress(OSError):
        if _is_at(raw.fileno(), part_path(path)):
            part_path(path).unlink(missing_ok=True)


def let_go(raw: BinaryIO) -> None:
    """Unlock a part and close it; also where a forked process still has its descriptor."""
    with suppress(OSError, ValueError):
        unlock_file(raw.fileno())
    with suppress(OSError):
        raw.close()


def hold_to_read(file: BinaryIO, path: Path) -> None:
    """Keep recorders from a file for as long as it is open.

    Raises:
        BadRecording: One is writing it.
    """
    if not lock_file(file.fileno(), shared=True):
        raise BadRecording(
            "a recording that is not being written",
            f"{path}, to which another taxel is recording", "wait until it has ended",
        )  # fmt: skip


def _held_by_another(part: Path) -> bool:
    """True where a recorder holds a part."""
    try:
        held = os.open(part, os.O_RDONLY | _LOOK)
    except OSError:  # it is not there, or no recorder's
        return False
    try:
        return not lock_file(held, shared=True)
    finally:
        os.close(held)


def _remove_stale(part: Path) -> None:
    """Remove a part, unless another process looks at it or has begun a new one in its place."""
    if part.is_symlink():
        part.unlink(missing_ok=True)
        return
    with suppress(FileNotFoundError):
        held = os.open(part, os.O_RDWR | _LOOK)
        try:
            # Under the lock: whoever else would remove it must have locked the same file.
            if lock_file(held) and _is_at(held, part):
                part.unlink()
        finally:
            os.close(held)


def _is_at(held: int, path: Path) -> bool:
    """True where an open file is the very file at `path`."""
    try:
        return os.path.samestat(os.fstat(held), path.lstat())
    except FileNotFoundError:
        return False


def _lost(part: Path) -> RecordingFailed:
    return RecordingFailed(
        f"needed {part}, in which this was recorded; it was removed or replaced meanwhile; "
        "record again, and let nothing else write there."
    )


def _busy(path: Path) -> BadInput:
    return BadInput(
        f"{path} for this recorder alone", "another taxel that is recording to it",
        "wait until it has ended, or choose another name",
    )  # fmt: skip
