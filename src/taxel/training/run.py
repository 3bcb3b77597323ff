"""A run: one folder with trained weights and all that is needed to use, judge or repeat them.

`run.json` holds the resolved configuration, the data's digest, the accuracy, the
history and how it was made; `weights-K.safetensors` holds the K-th network;
`predictions.*` hold what a cross-validation said, where there was one; `exemplars.npz` a few
grasps to rehearse by. A run that
was only evaluated has no weights. Knows nothing about how accuracy was measured.

Background of our choices: docs/decisions/0007.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from torch import nn

from taxel import __version__
from taxel.bundles.contract import (
    Contract,
    at_level,
    contract_from_json,
    contract_to_json,
    fingerprint_of,
    value_fingerprint,
)
from taxel.bundles.trials import IN_RUN
from taxel.errors import BadInput, TaxelError, not_written
from taxel.foreign.json_text import Fields, read_json
from taxel.foreign.records import record_of
from taxel.labels.trials import USUAL_GROUPS
from taxel.models.blend import EXPERT, Blend
from taxel.models.catalogue import count_parameters, find_network
from taxel.recordings.whole import whole_folder
from taxel.training.checkpoints import load_weights, save_weights
from taxel.training.curves import Curve, Epoch, curves_from_json, curves_to_json
from taxel.training.environment import Provenance
from taxel.training.exemplars import Exemplars, load_exemplars, save_exemplars
from taxel.training.loop import TrainConfig
from taxel.training.motion import measure_motion
from taxel.training.predictions import Predictions, load_predictions, save_predictions
from taxel.windows.dataset import Dataset
from taxel.windows.scaling import Scaling

_MOST_MEMBERS = 1000
"""Networks of a run. Source: our choice."""
_LARGEST_SIDE, _LARGEST_WINDOW = 100_000, 1_000_000
"""Steps, channels or classes, and values of a window, that a network is built for: it is built
before its weights are read. Source: our choice."""


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
    predictions: Predictions | None = None
    """The cross-validation's predictions for each test window; None without one."""
    trivial: Mapping[str, float] = field(default_factory=dict)
    """Trivial baseline → accuracy on the same folds, 0…1."""
    curves: tuple[Curve, ...] = ()
    """How each fold's network learned, its test windows held out; none of library models."""
    made: Provenance = Provenance()  # noqa: RUF009  # frozen
    """With which command, versions and processor."""
    exemplars: Exemplars | None = None
    """A few grasps of each class and session, to rehearse by when it learns another."""


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
        reference=dataset.reference,
        learned=_learned(dataset),
        learned_groups=_learned_groups(dataset),
        motion=measure_motion(dataset, target),
        usual=dataset.usual,
        trial_windows=_usual_windows(dataset.trial),
    )


def _learned(dataset: Dataset) -> tuple[str, ...]:
    """Return fingerprints of the recordings that gave a window."""
    names = {dataset.trials[index].recording for index in np.unique(dataset.trial)}
    own = (values for name, values in dataset.fingerprints.items() if name in names)
    return tuple(sorted({fingerprint_of(values) for values in own}))


def _learned_groups(dataset: Dataset) -> dict[str, tuple[str, ...]]:
    """Return fingerprints of the objects, persons … that gave a window, of usual groups only."""
    trials = [dataset.trials[index] for index in np.unique(dataset.trial)]
    return {
        key: tuple(sorted({value_fingerprint(trial.groups[key]) for trial in trials}))
        for key in USUAL_GROUPS
        if all(key in trial.groups for trial in trials)
    }


def _usual_windows(trial: NDArray[np.intp]) -> int:
    """Return the median of the trials' windows; those kept back have none, and do not count."""
    count = np.bincount(trial)
    return int(np.median(count[count > 0])) if len(trial) else 0


def save_run(folder: Path | str, run: Run) -> None:
    """Write a run's folder, whole or not at all; an older run there is replaced.

    Raises:
        RecordingFailed: The disk refused.
    """
    folder = Path(folder)
    try:
        with whole_folder(folder) as made:
            _write_run(made, run)
    except TaxelError:
        raise
    except OSError as error:
        raise not_written(folder, error) from error


def save_at_level(folder: Path, run: Run, level: NDArray[np.float32]) -> None:
    """Write a run for another level of its reference touches, exemplars too.

    At the level that it has, it is written byte for byte as it was.

    Args:
        folder: Where to.
        run: One that was trained with reference touches.
        level: The new level, shape (channels,), in the channels' units.

    Raises:
        RecordingFailed: The disk refused.
    """
    assert run.contract.reference is not None
    old, exemplars = run.contract.reference.level, run.exemplars
    if exemplars is not None:
        exemplars = exemplars.at_level(old, level)
    made = run.made if (level == old).all() else Provenance.now()
    contract = at_level(run.contract, level)
    save_run(folder, replace(run, contract=contract, exemplars=exemplars, made=made))


def _write_run(temporary: Path, run: Run) -> None:
    for index, network in enumerate(run.networks):
        save_weights(temporary / f"weights-{index}.safetensors", network, {})
    about = {
        "contract": json.loads(contract_to_json(run.contract)),
        "train": asdict(run.train),
        "history": [asdict(epoch) for epoch in run.history],
        "data": run.data,
        "members": len(run.networks),
        "trivial": dict(run.trivial),
        "curves": curves_to_json(run.curves),
        "made": asdict(run.made),
    }
    if run.predictions is not None:
        save_predictions(temporary, run.predictions)
    if run.exemplars is not None:
        save_exemplars(temporary, run.exemplars)
    (temporary / "run.json").write_text(json.dumps(about, indent=1, sort_keys=True) + "\n")


def load_run(folder: Path | str, *, weights: bool = True) -> Run:
    """Read a run's folder.

    Args:
        folder: Where `save_run` wrote it; by an older version too.
        weights: False leaves the networks out, for those who read results only.

    Raises:
        BadInput: It is a file such as a bundle, the folder is no run, is damaged, or has no
            weights to load.
    """
    folder = Path(folder)
    if folder.is_file():
        raise BadInput(
            "a run's folder", f"{folder}, a {'bundle' if folder.suffix == '.taxel' else 'file'}",
            "name the folder that taxel train wrote: its --output, usually runs/DATA-TARGET; "
            "if it is gone, train again",
        )  # fmt: skip
    if (folder / IN_RUN).is_file():
        raise BadInput(
            f"a run of an array in {folder}", "one of camera trials",
            f"use its bundle {folder / IN_RUN} with taxel evaluate-trials or taxel live",
        )  # fmt: skip
    try:
        about = Fields(read_json(folder / "run.json"), "run.json")
        contract = contract_from_json(json.dumps(about.any("contract")))
        members = about.count("members", 0, _MOST_MEMBERS)
        train = _train_config(about.any("train"))
        history = tuple(record_of(Epoch, epoch, finite=False) for epoch in about.items("history"))
        data = about.text("data")
        trivial = about.numbers("trivial") if "trivial" in about else {}
        curves = curves_from_json(about.any("curves")) if "curves" in about else ()
        made = record_of(Provenance, about.any("made")) if "made" in about else Provenance()
    except (OSError, ValueError) as error:  # BadBundle and BadFile are ValueErrors
        got = "none there"
        if (folder / "run.json").exists():
            got = f"a damaged one ({getattr(error, 'got', error)})"
        raise BadInput(f"a run in {folder}", got, "train one with: taxel train") from error
    if weights and not members:
        raise BadInput(
            f"a run with trained weights in {folder}",
            f"one of {contract.model} that was only evaluated",
            "train one with: taxel train",
        )
    networks = _load_networks(folder, contract, members) if weights else ()
    return Run(
        networks=networks,
        contract=contract,
        train=train,
        history=history,
        data=data,
        predictions=load_predictions(folder),
        trivial=trivial,
        curves=curves,
        made=made,
        exemplars=load_exemplars(folder) if weights else None,
    )


def _load_networks(folder: Path, contract: Contract, members: int) -> tuple[nn.Module, ...]:
    build = _build(contract.model)
    steps, channels, classes = contract.window.steps, len(contract.channels), len(contract.classes)
    if max(steps, channels, classes) > _LARGEST_SIDE or steps * channels > _LARGEST_WINDOW:
        raise BadInput(
            f"a run of windows of at most {_LARGEST_WINDOW:,} values in {folder}",
            f"{steps} × {channels} and {classes} classes", "train one with: taxel train",
        )  # fmt: skip
    networks = []
    for index in range(members):
        network = build(steps, channels, classes)
        load_weights(folder / f"weights-{index}.safetensors", network)
        networks.append(network.eval())
    return tuple(networks)


def _build(model: str) -> Callable[[int, int, int], nn.Module]:
    """Return what builds a model by its name; a blend's own weights say what it consists of."""
    return (lambda *_: Blend()) if model == EXPERT else find_network(model).build


def _train_config(raw: object) -> TrainConfig:
    from taxel.training.augment import Augment

    if not isinstance(raw, dict):
        raise ValueError("train is no object")
    augment = record_of(Augment, raw.get("augment"))
    plain = {key: value for key, value in raw.items() if key != "augment"}
    return replace(record_of(TrainConfig, plain), augment=augment)
