"""Run command lines of taxel in processes of their own: what they print, their memory and time.

Memory is what Linux says of a process; elsewhere it is not a number. Knows nothing about what is
run, or what it should do.

Background of our choices: docs/decisions/0019.
"""

from __future__ import annotations

import io
import json
import math
import os
import signal
import subprocess
import sys
import time
import traceback
from collections.abc import Callable, Sequence
from contextlib import redirect_stderr, redirect_stdout, suppress
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any

DEADLINE_S = 60.0
"""A hang is found by this. Our choice."""
_MAIN = "from taxel.cli.main import main"
_CLEAR, _STATUS = Path("/proc/self/clear_refs"), Path("/proc/self/status")
Main = Callable[[list[str]], object]


@dataclass(frozen=True, slots=True, kw_only=True)
class Ended:
    """How a command line ended."""

    code: int | None
    """Exit code; None where it had not ended by the deadline."""
    out: str
    err: str
    seconds: float
    memory_mb: float
    """Largest memory of the process and of those that it started; of a resident process what it
    took beside what it held before. Not a number where that is not known."""

    @property
    def refused(self) -> bool:
        """True for exit code 2 and one plain line, without a traceback."""
        lines = [line for line in self.err.splitlines() if line.strip()]
        if self.code != 2 or len(lines) != 1 or "Traceback" in self.out:
            return False
        return lines[0].startswith("taxel: needed ")


def run_alone(
    words: Sequence[str], where: Path, deadline_s: float = DEADLINE_S, main: str = _MAIN
) -> Ended:
    """Run a command line in a process of its own.

    Args:
        words: The command line, without "taxel".
        where: Its working folder.
        deadline_s: It is killed then, seconds.
        main: A line of Python that defines `main`, which takes the words.
    """
    read, write = os.pipe()
    program = f"{main}\nfrom taxel.bench.faults.watched_commands import once\nonce(main)"
    began_s = time.monotonic()
    try:
        process = subprocess.run(
            [sys.executable, "-c", program, str(write), *words], cwd=where, capture_output=True,
            text=True, timeout=deadline_s, check=False, stdin=subprocess.DEVNULL,
            pass_fds=(write,), errors="backslashreplace",
        )  # fmt: skip
        code, out, err = process.returncode, process.stdout, process.stderr
    except subprocess.TimeoutExpired:
        os.close(read)
        return Ended(code=None, out="", err="", seconds=deadline_s, memory_mb=math.nan)
    finally:
        os.close(write)
    seconds = time.monotonic() - began_s
    with os.fdopen(read) as pipe:
        memory = pipe.read()
    return Ended(code=code, out=out, err=err, seconds=seconds,
                 memory_mb=float(memory or "nan"))  # fmt: skip


class Resident:
    """A process that runs one command line after another, and keeps what it has loaded.

    For verbs that load PyTorch, which takes longer than most of them. A context manager.

    Args:
        where: Its working folder.
        deadline_s: A command line is stopped then, seconds.
        main: A line of Python that defines `main`, which takes the words.
    """

    def __init__(self, where: Path, deadline_s: float = DEADLINE_S, main: str = _MAIN) -> None:
        answers, write = os.pipe()
        program = f"{main}\nfrom taxel.bench.faults.watched_commands import serve\nserve(main)"
        self._process = subprocess.Popen(
            [sys.executable, "-c", program, str(write), str(deadline_s)], cwd=where,
            stdin=subprocess.PIPE, pass_fds=(write,), text=True,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        os.close(write)
        self._answers = os.fdopen(answers)

    def __enter__(self) -> Resident:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.wait()
        self._answers.close()
        if self._process.stdin is not None:
            with suppress(BrokenPipeError):  # what it never read
                self._process.stdin.close()

    def run(self, words: Sequence[str]) -> Ended:
        """Run a command line.

        Raises:
            ChildProcessError: The process has died of this one or an earlier one.
        """
        assert self._process.stdin is not None
        with suppress(BrokenPipeError):  # it is dead; the answer that is missing says so
            self._process.stdin.write(json.dumps(list(words)) + "\n")
            self._process.stdin.flush()
        answer = self._answers.readline()
        if not answer:
            raise ChildProcessError(f"the process of verbs died at {list(words)!r}")
        return Ended(**json.loads(answer))


def peak_mb(name: str = "VmHWM") -> float:
    """Return the largest memory of this process, MB; VmRSS is the memory now."""
    if not _STATUS.exists():
        return math.nan
    lines = _STATUS.read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith(f"{name}:")) / 1024


def forget_peak() -> float:
    """Let the largest memory of this process be that of now; return it, MB."""
    if _CLEAR.exists():
        _CLEAR.write_text("5")
    return peak_mb("VmRSS")


def once(main: Main) -> None:
    """Run the command line of this process; write its largest memory to the given pipe."""
    import resource

    descriptor, *words = sys.argv[1:]
    try:
        main(words)
    finally:
        # Not ru_maxrss of the process itself: a child begins with that of its parent.
        others = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
        os.write(int(descriptor), f"{max(peak_mb(), others):.1f}".encode())


def serve(main: Main) -> None:
    """Run each command line that comes; write how it ended to the given pipe."""
    descriptor, deadline_s = int(sys.argv[1]), float(sys.argv[2])
    signal.signal(signal.SIGALRM, _break_off)
    for line in sys.stdin:
        answer = json.dumps(_ended(main, json.loads(line), deadline_s)) + "\n"
        os.write(descriptor, answer.encode())


def _ended(main: Main, words: list[str], deadline_s: float) -> dict[str, Any]:
    out, err = io.StringIO(), io.StringIO()
    held_mb, began_s = forget_peak(), time.monotonic()
    signal.setitimer(signal.ITIMER_REAL, deadline_s)
    ended: int | None
    with redirect_stdout(out), redirect_stderr(err):
        try:
            main(words)
            ended = 0
        except SystemExit as exit_:
            ended = exit_.code if isinstance(exit_.code, int) else int(exit_.code is not None)
        except _BrokenOff:
            ended = None
        except Exception:
            traceback.print_exc()
            ended = 1
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
    return {"code": ended, "out": out.getvalue(), "err": err.getvalue(),
            "seconds": time.monotonic() - began_s, "memory_mb": peak_mb() - held_mb}  # fmt: skip


class _BrokenOff(BaseException):
    """The deadline has come; no verb catches this."""


def _break_off(_: int, __: FrameType | None) -> None:
    raise _BrokenOff
