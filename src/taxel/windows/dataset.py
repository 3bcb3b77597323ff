"""Data sets: recordings of one kind, cut into windows that know their trials.

Knows nothing about splits, scaling or models.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadDataset
from taxel.labels.class_order import in_order
from taxel.labels.joined import with_joined_label, with_joined_labels
from taxel.labels.trials import TIME, Trial, group_value, trials_of
from taxel.plain_text import number_of
from taxel.recordings.reader import list_recordings, read_recording
from taxel.signals import Samples, SensorInfo
from taxel.windows.checks import (
    OUTSIDE,
    check_classes,
    check_indices,
    check_sensor,
    check_size,
    filled_note,
    grid_note,
    labels_of,
    nothing_found,
    nothing_usable,
    rare_note,
    too_old,
)
from taxel.windows.config import WindowConfig
from taxel.windows.level_follow import KnownLevel, UsualLevel, followed_factors, parse_level_follow
from taxel.windows.rates import fit_age, fit_gap, rates_note, rates_of
from taxel.windows.reference import Reference, brought_to_level
from taxel.windows.stretches import owners_of, whole_stretches
from taxel.windows.windower import Windows, cut_windows

LABEL_THEM = "label the recordings: taxel label RECORDINGS --intervals TABLE --output FOLDER"
"""What helps where trials lack the label, for messages."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Dataset:
    """Windows, each inside one trial."""

    windows: Windows
    """All windows that lie in a trial and hold usable values only; n of them."""
    trial: NDArray[np.intp]
    """Shape (n,): each window's index into `trials`."""
    trials: tuple[Trial, ...]
    """All trials that gave at least one window."""
    sensor: SensorInfo
    """The array that all recordings share."""
    config: WindowConfig
    """How the windows were cut."""
    digest: str
    """SHA-256 over the recordings' values, hexadecimal."""
    notes: tuple[str, ...]
    """What a reader must know: windows and trials left out and why, windows padded,
    a slow grid, rare classes."""
    reference: Reference | None = None
    """The level that all sessions were brought to; None where values are as measured."""
    to_level: NDArray[np.float32] | None = None
    """What each trial's values were multiplied by for that, shape (trials, channels)."""
    tested_level: NDArray[np.float32] | None = None
    """What they are multiplied by where a trial is tested, likewise; None: the same."""
    usual: UsualLevel | None = None
    """The level that each session's was followed from; None where levels are not followed."""
    missing: int = 0
    """Windows that were left out, as they hold values that are missing or NaN."""
    fingerprints: Mapping[str, str] = field(default_factory=dict)
    """Recording's file name → SHA-256 over its values, hexadecimal: the same touch is known
    again under another name."""
    unlabelled: tuple[Trial, ...] = ()
    """Trials that gave windows and were left out, as they lack the label that is predicted."""
    empty: tuple[Trial, ...] = ()
    """Trials that gave no window."""
    spans: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """Recording's name without ending → its first and last scan, seconds on its fitted clock."""

    def __len__(self) -> int:
        return len(self.windows)

    def classes(self, target: str) -> list[str]:
        """Return the values of a label, sorted; numbers as numbers.

        Raises:
            BadDataset: A trial lacks it.
        """
        return list(in_order(labels_of(self.trials, target)))

    def only_trials(self, kept: Collection[int]) -> Dataset:
        """Return some of the trials with their windows; nothing of the others remains.

        Args:
            kept: Indices into `trials`; their order stays.

        Raises:
            BadDataset: There is no such trial.
        """
        index = np.array(sorted(kept), np.intp)
        check_indices(index, len(self.trials))
        own = np.isin(self.trial, index)
        trials = tuple(self.trials[i] for i in index)
        names = {trial.recording for trial in trials}
        return replace(
            self,
            windows=self.windows[own],
            trial=np.searchsorted(index, self.trial[own]).astype(np.intp),
            trials=trials,
            to_level=None if self.to_level is None else self.to_level[index],
            tested_level=None if self.tested_level is None else self.tested_level[index],
            fingerprints={k: v for k, v in self.fingerprints.items() if k in names},
        )

    def tested(self, index: NDArray[np.intp]) -> Windows:
        """Return some windows as they are where their trials are tested.

        Args:
            index: Their places, shape (m,).
        """
        windows = self.windows[index]
        if self.tested_level is None or self.to_level is None:
            return windows
        change = (self.tested_level / self.to_level)[self.trial[index]]
        return replace(windows, values=windows.values * change[:, None, :])

    def class_numbers(self, target: str) -> NDArray[np.intp]:
        """Return each window's class as an index into `classes(target)`, shape (n,).

        Raises:
            BadDataset: A trial lacks the label.
        """
        index = {name: number for number, name in enumerate(self.classes(target))}
        by_trial = np.array([index[name] for name in labels_of(self.trials, target)], np.intp)
        return by_trial[self.trial]

    def group(self, key: str) -> NDArray[np.str_]:
        """Return each trial's group, shape (trials,); for the key "time", where no trial has such a
        group, when each begins.

        Raises:
            BadDataset: A trial has no such group; or for "time" there are several recordings, each
                with a clock of its own.
        """
        known = sorted({name for trial in self.trials for name in trial.groups})
        begins = key == TIME and TIME not in known
        many = len({trial.recording for trial in self.trials})
        if begins and many > 1:
            raise BadDataset(
                f"one recording with all trials, to order them by {TIME}",
                f"{many} recordings, each with a clock of its own",
                "name a group of numbers, such as one for the day or the trial",
            )
        values = [group_value(trial, key) for trial in self.trials]
        if any((own is None) or (key not in t.groups and not begins)
               for own, t in zip(values, self.trials, strict=True)):  # fmt: skip
            raise BadDataset(
                f"the group {key!r} on every trial",
                f"trials with the groups {', '.join(known)}",
                "name one of those, or import again with a group column for it",
            )
        return np.array(values)


def load_dataset(
    path: Path | str,
    config: WindowConfig,
    *,
    target: str | None = None,
    where: Mapping[str, str] | None = None,
    unusable: bool = False,
    usual: KnownLevel | None = None,
) -> Dataset:
    """Cut all recordings of a folder, or one recording, into windows.

    Args:
        path: A folder of recordings, or one.
        config: What a window is.
        target: The label to predict, or several joined by "+", such as "shape+material"; trials
            without it are left out. None keeps all.
        where: Only trials whose label or group has this value, such as {"task": "shape"}.
        unusable: Also keep windows of missing, stale or NaN values, which live answers UNKNOWN.
        usual: The level that a bundle's sessions are followed from, where its window says that
            levels follow; None to learn it.

    Raises:
        BadRecording: A recording is damaged.
        BadDataset: There is no recording, no window, the sensors differ, or their rates where
            their own scans are rows, no trial has the target, or all are of one class.
    """
    path = Path(path)
    paths = list_recordings(path)
    stated = config.max_age_s is not None and config.grid_hz is None  # then no rate is asked for
    rates_hz = [] if stated else rates_of(paths)
    config = fit_gap(fit_age(config, rates_hz), rates_hz)
    cut = _cut_all(paths, config, where or {})
    if cut is None:
        raise nothing_found(path, config, where)
    if not unusable and not cut.windows.ready.any():
        stretches = whole_stretches(paths, config, cut.trials)
        raise nothing_usable(len(cut.windows), cut.stale, config, stretches)
    made = follow_levels(_assemble(cut, config, keep=unusable), config.level_follow, usual)
    made = replace(made, notes=(*rates_note(config, rates_hz), *made.notes))
    if target is None:
        return made
    made = only_labelled(made, target, path)
    empty = [with_joined_label(trial, target) for trial in made.empty]
    check_classes(made.trials, target, empty)
    return replace(made, notes=(*made.notes, *rare_note(made.trials, target)))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Cut:
    """All windows of some recordings."""

    windows: Windows
    trial: NDArray[np.intp]
    """Shape (n,): each window's trial."""
    trials: list[Trial]
    sensor: SensorInfo
    outside: int
    """Windows that were left out, as they lie across a trial's border or outside."""
    stale: int
    """Windows that hold rows whose latest scan is too old."""
    digest: str
    fingerprints: dict[str, str]
    spans: dict[str, tuple[float, float]]


def _cut_all(paths: list[Path], config: WindowConfig, where: Mapping[str, str]) -> _Cut | None:
    """Return the windows of recordings that lie in a wanted trial; None where there is none."""
    sensor: SensorInfo | None = None
    trials: list[Trial] = []
    parts: list[Windows] = []
    owners: list[NDArray[np.intp]] = []
    outside = stale = 0
    digest, fingerprints, spans = hashlib.sha256(), {}, {}
    for file in paths:
        recording = read_recording(file)
        samples, about = recording.samples, recording.manifest.sensor
        digest.update(samples.values.tobytes())
        fingerprints[file.name] = hashlib.sha256(samples.values.tobytes()).hexdigest()
        sensor = sensor or about
        check_sensor(sensor, about, file, config)
        if not len(samples):
            continue
        first_s, last_s = samples.fitted_s[[0, -1]].tolist()
        spans[file.stem] = first_s, last_s
        own = trials_of(file, recording.manifest, recording.marks, first_s, last_s)
        windows = cut_windows(samples, config, about)
        owner = owners_of(windows, own)
        wanted = np.array([_matches(trial, where) for trial in own], bool)
        outside += int((owner < 0).sum())
        kept = (owner >= 0) & wanted[owner]
        parts.append(windows[kept])
        stale += _stale(parts[-1], samples, config, about)
        owners.append((np.cumsum(wanted) - 1)[owner[kept]] + len(trials))
        trials += [trial for trial, own_wanted in zip(own, wanted, strict=True) if own_wanted]
    if sensor is None or not sum(map(len, parts)):
        return None
    return _Cut(
        windows=Windows.join(parts), trial=np.concatenate(owners), trials=trials, sensor=sensor,
        outside=outside, stale=stale, digest=digest.hexdigest(), fingerprints=fingerprints,
        spans=spans,
    )  # fmt: skip


def _assemble(cut: _Cut, config: WindowConfig, *, keep: bool) -> Dataset:
    windows, trial, stale = cut.windows, cut.trial, cut.stale
    whole = windows.ready
    if keep:
        whole, stale = np.ones(len(windows), bool), 0
    notes = grid_note(cut.sensor, config)
    if cut.outside:
        notes.append(f"{number_of(cut.outside, 'window')} {OUTSIDE}, without a label: left out")
    if stale:
        notes.append(
            f"{number_of(stale, 'window')} with rows whose latest scan is {too_old(config)}: "
            "left out; --window grid=own takes each scan as a row"
        )
    if unusable := int((~whole).sum()) - stale:
        noun = "scan" if config.steps == 1 else "window"
        notes.append(f"{number_of(unusable, noun)} with missing values or NaN: left out")
    windows, trial = windows[whole], trial[whole]
    notes += filled_note(windows)
    if windows.padded:
        notes.append(
            f"{windows.padded} of {number_of(len(windows), 'sequence')} shorter than "
            f"{number_of(config.steps, 'row')}: padded and masked"
        )
    if not keep:
        check_size(windows.values, cut.sensor.only(config.channels).channels, lambda at: (
            f"{cut.trials[trial[at]].recording}, in the window from {windows.start_s[at]:.2f} s"
        ))  # fmt: skip
    used, trial = np.unique(trial, return_inverse=True)
    if without := len(cut.trials) - len(used):
        notes.append(
            f"{without} of {number_of(len(cut.trials), 'trial')} without a window: too short, "
            "below the gate or not usable"
        )
    kept = tuple(cut.trials[index] for index in used)
    empty = tuple(cut.trials[index] for index in sorted(set(range(len(cut.trials))) - set(used)))
    reference = to_level = None
    if config.reference is not None:
        windows, trial, kept, reference, to_level = brought_to_level(
            windows, trial, kept, config.reference
        )
        notes.append(
            f"each session's channels scaled by its reference touches ({reference.touches}), "
            "which are left out"
        )
    return Dataset(
        windows=windows,
        trial=trial.astype(np.intp),
        trials=kept,
        sensor=cut.sensor.only(config.channels),
        config=config,
        digest=cut.digest,
        fingerprints=cut.fingerprints,
        spans=cut.spans,
        notes=tuple(notes),
        reference=reference,
        to_level=to_level,
        missing=max(unusable, 0),
        empty=empty,
    )


def follow_levels(dataset: Dataset, text: str | None, usual: KnownLevel | None = None) -> Dataset:
    """Return a data set whose touches are scaled by their session's level before them.

    Args:
        dataset: As measured.
        text: As `WindowConfig.level_follow` has it; None returns the data set as it is.
        usual: The level to follow from, as `followed_factors` takes it.

    Raises:
        BadDataset: A trial lacks the group.
    """
    if text is None:
        return dataset
    windows, follow = dataset.windows, parse_level_follow(text)
    found = followed_factors(windows, dataset.trial, dataset.trials, follow, usual)
    factor = found.learned_from
    levelled = replace(windows, values=windows.values * factor[dataset.trial, None, :])
    return replace(
        dataset, windows=levelled, config=replace(dataset.config, level_follow=text),
        to_level=factor, tested_level=found.tested, usual=found.usual,
    )  # fmt: skip


def _stale(windows: Windows, samples: Samples, config: WindowConfig, sensor: SensorInfo) -> int:
    """Return how many windows are not usable for the age of their scans alone."""
    bad = ~windows.ready
    if not bad.any() or config.grid_hz is None:
        return 0
    ageless = cut_windows(samples, replace(config, max_age_s=math.inf), sensor)
    return int(np.isin(windows.start_s[bad], ageless.start_s[ageless.ready]).sum())


def _matches(trial: Trial, where: Mapping[str, str]) -> bool:
    known = {**trial.groups, **trial.labels}
    return all(known.get(key) == value for key, value in where.items())


def only_labelled(
    dataset: Dataset, target: str, folder: Path, mend: str = f"name one of those, or {LABEL_THEM}"
) -> Dataset:
    """Return the trials that have the target's label, with a note of how many were left out.

    Args:
        dataset: Any.
        target: The label; "a+b" where both are to be predicted together.
        folder: Where the trials are from, for the message.
        mend: What helps where none has the label; unless given, another target may be named.

    Raises:
        BadDataset: No trial has it, or values of "a+b" that differ would be joined to one.
    """
    trials = with_joined_labels(dataset.trials, target, folder)
    kept = [i for i, trial in enumerate(trials) if target in trial.labels]
    whole = replace(dataset, trials=trials)
    if not kept:
        known = ", ".join(sorted({name for trial in trials for name in trial.labels})) or "none"
        raise BadDataset(
            f"trials with the label {target!r}", f"trials with the labels {known} in {folder}", mend
        )
    if len(kept) == len(trials):
        return whole
    note = f"{len(trials) - len(kept)} of {len(trials)} trials lack the label {target!r}: left out"
    left = tuple(trial for trial in trials if target not in trial.labels)
    return replace(whole, notes=(*dataset.notes, note), unlabelled=left).only_trials(kept)
