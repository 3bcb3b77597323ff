"""Shared memory says who owns it; what a dead owner left is swept, a living one's never."""

from __future__ import annotations

import os
import subprocess
import sys
from multiprocessing import shared_memory
from pathlib import Path

import pytest

from taxel.errors import BadInput
from taxel.live.station.shared import SHARED, create_shared, sweep

pytestmark = pytest.mark.skipif(not SHARED.is_dir(), reason="no /dev/shm on this system")

_LEAVER = """
import os, sys
from multiprocessing import resource_tracker
from taxel.live.station.shared import create_shared
memory = create_shared(64)
resource_tracker.unregister(memory._name, "shared_memory")  # it was killed as well
print(memory.name, flush=True)
sys.stdin.readline()
os._exit(1)
"""


def test_what_a_dead_owner_left_is_swept_and_what_a_living_one_owns_is_not():
    mine = create_shared(64)
    with subprocess.Popen(
        [sys.executable, "-c", _LEAVER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as other:
        assert other.stdout is not None
        name = other.stdout.readline().strip()
        assert f"_{other.pid}_" in name
        assert name not in sweep()
        other.kill()
        other.wait()
        assert (SHARED / name).exists()
        assert name in sweep()
    assert not (SHARED / name).exists()
    assert (SHARED / mine.name).exists()
    mine.close()
    mine.unlink()


def test_a_process_number_that_was_given_again_is_another_owner(tmp_path: Path):
    made = create_shared(64)
    head, _, start, number = made.name.rsplit("_", 3)
    made.close()
    made.unlink()
    mine = f"{head}_{os.getpid()}_{start}_{number}"
    before = f"{head}_{os.getpid()}_{int(start) - 1}_{number}"
    elsewhere = f"taxel_1_{2**22 + 1}_5_0"
    for name in (mine, before, elsewhere, "taxel_notes", "psm_12345678"):
        (tmp_path / name).touch()

    assert sweep(tmp_path) == [before]
    assert len(list(tmp_path.iterdir())) == 4


def test_where_shared_memory_has_no_names_nothing_is_swept(tmp_path: Path):
    assert sweep(tmp_path / "shm") == []


def test_names_differ_and_a_name_that_is_taken_is_passed_over():
    first, second = create_shared(64), create_shared(64)
    taken = second.name.rpartition("_")
    squatter = shared_memory.SharedMemory(f"{taken[0]}_{int(taken[2]) + 1}", create=True, size=64)
    third = create_shared(64)
    names = {block.name for block in (first, second, squatter, third)}
    for block in (first, second, squatter, third):
        block.close()
        block.unlink()
    assert len(names) == 4


def test_a_limit_on_the_size_of_files_is_named_and_leaves_nothing_behind():
    """In a process of its own: the limit holds for all that it writes."""
    words = (
        "import resource\n"
        "from taxel.errors import BadInput\n"
        "from taxel.live.station.shared import create_shared\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (300 * 1024, resource.RLIM_INFINITY))\n"
        "create_shared(300 * 1024).unlink()\n"
        "try:\n"
        "    create_shared(8 * 2**20)\n"
        "except BadInput as error:\n"
        "    print(error)\n"
    )
    ended = subprocess.run(
        [sys.executable, "-c", words], capture_output=True, text=True, timeout=60, check=True
    )

    assert ended.stdout == (
        "needed 8.0 MiB of shared memory; got a limit of 307,200 bytes on the size of a file "
        "(ulimit -f); raise it with ulimit -f unlimited, or start this from another shell.\n"
    )
    assert ended.stderr == ""


def test_what_else_refuses_shared_memory_is_one_plain_line(monkeypatch: pytest.MonkeyPatch):
    def refuse(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(shared_memory, "SharedMemory", refuse)
    with pytest.raises(BadInput, match="64 bytes of shared memory; got Permission denied"):
        create_shared(64)
