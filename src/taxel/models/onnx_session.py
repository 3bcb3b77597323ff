"""Open an ONNX model in ONNX Runtime, the same way wherever one runs.

Knows nothing about bundles, windows or what the numbers mean.
"""

from __future__ import annotations

import onnxruntime

from taxel.errors import BadBundle


def one_line(error: Exception) -> str:
    """Return what a library says, on one line and not for long."""
    return " ".join(str(error).split())[:300]


def open_session(model: bytes, threads: int = 1) -> onnxruntime.InferenceSession:
    """Return a model that is ready to run on the processor.

    Args:
        model: The ONNX file's bytes.
        threads: Threads that share one run; one is fastest for small networks and leaves the
            machine to others.

    Raises:
        BadBundle: ONNX Runtime refuses it.
    """
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    options.log_severity_level = 3
    # Threads wait for each other's next layer busily, but not for the next run: a core that
    # spins on is taken from whoever has work.
    options.add_session_config_entry("session.force_spinning_stop", "1")
    try:
        return onnxruntime.InferenceSession(model, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # onnxruntime's own errors share no public base
        raise BadBundle(
            "a model that ONNX Runtime can run", f"one that it refuses ({one_line(error)})",
            "write it again with this version of taxel",
        ) from error  # fmt: skip
