"""Branch coverage of what must not fail: `python -m mutants.branches`, or `make coverage`.

Runs the tests that guard some files, subprocesses measured too, and prints the share of branches
taken. `--store` writes the figures to `mutants/stored.json` and the page. Ends with exit code 1
where a part lies below the goal.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys

from mutants.places import PLACES, ROOT
from mutants.stored import store_branches

GOAL = 0.9
"""Share of branches that tests must take."""
CAMERA_PATH = (
    "src/taxel/labels/slip.py", "src/taxel/training/features.py", "src/taxel/training/heads.py",
    "src/taxel/training/extractors.py", "src/taxel/windows/pairs.py", "src/taxel/windows/rest.py",
    "src/taxel/windows/sequence.py", "src/taxel/evaluation/transitions/data.py",
    "src/taxel/evaluation/transitions/tables.py", "src/taxel/cli/train_monitor.py",
    "src/taxel/evaluation/early_warning/grasp_warnings.py",
    "src/taxel/evaluation/early_warning/learn_monitor.py",
    "src/taxel/cli/live_grasps.py", "src/taxel/bundles/grasp.py", "src/taxel/live/camera_health.py",
    "src/taxel/live/grasp_monitor.py", "src/taxel/live/grasp_session.py",
)  # fmt: skip
"""From a frame's label to an alarm."""
PARTS = {name: (place.sources,) for name, place in PLACES.items()} | {
    "camera path": CAMERA_PATH, "station": ("src/taxel/live/station/*.py",),
}  # fmt: skip
"""Part → globs of its files, from the repository's root."""
TESTS = (
    "tests/cli/test_camera_path.py", "tests/evaluation/early_warning", "tests/live",
    "tests/cli/test_live_station.py",
    "tests/evaluation/transitions", "tests/training/test_features_and_heads.py",
)  # fmt: skip
"""What guards the camera's path and the station, beside the places' own tests."""
_DATA = ROOT / "build" / "coverage"


def main() -> None:
    """Run the tests, then print and perhaps store each part's share."""
    parser = argparse.ArgumentParser(prog="python -m mutants.branches", description=__doc__)
    parser.add_argument("--store", action="store_true", help="store the figures and the page")
    parser.add_argument("--measured", action="store_true", help="do not run the tests again")
    options = parser.parse_args()
    if not options.measured:
        _run_tests()
    found = {name: _share(globs) for name, globs in PARTS.items()}
    for name, (taken, of) in found.items():
        print(f"{name:<12} {taken / of:6.1%}  {taken} of {of} branches")
    if options.store:
        store_branches(found)
    if any(taken < GOAL * of for taken, of in found.values()):
        raise SystemExit(f"needed {GOAL:.0%} of each part's branches")


def _run_tests() -> None:
    _DATA.mkdir(parents=True, exist_ok=True)
    for old in _DATA.glob("data*"):
        old.unlink()
    tests = dict.fromkeys([test for place in PLACES.values() for test in place.tests] + [*TESTS])
    subprocess.run(
        [sys.executable, "-m", "coverage", "run", "-m", "pytest", "-q", "-n0", *tests],
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
