"""Open an ONNX model in ONNX Runtime, the same way wherever one runs.

Knows nothing about bundles, windows or what the numbers mean.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import onnxruntime
from numpy.typing import NDArray

from taxel.errors import BadBundle
from taxel.models.devices import CPU, OPTIONS, PROVIDERS, VARIABLE, check_device


class WindowModel:
    """A model of windows that is ready to run; some look at no mask.

    Args:
        model: The ONNX file's bytes.
        threads: As `open_session` takes them.
        device: As above.
    """

    def __init__(self, model: bytes, threads: int = 1, device: str = CPU) -> None:
        self._session = open_session(model, threads, device)
        self._masked = "mask" in {entry.name for entry in self._session.get_inputs()}

    def __call__(self, values: NDArray[np.float32], mask: NDArray[np.bool_]) -> NDArray[np.float32]:
        """Return the model's one output.

        Args:
            values: Shape (n, steps, channels).
            mask: Shape (n, steps).
        """
        feed: dict[str, NDArray[Any]] = {"values": values}
        if self._masked:
            feed["mask"] = mask
        return run_session(self._session, feed)


def run_session(
    session: onnxruntime.InferenceSession, inputs: Mapping[str, NDArray[Any]]
) -> NDArray[np.float32]:
    """Return a model's first output.

    Args:
        session: The model.
        inputs: Name → values, of the shapes that the model takes.

    Raises:
        BadBundle: ONNX Runtime refuses the inputs, or the output is no real numbers.
    """
    try:
        found: NDArray[np.float32] = session.run(None, inputs)[0]
    except Exception as error:  # onnxruntime's own errors share no public base
        raise _unfit(f"one that ONNX Runtime refuses for them ({one_line(error)})") from error
    if found.dtype.kind != "f":
        raise _unfit(f"one that gives {found.dtype}")
    return found


def _unfit(got: str) -> BadBundle:
    return BadBundle(
        "a model that gives real numbers for its windows", got,
        "write it again with this version of taxel",
    )  # fmt: skip


def one_line(error: Exception) -> str:
    """Return an error's message on one line, at most 300 characters."""
    return " ".join(str(error).split())[:300]


def open_session(model: bytes, threads: int = 1, device: str = CPU) -> onnxruntime.InferenceSession:
    """Return a model that is ready to run.

    Args:
        model: The ONNX file's bytes.
        threads: Threads of the processor that share one run; one is fastest for small networks and
            leaves the machine to others.
        device: A name in `PROVIDERS`; what it cannot run, the processor runs.

    Raises:
        BadInput: The device is not there.
        BadBundle: ONNX Runtime refuses the model, or cannot open the device.
    """
    check_device(device)
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    options.log_severity_level = 3
    # Threads wait for each other's next layer busily, but not for the next run: a core that
    # spins on is taken from whoever has work.
    options.add_session_config_entry("session.force_spinning_stop", "1")
    wanted: list[Any] = [(PROVIDERS[device], OPTIONS.get(device, {}))]
    try:
        session = onnxruntime.InferenceSession(
            model, options, providers=wanted if device == CPU else [*wanted, PROVIDERS[CPU]]
        )
    except Exception as error:  # onnxruntime's own errors share no public base
        raise BadBundle(
            "a model that ONNX Runtime can run", f"one that it refuses ({one_line(error)})",
            "write it again with this version of taxel",
        ) from error  # fmt: skip
    if session.get_providers()[0] != PROVIDERS[device]:  # it falls back without a word
        raise BadBundle(
            f"a {device} device that ONNX Runtime can open",
            f"only {', '.join(session.get_providers())}",
            f"check its driver, or say {VARIABLE}=cpu",
        )  # fmt: skip
    return session
