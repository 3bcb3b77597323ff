"""One mutant against its tests, in a forked process that has the libraries loaded already.

The parent never imports taxel; the child imports it with one module replaced. Programs that a test
starts run the true code: what only they would notice counts as survived.
"""

from __future__ import annotations

import contextlib
import importlib
import importlib.abc
import importlib.machinery
import json
import os
import resource
import signal
import sys
import time
import traceback
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import CodeType

import pytest

from mutants.places import ROOT

_OPTIONS = ("-x", "-q", "--no-header", "-p", "no:cacheprovider", "-p", "no:xdist", "--assert=plain",
            "--hypothesis-seed=0")  # fmt: skip
_OUT_OF_TIME = (signal.SIGXCPU, signal.SIGKILL)
_BROKEN = 99
"""Exit status of a child that could not run pytest at all."""
_MEMORY = 12 * 1024**3
"""Bytes of address space: a mutant may ask for anything."""


@dataclass(frozen=True, slots=True)
class Limits:
    """After what a mutant counts as killed because it does not end."""

    cpu_s: float
    wall_s: float


@dataclass(slots=True)
class Running:
    """A child at work."""

    pid: int
    started_s: float


class _Loader(importlib.machinery.SourceFileLoader):
    def __init__(self, name: str, path: str, source: str) -> None:
        super().__init__(name, path)
        self._source = source

    def get_code(self, fullname: str) -> CodeType:
        return compile(self._source, self.path, "exec", dont_inherit=True)


class _Finder(importlib.abc.MetaPathFinder):
    """Gives the mutated source for one module and leaves all others alone."""

    def __init__(self, module: str, path: Path, source: str) -> None:
        self._module, self._path, self._source = module, path, source

    def find_spec(self, fullname: str, path: object = None, target: object = None):  # type: ignore[no-untyped-def]
        if fullname != self._module:
            return None
        loader = _Loader(fullname, str(self._path), self._source)
        return importlib.machinery.ModuleSpec(fullname, loader, origin=str(self._path))


def baseline(tests: Sequence[str], notes: Path) -> tuple[float, float]:
    """Run the tests on the true code; load the libraries that they took into this process.

    Args:
        tests: Their files.
        notes: Where the child writes the names of what it imported.

    Returns:
        Its processor and wall time, seconds.

    Raises:
        SystemExit: The tests fail without any mutant.
    """
    began_s = time.monotonic()
    child = os.fork()
    if child == 0:
        _run(tests, None, None, notes)
    _, status, used = os.wait4(child, 0)
    if status != 0:
        raise SystemExit(f"the tests {' '.join(tests)} fail on the code as it is")
    for name in json.loads(notes.read_text()):
        with contextlib.suppress(Exception), warnings.catch_warnings(action="ignore"):
            importlib.import_module(name)  # only for speed: a child imports what is missing
    return used.ru_utime + used.ru_stime, time.monotonic() - began_s


def start(tests: Sequence[str], path: Path, source: str, limits: Limits) -> Running:
    """Fork a child that runs the tests on one mutant."""
    child = os.fork()
    if child == 0:
        os.setsid()
        seconds = int(limits.cpu_s) + 1
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 5))
        resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
        _run(tests, _Finder(_module(path), path, source), limits, None)
    return Running(child, time.monotonic())


def verdict(running: Running, limits: Limits) -> str | None:
    """Return "killed", "survived" or "endless"; None while the child is at work."""
    pid, status = os.waitpid(running.pid, os.WNOHANG)
    if pid == 0 and time.monotonic() - running.started_s < limits.wall_s:
        return None
    if pid == 0 or (os.WIFSIGNALED(status) and os.WTERMSIG(status) in _OUT_OF_TIME):
        _end(running.pid, waited=pid != 0)
        return "endless"
    if os.WIFEXITED(status) and os.WEXITSTATUS(status) == _BROKEN:
        raise SystemExit("a mutant could not be tried; run one place alone and read the message")
    return "survived" if status == 0 else "killed"


def _module(path: Path) -> str:
    return ".".join(path.relative_to(ROOT / "src").with_suffix("").parts)


def _end(pid: int, *, waited: bool) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.killpg(pid, signal.SIGKILL)
    if not waited:
        os.waitpid(pid, 0)


def _run(
    tests: Sequence[str], finder: _Finder | None, limits: Limits | None, notes: Path | None
) -> None:
    """Run the tests and end this process with pytest's exit status."""
    code = _BROKEN
    try:
        nothing = os.open(os.devnull, os.O_WRONLY)
        if limits is not None:
            os.dup2(nothing, 1)
            sys.stderr = os.fdopen(os.dup(2), "w")
            os.dup2(nothing, 2)
        if finder is not None:
            sys.meta_path.insert(0, finder)
        code = int(pytest.main([*_OPTIONS, *tests]))
        if notes is not None:
            notes.write_text(json.dumps(_libraries()))
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(code)


def _libraries() -> list[str]:
    """Return the loaded modules that belong neither to taxel nor to its tests."""

    def foreign(name: str) -> bool:
        file = getattr(sys.modules[name], "__file__", None) or ""
        return "site-packages" in file and "taxel" not in name

    return [name for name in sorted(sys.modules) if foreign(name)]
