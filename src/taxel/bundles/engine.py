"""Run an ONNX model: ONNX Runtime by default, OpenVINO where installed.

Knows nothing about what the model predicts.
"""

from __future__ import annotations

from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadBundle, MissingExtra
from taxel.models.devices import CPU
from taxel.models.onnx_session import open_session, run_session
from taxel.side_by_side import SideBySide

EngineName = Literal["onnxruntime", "openvino"]
Precision = Literal["f32", "bf16", "int8"]
"""int8 is a matter of the model, whose other numbers stay f32; bf16 of the engine."""


def largest_difference(found: NDArray[Any], expected: NDArray[Any]) -> float:
    """Return the largest difference of two arrays of one shape; NaN where one is no number."""
    # A damaged file may hold a signalling NaN, which the processor reports.
    with np.errstate(invalid="ignore"):
        return float(np.abs(found - expected).max())


class Engine(Protocol):
    """A model that is ready to run."""

    def run(self, **inputs: NDArray[Any]) -> NDArray[np.float32]:
        """Return the model's one output for its named inputs; both as the model's maker says.

        Raises:
            BadBundle: It refuses the inputs, or gives no real numbers.
        """
        ...


class _OnnxRuntime:
    """Few rows run side by side, each in one thread; one row, or many, in all threads together.

    Threads that share a row wait for each other after each of its layers, so that two rows of a
    backbone take 2 to 8 % longer in two threads together. The row's numbers are the same.
    """

    def __init__(self, model: bytes, threads: int, device: str) -> None:
        threads = threads if device == CPU else 1  # a card takes all rows at once
        self._threads = threads
        self._together = open_session(model, threads, device)
        self._alone = open_session(model, 1) if threads > 1 else self._together
        self._beside = SideBySide(threads)

    def run(self, **inputs: NDArray[Any]) -> NDArray[np.float32]:
        rows = min(len(values) for values in inputs.values())
        if not 1 < rows <= self._threads:
            return run_session(self._together, inputs)
        parts = [
            {name: values[row : row + 1] for name, values in inputs.items()} for row in range(rows)
        ]
        return np.concatenate(self._beside.map(lambda part: run_session(self._alone, part), parts))


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
            # Else two processes run on the same core. Source: docs/decisions/0056.
            "ENABLE_CPU_PINNING": False,
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
    device: str = CPU,
) -> Engine:
    """Return an engine that has loaded a model.

    Args:
        model: An ONNX file's bytes.
        engine: Which library runs it.
        precision: bf16 needs OpenVINO; int8 needs a model in 8-bit numbers.
        threads: Threads of the engine.
        device: Of ONNX Runtime, a name in `PROVIDERS`.

    Raises:
        BadInput: The device is not there.
        BadBundle: The model cannot be run.
        MissingExtra: The library is not installed.
    """
    if engine == "openvino":
        return _OpenVino(model, threads, precision)
    if precision == "bf16":
        raise BadBundle(f"the engine openvino for {precision}", engine, "say --engine openvino")
    return _OnnxRuntime(model, threads, device)
