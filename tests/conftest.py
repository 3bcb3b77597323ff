"""What several rooms' tests share: how long to fuzz, and a few short simulated pours.

A fuzzer says `@settings(settings.get_profile("fuzz"))`, which is the profile `short` or `full`:
pytest --fuzz full, or TAXEL_FUZZ=full, as CI says it; `search` tries other examples each time.
"""

import os
import shutil
from pathlib import Path

import pytest
from hypothesis import settings

from taxel.sim.cup_pour import CupPourConfig, list_runs
from taxel.sources.pour_sets import CAMERA_HZ, write_run

FUZZ_PROFILES = {"short": 40, "full": 2000, "search": 2000}
"""Profile → examples of each fuzzer. `search` draws new ones each time, the others the same."""
_LONGEST_EXAMPLE_MS = 20_000
"""An example that takes longer is a flaw, on a busy machine too."""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--fuzz", choices=list(FUZZ_PROFILES), default=os.environ.get("TAXEL_FUZZ") or "short",
        help="how many examples fuzzers try: short, the default, full, or search for new ones",
    )  # fmt: skip


def pytest_configure(config: pytest.Config) -> None:
    # Tests run side by side themselves; those of workers say how many.
    os.environ.setdefault("TAXEL_WORKERS", "1")
    for name, examples in FUZZ_PROFILES.items():
        settings.register_profile(
            name, max_examples=examples, deadline=_LONGEST_EXAMPLE_MS, print_blob=True,
            derandomize=name != "search",
        )  # fmt: skip
    settings.register_profile("fuzz", parent=settings.get_profile(config.getoption("--fuzz")))


@pytest.fixture(scope="session")
def few_pours(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three cups, two pours each, 1.5 s long."""
    folder = tmp_path_factory.mktemp("pours")
    config = CupPourConfig(
        cups=3, positions=("middle",), forces_n=(15.0, 50.0), duration_s=1.5, still=0.0
    )
    for run in list_runs(config):
        write_run(folder, run, config, CAMERA_HZ)
    return folder


@pytest.fixture(scope="session")
def pour_made_once(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One pour, 2 s long: 120 frames of two cameras, with physics truth."""
    folder = tmp_path_factory.mktemp("pour")
    config = CupPourConfig(
        cups=1, positions=("upper",), forces_n=(15.0,), duration_s=2.0, still=0.0
    )
    (run,) = list_runs(config)
    write_run(folder, run, config, CAMERA_HZ)
    (path,) = folder.glob("*.mcap")
    return path


@pytest.fixture
def pour(pour_made_once: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy in a folder of its own; features are kept beside it, not in the user's cache."""
    monkeypatch.setenv("TAXEL_CACHE", str(tmp_path / "cache"))
    (tmp_path / "cups").mkdir()
    return Path(shutil.copy(pour_made_once, tmp_path / "cups" / "pour.mcap"))
