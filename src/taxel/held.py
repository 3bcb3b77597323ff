"""What a process holds on disk while it lives: scratch folders, and the right to write an output.

Both rest on `flock`, which the system lets go of when the process ends, however it ends. So a
folder whose owner was killed is known as such by the next that comes, and is removed then; a lock
is never left behind. Where a system or a network's disk has no `flock`, folders of the killed stay
and nothing is locked. Knows nothing about what is written.

Source: docs/decisions/0035.
"""

from __future__ import annotations

import errno
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from taxel.errors import BadInput, RecordingFailed, not_written

_PREFIX = ".taxel-"
_OWNER = ".owner"
"""A file in each scratch folder, locked by its owner for as long as it lives."""
_SIGN = b"taxel's scratch folder; its owner holds a lock on this file; for "
"""What that file begins with; the output's path follows."""
MADE = "made"
"""Where a whole output is made in a scratch folder, before it takes its name."""
REPLACED = "replaced"
"""Where an older output waits meanwhile."""
_NO_LINK = getattr(os, "O_NOFOLLOW", 0)
_NO_LOCKS = (errno.ENOSYS, errno.EOPNOTSUPP, errno.ENOLCK)
"""What a file system without `flock` answers, such as a Lustre that was mounted without it."""


@contextmanager
def scratch_folder(beside: Path, option: str = "--output") -> Iterator[Path]:
    """Give an empty folder on the same disk as an output, which goes when the block ends.

    First removes those that killed processes left there; nothing else is ever removed.

    Args:
        beside: The output; its parent is made where it is missing.
        option: By which another is chosen; empty names none.

    Raises:
        RecordingFailed: The disk refused.
    """
    try:
        beside.parent.mkdir(parents=True, exist_ok=True)
        sweep(beside.parent)
        prefix = f"{_PREFIX}{beside.name[:60]}-"
        folder = Path(tempfile.mkdtemp(prefix=prefix, dir=beside.parent))
    except OSError as error:
        raise _refused(beside, error, option) from error
    owner = None
    try:
        try:
            owner = _own(folder, beside)
        except OSError as error:
            raise _refused(beside, error, option) from error
        yield folder
    finally:
        with suppress(OSError):  # an error or Ctrl-C just as it took an older one's place
            _finish(folder)
            shutil.rmtree(folder, ignore_errors=True)
        if owner is not None:
            os.close(owner)


def sweep(parent: Path) -> list[Path]:
    """Remove scratch folders in `parent` whose owners were killed; return them.

    Where the owner was killed just as its output took the place of an older one, that is finished.
    """
    removed = []
    for folder in sorted(parent.glob(f"{_PREFIX}*")):
        with suppress(OSError):
            held = _abandoned(folder)
            if held is None:
                continue
            try:
                _finish(folder)
                shutil.rmtree(folder)
                removed.append(folder)
            finally:
                os.close(held)
    return removed


def output_of(path: Path) -> Path | None:
    """Return for which output a file is made, where it lies in a scratch folder."""
    for folder in path.absolute().parents:
        if folder.name.startswith(_PREFIX):
            with suppress(OSError):
                content = (folder / _OWNER).read_bytes()
                if content.startswith(_SIGN):
                    return Path(os.fsdecode(content[len(_SIGN) :]))
    return None


@contextmanager
def only_writer(output: Path, option: str = "--output") -> Iterator[None]:
    """Hold the right to write an output; a second process is refused in a plain line.

    Args:
        output: A file or folder to be written; the lock is a hidden file beside it.
        option: By which another is chosen.

    Raises:
        BadInput: Another process holds it.
        RecordingFailed: The disk refused.
    """
    path = output.with_name(f".{output.name}.lock")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        held = _take(path)
        if held is None:
            raise BadInput(
                f"{output} for this process alone",
                f"another that writes it, process {_pid_in(path)}",
                f"wait until it has ended, or choose another {option}",
            )
    except OSError as error:
        raise _refused(output, error, option) from error
    try:
        yield
    finally:
        with suppress(OSError):
            path.unlink()  # while it is held: who opened it meanwhile looks whether it is there
        os.close(held)


def lock_file(held: int, *, shared: bool = False, without: bool = True) -> bool:
    """Lock an open file for as long as it is open anywhere, unless another process has.

    Args:
        held: Its descriptor.
        shared: Others may lock it as well that share it.
        without: What to return where there are no such locks.
    """
    if sys.platform == "win32":
        return without
    import fcntl

    try:
        fcntl.flock(held, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError as error:
        if error.errno not in _NO_LOCKS:
            raise
        return without
    return True


def unlock_file(held: int) -> None:
    """Unlock a file, also where a forked process still has its descriptor."""
    if sys.platform != "win32":
        import fcntl

        fcntl.flock(held, fcntl.LOCK_UN)


def _own(folder: Path, output: Path) -> int:
    """Lock a folder's sign before it takes its name, so that nobody finds it without a lock."""
    new = folder / f"{_OWNER}.new"
    held = os.open(new, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600)
    try:
        os.write(held, _SIGN + os.fsencode(output))
        lock_file(held)
        os.rename(new, folder / _OWNER)
    except BaseException:
        os.close(held)
        raise
    return held


def _abandoned(folder: Path) -> int | None:
    """Return the locked descriptor of a folder whose owner is dead; None of any other."""
    if sys.platform == "win32" or folder.is_symlink() or not folder.is_dir():
        return None
    held = os.open(folder / _OWNER, os.O_RDWR | _NO_LINK)
    if os.read(held, len(_SIGN)) == _SIGN and lock_file(held, without=False):
        return held
    os.close(held)
    return None


def _finish(folder: Path) -> None:
    """Complete a replacement that was cut off: give the output's name to the new files.

    Where the new ones are gone, the replaced ones get their name back.
    """
    made = output_of(folder / MADE) if (folder / REPLACED).exists() else None
    if made is None:
        return
    output = folder.parent / made.name  # its path may be relative to another folder
    if output.exists():
        return
    newer = folder / MADE
    os.replace(newer if newer.exists() else folder / REPLACED, output)


def _take(path: Path) -> int | None:
    """Return a locked descriptor of the file at `path`, or None where another holds it."""
    while True:
        # Never through a link: what it leads to would be emptied, and may be anybody's.
        held = os.open(path, os.O_RDWR | os.O_CREAT | _NO_LINK, 0o600)
        try:
            if not lock_file(held):
                os.close(held)
                return None
            with suppress(FileNotFoundError):
                if os.path.samestat(os.fstat(held), path.lstat()):
                    os.ftruncate(held, 0)
                    os.write(held, f"{os.getpid()}\n".encode())
                    return held
        except BaseException:
            os.close(held)
            raise
        os.close(held)  # its holder removed it while it was being opened


def _pid_in(path: Path) -> str:
    with suppress(OSError, ValueError):
        return str(int(path.read_text("ascii", "replace")[:20]))
    return "unknown"


def _refused(output: Path, error: OSError, option: str = "--output") -> RecordingFailed:
    place = f"another place with {option}" if option else "another place"
    return not_written(output, error, f"make room or choose {place}")
