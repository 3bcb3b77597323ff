"""Train a recipe on all recordings, for use.

Knows nothing about screens.
"""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from taxel.bundles.contract import Contract
from taxel.bundles.writer import write_bundle
from taxel.errors import BadDataset, BadInput
from taxel.models.catalogue import find_network
from taxel.training.curves import Epoch
from taxel.training.environment import code_digest, environment
from taxel.training.exemplars import all_exemplars, thin_out
from taxel.training.fitting import Job, TrainingSet, fit_model, training_windows
from taxel.training.loop import Checkpoint
from taxel.training.recipes import Recipe
from taxel.training.run import Run, contract_of, save_run
from taxel.training.unknown import fit_unknown
from taxel.windows.dataset import Dataset, follow_levels, load_dataset

_PARITY_WINDOWS = 1000
"""Windows that a bundle's export is compared on. Source: our choice, docs/decisions/0009."""


def train_on_all(
    path: Path | str,
    recipe: Recipe,
    *,
    checkpoints: Path | str,
    resume: bool = False,
    unknown: float | None = None,
    part: Callable[[Dataset], Dataset] = lambda dataset: dataset,
    on_epoch: Callable[[Epoch], None] | None = None,
) -> Run:
    """Train a recipe's networks on all windows.

    Args:
        path: A folder of recordings.
        recipe: Window, model, target and training.
        checkpoints: A folder for checkpoints; deleted when all is trained.
        resume: True goes on from checkpoints found there.
        unknown: Share of known touch that may be rejected as novel, between 0 and 1; None makes
            no such test.
        part: Takes from all windows those that may be learned from, as a split says.
        on_epoch: Called after each epoch.

    Raises:
        BadDataset: The recordings do not make such a data set.
        BadInput: `unknown` is no such share, or a checkpoint is damaged or another training's.
    """
    if unknown is not None and not 0 < unknown < 1:
        raise BadInput("a share between 0 and 1 for unknown", f"{unknown}", "give one such as 0.05")
    path, checkpoints = Path(path), Path(checkpoints)
    find_network(recipe.model)
    dataset = load_dataset(path, recipe.window, target=recipe.target)
    check_gate(dataset, own=recipe.own_gate)
    known, dataset = dataset, part(dataset)
    if recipe.window.level_follow is not None and len(dataset.trials) < len(known.trials):
        # What is kept back must have no part in the usual level either.
        measured = load_dataset(
            path, replace(recipe.window, level_follow=None), target=recipe.target
        )
        dataset = follow_levels(part(measured), recipe.window.level_follow)
    source = training_windows(path, dataset, recipe)
    if not resume:
        shutil.rmtree(checkpoints, ignore_errors=True)
    checkpoints.mkdir(parents=True, exist_ok=True)
    classes = dataset.classes(recipe.target)
    learned = replace(TrainingSet.of(source, recipe.target), classes=len(classes))
    job = _job_text(recipe, dataset.digest, learned, classes)
    fitted = fit_model(
        learned,
        Job.of(recipe),
        steps=recipe.window.steps,
        checkpoint=lambda member: Checkpoint(checkpoints / f"member-{member}.safetensors", job),
        on_epoch=on_epoch,
    )
    shutil.rmtree(checkpoints)
    networks, scaling = fitted.networks, fitted.scaling
    contract = contract_of(dataset, recipe.target, recipe.model, networks, scaling, {})
    if unknown is not None:
        contract = replace(contract, unknown=fit_unknown(dataset, recipe.target, scaling, unknown))
    return Run(
        networks=networks,
        contract=contract,
        train=recipe.train,
        history=tuple(fitted.history),
        data=str(path),
        exemplars=thin_out(all_exemplars(dataset, contract.classes, recipe.target)),
    )


def train_bundle(
    path: Path | str, recipe: Recipe, bundle: Path | str, run: Path | str | None = None
) -> Contract:
    """Train a recipe on all recordings and write its bundle; return the bundle's contract.

    Args:
        path: A folder of recordings.
        recipe: Window, model, target and training.
        bundle: The file to write.
        run: A folder to keep the run in, too.
    """
    trained = train_on_all(path, recipe, checkpoints=Path(bundle).with_suffix(".checkpoints"))
    if run is not None:
        save_run(Path(run), trained)
    windows = load_dataset(path, recipe.window).windows[:_PARITY_WINDOWS]
    return write_bundle(bundle, trained.networks, trained.contract, windows.values, windows.mask)


def check_gate(dataset: Dataset, *, own: bool = False) -> None:
    """Refuse a gate in volts for channels in other units.

    Args:
        dataset: Cut by that gate.
        own: Whether the gate was chosen for these recordings, in their channels' unit.

    Raises:
        BadDataset: The window has a recipe's gate and no channel is in volts.
    """
    gate, units = dataset.config.gate, sorted(set(dataset.sensor.units))
    if gate is not None and not own and "V" not in units:
        raise BadDataset(
            f"channels in V for a gate of {gate:g}",
            f"channels in {', '.join(units)}",
            "say --window gate=none grid=own, or a gate in your unit",
        )


def _job_text(recipe: Recipe, digest: str, learned: TrainingSet, classes: Sequence[str]) -> str:
    """Return what a checkpoint must share with the training that goes on from it.

    The recordings' values do not say it: trials may be labelled anew or cut elsewhere, and another
    table of folds may keep others back.
    """
    content = hashlib.sha256()
    for part in (learned.windows.values, learned.windows.mask, learned.y):
        content.update(np.ascontiguousarray(part).data)
    job = {
        "data": digest,
        "learned": content.hexdigest(),
        "classes": list(classes),
        "target": recipe.target,
        "model": recipe.model,
        "window": asdict(recipe.window),
        "train_stride": recipe.train_stride,
        "train_steps": recipe.train_steps,
        # Without the commit: it is that of whatever project taxel is installed in.
        "software": {name: text for name, text in environment().items() if name != "commit"},
        "code": code_digest(),
    }
    return json.dumps(job, sort_keys=True)
