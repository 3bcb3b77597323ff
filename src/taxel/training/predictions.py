"""What a cross-validation predicted for each test window, and how it is kept beside a run.

`predictions.npz` holds the arrays, `predictions.json` the trials and names; nothing in them is
pickled. Knows nothing about how folds were made or models fitted.

Background of our choices: docs/decisions/0025.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadInput
from taxel.foreign.archives import read_kinds
from taxel.foreign.files import MIB
from taxel.foreign.json_text import Fields, read_json
from taxel.foreign.records import record_of
from taxel.labels.trials import Trial

_ARRAYS = "predictions.npz"
_NAMES = "predictions.json"
_LARGEST_NAMES = 32 * MIB
"""Bytes; a trial takes some 300. Source: our choice."""
_KINDS = {"trained": "iub", "trial": "iu", "start_s": "f", "fold": "iu", "y": "iu",
          "probabilities": "f"}  # fmt: skip
"""Array → NumPy's letters for its numbers."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Predictions:
    """Test windows, each predicted once by a model that was not trained on its fold."""

    split: str
    """The split's name, such as "session held out"."""
    classes: tuple[str, ...]
    trials: tuple[Trial, ...]
    folds: tuple[str, ...]
    """Names of the folds."""
    trained: NDArray[np.intp]
    """Shape (folds, trials): how many of a trial's windows were on the training side."""
    trial: NDArray[np.intp]
    """Shape (n,): each test window's index into `trials`."""
    start_s: NDArray[np.float64]
    """Shape (n,): time of the window's first row on its recording's clock, seconds."""
    fold: NDArray[np.intp]
    """Shape (n,): index into `folds`."""
    y: NDArray[np.intp]
    """Shape (n,): true class, an index into `classes`."""
    probabilities: NDArray[np.float64]
    """Shape (n, classes)."""
    at_limit: NDArray[np.bool_] | None = None
    """Shape (n,): whether a channel stands at the converter's limit in all rows of the window, so
    that live answers UNKNOWN; None where that is not known. Not kept beside a run."""

    def __len__(self) -> int:
        return len(self.y)

    @property
    def correct(self) -> NDArray[np.bool_]:
        """Whether each window was predicted correctly, shape (n,)."""
        return np.asarray(self.probabilities.argmax(axis=1) == self.y)

    def groups(self) -> list[str]:
        """Return the groups that every trial has."""
        common = set.intersection(*(set(trial.groups) for trial in self.trials))
        return sorted(common)

    def group(self, key: str) -> NDArray[np.str_]:
        """Return each test window's group, shape (n,).

        Raises:
            BadInput: A trial has no such group.
        """
        if key not in self.groups():
            raise BadInput(
                f"the group {key!r} on every trial",
                f"trials with the groups {', '.join(self.groups())}",
                "name one of those",
            )
        return np.array([trial.groups[key] for trial in self.trials])[self.trial]


def save_predictions(folder: Path, predictions: Predictions) -> None:
    """Write both files into a folder that exists."""
    names = {
        "split": predictions.split,
        "classes": predictions.classes,
        "folds": predictions.folds,
        "trials": [_trial_to_json(trial) for trial in predictions.trials],
    }
    (folder / _NAMES).write_text(json.dumps(names, sort_keys=True) + "\n")
    np.savez_compressed(
        folder / _ARRAYS,
        trained=predictions.trained,
        trial=predictions.trial,
        start_s=predictions.start_s,
        fold=predictions.fold,
        y=predictions.y,
        probabilities=predictions.probabilities,
    )


def load_predictions(folder: Path) -> Predictions | None:
    """Read a run's predictions; None where it was saved without any.

    Raises:
        BadInput: They are damaged, or their parts do not fit one another.
    """
    if not (folder / _NAMES).exists() and not (folder / _ARRAYS).exists():
        return None
    try:
        names = Fields(read_json(folder / _NAMES, _LARGEST_NAMES), _NAMES)
        arrays = read_kinds(folder / _ARRAYS, _KINDS)
        predictions = Predictions(
            split=names.text("split"),
            classes=names.texts("classes"),
            trials=tuple(record_of(Trial, trial) for trial in names.items("trials")),
            folds=names.texts("folds"),
            trained=arrays["trained"].astype(np.intp),
            trial=arrays["trial"].astype(np.intp),
            start_s=arrays["start_s"].astype(np.float64),
            fold=arrays["fold"].astype(np.intp),
            y=arrays["y"].astype(np.intp),
            probabilities=arrays["probabilities"].astype(np.float64),
        )
        _check(predictions)
    except (OSError, ValueError) as error:  # BadFile is a ValueError
        raise BadInput(
            f"predictions that can be read in {folder}",
            f"damaged ones ({getattr(error, 'got', error)})",
            "train the run again with: taxel train",
        ) from error
    return predictions


def _check(found: Predictions) -> None:
    if found.y.ndim != 1:
        raise ValueError(f"y of shape {found.y.shape}")
    n = len(found)
    shapes = {
        "trained": (len(found.folds), len(found.trials)),
        "trial": (n,),
        "start_s": (n,),
        "fold": (n,),
        "probabilities": (n, len(found.classes)),
    }
    for name, shape in shapes.items():
        if getattr(found, name).shape != shape:
            raise ValueError(f"{name} of shape {getattr(found, name).shape}, not {shape}")
    limits = {"trial": len(found.trials), "fold": len(found.folds), "y": len(found.classes)}
    for name, limit in limits.items():
        values = getattr(found, name)
        if n == 0 or values.min() < 0 or values.max() >= limit:
            raise ValueError(f"{name} outside 0 … {limit - 1}")
    if not np.isfinite(found.probabilities).all() or not np.isfinite(found.start_s).all():
        raise ValueError("a probability or time that is not finite")
    for trial in found.trials:
        if not {"recording", "trial"} <= set(trial.groups):
            raise ValueError("a trial without the groups recording and trial")


def _trial_to_json(trial: Trial) -> dict[str, Any]:
    return asdict(trial) | {"labels": dict(trial.labels), "groups": dict(trial.groups)}
