"""Run code or a verb in a process of its own: what it gives, and the most memory that it held.

Knows nothing about what is measured.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from contextlib import suppress
from time import sleep
from typing import Any

_VERB = (sys.executable, "-m", "taxel.cli.main")


def run_code(code: str) -> Any:
    """Return the JSON that Python code prints, run in a process of one thread.

    Raises:
        CalledProcessError: It failed.
    """
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True, env=environment
    )
    return json.loads(done.stdout)


def run_verb(*words: str) -> Any:
    """Return the JSON that a verb prints.

    Raises:
        CalledProcessError: It failed.
    """
    done = subprocess.run([*_VERB, *words], check=True, capture_output=True, text=True)
    return json.loads(done.stdout)


def most_memory_mb(*words: str) -> float:
    """Return the most memory that a verb and its processes held together, MiB.

    Raises:
        CalledProcessError: It failed.
    """
    import psutil

    command = [*_VERB, *words]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as child:
        most = 0
        while child.poll() is None:
            held = 0
            with suppress(psutil.NoSuchProcess):
                tree = psutil.Process(child.pid)
                for process in [tree, *tree.children(recursive=True)]:
                    with suppress(psutil.NoSuchProcess):
                        held += process.memory_info().rss
            most = max(most, held)
            sleep(0.1)
        if child.returncode:
            raise subprocess.CalledProcessError(child.returncode, command)
    return most / 2**20
