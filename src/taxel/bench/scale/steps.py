"""`taxel bench scale`: work that survives its workers, here and on other people's engines.

Rows of speed need a quiet machine and stay unmeasured on a busy one. Knows nothing about how
engines work.

Source of the goals: issue 19; background: docs/decisions/0050.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from time import perf_counter

from taxel.bench.rows import Row, missing, row
from taxel.bench.scale import bus as scale_bus
from taxel.bench.scale import folders as scale_folders
from taxel.bench.scale import formats as scale_formats
from taxel.bench.scale import speed as scale_speed
from taxel.bench.scale import tune as scale_tune
from taxel.bench.scale.jobs import nothing, pour_digest
from taxel.jobs.places import open_engine
from taxel.jobs.running import Engine, as_done, use_engine

Measure = Callable[[], list[Row]]
JOBS, WORKERS = 16, 2
"""As the issue asks."""
_WARM_JOBS = 200
"""Empty jobs whose mean time is a job's overhead. Source: our choice, docs/decisions/0050."""
PACKAGES = {"dask": "distributed", "ray": "ray", "slurm": "submitit"}


def quick_steps() -> list[tuple[str, Measure]]:
    """Return the measurements of a normal run: workers of this machine."""
    return [
        ("a worker killed: local", lambda: killed_rows("local", "local")),
        ("overhead: local", lambda: [overhead_row("local", "local", 50.0)]),
        ("10,000 recordings", scale_folders.folder_rows),
        *scale_formats.quick_steps(),
    ]


def full_steps(data: Path | None) -> list[tuple[str, Measure]]:
    """Return what takes longer: other engines, speed, a search that is killed, memory."""
    return [
        ("a worker killed: Dask", lambda: killed_rows("Dask", "dask")),
        ("a worker killed: Ray", lambda: killed_rows("Ray", "ray")),
        ("a node killed: Ray", killed_node_rows),
        ("a worker killed: SLURM's jobs as processes", slurm_rows),
        ("overhead: Ray", lambda: [overhead_row("Ray", "ray", 10.0)]),
        ("overhead: Dask", lambda: [overhead_row("Dask", "dask", None)]),
        ("memory of many pours", scale_folders.memory_rows),
        ("a search killed", scale_tune.search_rows),
        *scale_speed.full_steps(),
        *scale_bus.quick_steps(),
        *scale_formats.full_steps(data),
    ]


def data_digest(_: Path | None) -> str:
    """Return the digest of recordings used: all are simulated."""
    return "none"


def killed_rows(name: str, place: str) -> list[Row]:
    """Run sixteen jobs, one of which kills its first worker; compare with one process."""
    row_name = f"{JOBS} jobs, a worker killed with -9 midway, {name}: equal to one process"
    engine = place.partition(":")[0]
    if engine in PACKAGES and find_spec(PACKAGES[engine]) is None:
        return [missing(row_name, "jobs", f">= {JOBS}", f"{PACKAGES[engine]} is not installed")]
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch, _imports():
        folder = Path(scratch)
        started = perf_counter()
        with use_engine(open_engine(place, WORKERS)) as opened:
            found = _digests(folder, opened)
        seconds = perf_counter() - started
        note = f"{seconds:.0f} s with starting the engine; killed: {(folder / 'died').exists()}"
    return [row(row_name, _equal(found), "jobs", ">=", JOBS, note)]


def killed_node_rows() -> list[Row]:
    """Run the same on two nodes of Ray, of which one is killed as a whole."""
    row_name = f"{JOBS} jobs, a node of two killed, Ray: equal to one process"
    if find_spec("ray") is None:
        return [missing(row_name, "jobs", f">= {JOBS}", "ray is not installed")]
    os.environ["RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER"] = "0"  # on the loopback address
    os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
    from ray.cluster_utils import Cluster

    node = {"num_cpus": 1, "object_store_memory": 100_000_000}
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch, _imports():
        folder = Path(scratch)
        digests: dict[int, str] = {}
        cluster = Cluster(initialize_head=True, head_node_args={**node, "include_dashboard": False})
        try:
            other = cluster.add_node(**node)
            started = perf_counter()
            with use_engine(open_engine(f"ray://{cluster.address}")):
                jobs = [(folder, number, False) for number in range(JOBS)]
                for number, digest in as_done(pour_digest, jobs):
                    if len(digests) == JOBS // 4:
                        cluster.remove_node(other, allow_graceful=False)
                    digests[number] = digest
            seconds = perf_counter() - started
        finally:
            cluster.shutdown()
    return [
        row(row_name, _equal(digests), "jobs", ">=", JOBS, f"{seconds:.0f} s; killed after 4 jobs")
    ]


def slurm_rows() -> list[Row]:
    """Run the same through submitit's local executor."""
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        return killed_rows(
            "submitit's local executor", f"slurm://?executor=local&folder={scratch}/jobs"
        )


def overhead_row(name: str, place: str, limit_ms: float | None) -> Row:
    """Return what an empty job costs on an engine whose workers are there already."""
    row_name = f"overhead of a job, {name}, warm"
    if place in PACKAGES and find_spec(PACKAGES[place]) is None:
        return missing(row_name, "ms", f"<= {limit_ms:g}" if limit_ms else "", "not installed")
    with _imports(), use_engine(open_engine(place, WORKERS)):
        dict(as_done(nothing, [(n,) for n in range(4 * WORKERS)]))
        started = perf_counter()
        dict(as_done(nothing, [(n,) for n in range(_WARM_JOBS)]))
        each_ms = 1000.0 * (perf_counter() - started) / _WARM_JOBS
    note = f"mean of {_WARM_JOBS} jobs, {WORKERS} workers"
    if limit_ms is None:
        return Row(name=row_name, value=each_ms, unit="ms", note=note)
    return row(row_name, each_ms, "ms", "<=", limit_ms, note)


def _digests(folder: Path, _: Engine) -> dict[int, str]:
    jobs = [(folder, number, number == JOBS // 3) for number in range(JOBS)]
    return dict(as_done(pour_digest, jobs))


def _equal(found: dict[int, str]) -> int:
    """Return how many results equal those of this process."""
    return sum(found.get(n) == pour_digest(Path(), n, False) for n in range(JOBS))


@contextmanager
def _imports() -> Iterator[None]:
    """Let engines' own processes import this taxel, also where it runs from a tree of files."""
    before = os.environ.get("PYTHONPATH")
    root = str(Path(__file__).parents[3])
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [root, before]))
    try:
        yield
    finally:
        os.environ.pop("PYTHONPATH")
        if before is not None:
            os.environ["PYTHONPATH"] = before
