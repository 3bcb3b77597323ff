"""Run a module with PyTorch itself: on a graphics card where there is one, else on the processor.

Offline only: what runs live is an ONNX file, without PyTorch. Knows nothing about what the module
predicts.

Background of our choices: docs/decisions/0057.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from taxel.errors import BadInput

_MULTIPLE = 16
"""Of how many rows a graphics card is given. Source: our choice, docs/decisions/0057."""


def best_device() -> torch.device:
    """Return the device that trains and computes fastest here: under torchrun, this process's."""
    if torch.cuda.is_available():
        number = int(os.environ.get("LOCAL_RANK", "0"))
        return torch.device("cuda", number % torch.cuda.device_count())
    return torch.device("cpu")


def device_words(device: torch.device) -> str:
    """Return a device's name, such as "NVIDIA H100 80GB HBM3"."""
    return torch.cuda.get_device_name(device) if device.type == "cuda" else str(device)


@contextmanager
def in_numbers(device: torch.device, *, bf16: bool) -> Iterator[None]:
    """Choose the numbers of convolutions and products within a block: 16 bits, or all of 32."""
    numbers: Any = torch.autocast(device.type, torch.bfloat16) if bf16 else nullcontext()
    # Else a card's convolutions would keep 10 bits of a number's 23 (TF32).
    with torch.backends.cudnn.flags(enabled=True, allow_tf32=False), numbers:
        yield


@contextmanager
def enough_memory() -> Iterator[None]:
    """Say in one line that a card's memory is full.

    Raises:
        BadInput: It is.
    """
    try:
        yield
    except torch.OutOfMemoryError as error:
        raise BadInput(
            "more memory of the graphics card for a step", "all of it in use",
            "try a smaller --batch",
        ) from error  # fmt: skip


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
        """Return the module's output for its one input, 32-bit, a row for each of the input's."""
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
