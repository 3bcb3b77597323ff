"""What several rooms' tests share: a few short simulated pours, written once a session."""

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
