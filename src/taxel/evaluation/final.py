"""Train a recipe on all recordings, for use.

Knows nothing about screens.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from pathlib import Path

from torch import nn

from taxel.bundles.contract import Contract
from taxel.bundles.writer import write_bundle
from taxel.evaluation.checked import check_gate
from taxel.evaluation.splits import Split, TrialFold
from taxel.evaluation.table_split import OWN_SPLIT, Elsewhere, split_elsewhere
from taxel.models.catalogue import find_network
from taxel.training.adapt.exemplars import all_exemplars, thin_out
from taxel.training.loop import Epoch, Labelled, fit, new_network
from taxel.training.recipes import Recipe
from taxel.training.run import Run, contract_of, save_run
from taxel.training.unknown import fit_unknown
from taxel.windows.dataset import load_dataset, recut
from taxel.windows.scaling import fit_scaling

_PARITY_WINDOWS = 1000
"""Windows that a bundle's export is compared on. Source: our choice, docs/decisions/0009."""


def train_on_all(
    path: Path,
    recipe: Recipe,
    accuracy: Mapping[str, float],
    *,
    checkpoints: Path,
    resume: bool = False,
    unknown: float | None = None,
    given: Elsewhere = OWN_SPLIT,
    on_epoch: Callable[[Epoch], None] | None = None,
) -> Run:
    """Train a recipe's networks on all windows.

    A table of folds with one training and one test part keeps its test part (and validation)
    from them, so that the run can still be scored on it; with several folds nothing is kept back.

    Args:
        path: A folder of recordings.
        recipe: Window, model, target and training.
        accuracy: What the run says of itself: split → accuracy, 0…1.
        checkpoints: A folder for checkpoints; deleted when all is trained.
        resume: True goes on from checkpoints found there.
        unknown: Share of known touch that may be called unlike anything learned, 0…1; None
            makes no such test.
        given: The split that came from elsewhere, if there is one.
        on_epoch: Called after each epoch.

    Raises:
        BadDataset: The recordings do not make such a data set.
        BadInput: A checkpoint is damaged or of another configuration.
    """
    model = find_network(recipe.model)
    dataset = load_dataset(path, recipe.window, target=recipe.target)
    check_gate(dataset)
    if given.table is not None:
        _, split = split_elsewhere(path, dataset, recipe.target, given)
        if len(split.folds) == 1:
            dataset = dataset.only_trials(_train_part(split))
    source = dataset
    if recipe.train_stride is not None:
        rows = recipe.train_steps or recipe.window.steps
        source = recut(path, dataset, recipe.train_stride, rows)
    windows, y = source.windows, source.class_numbers(recipe.target)
    full_scale = dataset.sensor.full_scale
    kind = model.scaling
    if kind == "full-scale" and full_scale is None:
        kind = "standard"
    scaling = fit_scaling(kind, windows.values, windows.mask, full_scale)
    data = Labelled(scaling.apply(windows.values, windows.mask), windows.mask, y)
    classes = len(dataset.classes(recipe.target))
    if not resume:
        shutil.rmtree(checkpoints, ignore_errors=True)
    checkpoints.mkdir(parents=True, exist_ok=True)
    networks: list[nn.Module] = []
    history: list[Epoch] = []
    for member in range(recipe.members):
        config = replace(recipe.train, seed=recipe.train.seed + member)
        steps, channels = recipe.window.steps, data.values.shape[2]
        network = new_network(lambda: model.build(steps, channels, classes), config.seed)  # noqa: B023
        checkpoint = checkpoints / f"member-{member}.safetensors"
        history = fit(
            network,
            data,
            config,
            steps=steps,
            checkpoint=checkpoint,
            on_epoch=on_epoch,
            job=_job_text(recipe, dataset.digest, len(dataset.trials)),
        )
        networks.append(network)
    shutil.rmtree(checkpoints)
    contract = contract_of(dataset, recipe.target, recipe.model, tuple(networks), scaling, accuracy)
    if unknown is not None:
        contract = replace(contract, unknown=fit_unknown(dataset, recipe.target, scaling, unknown))
    return Run(
        networks=tuple(networks),
        contract=contract,
        train=recipe.train,
        history=tuple(history),
        data=str(path),
        exemplars=thin_out(all_exemplars(dataset, contract.classes, recipe.target)),
    )


def _train_part(split: Split) -> frozenset[int]:
    (fold,) = split.folds
    assert isinstance(fold, TrialFold)
    return fold.train


def train_bundle(path: Path, recipe: Recipe, bundle: Path, run: Path | None = None) -> Contract:
    """Train a recipe on all recordings and write its bundle; return the bundle's contract.

    Args:
        path: A folder of recordings.
        recipe: Window, model, target and training.
        bundle: The file to write.
        run: A folder to keep the run in, too.
    """
    trained = train_on_all(path, recipe, {}, checkpoints=bundle.with_suffix(".checkpoints"))
    if run is not None:
        save_run(run, trained)
    windows = load_dataset(path, recipe.window).windows[:_PARITY_WINDOWS]
    return write_bundle(bundle, trained.networks, trained.contract, windows.values, windows.mask)


def _job_text(recipe: Recipe, digest: str, trials: int) -> str:
    """Return what a checkpoint must share with the training that goes on from it."""
    job = {
        "data": digest,
        "trials": trials,
        "target": recipe.target,
        "model": recipe.model,
        "window": asdict(recipe.window),
        "train_stride": recipe.train_stride,
        "train_steps": recipe.train_steps,
    }
    return json.dumps(job, sort_keys=True)
