"""Open and run a bundle's models in a process of their own first, within a time and a memory.

A model of known operators can still ask for any amount of work: two small numbers span a huge
table, and ONNX Runtime calculates what is constant while it opens a model, where nothing can
stop it. So a child (`trial_child.py`) opens and runs it first; the child is ended by the system
when its processor time or memory is spent. Knows nothing about contracts.
"""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from numpy.typing import NDArray

from taxel.bundles.envelope import to_npy
from taxel.errors import BadBundle, RecordingFailed
from taxel.foreign.files import MIB

_CHILD = Path(__file__).with_name("trial_child.py")
CPU_S = 1.0
"""Processor time of a trial beside what a model's size adds; a small model takes 0.01 s. Source:
our choice, docs/decisions/0033."""
_CPU_S_A_BYTE = 1 / (10 * MIB)
"""A forest of 14 MB opens in 0.3 s here, a ResNet of 100 MB in 0.4 s; eight times that on a slow
board."""
_MEMORY = 128 * MIB
"""Bytes beside what the model and its windows add. Source: as above."""
_TIMES_MODEL, _TIMES_WINDOWS = 6, 16
"""ONNX Runtime holds a model parsed, as tensors and as packed ones; a layer widens a window."""
_WALL_S = 60.0
"""A trial that sleeps is ended, too."""
_tried: set[str] = set()
"""Digests of trials that ended well in this process."""


@dataclass(frozen=True, slots=True)
class Trial:
    """A model, and the inputs it is run on in the child process."""

    model: bytes
    """ONNX."""
    windows: Mapping[str, NDArray[Any]]
    """Input's name → array; the child leaves out those that the model does not take."""


def try_models(trials: Sequence[Trial]) -> None:
    """Run models as they will be run, in a process that may take only so much.

    Raises:
        BadBundle: One is refused by ONNX Runtime, or takes too long or too much memory.
    """
    parts, heads = [], []
    for trial in trials:
        arrays = {name: to_npy(array) for name, array in trial.windows.items()}
        heads.append({"model": len(trial.model), "windows": {n: len(a) for n, a in arrays.items()}})
        parts += [trial.model, *arrays.values()]
    models = sum(len(trial.model) for trial in trials)
    windows = sum(map(len, parts)) - models
    order = {
        "trials": heads,
        "cpu_s": CPU_S + models * _CPU_S_A_BYTE,
        "memory": _MEMORY + _TIMES_MODEL * models + _TIMES_WINDOWS * windows,
    }
    content = [json.dumps(order).encode() + b"\n", *parts]
    digest = hashlib.sha256()
    for part in content:
        digest.update(part)
    if digest.hexdigest() not in _tried and sys.executable:
        _run(content)
        _tried.add(digest.hexdigest())


@contextmanager
def _order(content: Sequence[bytes]) -> Iterator[IO[bytes]]:
    """Give a file without a name that holds a content.

    Raises:
        RecordingFailed: The disk refused.
    """
    with ExitStack() as stack:
        try:
            order = stack.enter_context(tempfile.TemporaryFile())
            for part in content:
                order.write(part)
            order.seek(0)
        except OSError as error:
            raise RecordingFailed(
                f"needed room for a bundle's models in {tempfile.gettempdir()}; got "
                f"{error.strerror or error}; free space, or name another folder in TMPDIR."
            ) from error
        yield order


def _run(content: Sequence[bytes]) -> None:
    with _order(content) as order:
        # -P: the folder that the user stands in is nobody's package.
        child = subprocess.Popen(
            [sys.executable, "-P", str(_CHILD)],
            stdin=order, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        try:
            answer, _ = child.communicate(timeout=_WALL_S)
        except subprocess.TimeoutExpired:
            answer = b""
        finally:
            child.kill()
            child.wait()
    if answer == b"ok\n":
        return
    message = " ".join(answer.decode("utf-8", "replace").split())[:300]
    raise BadBundle(
        "a model that opens and runs within the time and memory of its size",
        f"one that ONNX Runtime refuses ({message})" if message else "one that takes more",
        "write the bundle again with this version of taxel",
    )
