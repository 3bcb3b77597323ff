"""What crops of camera trials show, as rows of numbers; each trial's come from a cache.

Trials that the cache lacks are looked at side by side where an engine is in use. Knows nothing
about labels, folds or models.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.jobs.running import as_done, shared_out
from taxel.training.camera_trials.image_network import stored_network
from taxel.training.camera_trials.learning import Crops, Moved
from taxel.training.camera_trials.one_trial import Cuts, is_kept, look_at_trial, moving_part
from taxel.training.frames.jobs import other_disk
from taxel.windows.camera_trials import CameraTrial, check_unchanged
from taxel.windows.trial_crops import row_of, rows_alone
from taxel.windows.trial_layout import Layout

OnTrial = Callable[[int, int], None]
"""Called with trials done and in all."""


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


def trial_rows(
    trials: Sequence[CameraTrial],
    cuts: Cuts,
    families: Sequence[str],
    cache: Path,
    on_trial: OnTrial = lambda done, of: None,
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
        BadInput: A worker has another cache.
        BadDataset: A worker has other images.
    """
    shown: dict[str, list[NDArray[np.float32]]] = {name: [] for name in families}
    filled = _fill(trials, cuts, families, cache, on_trial)
    for done, trial in enumerate(trials, start=1):
        for name, values in look_at_trial(trial, cuts, families, cache).items():
            shown[name].append(values)
        if not filled:
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


def _fill(
    trials: Sequence[CameraTrial],
    cuts: Cuts,
    families: Sequence[str],
    cache: Path,
    on_trial: OnTrial,
) -> bool:
    """Let workers compute what the cache lacks; return whether there are any workers."""
    if not shared_out():
        return False
    missing = [trial for trial in trials if not is_kept(trial, cuts, families, cache)]
    missing.sort(key=lambda trial: -trial.frames)  # the longest last would keep one worker alone
    if missing and cuts.network is not None and "network" in families:
        cuts = replace(cuts, network=stored_network(cuts.network, cache))
    kept, where = len(trials) - len(missing), cache.absolute()
    jobs = [(replace(trial, slip_um=None), cuts, tuple(families), where) for trial in missing]
    names = [trial.name for trial in missing]
    for done, (number, _) in enumerate(as_done(_leave, jobs, names=names), start=1):
        if not is_kept(missing[number], cuts, families, cache):
            raise other_disk(cache)
        on_trial(kept + done, len(trials))
    return True


def _leave(trial: CameraTrial, cuts: Cuts, families: Sequence[str], cache: Path) -> None:
    """Leave what a trial's crops show in the cache; a job for any worker."""
    check_unchanged(trial)
    look_at_trial(trial, cuts, families, cache)


def _moving_part(trial: CameraTrial, layout: Layout, cache: Path) -> range:
    """Return what `moving_part` does; a job for any worker."""
    check_unchanged(trial)
    return moving_part(trial, layout, cache)


def all_moves(
    trials: Sequence[CameraTrial],
    layout: Layout,
    cache: Path,
    on_trial: OnTrial = lambda done, of: None,
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
    shared, names = shared_out(), [trial.name for trial in trials]
    jobs = [(replace(trial, slip_um=None), layout, cache.absolute()) for trial in trials]
    looked = as_done(_moving_part if shared else moving_part, jobs, None if shared else 1, names)
    with closing(looked):  # those that have not begun need not be looked at
        for done, (number, part) in enumerate(looked, start=1):
            if len(part) < trials[number].frames:
                return False
            on_trial(done, len(trials))
    return True
