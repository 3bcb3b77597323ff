"""The child of `model_trial`: open and run models under limits that the system keeps.

Run as a script, so that nothing of taxel is loaded. Reads a line of JSON and what it lists from
standard input; answers "ok", or why not, on standard output. Knows nothing about bundles.
"""

from __future__ import annotations

import io
import json
import os
import sys

import numpy as np
import onnxruntime

_STATUS = "/proc/self/status"


def limit(cpu_s: float, memory: int) -> None:
    """Let the system end this process after so much more processor time or memory.

    Args:
        cpu_s: Seconds.
        memory: Bytes.
    """
    try:
        import resource
        import signal
    except ModuleNotFoundError:  # no such limits on this system: the parent's clock remains
        return
    signal.setitimer(signal.ITIMER_PROF, cpu_s)  # SIGPROF ends a process that does not ask for it
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    try:
        with open(_STATUS) as status:
            held = next(int(line.split()[1]) for line in status if line.startswith("VmData:"))
    except (OSError, StopIteration):
        return
    most = held * 1024 + memory
    resource.setrlimit(resource.RLIMIT_DATA, (most, most))


def own_output() -> int:
    """Return what was the standard output; what a library prints there is lost from now on."""
    answer = os.dup(1)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    return answer


def main() -> None:
    """Do as the standard input says."""
    order = json.loads(sys.stdin.buffer.readline())
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 4
    limit(order["cpu_s"], order["memory"])
    for trial in order["trials"]:
        model = sys.stdin.buffer.read(trial["model"])
        windows = {
            name: np.load(io.BytesIO(sys.stdin.buffer.read(size)), allow_pickle=False)
            for name, size in trial["windows"].items()
        }
        session = onnxruntime.InferenceSession(model, options, providers=["CPUExecutionProvider"])
        names = {entry.name for entry in session.get_inputs()}
        session.run(None, {name: own for name, own in windows.items() if name in names})


if __name__ == "__main__":
    output = own_output()
    try:
        main()
        os.write(output, b"ok\n")
    except MemoryError:
        pass
    except Exception as error:  # ONNX Runtime's own errors share no public base
        os.write(output, str(error).encode("utf-8", "replace")[:2000])
