"""Claims about where jobs run: an address is read as it is meant, or refused in one line."""

import subprocess
import sys
from pathlib import Path

import pytest

from taxel.errors import BadInput
from taxel.jobs.local import LocalEngine
from taxel.jobs.place import Place
from taxel.jobs.places import open_engine, parse_place


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("local", Place(engine="local")),
        ("dask", Place(engine="dask")),
        ("dask://127.0.0.1:8786", Place(engine="dask", address="127.0.0.1:8786")),
        ("ray://node7:6379", Place(engine="ray", address="node7:6379")),
        (
            "slurm://gpu?minutes=90&memory_gb=8&folder=/share/jobs",
            Place(engine="slurm", address="gpu", minutes=90, memory_gb=8,
                  folder=Path("/share/jobs")),
        ),
        ("slurm://?executor=local", Place(engine="slurm", executor="local")),
    ],
)  # fmt: skip
def test_an_address_is_a_place(text: str, place: Place) -> None:
    assert parse_place(text) == place


@pytest.mark.parametrize(
    "text",
    ["", "spark", "local://host", "dask://host/path", "dask?minutes=3", "slurm://p?minutes=0",
     "slurm://p?minutes=soon", "slurm://p?executor=cloud", "slurm://p?colour=red",
     "slurm://p?minutes=²", "dask://[::1"],
)  # fmt: skip
def test_an_address_that_means_nothing_is_refused(text: str) -> None:
    with pytest.raises(BadInput):
        parse_place(text)


@pytest.mark.parametrize("workers", [0, -1, 5000])
def test_workers_are_at_least_one_and_not_beyond_measure(workers: int) -> None:
    with pytest.raises(BadInput, match="--workers within 1 and 1024"):
        open_engine("local", workers)


@pytest.mark.parametrize("workers", ["0", "-1", "many", "²"])
def test_a_number_of_workers_in_the_environment_that_is_none_is_refused(
    monkeypatch: pytest.MonkeyPatch, workers: str
) -> None:
    monkeypatch.setenv("TAXEL_WORKERS", workers)
    with pytest.raises(BadInput, match=r"1 to 1024 in \$TAXEL_WORKERS"):
        open_engine("local")


def test_the_environment_says_where_and_how_many_where_no_option_does(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("TAXEL_RUN_ON", "nowhere")
    with pytest.raises(BadInput, match="nowhere"):
        open_engine()
    monkeypatch.setenv("TAXEL_WORKERS", "3")
    engine = open_engine("local")
    assert isinstance(engine, LocalEngine)
    assert engine.workers == 3
    engine.close()


def test_no_engine_is_imported_unless_it_is_asked_for() -> None:
    code = (
        "import sys\n"
        "from taxel.jobs.places import open_engine\n"
        "open_engine('local', 2).close()\n"
        "print(sorted({'ray', 'distributed', 'dask', 'submitit', 'optuna'} & set(sys.modules)))\n"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout == "[]\n"


@pytest.mark.parametrize("name", ["dask", "ray"])
@pytest.mark.parametrize("address", ["127.0.0.1:9", "127.0.0.1", "127.0.0.1:many"])
def test_an_address_at_which_nobody_answers_is_reported_in_one_line(
    name: str, address: str
) -> None:
    with pytest.raises(BadInput, match=f"needed a .* at {address}; got none that answers"):
        open_engine(f"{name}://{address}", 2)
