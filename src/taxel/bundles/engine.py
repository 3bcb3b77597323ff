"""Run an ONNX model: ONNX Runtime by default, OpenVINO where installed.

Knows nothing about what the model tells.
"""

from __future__ import annotations

from typing import Any, Literal, Protocol

import numpy as np
import onnxruntime
from numpy.typing import NDArray

from taxel.errors import BadBundle, MissingExtra

EngineName = Literal["onnxruntime", "openvino"]
Precision = Literal["f32", "bf16", "int8"]
"""int8 is a matter of the model, whose other numbers stay f32; bf16 of the engine."""


class Engine(Protocol):
    """A model that is ready to run."""

    def run(self, **inputs: NDArray[Any]) -> NDArray[np.float32]:
        """Return the model's one output for its named inputs."""
        ...


class _OnnxRuntime:
    def __init__(self, model: bytes, threads: int) -> None:
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = threads
        options.inter_op_num_threads = 1
        options.log_severity_level = 3
        try:
            self._session = onnxruntime.InferenceSession(
                model, options, providers=["CPUExecutionProvider"]
            )
        except Exception as error:  # onnxruntime's own errors share no public base
            raise BadBundle(
                "a model that ONNX Runtime can run", f"one that it refuses ({error})",
                "write it again with this version of taxel",
            ) from error  # fmt: skip

    def run(self, **inputs: NDArray[Any]) -> NDArray[np.float32]:
        found: NDArray[np.float32] = self._session.run(None, inputs)[0]
        return found


class _OpenVino:
    def __init__(self, model: bytes, threads: int, precision: Precision) -> None:
        try:
            import openvino
        except ModuleNotFoundError as error:
            raise MissingExtra("openvino", "openvino", "this engine") from error
        core = openvino.Core()
        config = {
            "INFERENCE_PRECISION_HINT": "bf16" if precision == "bf16" else "f32",
            "INFERENCE_NUM_THREADS": threads,
            "NUM_STREAMS": 1,
            "PERFORMANCE_HINT": "LATENCY",
        }
        self._compiled = core.compile_model(core.read_model(model), "CPU", config)
        self._request = self._compiled.create_infer_request()

    def run(self, **inputs: NDArray[Any]) -> NDArray[np.float32]:
        found = self._request.infer(inputs)[0]
        return np.array(found, np.float32)


def open_engine(
    model: bytes,
    engine: EngineName = "onnxruntime",
    precision: Precision = "f32",
    threads: int = 1,
) -> Engine:
    """Return an engine that has loaded a model.

    Args:
        model: An ONNX file's bytes.
        engine: Which library runs it.
        precision: bf16 needs OpenVINO; int8 needs a model in 8-bit numbers.
        threads: Threads of the engine.

    Raises:
        BadBundle: The model cannot be run.
        MissingExtra: The library is not installed.
    """
    if engine == "openvino":
        return _OpenVino(model, threads, precision)
    if precision == "bf16":
        raise BadBundle(f"the engine openvino for {precision}", engine, "say --engine openvino")
    return _OnnxRuntime(model, threads)
