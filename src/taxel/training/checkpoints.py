"""Checkpoints: weights, Adam's state and history in one safetensors file.

Nothing is unpickled. Knows nothing about models or windows.
"""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import torch
from torch import nn

from taxel.errors import BadFile, BadInput
from taxel.foreign.json_text import parse_json
from taxel.foreign.records import record_of
from taxel.models.backbones.weight_files import read_tensors, save_tensors

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

_Record = TypeVar("_Record", bound="DataclassInstance")


def save_weights(path: Path, network: nn.Module, about: dict[str, str]) -> None:
    """Write a network's weights, whole or not at all."""
    save_tensors(
        path, {key: value.contiguous() for key, value in network.state_dict().items()}, about
    )


def load_weights(path: Path, network: nn.Module) -> dict[str, str]:
    """Read weights into a network and return what was said about them.

    Raises:
        BadInput: The file is damaged or belongs to another network.
    """
    tensors, about = _load(path)
    _put(path, network, tensors)
    return about


def save_checkpoint(
    path: Path,
    network: nn.Module,
    optimiser: torch.optim.Optimizer,
    config: Any,
    history: Any,
    job: str,
) -> None:
    """Write what training needs to go on, whole or not at all."""
    tensors = {f"weights.{k}": v.contiguous() for k, v in network.state_dict().items()}
    for index, state in optimiser.state_dict()["state"].items():
        for key, value in state.items():
            tensors[f"adam.{index}.{key}"] = value.contiguous()
    about = {
        "config": json.dumps(dataclasses.asdict(config), sort_keys=True),
        "job": job,
        "history": json.dumps([dataclasses.asdict(epoch) for epoch in history]),
    }
    save_tensors(path, tensors, about)


def load_checkpoint(
    path: Path,
    network: nn.Module,
    optimiser: torch.optim.Optimizer,
    config: Any,
    record: type[_Record],
    job: str,
) -> list[_Record]:
    """Read a checkpoint into network and optimiser and return the history so far.

    Raises:
        BadInput: The file is damaged, or was written under another configuration.
    """
    tensors, about = _load(path)
    now = json.dumps(dataclasses.asdict(config), sort_keys=True)
    if about.get("config") != now or about.get("job") != job:
        raise BadInput(
            f"a checkpoint of this configuration and data in {path.name}",
            "one of another configuration or other data",
            "train into another folder, or delete the checkpoint",
        )
    _put(path, network, _below("weights.", tensors))
    try:
        state: dict[int, dict[str, torch.Tensor]] = {}
        for name, value in _below("adam.", tensors).items():
            index, key = name.split(".", 1)
            state.setdefault(int(index), {})[key] = value
        optimiser.load_state_dict({**optimiser.state_dict(), "state": state})
        history = parse_json(about.get("history", ""))
        return [record_of(record, epoch, finite=False) for epoch in history]
    except (TypeError, ValueError) as error:
        raise BadInput(
            f"a whole checkpoint {path.name}", f"one with damaged history or steps ({error})",
            "delete it and train again",
        ) from error  # fmt: skip


def _below(prefix: str, tensors: dict[str, torch.Tensor]) -> dict[str, torch.Tensor]:
    return {k.removeprefix(prefix): v for k, v in tensors.items() if k.startswith(prefix)}


def _put(path: Path, network: nn.Module, tensors: dict[str, torch.Tensor]) -> None:
    try:
        network.load_state_dict(tensors)
    except RuntimeError as error:
        raise BadInput(
            "weights of this network", f"others in {path.name}", "train it again"
        ) from error


def _load(path: Path) -> tuple[dict[str, torch.Tensor], dict[str, str]]:
    try:
        return read_tensors(path)
    except (OSError, BadFile) as error:
        raise BadInput(
            f"a readable safetensors file {path.name}",
            f"a damaged one ({getattr(error, 'got', error)})",
            "delete it and train again",
        ) from error
