"""A small recogniser of the simulated hand, and recordings that it has not seen."""

from dataclasses import replace
from pathlib import Path

import pytest

from taxel.evaluation.robustness.touches import Model, Recorded, read_touches, train_model
from taxel.sources.simulated.data_sets import write_sessions
from taxel.sources.simulated.teng_options import checked_config
from taxel.training.recipes import find_recipe


def write_set(folder: Path, seed: int, scans: int, sessions: int = 3) -> Path:
    config = checked_config(seed=seed, scans_per_class=scans, sessions=sessions, rate_hz=100.0)
    write_sessions(folder, config, lambda _: None)
    return folder


@pytest.fixture(scope="session")
def seen(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three sessions to learn from."""
    return write_set(tmp_path_factory.mktemp("seen") / "seen", 0, 14_000)


@pytest.fixture(scope="session")
def unseen(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three sessions of another seed, long enough for three reference touches each."""
    return write_set(tmp_path_factory.mktemp("unseen") / "unseen", 5, 14_000)


@pytest.fixture(scope="session")
def model(seen: Path) -> Model:
    """Trees with reference touches: as good as a network on so few windows, and at once."""
    return train_model(seen, replace(find_recipe("teng-referenced"), model="extra-trees"))


@pytest.fixture(scope="session")
def touches(unseen: Path) -> list[Recorded]:
    return read_touches(unseen)[0]
