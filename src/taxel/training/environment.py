"""What a result was made with: versions, processor, commit and the exact command.

Names neither the machine nor its user. Knows nothing about results.
"""

from __future__ import annotations

import os
import platform
import shlex
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from taxel import __version__
from taxel.jobs.call import code_digest as code_digest  # part of what a result was made with

_PACKAGES = ("numpy", "torch", "onnxruntime", "scikit-learn", "aeon")
_CPU_FILE = Path("/proc/cpuinfo")


@dataclass(frozen=True, slots=True, kw_only=True)
class Provenance:
    """Command line, time and software versions by which a result was made."""

    command: str = ""
    """The command line; empty where no command was given, as from a script."""
    created: str = ""
    """When, ISO 8601 with zone."""
    environment: Mapping[str, str] = field(default_factory=dict)
    """Name → version, processor, commit."""

    @staticmethod
    def now(argv: Sequence[str] | None = None) -> Provenance:
        """Return how this process makes what it makes.

        Args:
            argv: The words after `taxel`; those of this process unless given.
        """
        return Provenance(
            command=_command(sys.argv if argv is None else ["taxel", *argv]),
            created=datetime.now(UTC).isoformat(timespec="seconds"),
            environment=environment(),
        )


def environment() -> dict[str, str]:
    """Return versions, processor and, in a git tree, the commit of taxel."""
    found = {
        "taxel": __version__,
        "commit": _commit(),
        "Python": platform.python_version(),
        "system": f"{platform.system()} {platform.machine()}",
        "processor": _processor(),
        "cores": str(os.cpu_count() or 0),
        "threads of an engine": os.environ.get("OMP_NUM_THREADS", "as many as it likes"),
    }
    for name in _PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return {name: text for name, text in found.items() if text}


def _command(argv: Sequence[str]) -> str:
    """Return the words as they were typed after `taxel`; empty where this is no taxel command."""
    first = Path(argv[0]) if argv else Path()
    module = first.parts[-3:] == ("taxel", "cli", "main.py") or first.parts[-2:] == (
        "taxel", "__main__.py",  # python -m taxel
    )  # fmt: skip
    if first.name != "taxel" and not module:
        return ""
    return shlex.join(["taxel", *argv[1:]])


def _processor() -> str:
    try:
        lines = _CPU_FILE.read_text().splitlines()
    except OSError:
        return platform.processor()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor()


def _commit() -> str:
    """Return the commit of the tree that taxel runs from, with + where it was changed since."""
    try:
        done = subprocess.run(
            ["git", "describe", "--always", "--dirty=+", "--exclude=*"],
            capture_output=True,
            text=True,
            check=False,
            timeout=10,
            cwd=Path(__file__).parent,
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.strip()
