"""What one trial's crops show, computed once and kept on disk, a file a family.

Files are named by the family and by the images' contents: other images, another crop or another
version of a family give another file. Any process can compute it: a trial and its cuts can be sent.
Knows nothing about labels, folds or models.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import count
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.gel.scale import mm_per_row_px
from taxel.training.camera_trials.image_network import AnyNetwork
from taxel.training.frames.features import load_kept, save_kept
from taxel.windows.camera_trials import CameraTrial, Image
from taxel.windows.trial_crops import FAMILIES, Scene, look_at
from taxel.windows.trial_layout import Layout
from taxel.windows.trial_shifts import VERSION, WHOLE, looked_at, shifted
from taxel.windows.trial_stretch import VERSION as CHANGES
from taxel.windows.trial_stretch import changes_of, part_of


@dataclass(frozen=True, slots=True)
class Cuts:
    """Which crops of a trial are looked at: those it is judged by, unless others are asked for."""

    layout: Layout
    """How trials are cut."""
    between: int = 0
    """So many crops between the places instead, which are only learned from."""
    copies: int = 0
    """So many shifted copies of each crop instead, by which no trial is judged."""
    network: AnyNetwork | None = None
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


def look_at_trial(
    trial: CameraTrial, cuts: Cuts, families: Sequence[str], cache: Path
) -> dict[str, NDArray[np.float32]]:
    """Return what one trial's crops show, from the cache where it has it.

    Args:
        trial: Not shorter than a crop.
        cuts: Which crops of it.
        families: Names in `FAMILIES`.
        cache: Folder to keep files in.

    Returns:
        Family → shape (places, rows, cameras, columns).

    Raises:
        RecordingFailed: The disk refused.
        BadTable: A video cannot be read.
    """
    part = moving_part(trial, cuts.layout, cache)
    files = _files(trial, cuts, part, families, cache)
    found = {name: _kept(files[name], trial, cuts, name) for name in families}
    lacking = [name for name in families if found[name] is None]
    if lacking:
        for name, values in _compute(trial, cuts, part, lacking).items():
            save_kept(files[name], values.reshape(-1, values.shape[-1]))
            found[name] = values
    return {name: values for name, values in found.items() if values is not None}


def is_kept(trial: CameraTrial, cuts: Cuts, families: Sequence[str], cache: Path) -> bool:
    """Return whether the cache has files of what a trial's crops show; none is opened.

    Args:
        trial: Not shorter than a crop.
        cuts: Which crops of it.
        families: Names in `FAMILIES`.
        cache: Folder of the files.
    """
    layout = cuts.layout
    if layout.moving and layout.places > 1 and not _changes_file(trial, layout, cache).exists():
        return False
    part = moving_part(trial, layout, cache)
    return all(file.exists() for file in _files(trial, cuts, part, families, cache).values())


def _files(
    trial: CameraTrial, cuts: Cuts, part: range, families: Sequence[str], cache: Path
) -> dict[str, Path]:
    folder = cuts.key(len(part) == trial.frames)
    return {name: _file(trial, cuts, name, cache / "trials", folder) for name in families}


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


def moving_part(trial: CameraTrial, layout: Layout, cache: Path) -> range:
    """Return the frames of a trial of which its crops are cut.

    Args:
        trial: Not shorter than a crop.
        layout: How it is cut.
        cache: Folder to keep in how much it moves.

    Raises:
        RecordingFailed: The disk refused.
        BadTable: A video cannot be read.
    """
    return part_of(layout, trial.frames, lambda: _changes(trial, layout, cache))


def _changes(trial: CameraTrial, layout: Layout, cache: Path) -> NDArray[np.float32]:
    """Return how much each frame of a trial differs from others, from the cache where it has it.

    Returns:
        Shape (frames, 3), as `taxel.windows.trial_stretch.Changes` measures it.
    """
    file = _changes_file(trial, layout, cache)
    values = load_kept(file, 3)
    if values is None or len(values) != trial.frames:
        values = np.array(changes_of(trial.moments(), layout.step), np.float32)
        save_kept(file, values)
    return values


def _changes_file(trial: CameraTrial, layout: Layout, cache: Path) -> Path:
    return cache / "trials" / f"{CHANGES}-by-{layout.step}" / f"{trial.digest[:32]}.npy"


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
