"""What several rooms' tests share: their order, how long to fuzz, warm processes, simulated pours.

A fuzzer says `@settings(settings.get_profile("fuzz"))`, which is the profile `short` or `full`:
pytest --fuzz full, or TAXEL_FUZZ=full, as CI says it; `search` tries other examples each time.
Any other test with examples draws the same 100 each time, however busy the machine is.
"""

import fcntl
import os
import shutil
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import pytest
from forked import Forked
from hypothesis import settings
from tyro import _docstrings
from website.output_blocks import WIDTH

from taxel.sim.pour.cup_pour import CupPourConfig, list_runs
from taxel.sources.simulated.pour_sets import CAMERA_HZ, write_run

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
    _read_verbs_once()
    for name, examples in FUZZ_PROFILES.items():
        settings.register_profile(
            name, max_examples=examples, deadline=_LONGEST_EXAMPLE_MS, print_blob=True,
            derandomize=name != "search",
        )  # fmt: skip
    settings.register_profile("fuzz", parent=settings.get_profile(config.getoption("--fuzz")))
    settings.register_profile("usual", deadline=_LONGEST_EXAMPLE_MS, derandomize=True)
    settings.load_profile("usual")


def _read_verbs_once() -> None:
    """Let tyro keep what it reads of a verb's source: it reads it anew for each command line, and
    tests parse thousands of them in one process.
    """
    kind = getattr(_docstrings, "_ClassTokenization", None)
    if kind is not None:
        kind.make = staticmethod(cache(kind.make))


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Long tests first, those of the pages' commands before all: the processes then end together.

    One that is begun last would keep one of them busy while the others have nothing left to do.
    """
    items.sort(key=lambda item: item.get_closest_marker("slow") is None)
    items.sort(key=lambda item: item.get_closest_marker("longest") is None)


@pytest.fixture(scope="session")
def forked() -> Iterator[Forked]:
    """Processes that begin with PyTorch and the like loaded, on one thread each."""
    with Forked(environment={"OMP_NUM_THREADS": "1", "OMP_WAIT_POLICY": "PASSIVE"}) as found:
        yield found


def made_once(factory: pytest.TempPathFactory, name: str, make: Callable[[Path], None]) -> Path:
    """Return a folder that whoever asks first fills, though pytest runs in several processes.

    Args:
        factory: Of this process.
        name: What the folder is called.
        make: Fills it. Nobody may write to it later.
    """
    base = factory.getbasetemp()
    base = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    folder, half = base / f"once-{name}", base / f"half-{name}"
    with (base / f"{name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not folder.exists():
            half.mkdir()
            make(half)
            half.rename(folder)
    return folder


DEMO = ("demo", "--seconds", "0")
"""The command whose output the README shows."""


@pytest.fixture(scope="session")
def demo_made_once(tmp_path_factory: pytest.TempPathFactory, forked: Forked) -> Path:
    """A folder in which the README's demo has run; what it printed stands in `printed.txt`."""

    def make(folder: Path) -> None:
        own = {"COLUMNS": str(WIDTH), "XDG_CACHE_HOME": str(folder / ".cache")}
        script = Path(__file__).parent / "cli" / "one_epoch_demo.py"
        done = forked.run(DEMO, folder, script=script, variables=own)
        assert done.code == 0, done.err
        (folder / "printed.txt").write_text(done.out, "utf-8")

    return made_once(tmp_path_factory, "demo", make)


def write_pours(folder: Path, config: CupPourConfig) -> None:
    for run in list_runs(config):
        write_run(folder, run, config, CAMERA_HZ)


@pytest.fixture(scope="session")
def few_pours(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three cups, two pours each, 1.5 s long."""
    config = CupPourConfig(
        cups=3, positions=("middle",), forces_n=(15.0, 50.0), duration_s=1.5, still=0.0
    )
    return made_once(tmp_path_factory, "pours", lambda folder: write_pours(folder, config))


@pytest.fixture(scope="session")
def pour_made_once(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One pour, 2 s long: 120 frames of two cameras, with physics truth."""
    config = CupPourConfig(
        cups=1, positions=("upper",), forces_n=(15.0,), duration_s=2.0, still=0.0
    )
    folder = made_once(tmp_path_factory, "pour", lambda folder: write_pours(folder, config))
    (path,) = folder.glob("*.mcap")
    return path


@pytest.fixture
def pour(pour_made_once: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy in a folder of its own; features are kept beside it, not in the user's cache."""
    monkeypatch.setenv("TAXEL_CACHE", str(tmp_path / "cache"))
    (tmp_path / "cups").mkdir()
    return Path(shutil.copy(pour_made_once, tmp_path / "cups" / "pour.mcap"))


@pytest.fixture
def untried_hdf5(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out the process that reads HDF5 first: 0.3 s a file, and tested by itself."""
    monkeypatch.setattr("taxel.foreign.hdf5_file.try_hdf5", lambda path: None)
