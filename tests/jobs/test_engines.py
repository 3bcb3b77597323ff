"""Claims about engines for many machines: a killed worker's job is done again, results are equal.

Each engine is an extra, and skipped where it is not installed. All run on the loopback address.
"""

import os
import sys
from importlib.util import find_spec
from pathlib import Path

import psutil
import pytest
from work_to_do import die_first, own_number, refuse, square

from taxel.errors import BadInput, MissingExtra
from taxel.jobs.places import open_engine
from taxel.jobs.running import as_done, side_by_side, use_engine

PACKAGES = {"dask": "distributed", "ray": "ray", "slurm": "submitit"}
pytestmark = [
    pytest.mark.slow,
    # Third parties' sockets and processes, closed late.
    *(
        pytest.mark.filterwarnings(f"ignore::{kind}")
        for kind in ("ResourceWarning", "DeprecationWarning", "FutureWarning",
                     "pytest.PytestUnraisableExceptionWarning")
    ),
]  # fmt: skip


def let_workers_import(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let processes that are no children of pytest find what it was told where to find."""
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, sys.path)))


@pytest.fixture(params=list(PACKAGES))
def place(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    name: str = request.param
    if find_spec(PACKAGES[name]) is None:
        pytest.skip(f"{PACKAGES[name]} is not installed: pip install 'taxel[{name}]'")
    let_workers_import(monkeypatch)
    return f"slurm://?executor=local&folder={tmp_path / 'jobs'}" if name == "slurm" else name


def test_sixteen_jobs_are_done_where_a_worker_is_killed_and_what_a_job_raises_comes_back(
    place: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """In one engine, since some take many seconds to start."""
    lines: list[str] = []
    signs = tmp_path / "signs"
    signs.mkdir()
    jobs = [(signs, number, number == 5) for number in range(16)]
    with use_engine(open_engine(place, 2, lines.append)):
        found = dict(as_done(die_first, jobs, names=[f"job {n}" for n in range(16)]))
        beyond = [
            connection.laddr
            for process in [psutil.Process(), *psutil.Process().children(recursive=True)]
            for connection in process.net_connections()
            if connection.status == "LISTEN"
            and connection.laddr.ip.removeprefix("::ffff:") != "127.0.0.1"
        ]
        with pytest.raises(BadInput, match="needed an even number; got 3; give another"):
            side_by_side(refuse, [(3,)])

    assert found == {number: number * number for number in range(16)}
    assert (signs / "died").exists()
    assert {int(path.name.split("-")[0]) for path in signs.glob("*-*")} == set(range(16))
    done = [line for line in lines if " of 16: job " in line]
    assert len(done) == 16
    assert all(", process " in line and " on " in line for line in done)
    assert beyond == []
    assert capfd.readouterr().out == "", "JSON on the output stands alone"


@pytest.mark.skipif(find_spec("ray") is None, reason="ray is not installed")
def test_a_killed_node_of_ray_costs_its_own_jobs_a_second_start(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from ray.cluster_utils import Cluster

    let_workers_import(monkeypatch)
    monkeypatch.setenv("RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER", "0")
    monkeypatch.setenv("RAY_USAGE_STATS_ENABLED", "0")
    store = {"num_cpus": 1, "object_store_memory": 100_000_000, "include_dashboard": False}
    cluster = Cluster(initialize_head=True, head_node_args=store)
    try:
        other = cluster.add_node(num_cpus=1, object_store_memory=100_000_000)
        with use_engine(open_engine(f"ray://{cluster.address}", 2)) as engine:
            assert engine.workers == 2
            found = {}
            for number, result in as_done(square, [(n,) for n in range(16)]):
                if len(found) == 4:
                    cluster.remove_node(other, allow_graceful=False)
                found[number] = result
    finally:
        cluster.shutdown()
    assert found == {number: number * number for number in range(16)}


@pytest.mark.skipif(find_spec("distributed") is None, reason="distributed is not installed")
def test_a_scheduler_that_runs_already_gives_its_workers() -> None:
    from distributed import LocalCluster

    with (
        LocalCluster(n_workers=2, threads_per_worker=1, host="127.0.0.1",
                     dashboard_address="127.0.0.1:0", scheduler_kwargs={"dashboard": False})
        as cluster,
        use_engine(open_engine(cluster.scheduler_address.replace("tcp", "dask"), 5)) as engine,
    ):  # fmt: skip
        assert engine.workers == 2
        processes = set(side_by_side(own_number, [(n,) for n in range(8)]))
    assert len(processes) <= 2
    assert os.getpid() not in processes


@pytest.mark.parametrize("name", list(PACKAGES))
def test_an_engine_that_is_not_installed_is_reported_with_its_extra(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, PACKAGES[name], None)
    with pytest.raises(MissingExtra, match=rf"pip install 'taxel\[{name}\]'"):
        open_engine(name, 2)
