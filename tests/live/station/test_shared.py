"""Shared memory says who owns it; what a dead owner left is swept, a living one's never."""

from __future__ import annotations

import os
import subprocess
import sys
from multiprocessing import shared_memory
from pathlib import Path

import pytest

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
