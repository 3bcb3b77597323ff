"""What crops of camera trials show, computed once and kept on disk, a file a trial and family.

Files are named by the family and by the images' contents: other images, another crop or another
version of a family give another file. Knows nothing about labels, folds or models.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import count
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.gel.scale import mm_per_row_px
from taxel.training.camera_trials.image_network import ImageNetwork
from taxel.training.camera_trials.learning import Crops, Moved
from taxel.training.frames.features import load_kept, save_kept
from taxel.windows.camera_trials import CameraTrial, Image
from taxel.windows.trial_crops import (
    FAMILIES,
    Scene,
    look_at,
    row_of,
    rows_alone,
)
from taxel.windows.trial_layout import Layout
from taxel.windows.trial_shifts import VERSION, WHOLE, looked_at, shifted
from taxel.windows.trial_stretch import VERSION as CHANGES
from taxel.windows.trial_stretch import changes_of, part_of


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialRows:
    """All trials' crops, a trial's together."""

    rows: dict[str, NDArray[np.float32]]
    """Family → shape (n, numbers)."""
    shown: dict[str, NDArray[np.float32]]
    """Family → shape (n, rows, cameras, columns): what a crop shows before it is summed up."""
    trial: NDArray[np.intp]
    """Shape (n,): index of the trial."""
    place: NDArray[np.intp]
    """Shape (n,): index in `PLACES`, or of crops between them."""

    @property
    def whole(self) -> NDArray[np.float32]:
        """Shape (n, columns): all families side by side."""
        return np.concatenate(list(self.rows.values()), axis=1)

    @property
    def cameras(self) -> int:
        """How many there are."""
        return int(next(iter(self.shown.values())).shape[2])


@dataclass(frozen=True, slots=True)
class Cuts:
    """Which crops of a trial are looked at: those it is judged by, unless others are asked for."""

    layout: Layout
    """How trials are cut."""
    between: int = 0
    """So many crops between the places instead, which are only learned from."""
    copies: int = 0
    """So many shifted copies of each crop instead, by which no trial is judged."""
    network: ImageNetwork | None = None
    """What the family of that name looks through."""

    def starts(self, part: range) -> list[int]:
        """Return the first frames of these crops in a trial of which they show this part."""
        if self.between:
            return self.layout.between(part, self.between)
        return self.layout.starts(part)

    @property
    def places(self) -> int:
        """How many crops each trial gives, copies counted."""
        return len(self.starts(range(self.layout.span))) * max(1, self.copies)

    def key(self, whole: bool) -> str:
        """Return a name for the cache; `whole`: whether crops are taken from all of a trial."""
        between = f"-between-{self.between}" if self.between else ""
        shifted = f"-{VERSION}-{self.copies}" if self.copies else ""
        moving = "" if whole else f"-of-{CHANGES}"
        moving += f"-by-{self.layout.step}" if self.layout.step > 1 else ""
        return f"{self.layout.crop}x{self.layout.places}{moving}{between}{shifted}"


def trial_rows(
    trials: Sequence[CameraTrial],
    cuts: Cuts,
    families: Sequence[str],
    cache: Path,
    on_trial: Callable[[int, int], None] = lambda done, of: None,
) -> TrialRows:
    """Return what all crops show, from the cache where it has it.

    Args:
        trials: None shorter than a crop.
        cuts: Which crops of them.
        families: Names in `FAMILIES`.
        cache: Folder to keep files in.
        on_trial: Called with trials done and in all.

    Raises:
        RecordingFailed: The disk refused.
        BadTable: A video cannot be read.
    """
    shown: dict[str, list[NDArray[np.float32]]] = {name: [] for name in families}
    for done, trial in enumerate(trials, start=1):
        for name, values in _shown(trial, cuts, families, cache).items():
            shown[name].append(values)
        on_trial(done, len(trials))
    whole = {name: np.concatenate(parts) for name, parts in shown.items()}
    places = cuts.places
    crops = range(len(trials) * places)
    each = [row_of({name: whole[name][at] for name in families}) for at in crops]
    return TrialRows(
        rows={name: np.stack([row[name] for row in each]) for name in families},
        shown=whole,
        trial=np.repeat(np.arange(len(trials)), places),
        place=np.tile(np.arange(places), len(trials)),
    )


def further_crops(cut: TrialRows, between: TrialRows | None, views: Sequence[str]) -> Crops | None:
    """Return crops that are only learned from; None where there are none.

    Those between the places; and, of several cameras, what each alone shows in every crop.

    Args:
        cut: Crops that trials are judged by.
        between: Crops between their places, of those views.
        views: The first of `cut`, so that columns keep their place; of the others, which nobody
            learns from here, nothing is kept.
    """
    parts = [] if between is None else [Crops(between.whole, between.trial)]
    parts += [_alone(own, views) for own in (cut, between) if own is not None and own.cameras > 1]
    if not parts:
        return None
    return Crops(
        np.concatenate([part.rows for part in parts]),
        np.concatenate([part.trial for part in parts]),
    )


def moved_crops(cut: TrialRows, copied: TrialRows) -> Moved:
    """Return shifted copies of crops, by which no trial is judged.

    Args:
        cut: Crops that trials are judged by.
        copied: Their copies, as many of each, of some of those views.
    """
    ends = np.cumsum([own.shape[1] for own in cut.rows.values()])
    end = dict(zip(cut.rows, ends.tolist(), strict=True))
    columns = [np.arange(end[name] - own.shape[1], end[name]) for name, own in copied.rows.items()]
    crop = np.repeat(np.arange(len(cut.trial)), len(copied.trial) // len(cut.trial))
    return Moved(copied.whole, crop, np.asarray(np.concatenate(columns), np.intp))


def _alone(cut: TrialRows, views: Sequence[str]) -> Crops:
    rows = [
        np.concatenate(list(row.values()))
        for at in range(len(cut.trial))
        for row in rows_alone({name: cut.shown[name][at] for name in views})
    ]
    return Crops(np.stack(rows), np.repeat(cut.trial, cut.cameras))


def _shown(
    trial: CameraTrial, cuts: Cuts, families: Sequence[str], cache: Path
) -> dict[str, NDArray[np.float32]]:
    """Return what one trial's crops show, family → shape (places, rows, cameras, columns)."""
    part = _part(trial, cuts.layout, cache)
    folder = cuts.key(len(part) == trial.frames)
    files = {name: _file(trial, cuts, name, cache / "trials", folder) for name in families}
    found = {name: _kept(files[name], trial, cuts, name) for name in families}
    lacking = [name for name in families if found[name] is None]
    if lacking:
        for name, values in _compute(trial, cuts, part, lacking).items():
            save_kept(files[name], values.reshape(-1, values.shape[-1]))
            found[name] = values
    return {name: values for name, values in found.items() if values is not None}


def _file(trial: CameraTrial, cuts: Cuts, name: str, cache: Path, crops: str) -> Path:
    camera = f"{trial.rate_hz:.4g}-{mm_per_row_px(trial.width, trial.mm_per_px):.4g}"
    family = FAMILIES[name].key
    if name == "network" and cuts.network is not None:
        family = f"{family}-{cuts.network.key}"
    return cache / f"{family}-{crops}-{camera}" / f"{trial.digest[:32]}.npy"


def _kept(file: Path, trial: CameraTrial, cuts: Cuts, name: str) -> NDArray[np.float32] | None:
    columns, cameras = FAMILIES[name].columns, len(trial.cameras)
    values = load_kept(file, columns)
    if values is None or len(values) % (cuts.places * cameras):
        return None
    return values.reshape(cuts.places, -1, cameras, columns)


def all_moves(
    trials: Sequence[CameraTrial],
    layout: Layout,
    cache: Path,
    on_trial: Callable[[int, int], None] = lambda done, of: None,
) -> bool:
    """Return whether crops of this layout are what crops of whole trials are, frame by frame.

    Args:
        trials: None shorter than a crop.
        layout: How they are cut.
        cache: Folder to keep in how much they move.
        on_trial: Called with trials done and in all, until one is not wholly taken.

    Raises:
        RecordingFailed: The disk refused.
        BadTable: A video cannot be read.
    """
    if layout.step > 1:
        return False
    for done, trial in enumerate(trials, start=1):
        if len(_part(trial, layout, cache)) < trial.frames:
            return False
        on_trial(done, len(trials))
    return True


def _part(trial: CameraTrial, layout: Layout, cache: Path) -> range:
    return part_of(layout, trial.frames, lambda: _changes(trial, layout.step, cache))


def _changes(trial: CameraTrial, step: int, cache: Path) -> NDArray[np.float32]:
    """Return how much each frame of a trial differs from others, from the cache where it has it.

    Returns:
        Shape (frames, 3), as `taxel.windows.trial_stretch.Changes` measures it.
    """
    file = cache / "trials" / f"{CHANGES}-by-{step}" / f"{trial.digest[:32]}.npy"
    values = load_kept(file, 3)
    if values is None or len(values) != trial.frames:
        values = np.array(changes_of(trial.moments(), step), np.float32)
        save_kept(file, values)
    return values


def _compute(
    trial: CameraTrial, cuts: Cuts, part: range, families: Sequence[str]
) -> dict[str, NDArray[np.float32]]:
    scale = mm_per_row_px(trial.width, trial.mm_per_px)

    def look(names: Sequence[str], images: list[list[Image]]) -> dict[str, NDArray[np.float32]]:
        scenes = [
            Scene(own, trial.rate_hz / cuts.layout.step, scale, cuts.network) for own in images
        ]
        return look_at(names, scenes)

    whole = tuple(name for name in families if name in WHOLE)
    others = tuple(name for name in families if name not in WHOLE)

    def copy_of(images: list[list[Image]], seed: tuple[int, ...]) -> dict[str, NDArray[np.float32]]:
        found = {}
        for names in filter(None, (whole, others)):
            seen = [looked_at(names[0], own) for own in images]
            moved = [shifted(own, (*seed, camera)) for camera, own in enumerate(seen)]
            found.update(look(names, moved))
        return found

    def look_at_all(number: int, images: list[list[Image]]) -> list[dict[str, NDArray[np.float32]]]:
        if not cuts.copies:
            return [look(families, images)]
        seed = int(trial.digest[:8], 16), number
        return [copy_of(images, (*seed, copy)) for copy in range(cuts.copies)]

    # map lets go of each crop before the next is read
    crops = trial.crops(cuts.starts(part), cuts.layout.span, cuts.layout.step)
    each = [found for copies in map(look_at_all, count(), crops) for found in copies]
    return {name: np.stack([found[name] for found in each]) for name in families}
