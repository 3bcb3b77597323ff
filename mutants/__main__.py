"""Try the mutants of some places, or of all: `python -m mutants [PLACE …]`.

A mutant that was tried is not tried again, unless it survived and its tests have changed since;
`rm -r build/mutants` begins anew. The driver's rules: docs/decisions/0049.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mutants.places import PLACES, ROOT, WORK, Place, key_of
from mutants.stored import store_mutants
from mutants.trial import Limits, Running, baseline, start, verdict

_TOOL = ROOT / ".venv-mutants" / "bin" / "python"
_SLACK_CPU, _SLACK_WALL = 4.0, 20.0
"""Times the tests' own time after which a mutant counts as endless: the machine may be busy."""


def main() -> None:
    """Draw, try and count."""
    parser = argparse.ArgumentParser(prog="python -m mutants", description=__doc__)
    parser.add_argument("places", nargs="*", choices=[*PLACES, []], help="default: all")
    parser.add_argument("--jobs", type=int, default=2, help="mutants at a time, default 2")
    parser.add_argument("--store", action="store_true", help="store the figures and the page")
    parser.add_argument(
        "--draw", action="store_true", help="draw anew; needed after a change of src"
    )
    options = parser.parse_args()
    for name in options.places or PLACES:
        _draw(name)
        _in_own_process(name, options.jobs)
    if options.store:
        store_mutants()


def _draw(name: str) -> None:
    subprocess.run([str(_TOOL), "-m", "mutants.draw", name], cwd=ROOT, check=True)


def _in_own_process(name: str, jobs: int) -> None:
    """Try a place's mutants in a child, so that no place inherits another's libraries."""
    child = os.fork()
    if child == 0:
        status = 1
        try:
            _try_place(name, PLACES[name], jobs)
            status = 0
        finally:
            os._exit(status)
    _, status = os.waitpid(child, 0)
    if status != 0:
        raise SystemExit(1)


def _try_place(name: str, place: Place, jobs: int) -> None:
    file = WORK / f"{name}.verdicts.json"
    known: dict[str, dict[str, Any]] = json.loads(file.read_text()) if file.exists() else {}
    drawn = json.loads((WORK / f"{name}.drawn.json").read_text())
    tests = tests_digest(place)
    waiting = [mutant for mutant in drawn if _open(known.get(key_of(mutant)), tests)]
    if waiting:
        cpu_s, wall_s = baseline(place.tests, WORK / f"{name}.libraries.json")
        limits = Limits(10 + _SLACK_CPU * cpu_s, 60 + _SLACK_WALL * wall_s)
        _check_driver(place, limits)
        for mutant, ended in _tried(waiting, place, limits, jobs):
            known[key_of(mutant)] = {"verdict": ended, "tests": tests}
            _write(file, known)
    _report(name, drawn, known)


def _tried(
    waiting: list[dict[str, Any]], place: Place, limits: Limits, jobs: int
) -> Iterator[tuple[dict[str, Any], str]]:
    """Yield each mutant with its verdict, as they end."""
    running: list[tuple[dict[str, Any], Running]] = []
    while waiting or running:
        while waiting and len(running) < jobs:
            mutant = waiting.pop()
            path = ROOT / mutant["file"]
            running.append((mutant, start(place.tests_for(path), path, mutant["source"], limits)))
        time.sleep(0.02)
        for mutant, child in list(running):
            ended = verdict(child, limits)
            if ended is not None:
                running.remove((mutant, child))
                yield mutant, ended


def _check_driver(place: Place, limits: Limits) -> None:
    """Try the true code as if it were a mutant: it must survive, or every verdict is worthless.

    Raises:
        SystemExit: It did not.
    """
    path = place.files()[0]
    true = {"file": str(path.relative_to(ROOT)), "source": path.read_text("utf-8")}
    for _, ended in _tried([true], place, limits, 1):
        if ended != "survived":
            raise SystemExit(f"the unchanged {true['file']} counts as {ended}: mend the driver")


def _report(name: str, drawn: list[dict[str, Any]], known: dict[str, dict[str, Any]]) -> None:
    left = [mutant for mutant in drawn if known[key_of(mutant)]["verdict"] == "survived"]
    score = 1 - len(left) / len(drawn)
    print(f"{name}: {len(drawn)} mutants, {len(left)} survived, score {score:.3f}", flush=True)
    for mutant in left:
        print(f"  {mutant['file']}:{mutant['line']}  {mutant['operator']}\n"
              f"    - {mutant['before']}\n    + {mutant['after']}", flush=True)  # fmt: skip


def _open(found: dict[str, Any] | None, tests: str) -> bool:
    """True for a mutant that must be tried: new, or a survivor of other tests."""
    return found is None or (found["verdict"] == "survived" and found["tests"] != tests)


def tests_digest(place: Place) -> str:
    """Return what changes with any of a place's test files."""
    total = hashlib.sha256()
    for file in place.test_files():
        total.update(file.read_bytes())
    return total.hexdigest()


def _write(file: Path, known: dict[str, dict[str, Any]]) -> None:
    part = file.with_suffix(".part")
    part.write_text(json.dumps(known))
    os.replace(part, file)


if __name__ == "__main__":
    sys.exit(main())
