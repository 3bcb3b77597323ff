"""Finished folds of a cross-validation, so that an interrupted one continues where it was.

A fold's predictions are stored as soon as it is done, under a key of everything that they depend
on: recipe, folds, windows and labels, software, taxel's own code as it stands, and processor. A
fold of another key, or a damaged one, is fitted again. Knows nothing about models.

Source: docs/decisions/0035.
"""

from __future__ import annotations

import hashlib
import io
import json
import math
from contextlib import nullcontext, suppress
from dataclasses import astuple, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from taxel.errors import BadFile, RecordingFailed
from taxel.evaluation.crossval import FoldPredictions
from taxel.evaluation.splits import Fold
from taxel.foreign.archives import read_arrays
from taxel.held import sweep
from taxel.jobs.call import code_digest
from taxel.recordings.whole import write_whole
from taxel.training.curves import Epoch
from taxel.training.environment import environment
from taxel.windows.dataset import Dataset

MOST_SHARED = 50
"""Data sets and splits whose folds are kept in a shared folder. Source: our choice,
docs/decisions/0040."""
_ARRAYS = ("test", "y", "probabilities")
_HISTORY = "history"


def folds_folder(output: Path) -> Path:
    """Return where the folds of a run are kept until it is complete."""
    return output.with_name(f"{output.name}.folds")


@dataclass(frozen=True, slots=True)
class FoldStore:
    """Folders in which the finished folds of a cross-validation are kept."""

    folder: Path | None = None
    """None keeps none."""
    cache: Path | None = None
    """For the library models' folds, which depend on data and split but not on the recipe's own
    model; None keeps them with the others."""
    fresh: bool = False
    """Whether what is there is removed first."""


NOTHING_KEPT = FoldStore()


class KeptFolds:
    """A folder of finished folds; without a folder, nothing is kept.

    Args:
        folder: Made with the first fold.
        depends_on: Plain values that the results depend on, besides the data set and software.
        dataset: The windows and their labels.
        target: The label that is predicted.
        fresh: Remove what is there first.
        shared: The folder is shared by many data sets and splits: each has one of its own in it,
            by its key, of which the latest `MOST_SHARED` stay.
    """

    def __init__(
        self,
        folder: Path | None,
        depends_on: Any,
        dataset: Dataset,
        target: str,
        *,
        fresh: bool,
        shared: bool = False,
    ) -> None:
        self.used = 0
        """Folds that were found finished."""
        self._folder, self._shared = folder, shared
        about = {"for": depends_on, "software": environment(), "code": code_digest()}
        digest = hashlib.sha256(json.dumps(about, sort_keys=True, default=str).encode())
        digest.update(content_digest(dataset, target).encode())
        self._key = np.frombuffer(digest.digest(), np.uint8)
        if folder is not None and shared:
            _thin_out(folder)
            self._folder = folder = folder / digest.hexdigest()[:32]
        if folder is not None and fresh:
            _remove(folder)

    def find(self, model: str, number: int, fold: Fold) -> FoldPredictions | None:
        """Return a fold's predictions where they were kept."""
        if self._folder is None:
            return None
        try:
            kept = read_arrays(self._path(model, number), ("key", *_ARRAYS, _HISTORY))
            if not np.array_equal(kept["key"], self._key):
                return None
            test, y, probabilities = (kept[name] for name in _ARRAYS)
            history = tuple(map(_epoch, kept[_HISTORY].tolist()))
        except (OSError, BadFile, KeyError, TypeError, ValueError):
            return None
        self.used += 1
        return FoldPredictions(fold.name, test, y, probabilities, history=history)

    def keep(self, model: str, number: int, result: FoldPredictions) -> None:
        """Store a fold that is done, whole or not at all; a shared folder may refuse it.

        Raises:
            RecordingFailed: The disk refused, and the folder is not shared.
        """
        if self._folder is None:
            return
        content = io.BytesIO()
        arrays = {name: getattr(result, name) for name in _ARRAYS}
        rows = [[math.nan if v is None else v for v in astuple(epoch)] for epoch in result.history]
        history = np.array(rows, np.float64).reshape(len(rows), len(fields(Epoch)))
        np.savez(content, key=self._key, history=history, **arrays)
        with suppress(RecordingFailed) if self._shared else nullcontext():
            write_whole(self._path(model, number), content.getvalue())

    def _path(self, model: str, number: int) -> Path:
        assert self._folder is not None
        return self._folder / f"{model}-{number}.npz"


def content_digest(dataset: Dataset, target: str) -> str:
    """Return the SHA-256 over windows, labels and the trials that they belong to."""
    digest = hashlib.sha256()
    windows = dataset.windows
    for part in (windows.values, windows.mask, dataset.class_numbers(target), dataset.trial):
        digest.update(np.ascontiguousarray(part).tobytes())
    digest.update(json.dumps(dataset.classes(target)).encode())
    return digest.hexdigest()


def forget_folds(output: Path) -> None:
    """Remove the kept folds of a run that is complete."""
    _remove(folds_folder(output))


def _epoch(values: list[float]) -> Epoch:
    """Return an epoch from its row; NaN is None where that is allowed."""
    number, loss, *rest = values
    return Epoch(int(number), loss, *(None if math.isnan(figure) else figure for figure in rest))


def _thin_out(folder: Path) -> None:
    """Remove the oldest folders of a shared one, so that it stays small."""
    with suppress(OSError):
        own = sorted(folder.iterdir(), key=lambda path: path.stat().st_mtime)
        for path in own[: max(0, len(own) - MOST_SHARED)]:
            _remove(path)


def _remove(folder: Path) -> None:
    """Remove kept folds, and their folder where nothing else is in it."""
    if folder.is_symlink():
        return
    with suppress(OSError):
        sweep(folder)
        for path in folder.glob("*.npz"):
            path.unlink()
        folder.rmdir()
