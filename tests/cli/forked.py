"""Command lines of taxel, each in a process of its own that begins with others' libraries loaded.

`Forked` starts one process, which imports what it is asked to and does nothing else; for each
command line that comes it forks. So each runs in a real process, with memory, files and signals of
its own, can be killed, and imports taxel itself anew: only the seconds of PyTorch's import and the
like are gone.
"""

from __future__ import annotations

import json
import math
import os
import select
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

if TYPE_CHECKING:
    from taxel.bench.faults.watched_commands import Ended

WITHOUT_TORCH = (
    "numpy", "scipy.signal", "onnxruntime", "mcap.reader", "mcap.writer", "lz4.frame",
    "rich.console", "rich.progress", "rich.table", "tyro",
)  # fmt: skip
"""What verbs that do without PyTorch import of others."""
LIBRARIES = (
    *WITHOUT_TORCH, "torch", "torch._dynamo", "torch.onnx", "sklearn.ensemble", "scipy.stats",
    "sklearn.linear_model", "sklearn.metrics", "sklearn.preprocessing", "onnx", "safetensors.torch",
    "optuna",
)  # fmt: skip
"""What verbs that train import of others, which takes seconds."""
LONGEST_S = 600.0
"""After which a command line is broken off, seconds."""


class Forked:
    """Gives a process for each command line. A context manager.

    Args:
        libraries: Modules to import first; one that is not installed is left out.
        environment: Variables beside this process's own.
    """

    def __init__(
        self, libraries: Sequence[str] = LIBRARIES, environment: Mapping[str, str] | None = None
    ) -> None:
        path = os.pathsep.join(filter(None, [str(Path(__file__).parent), *sys.path]))
        self._process = subprocess.Popen(
            [sys.executable, "-c", "import forked; forked.serve()", *libraries],
            env={**os.environ, "PYTHONPATH": path, **(environment or {})},
            stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        )  # fmt: skip
        self._heard = b""
        self._ended: dict[int, dict[str, int]] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        self._process.wait(60)
        self._process.stdout.close()

    def start(
        self, words: Sequence[str], where: Path, out: Path, err: Path, script: Path | None = None,
        variables: Mapping[str, str] | None = None,
    ) -> Started:  # fmt: skip
        """Start a command line.

        Args:
            words: Without "taxel".
            where: Its working folder.
            out: File for what it prints.
            err: File for what it complains of.
            script: A program of Python to run instead of taxel.
            variables: Of its environment, beside those it has; not for what libraries read when
                they are imported.
        """
        assert self._process.stdin is not None
        order = {"words": list(words), "where": str(where), "out": str(out), "err": str(err),
                 "script": str(script or ""), "variables": dict(variables or {})}  # fmt: skip
        self._process.stdin.write(json.dumps(order).encode() + b"\n")
        self._process.stdin.flush()
        until_s = time.monotonic() + LONGEST_S
        while True:
            note = self._next(until_s - time.monotonic())
            assert note is not None, "no process was begun"
            if "begun" in note:
                return Started(self, note["begun"])

    def run(
        self, words: Sequence[str], where: Path, longest_s: float = LONGEST_S,
        script: Path | None = None, variables: Mapping[str, str] | None = None,
    ) -> Ended:  # fmt: skip
        """Run a command line to its end; it is killed after a time, and has no exit code then."""
        from taxel.bench.faults.watched_commands import Ended

        with tempfile.TemporaryDirectory() as scratch:
            out, err = Path(scratch, "out"), Path(scratch, "err")
            began_s = time.monotonic()
            started = self.start(words, where, out, err, script, variables)
            found = self.ended(started.pid, longest_s)
            if found is None:
                started.kill()
                return Ended(code=None, out="", err="", seconds=longest_s, memory_mb=math.nan)
            return Ended(
                code=found["code"], seconds=time.monotonic() - began_s,
                out=out.read_text("utf-8", "backslashreplace"),
                err=err.read_text("utf-8", "backslashreplace"), memory_mb=found["kb"] / 1024,
            )  # fmt: skip

    def ended(self, pid: int, longest_s: float) -> dict[str, int] | None:
        """Return a process's exit code and largest memory; None where it lives after a time."""
        until_s = time.monotonic() + longest_s
        while pid not in self._ended:
            if self._next(max(0.0, until_s - time.monotonic())) is None:
                return None
        return self._ended[pid]

    def _next(self, longest_s: float) -> dict[str, int] | None:
        """Return what the process says next; None where it says nothing for so long."""
        assert self._process.stdout is not None
        until_s = time.monotonic() + longest_s
        while b"\n" not in self._heard:
            left_s = max(0.0, until_s - time.monotonic())
            if not select.select([self._process.stdout], [], [], left_s)[0]:
                return None
            more = os.read(self._process.stdout.fileno(), 4096)
            assert more, "the process that forks is gone"
            self._heard += more
        line, _, self._heard = self._heard.partition(b"\n")
        note: dict[str, int] = json.loads(line)
        if "ended" in note:
            self._ended[note["ended"]] = note
        return note


@dataclass(frozen=True)
class Started:
    """A command line at work, as `subprocess.Popen` would show it; leads a session of its own."""

    forked: Forked
    pid: int

    def poll(self) -> int | None:
        found = self.forked.ended(self.pid, 0.0)
        return None if found is None else found["code"]

    def wait(self, longest_s: float) -> int:
        found = self.forked.ended(self.pid, longest_s)
        if found is None:
            raise subprocess.TimeoutExpired("taxel", longest_s)
        return found["code"]

    def kill(self) -> None:
        os.kill(self.pid, signal.SIGKILL)


def serve() -> None:
    """Fork for each order on the standard input; say on the output what was begun and has ended."""
    import importlib

    for name in sys.argv[1:]:
        try:
            importlib.import_module(name)
        except ImportError:
            continue
    woken, wake = os.pipe()
    os.set_blocking(wake, False)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    signal.set_wakeup_fd(wake)
    orders = b""
    while True:
        ready = select.select([0, woken], [], [])[0]
        if woken in ready:
            os.read(woken, 4096)
            _say_what_ended()
        if 0 in ready:
            more = os.read(0, 65536)
            if not more:
                return
            orders += more
            while b"\n" in orders:
                line, _, orders = orders.partition(b"\n")
                pid = os.fork()
                if pid == 0:
                    _perform(json.loads(line), (woken, wake))
                _say({"begun": pid})


def _say(note: dict[str, int]) -> None:
    os.write(1, json.dumps(note).encode() + b"\n")


def _say_what_ended() -> None:
    while True:
        try:
            pid, status, used = os.wait4(-1, os.WNOHANG)
        except ChildProcessError:
            return
        if pid == 0:
            return
        # Not more than the process's own: it has not begun another program, whose child would
        # begin with its parent's largest memory.
        code = os.waitstatus_to_exitcode(status)
        _say({"ended": pid, "code": code, "kb": used.ru_maxrss})


def _perform(order: dict[str, Any], pipes: tuple[int, int]) -> None:
    """Be the process of a command line, or of a script."""
    import atexit
    import runpy
    import threading

    signal.set_wakeup_fd(-1)
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    os.setsid()
    for pipe in pipes:
        os.close(pipe)
    flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC
    for number, name, how in ((0, os.devnull, os.O_RDONLY), (1, order["out"], flags),
                              (2, order["err"], flags)):  # fmt: skip
        opened = os.open(name, how, 0o600)
        os.dup2(opened, number)
        os.close(opened)
    os.chdir(order["where"])
    os.environ.update(order["variables"])
    sys.argv = [order["script"] or "taxel", *order["words"]]
    code = 1
    try:
        if order["script"]:
            runpy.run_path(order["script"], run_name="__main__")
        else:
            from taxel.cli.main import main

            main()
        code = 0
    except SystemExit as ended:
        code = ended.code if isinstance(ended.code, int) else int(ended.code is not None)
    except BaseException:
        sys.excepthook(*sys.exc_info())
    finally:
        threading._shutdown()  # type: ignore[attr-defined]
        atexit._run_exitfuncs()
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
