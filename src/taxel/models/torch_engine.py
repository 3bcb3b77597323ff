"""Run a module with PyTorch itself: on a graphics card where there is one, else on the processor.

Offline only: what runs live is an ONNX file, without PyTorch. Knows nothing about what the module
predicts.

Background of our choices: docs/decisions/0057.
"""

from __future__ import annotations

from contextlib import nullcontext
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

_MULTIPLE = 16
"""Of how many rows a graphics card is given. Source: our choice, docs/decisions/0057."""


def best_device() -> torch.device:
    """Return the device that trains and computes fastest here."""
    if torch.cuda.is_available():
        return torch.device("cuda")
    return torch.device("cpu")


def device_words(device: torch.device) -> str:
    """Return a device's name, such as "NVIDIA H100 80GB HBM3"."""
    return torch.cuda.get_device_name(device) if device.type == "cuda" else str(device)


def in_numbers(device: torch.device, *, bf16: bool) -> Any:
    """Return what chooses the numbers of convolutions and products within a block."""
    return torch.autocast(device.type, torch.bfloat16) if bf16 else nullcontext()


class TorchEngine:
    """A module that is ready to run.

    Args:
        module: Takes one tensor and gives one.
        device: Where it runs; the module is moved there.
        bf16: Convolutions and products in 16 bits (bfloat16), else in 32.
    """

    def __init__(self, module: nn.Module, device: torch.device, *, bf16: bool = False) -> None:
        self.device = device
        self._bf16 = bf16
        self._module = module.eval().to(device, memory_format=torch.channels_last)  # type: ignore[call-overload]

    @property
    def on_card(self) -> bool:
        """Whether it runs on a graphics card."""
        return self.device.type != "cpu"

    def run(self, **inputs: NDArray[Any]) -> NDArray[np.float32]:
        """Return the module's output for its one input, 32-bit."""
        (values,) = inputs.values()
        values = np.ascontiguousarray(values)
        rows = len(values)
        if self.on_card and rows > _MULTIPLE:  # it prepares itself anew for each number of rows
            values = np.concatenate([values, values[-1:].repeat(-rows % _MULTIPLE, axis=0)])
        return np.asarray(self.of(torch.from_numpy(values).to(self.device))[:rows].cpu().numpy())

    def of(self, values: Tensor) -> Tensor:
        """Return the module's output, 32-bit, for a tensor on the same device."""
        with torch.no_grad(), in_numbers(self.device, bf16=self._bf16):
            found: Tensor = self._module(values).float()
        return found
