"""Claims about workers on this machine: a killed one costs its own job a second start only."""

import errno
import os
import subprocess
import sys
from collections import Counter
from multiprocessing.context import SpawnProcess
from pathlib import Path

import pytest
from work_to_do import (
    always_die,
    collects,
    count_up,
    die_first,
    fall,
    leave_a_sign,
    opencv_threads,
    own_number,
    refuse,
    sign_at_the_end,
    square,
    where,
)

from taxel.errors import BadInput, WorkerLost
from taxel.jobs.local import ATTEMPTS, LocalEngine
from taxel.jobs.running import as_done, shared_out, side_by_side, use_engine, usual_workers


@pytest.mark.parametrize("workers", [1, 2])
def test_results_come_in_the_order_of_the_jobs(workers: int) -> None:
    done: list[int] = []

    found = side_by_side(square, [(2,), (4,), (6,)], done.append, workers)

    assert found == done == [4, 16, 36]


def test_a_worker_takes_one_thread_for_images_too(monkeypatch: pytest.MonkeyPatch) -> None:
    """With as many workers as cores, OpenCV's own threads would take turns."""
    monkeypatch.delenv("OPENCV_FOR_THREADS_NUM", raising=False)
    with use_engine(LocalEngine(2, print)):
        assert side_by_side(opencv_threads, [(0,), (1,)]) == [1, 1]


def test_a_killed_worker_costs_its_own_job_a_second_start_and_no_other(tmp_path: Path) -> None:
    lines: list[str] = []
    jobs = [(tmp_path, number, number == 5) for number in range(16)]
    with use_engine(LocalEngine(2, lines.append)):
        found = dict(as_done(die_first, jobs, names=[f"job {n}" for n in range(16)]))

    assert found == {number: number * number for number in range(16)}
    signs = [path.name for path in tmp_path.iterdir() if path.name != "died"]
    assert Counter(int(name.split("-")[0]) for name in signs) == dict.fromkeys(range(16), 1)
    (line,) = lines
    assert "job 5: its worker" in line
    assert "was killed by SIGKILL; it starts again" in line


def test_a_job_that_ends_each_worker_ends_the_work_in_one_line() -> None:
    lines: list[str] = []
    with use_engine(LocalEngine(2, lines.append)), pytest.raises(WorkerLost) as lost:
        side_by_side(always_die, [(0,), (1,)])
    assert f"after {ATTEMPTS} attempts: the last worker was killed by SIGKILL;" in str(lost.value)
    assert len(str(lost.value).splitlines()) == 1


UNGUARDED = """
import math
from taxel.jobs.local import LocalEngine
from taxel.jobs.running import side_by_side, use_engine

with use_engine(LocalEngine(2, print)):
    print(side_by_side(math.sqrt, [(4.0,), (9.0,)]))
"""


def test_a_script_that_begins_its_work_when_imported_is_refused_at_once(tmp_path: Path) -> None:
    """Each worker imports the script, and would begin the same work."""
    script = tmp_path / "script.py"
    script.write_text(UNGUARDED)
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, timeout=120)
    assert done.returncode == 1
    assert "starts again" not in done.stdout
    last = done.stderr.splitlines()[-1]
    assert "one that ended with exit code 1 before its first job" in last
    assert 'work stands under if __name__ == "__main__"' in last

    body = UNGUARDED.replace("with use", 'if __name__ == "__main__":\n  with use', 1)
    script.write_text(body.replace("    print", "      print"))
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stdout) == (0, "[2.0, 3.0]\n"), done.stderr


def test_a_worker_killed_by_a_signal_without_a_name_is_one_lost_worker_too(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Real-time signals have numbers alone."""
    monkeypatch.setattr(SpawnProcess, "exitcode", property(lambda _: -35))
    with use_engine(LocalEngine(2, print)), pytest.raises(WorkerLost) as lost:
        side_by_side(always_die, [(0,), (1,)])
    assert "the last worker was killed by signal 35;" in str(lost.value)


def test_a_process_that_the_machine_refuses_is_reported_as_that(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As beyond the number of open files or of processes."""

    def refused(_: SpawnProcess) -> None:
        raise OSError(errno.EMFILE, "Too many open files")

    monkeypatch.setattr(SpawnProcess, "start", refused)
    with (
        use_engine(LocalEngine(2, print)),
        pytest.raises(BadInput, match=r"a process for square \d; got Too many open files; use few"),
    ):
        side_by_side(square, [(0,), (1,)])


def test_what_a_job_raises_is_raised_here_with_where_it_was() -> None:
    with pytest.raises(BadInput, match=r"needed an even number; got [35]; give another") as refused:
        side_by_side(refuse, [(3,), (5,)], workers=2)
    assert "in refuse" in "".join(refused.value.__notes__)
    with pytest.raises(ZeroDivisionError):
        side_by_side(fall, [(3,), (5,)], workers=2)


def test_results_that_cannot_travel_are_reported_as_an_error() -> None:
    """A generator of the worker's own."""
    with pytest.raises(RuntimeError, match="generator"):
        side_by_side(count_up, [(3,), (5,)], workers=2)


def test_a_job_does_not_share_its_own_work_out() -> None:
    for process, processes in side_by_side(where, [(0,), (1,)], workers=2):
        assert set(processes) == {process} != {os.getpid()}


def test_an_engine_is_used_by_all_that_is_called_in_its_block() -> None:
    assert not shared_out()
    with use_engine(LocalEngine(2)):
        assert shared_out()
        first = set(side_by_side(own_number, [(n,) for n in range(8)]))
        again = set(side_by_side(own_number, [(n,) for n in range(8)]))
    assert os.getpid() not in first
    assert len(first | again) <= 2, "the same workers go on"
    assert not shared_out()


def test_workers_that_are_not_needed_any_more_end_in_order(tmp_path: Path) -> None:
    """What is to be done at a process's end is done, though its memory is left to the system."""
    jobs = [(tmp_path, number) for number in range(4)]
    side_by_side(sign_at_the_end, jobs, workers=2)
    assert sorted(path.name.split("-")[0] for path in tmp_path.iterdir()) == ["0", "1", "2", "3"]


def test_jobs_collect_garbage_though_a_workers_start_does_not() -> None:
    assert all(side_by_side(collects, [(0,), (1,)], workers=2))


@pytest.mark.slow
def test_a_worker_brings_no_framework_that_its_jobs_do_not_use() -> None:
    """PyTorch takes a second and a half to import, scikit-learn one: half of a worker's start."""
    code = (
        "import sys\n"
        "import taxel.sources.simulated.pour_folder, taxel.training.frames.jobs\n"
        "print(sorted({'torch', 'sklearn'} & set(sys.modules)))\n"
        "import taxel.evaluation.fold_jobs\n"
        "print(sorted({'torch', 'sklearn'} & set(sys.modules)))\n"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout == "[]\n['torch']\n"


def test_one_worker_is_this_process(tmp_path: Path) -> None:
    with use_engine(LocalEngine(1)):
        assert not shared_out()
        side_by_side(leave_a_sign, [(tmp_path, 1), (tmp_path, 2)])
    assert {path.name.split("-")[1] for path in tmp_path.iterdir()} == {str(os.getpid())}


def test_workers_are_as_many_as_cores_may_be_used(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("TAXEL_WORKERS")
    if hasattr(os, "sched_getaffinity"):
        monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 2, 3})
        assert usual_workers() == 3
    monkeypatch.setenv("TAXEL_WORKERS", "7")
    assert usual_workers() == 7
    monkeypatch.setenv("TAXEL_WORKERS", "many")
    with pytest.raises(BadInput, match="TAXEL_WORKERS; got many"):
        usual_workers()
