"""What several rooms' tests share: a few short simulated pours, written once a session."""

import shutil
from pathlib import Path

import pytest

from taxel.sim.cup_pour import CupPourConfig, list_runs
from taxel.sources.pour_sets import CAMERA_HZ, write_run


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
