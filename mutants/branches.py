"""Branch coverage of what must not fail: `python -m mutants.branches [PART …]`, or `make coverage`.

Runs the tests that guard some files, subprocesses measured too, and prints the share of branches
taken. Of parts that are named, only their own tests run. `--store` writes the figures to
`mutants/stored.json` and the page; other parts' figures stay. Ends with exit code 1 where a part
lies below the goal.
"""

from __future__ import annotations

import argparse
import json
import os
import shlex
import subprocess
import sys
from collections.abc import Sequence

from mutants.places import PLACES, ROOT
from mutants.stored import store_branches

GOAL = 0.9
"""Share of branches that tests must take."""
CAMERA_PATH = (
    "src/taxel/labels/slip.py", "src/taxel/training/frames/features.py",
    "src/taxel/training/frames/heads.py", "src/taxel/training/frames/extractors.py",
    "src/taxel/windows/pairs.py", "src/taxel/windows/rest.py",
    "src/taxel/windows/sequence.py", "src/taxel/evaluation/transitions/data.py",
    "src/taxel/evaluation/transitions/tables.py", "src/taxel/cli/training/train_monitor.py",
    "src/taxel/evaluation/early_warning/grasp_warnings.py",
    "src/taxel/evaluation/early_warning/learn_monitor.py",
    "src/taxel/cli/live/grasps.py", "src/taxel/bundles/grasp.py", "src/taxel/live/camera_health.py",
    "src/taxel/live/grasp_monitor.py", "src/taxel/live/grasp_session.py",
)  # fmt: skip
"""From a frame's label to an alarm."""
PARTS = {name: (place.sources,) for name, place in PLACES.items()} | {
    "camera path": CAMERA_PATH, "station": ("src/taxel/live/station/*.py",),
}  # fmt: skip
"""Part → globs of its files, from the repository's root."""
TESTS = {name: place.tests for name, place in PLACES.items()} | {
    "camera path": (
        "tests/cli/test_camera_path.py", "tests/evaluation/early_warning", "tests/live",
        "tests/evaluation/transitions", "tests/training/test_features_and_heads.py",
        "tests/windows",
    ),
    "station": ("tests/live/station", "tests/cli/test_live_station.py"),
}  # fmt: skip
"""Part → the tests that guard it, files or folders."""
_DATA = ROOT / "build" / "coverage"


def main() -> None:
    """Run the tests, then print and perhaps store each part's share."""
    parser = argparse.ArgumentParser(prog="python -m mutants.branches", description=__doc__)
    parser.add_argument("--store", action="store_true", help="store the figures and the page")
    parser.add_argument("--measured", action="store_true", help="do not run the tests again")
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"of {', '.join(PARTS)}; all")
    options = parser.parse_args()
    parts = options.parts or [*PARTS]
    if unknown := sorted(set(parts) - PARTS.keys()):
        parser.error(f"needed parts of {', '.join(PARTS)}; got {', '.join(unknown)}")
    if not options.measured:
        _run_tests(parts)
    found = {name: _share(PARTS[name]) for name in parts}
    for name, (taken, of) in found.items():
        print(f"{name:<12} {taken / of:6.1%}  {taken} of {of} branches")
    if options.store:
        store_branches(found, command_of(options.parts))
    if any(taken < GOAL * of for taken, of in found.values()):
        raise SystemExit(f"needed {GOAL:.0%} of each part's branches")


def command_of(parts: list[str]) -> str:
    """Return what measures and stores these parts; all where none is named."""
    if not parts:
        return "make coverage"
    return shlex.join(["python", "-m", "mutants.branches", *parts, "--store"])


def guards_of(parts: Sequence[str]) -> list[str]:
    """Return the tests that guard some parts, none in another's folder: each runs once."""
    every = dict.fromkeys(test for name in parts for test in TESTS[name])
    return [test for test in every if not any(test.startswith(f"{other}/") for other in every)]


def _run_tests(parts: Sequence[str]) -> None:
    _DATA.mkdir(parents=True, exist_ok=True)
    for old in _DATA.glob("data*"):
        old.unlink()
    subprocess.run(
        [sys.executable, "-m", "coverage", "run", "-m", "pytest", "-q", "-n0", *guards_of(parts)],
        cwd=ROOT, check=True, env=os.environ | {"COVERAGE_CORE": "ctrace"},
    )  # fmt: skip
    subprocess.run([sys.executable, "-m", "coverage", "combine", "-q"], cwd=ROOT, check=True)


def _share(globs: tuple[str, ...]) -> tuple[int, int]:
    """Return how many branches of some files were taken, and of how many."""
    report = _DATA / "report.json"
    subprocess.run(
        [sys.executable, "-m", "coverage", "json", "-q", "-o", str(report), "--include",
         ",".join(globs)], cwd=ROOT, check=True,
    )  # fmt: skip
    totals = json.loads(report.read_text())["totals"]
    return totals["covered_branches"], totals["num_branches"]


if __name__ == "__main__":
    main()
