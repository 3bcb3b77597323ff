"""A trained run's predictions for recordings that it has not learned from, to compare two runs.

Knows nothing about how runs are compared.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from taxel.bundles.contract import fingerprint_of
from taxel.errors import BadDataset, BadInput
from taxel.evaluation.fold_table import FoldTable
from taxel.evaluation.shared_values import name_by_unseen
from taxel.evaluation.table_split import trials_tested
from taxel.training.fitting import Fitted
from taxel.training.predictions import Predictions
from taxel.training.run import Run
from taxel.windows.dataset import LABEL_THEM, load_dataset, only_labelled


def predictions_of_both_on(
    first: Run, second: Run, folder: Path
) -> tuple[Predictions, Predictions, tuple[str, ...]]:
    """Return two runs' predictions for a folder, and notes; see `predictions_on`.

    Their split is named by the objects, persons … that neither was trained on.
    """
    (ours, notes), (theirs, _) = predictions_on(first, folder), predictions_on(second, folder)
    learned = [run.contract.learned_groups for run in (first, second)]
    split = name_by_unseen(ours.split, ours.trials, learned)
    return replace(ours, split=split), replace(theirs, split=split), notes


def predictions_on(run: Run, folder: Path) -> tuple[Predictions, tuple[str, ...]]:
    """Return a run's predictions for a folder's labelled windows, and notes on what was left out.

    Args:
        run: A run with weights, trained on values as measured.
        folder: Recordings with its label; trials without it are left out.

    Raises:
        BadInput: The run has no weights.
        BadBundle: The recordings are of another array.
        BadDataset: No trial has the label, one is of a class that was never learned, or the run
            learned from one of the recordings.
    """
    contract = run.contract
    if not run.networks:
        raise BadInput("a run with weights to test on other recordings", "one without",
                       "write it with: taxel train")  # fmt: skip
    window = replace(contract.window, reference=None)
    dataset = load_dataset(folder, window, usual=contract.followed_from)
    contract.check_sensor(dataset.sensor)
    dataset = only_labelled(dataset, contract.target, folder, f"{LABEL_THEM}; or test on others")
    for name, own in dataset.fingerprints.items():
        if fingerprint_of(own) in contract.learned:
            raise BadDataset("recordings that neither run was trained on", f"{name} in {folder}",
                             "take it out of the folder")  # fmt: skip
    labels = [trial.labels[contract.target] for trial in dataset.trials]
    for trial, label in zip(dataset.trials, labels, strict=True):
        if label not in contract.classes:
            raise BadDataset(
                f"the label {contract.target!r} among {', '.join(contract.classes)} on every trial",
                f"{label!r} on {trial.groups['trial']} in {folder}",
                "correct the label if it is mistyped, or take the trial out",
            )  # fmt: skip
    number = np.array([contract.classes.index(label) for label in labels], np.intp)
    windows = dataset.windows
    fitted = Fitted(run.networks, contract.scaling, [])
    predictions = Predictions(
        split=f"trained elsewhere, tested on {folder.name or folder}",
        classes=contract.classes,
        trials=dataset.trials,
        folds=("test",),
        trained=np.zeros((1, len(dataset.trials)), np.intp),
        trial=dataset.trial,
        start_s=windows.start_s,
        fold=np.zeros(len(dataset), np.intp),
        y=number[dataset.trial],
        probabilities=fitted.probabilities(windows.values, windows.mask),
    )
    return predictions, dataset.notes


def only_tested(found: Predictions, table: FoldTable) -> Predictions:
    """Return the predictions of the trials that a table tests.

    Args:
        found: Of a split that moves whole trials.
        table: A table of folds.

    Raises:
        BadTable: It names recordings or groups that are not there.
        BadInput: The run trained on windows of a trial that it tests, or tested none of them.
    """
    recordings = {trial.groups["recording"] for trial in found.trials}
    kept = np.isin(found.trial, sorted(trials_tested(table, found.trials, recordings)))
    if not kept.any():
        raise BadInput(f"windows of trials that {table.name} tests", "none in the run",
                       "evaluate it with: --folds TABLE")  # fmt: skip
    if found.trained[found.fold[kept], found.trial[kept]].any():
        raise BadInput(f"a run that keeps what {table.name} tests whole",
                       f"one split by {found.split!r}", "evaluate it with: --folds TABLE",
                       )  # fmt: skip
    return replace(
        found, split=f"{found.split}; tested: {table.split}", trial=found.trial[kept],
        start_s=found.start_s[kept], fold=found.fold[kept], y=found.y[kept],
        probabilities=found.probabilities[kept],
    )  # fmt: skip
