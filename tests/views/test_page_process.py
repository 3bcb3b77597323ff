"""The page's own process, and what goes over the socket as text."""

import json
import os
import signal
import subprocess
import sys

from taxel.views.page.clients import to_json


def test_sigterm_ends_a_page_s_own_process_cleanly():
    program = (
        "from taxel.views.page.server import run_page\n"
        "class S:\n"
        "    def snapshot(self): return {'time_s': 1.0}\n"
        "    def frame(self, camera): return None\n"
        "    def traces(self, since_s): return {'time_s': 1.0}\n"
        "run_page(S(), on_open=lambda url: print(url, flush=True))\n"
        "print('ended', flush=True)\n"
    )
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        url = process.stdout.readline().decode()
        assert url.startswith("http://127.0.0.1:")
        os.kill(process.pid, signal.SIGTERM)
        rest, _ = process.communicate(timeout=10)

    assert (rest, process.returncode) == (b"ended\n", 0)


def test_arrays_and_missing_numbers_become_lists_and_null():
    import numpy as np

    value = {"t": np.array([1.0, np.nan]), "n": np.float32(2.0), "x": float("inf"), "k": (1,)}

    assert json.loads(to_json(value)) == {"t": [1.0, None], "n": 2.0, "x": None, "k": [1]}
