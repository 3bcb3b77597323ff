"""One job as it travels: a function of a module, its arguments, and its result.

Arguments are paths and configurations, never arrays or open things: a job is small, and can be
given to another worker when its own was killed. Knows nothing about engines.

Source: docs/decisions/0050.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import socket
import traceback
from collections.abc import Callable
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from time import perf_counter
from typing import Any

import taxel
from taxel.errors import BadInput

_INSIDE: ContextVar[bool] = ContextVar("taxel_inside_a_job", default=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class Call:
    """A job to be done."""

    work: Callable[..., Any]
    """A function of a module, so that a worker can import it."""
    args: tuple[Any, ...]
    name: str
    """How logs call it."""
    code: str = ""
    """Digest of taxel's code that the worker must have too; empty asks for none."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JobResult:
    """A finished job: its result or error, and where it ran."""

    result: Any
    error: BaseException | None
    """What it raised, to be raised again where the result is taken."""
    trace: str
    """Where it was raised."""
    host: str
    process: int
    seconds: float
    attempt: int = 1
    """1, or more where a worker was killed with it."""

    def value(self) -> Any:
        """Return the result, or raise what the job raised."""
        if self.error is not None:
            self.error.add_note(f"on {self.host}, process {self.process}:\n{self.trace}")
            raise self.error
        return self.result


def perform(call: Call) -> JobResult:
    """Do a job in this process; what it raises comes back as a value."""
    started, error, result, trace = perf_counter(), None, None, ""
    token = _INSIDE.set(True)
    try:
        _check_code(call.code)
        result = call.work(*call.args)
    except Exception as raised:
        error, trace = _portable(raised), "".join(traceback.format_exception(raised))
    finally:
        _INSIDE.reset(token)
    return JobResult(
        result=result,
        error=error,
        trace=trace,
        host=socket.gethostname(),
        process=os.getpid(),
        seconds=perf_counter() - started,
    )


def inside_a_job() -> bool:
    """Return whether this is called by a job: it does not share its work out again."""
    return _INSIDE.get()


@cache
def code_digest() -> str:
    """Return the SHA-256 over taxel's own modules: a commit does not say what was changed since."""
    root = Path(taxel.__file__).parent
    digest = hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        digest.update(path.relative_to(root).as_posix().encode() + b"\0")
        digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


def last_line(error: BaseException) -> str:
    """Return what an error of an engine's says last: before it stand traces of other processes."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return lines[-1] if lines else type(error).__name__


def _check_code(wanted: str) -> None:
    if wanted and wanted != code_digest():
        raise BadInput(
            "the same taxel on every worker",
            f"another version of its code on {socket.gethostname()}",
            "install the same commit there",
        )


def _portable(error: Exception) -> Exception:
    """Return an error that can be sent to another process."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error
