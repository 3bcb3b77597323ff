"""Processes end with their parent."""

import os
import subprocess
import sys

import pytest


def test_a_killed_parent_leaves_no_process_behind() -> None:
    """The child prints its workers' numbers; they are gone soon after it was killed."""
    code = (
        "import multiprocessing, os, sys, threading, time\n"
        "from taxel.jobs.running import side_by_side\n"
        "def tell():\n"
        "    while len(multiprocessing.active_children()) < 2: time.sleep(0.01)\n"
        "    print(*[c.pid for c in multiprocessing.active_children()], flush=True)\n"
        "threading.Thread(target=tell, daemon=True).start()\n"
        "side_by_side(time.sleep, [(600,), (600,)], workers=2)\n"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE) as child:
        assert child.stdout is not None
        workers = [int(word) for word in child.stdout.readline().split()]
        child.kill()
    assert len(workers) == 2
    for worker in workers:
        wait_until_gone(worker)


def wait_until_gone(pid: int) -> None:
    """Wait on the process's own file descriptor, at most ten seconds."""
    import select

    try:
        descriptor = os.pidfd_open(pid)
    except ProcessLookupError:
        return
    ready, _, _ = select.select([descriptor], [], [], 10.0)
    os.close(descriptor)
    assert ready, f"process {pid} still lives"


@pytest.mark.skipif(sys.platform != "linux", reason="Linux only")
@pytest.mark.parametrize("number", ["SIGKILL", "SIGCONT"])
def test_a_stopped_process_ends_with_its_killed_parent(number: str) -> None:
    """SIGKILL ends it where it stands; SIGCONT wakes it, and it sees that it is alone."""
    child_code = (
        "import os, signal, sys, time\n"
        "from taxel.processes import signal_at_parents_end\n"
        "parent = int(sys.argv[1])\n"
        f"signal_at_parents_end(parent, signal.{number})\n"
        "os.write(1, b'x')\n"
        "os.kill(os.getpid(), signal.SIGSTOP)\n"
        "while os.getppid() == parent: time.sleep(0.01)\n"
    )
    code = (
        "import os, subprocess, sys\n"
        f"c = subprocess.Popen([sys.executable, '-c', {child_code!r}, str(os.getpid())],"
        " stdout=subprocess.PIPE)\n"
        "c.stdout.read(1)\n"
        "os.waitpid(c.pid, os.WUNTRACED)\n"
        "print(c.pid, flush=True)\n"
        "sys.stdin.read()\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as parent:
        assert parent.stdout is not None
        worker = int(parent.stdout.readline())
        parent.kill()
    wait_until_gone(worker)
