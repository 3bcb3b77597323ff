"""A run: one folder with trained weights and all that is needed to use or repeat them.

`run.json` holds the resolved configuration, the data's digest, the accuracy and
the history; `weights-K.safetensors` holds the K-th network. Knows nothing about
how accuracy was measured.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from torch import nn

from taxel import __version__
from taxel.bundles.contract import Contract, contract_from_json, contract_to_json
from taxel.errors import BadInput, RecordingFailed, TaxelError
from taxel.models.catalogue import count_parameters, find_network
from taxel.training.checkpoints import load_weights, save_weights
from taxel.training.loop import Epoch, TrainConfig
from taxel.windows.dataset import Dataset
from taxel.windows.scaling import Scaling


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """A trained recogniser with its history."""

    networks: tuple[nn.Module, ...]
    contract: Contract
    """What it needs and gives; its parity is None until it is exported."""
    train: TrainConfig
    history: tuple[Epoch, ...]
    data: str
    """The data set's path, as it was given."""


def contract_of(
    dataset: Dataset,
    target: str,
    model: str,
    networks: tuple[nn.Module, ...],
    scaling: Scaling,
    accuracy: Mapping[str, float],
) -> Contract:
    """Return what a recogniser trained on a data set needs and gives."""
    return Contract(
        target=target,
        classes=tuple(dataset.classes(target)),
        window=dataset.config,
        scaling=scaling,
        channels=dataset.sensor.channels,
        units=dataset.sensor.units,
        rate_hz=dataset.sensor.rate_hz,
        model=model,
        parameters=sum(count_parameters(network) for network in networks),
        data_digest=dataset.digest,
        accuracy=dict(accuracy),
        software=f"taxel {__version__}",
        parity=None,
    )


def save_run(folder: Path, run: Run) -> None:
    """Write a run's folder, whole or not at all; an older run there is replaced.

    Raises:
        RecordingFailed: The disk refused.
    """
    temporary = folder.with_name(folder.name + ".part")
    try:
        _write_run(temporary, run)
        if folder.exists():
            shutil.rmtree(folder)
        os.replace(temporary, folder)
    except TaxelError:
        raise
    except OSError as error:
        raise RecordingFailed(
            f"needed to write {folder}; got {error.strerror or error}; "
            "make room or choose another place."
        ) from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _write_run(temporary: Path, run: Run) -> None:
    shutil.rmtree(temporary, ignore_errors=True)
    temporary.mkdir(parents=True)
    for index, network in enumerate(run.networks):
        save_weights(temporary / f"weights-{index}.safetensors", network, {})
    about = {
        "contract": json.loads(contract_to_json(run.contract)),
        "train": asdict(run.train),
        "history": [asdict(epoch) for epoch in run.history],
        "data": run.data,
        "members": len(run.networks),
    }
    (temporary / "run.json").write_text(json.dumps(about, indent=1, sort_keys=True) + "\n")


def load_run(folder: Path) -> Run:
    """Read a run's folder.

    Raises:
        BadInput: The folder is no run, or is damaged.
    """
    try:
        about: dict[str, Any] = json.loads((folder / "run.json").read_text())
        contract = contract_from_json(json.dumps(about["contract"]))
        members = int(about["members"])
    except (OSError, ValueError, KeyError, TypeError) as error:  # BadBundle is a ValueError
        raise BadInput(
            f"a run in {folder}", f"none that can be read ({error})", "train one with: taxel train"
        ) from error
    build = find_network(contract.model).build
    networks = []
    for index in range(members):
        network = build(contract.window.steps, len(contract.channels), len(contract.classes))
        load_weights(folder / f"weights-{index}.safetensors", network)
        networks.append(network.eval())
    train = about["train"]
    return Run(
        networks=tuple(networks),
        contract=contract,
        train=_train_config(train),
        history=tuple(Epoch(**epoch) for epoch in about["history"]),
        data=about["data"],
    )


def _train_config(raw: dict[str, Any]) -> TrainConfig:
    from taxel.training.augment import Augment

    return TrainConfig(**{**raw, "augment": Augment(**raw["augment"])})
