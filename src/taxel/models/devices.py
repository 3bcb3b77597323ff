"""On which device ONNX Runtime runs a model: one of its providers, the processor by default.

What there is depends on the installed package: `onnxruntime` has the processor,
`onnxruntime-gpu` NVIDIA's cards as well. Knows nothing about models.

Background of our choices: docs/decisions/0046.
"""

from __future__ import annotations

import os
from typing import Any

import onnxruntime

from taxel.errors import BadInput

VARIABLE = "TAXEL_DEVICE"
"""The environment variable that names the device of a command. Source: our choice,
docs/decisions/0046."""
CPU = "cpu"
"""What every ONNX Runtime has."""
PROVIDERS = {
    CPU: "CPUExecutionProvider",
    "cuda": "CUDAExecutionProvider",
    "tensorrt": "TensorrtExecutionProvider",
    "rocm": "ROCMExecutionProvider",
    "migraphx": "MIGraphXExecutionProvider",
    "directml": "DmlExecutionProvider",
    "coreml": "CoreMLExecutionProvider",
    "openvino": "OpenVINOExecutionProvider",
}
"""Device, as it is typed → ONNX Runtime's name of what runs there."""
OPTIONS: dict[str, dict[str, Any]] = {"cuda": {"use_tf32": "0"}}
"""Device → its provider's options. TF32 keeps 10 bits of a number: too few for a bundle's own
check, which allows a difference of 1e-5."""


def devices_here() -> tuple[str, ...]:
    """Return the devices that the installed ONNX Runtime was built for."""
    there = set(onnxruntime.get_available_providers())
    return tuple(name for name, provider in PROVIDERS.items() if provider in there)


def asked_device() -> str:
    """Return the device that $TAXEL_DEVICE names; the processor unless it is set.

    Raises:
        BadInput: It is not there.
    """
    device = os.environ.get(VARIABLE) or CPU
    check_device(device)
    return device


def check_device(device: str) -> None:
    """Refuse a device that is not there.

    Raises:
        BadInput: It is unknown, or the installed ONNX Runtime was not built for it.
    """
    here = devices_here()
    if device not in here:
        raise BadInput(
            f"{VARIABLE} among {', '.join(here)}, which are here", repr(device),
            "choose another, or install an ONNX Runtime built for it, such as onnxruntime-gpu",
        )  # fmt: skip
