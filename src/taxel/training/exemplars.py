"""Exemplars: a few grasps of each class and session that a run keeps, to rehearse by later.

Knows nothing about networks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadInput
from taxel.foreign.archives import read_kinds
from taxel.labels.joined import joined_label
from taxel.windows.dataset import Dataset

GRASPS = 8
"""Whole grasps that are kept of each class and session. Source: our choice, docs/decisions/0028."""
FILE = "exemplars.npz"
"""Beside a run's weights."""
_KINDS = {"values": "f", "mask": "b", "y": "iu", "session": "U", "grasp": "U"}
"""Array → NumPy's letters for its values."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Exemplars:
    """Windows with their classes, as values of the run's own level."""

    values: NDArray[np.float32]
    """Shape (n, steps, channels), unscaled."""
    mask: NDArray[np.bool_]
    """Shape (n, steps)."""
    y: NDArray[np.intp]
    """Shape (n,): class numbers in the run's contract."""
    session: NDArray[np.str_]
    """Shape (n,): the session, or recording, of each."""
    grasp: NDArray[np.str_]
    """Shape (n,): the grasp of each, a name of its own across all data."""

    def __len__(self) -> int:
        return len(self.y)

    def __getitem__(self, part: NDArray[np.bool_] | NDArray[np.intp]) -> Exemplars:
        """Return those that a mask or an index array selects."""
        return Exemplars(
            values=self.values[part],
            mask=self.mask[part],
            y=self.y[part],
            session=self.session[part],
            grasp=self.grasp[part],
        )

    def at_level(self, old: NDArray[np.float32], new: NDArray[np.float32]) -> Exemplars:
        """Return the same touches as values of another level, each of shape (channels,)."""
        return Exemplars(
            values=(self.values * (new / old)).astype(np.float32),
            mask=self.mask,
            y=self.y,
            session=self.session,
            grasp=self.grasp,
        )

    @staticmethod
    def join(parts: Sequence[Exemplars]) -> Exemplars:
        """Return the windows of several parts one after another."""
        return Exemplars(
            values=np.concatenate([part.values for part in parts]),
            mask=np.concatenate([part.mask for part in parts]),
            y=np.concatenate([part.y for part in parts]),
            session=np.concatenate([part.session for part in parts]),
            grasp=np.concatenate([part.grasp for part in parts]),
        )


def all_exemplars(dataset: Dataset, classes: Sequence[str], target: str) -> Exemplars:
    """Return all windows of a data set whose class is one of `classes`."""
    names = [joined_label(trial.labels, target) for trial in dataset.trials]
    number = np.array([classes.index(n) if n in classes else -1 for n in names], np.intp)
    everywhere = all("session" in trial.groups for trial in dataset.trials)
    session = dataset.group("session" if everywhere else "recording")
    grasp = dataset.group("trial")
    found = Exemplars(
        values=dataset.windows.values,
        mask=dataset.windows.mask,
        y=number[dataset.trial],
        session=session[dataset.trial],
        grasp=grasp[dataset.trial],
    )
    return found[found.y >= 0]


def thin_out(exemplars: Exemplars, most: int = GRASPS, seed: int = 0) -> Exemplars:
    """Return at most so many whole grasps of each class and session, drawn at random.

    Whole grasps, so that what remains still says how many windows a grasp of a class gives.
    """
    rng = np.random.default_rng(seed)
    place = np.char.add(np.char.add(exemplars.y.astype(str), "/"), exemplars.session)
    kept = np.zeros(len(exemplars), bool)
    for value in np.unique(place):
        there = place == value
        names = rng.permutation(np.unique(exemplars.grasp[there]))[:most]
        kept |= there & np.isin(exemplars.grasp, names)
    return exemplars[kept]


def save_exemplars(folder: Path, exemplars: Exemplars) -> None:
    """Write them into a run's folder."""
    np.savez_compressed(
        folder / FILE,
        values=exemplars.values,
        mask=exemplars.mask,
        y=exemplars.y,
        session=exemplars.session,
        grasp=exemplars.grasp,
    )


def load_exemplars(folder: Path) -> Exemplars | None:
    """Read a run's exemplars; None where it has none, as runs of older versions.

    Raises:
        BadInput: They are damaged.
    """
    path = folder / FILE
    if not path.exists():
        return None
    try:
        arrays = read_kinds(path, _KINDS)
        exemplars = Exemplars(
            values=arrays["values"].astype(np.float32),
            mask=arrays["mask"].astype(bool),
            y=arrays["y"].astype(np.intp),
            session=arrays["session"].astype(str),
            grasp=arrays["grasp"].astype(str),
        )
        n = len(exemplars.y) if exemplars.y.ndim == 1 else -1
        shapes = (exemplars.values.shape[:2], exemplars.mask.shape,
                  (n, *exemplars.session.shape[1:]), (n, *exemplars.grasp.shape[1:]))  # fmt: skip
        if (
            exemplars.values.ndim != 3
            or shapes != (exemplars.mask.shape, exemplars.mask.shape, (n,), (n,))
            or {len(exemplars.mask), len(exemplars.session), len(exemplars.grasp)} != {n}
            or not np.isfinite(exemplars.values).all()
        ):
            raise ValueError("parts of different length, or values that are not finite")
    except (OSError, ValueError) as error:  # BadFile is a ValueError
        raise BadInput(
            f"exemplars that can be read in {path}",
            f"damaged ones ({getattr(error, 'got', error)})",
            "train the run again with: taxel train",
        ) from error
    return exemplars
