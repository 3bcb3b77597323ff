"""What is audited: labelled trials of an array or of tactile cameras, in one shape.

A camera's frame becomes a row of small grey squares, so that every check is written once for
both systems. Knows nothing about files, splits or checks.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadDataset
from taxel.labels.class_order import figures_as_classes, in_order
from taxel.labels.trials import OBJECTS, SESSIONS, Trial
from taxel.plain_text import number_of
from taxel.signals import SensorInfo
from taxel.windows.config import WindowConfig
from taxel.windows.dataset import Dataset
from taxel.windows.joining import TEST_PREFIX, renamed
from taxel.windows.windower import Windows

LEAST_TRIALS = 8
"""Fewer labelled trials allow no statement. Source: our choice, docs/decisions/0023."""

_SHOWN_CLASSES = 8
"""Classes that a message lists. Source: our choice, docs/decisions/0023."""

LEAST_ROWS = 3
"""A shorter trial shows neither a start nor a change. Source: our choice, docs/decisions/0023."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TouchSet:
    """Labelled trials; all sequences share their first axis, one entry a trial."""

    kind: Literal["array", "camera"]
    target: str
    """The label that is to be predicted."""
    trials: tuple[Trial, ...]
    rows: tuple[NDArray[np.float32], ...]
    """Each shape (rows, channels), oldest first: units of the array, or grey levels 0…255."""
    time_s: tuple[NDArray[np.float64], ...]
    """Each shape (rows,): the recording's fitted clock, seconds."""
    views: tuple[str, ...]
    """One a channel: the camera that it belongs to; all alike for an array."""
    channels: tuple[str, ...] = ()
    """Names of an array's channels; empty where nobody knows them."""
    squares: tuple[int, int] | None
    """Rows and columns of a camera's small frame; None for an array."""
    created: tuple[str, ...]
    """When each trial's recording began, wall time, ISO 8601; empty where it is not known."""
    files: tuple[Mapping[str, str], ...]
    """What the file says beside labels and groups: serial number, rate, size …"""
    notes: tuple[str, ...] = ()
    left_out: tuple[Trial, ...] = ()
    """Trials that are there and are not audited: too short, or without the label."""
    every: Mapping[str, int] = field(default_factory=dict)
    """Recording → of so many rows one is held; only those that are thinned, in too large a set."""
    scans: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    """Recording → how many usable values each channel has over all of its scans, their sum and
    the sum of their squares, shape (3, channels); empty where nothing but trials is known."""

    def __len__(self) -> int:
        return len(self.trials)

    @property
    def rate_hz(self) -> float:
        """Rows a second, of the middle trial."""
        return float(np.median([(len(t) - 1) / max(t[-1] - t[0], 1e-9) for t in self.time_s]))

    @property
    def classes(self) -> list[str]:
        """The label's values, sorted; numbers as numbers."""
        return list(in_order(trial.labels[self.target] for trial in self.trials))

    @property
    def y(self) -> NDArray[np.intp]:
        """Shape (trials,): each one's class as an index into `classes`."""
        index = {name: number for number, name in enumerate(self.classes)}
        return np.array([index[trial.labels[self.target]] for trial in self.trials], np.intp)

    def only(self, kept: NDArray[np.intp]) -> TouchSet:
        """Return some of the trials by their indices, shape (m,), in the order given."""
        return replace(
            self,
            trials=tuple(self.trials[i] for i in kept),
            rows=tuple(self.rows[i] for i in kept),
            time_s=tuple(self.time_s[i] for i in kept),
            created=tuple(self.created[i] for i in kept),
            files=tuple(self.files[i] for i in kept),
        )

    def group(self, key: str) -> NDArray[np.str_] | None:
        """Return each trial's group, shape (trials,); None where a trial has none."""
        if any(key not in trial.groups for trial in self.trials):
            return None
        return np.array([trial.groups[key] for trial in self.trials])

    def keys(self, wanted: tuple[str, ...]) -> list[str]:
        """Return those of some groups that every trial has."""
        return [key for key in wanted if self.group(key) is not None]


def joined(first: TouchSet, second: TouchSet) -> TouchSet:
    """Return the trials of two folders, those of the second renamed so that they stay apart.

    Raises:
        BadDataset: They are of different sensors.
    """
    if first.channels != second.channels and first.views == second.views:
        raise BadDataset(
            f"the channels {', '.join(first.channels)} in both folders",
            f"{', '.join(second.channels)} in the one to test on", "name recordings of one sensor",
        )  # fmt: skip
    if (first.kind, first.views) != (second.kind, second.views):
        raise BadDataset(
            f"the same sensor in both folders ({first.kind}, "
            f"{number_of(len(first.views), 'channel')})",
            f"{second.kind}, {number_of(len(second.views), 'channel')} in the one to test on",
            "name recordings of one sensor",
        )  # fmt: skip
    there = {name: f"{TEST_PREFIX}{name}" for name in (*second.every, *second.scans)}
    return replace(
        first,
        trials=first.trials + tuple(renamed(trial) for trial in second.trials),
        rows=first.rows + second.rows,
        time_s=first.time_s + second.time_s,
        created=first.created + second.created,
        files=first.files + second.files,
        notes=tuple(dict.fromkeys((*first.notes, *second.notes))),
        left_out=first.left_out + tuple(renamed(trial) for trial in second.left_out),
        every={**first.every, **{there[name]: n for name, n in second.every.items()}},
        scans={**first.scans, **{there[name]: own for name, own in second.scans.items()}},
    )


def checked(touch: TouchSet) -> TouchSet:
    """Return the set, or refuse one that allows no statement.

    Raises:
        BadDataset: There are too few trials, one class only, or one trial a class.
    """
    if len(touch) < LEAST_TRIALS or not 1 < len(touch.classes) < len(touch):
        shown = ", ".join(touch.classes[:_SHOWN_CLASSES]) or "none"
        if len(touch.classes) > _SHOWN_CLASSES:
            shown = f"{len(touch.classes)} classes, such as {shown}"
        labels = [trial.labels[touch.target] for trial in touch.trials]
        raise BadDataset(
            f"at least {LEAST_TRIALS} trials of at least two classes of {touch.target!r}, several "
            "of a class",
            f"{len(touch)} of {shown}",
            figures_as_classes(labels, touch.target) or "record or import more of them",
        )
    return touch


@dataclass(frozen=True, slots=True, kw_only=True)
class Pieces:
    """Stretches of trials that a split moves; n of them."""

    trial: NDArray[np.intp]
    """Shape (n,): index into `TouchSet.trials`."""
    first: NDArray[np.intp]
    """Shape (n,): the first row within the trial."""
    stop: NDArray[np.intp]
    """Shape (n,): one past the last row."""
    view: NDArray[np.str_]
    """Shape (n,): the one camera or finger that the piece shows; empty for all."""
    label_s: NDArray[np.float64]
    """Shape (n,): the moment that the piece is labelled for; NaN where none is named."""

    def __len__(self) -> int:
        return len(self.trial)

    def start_s(self, touch: TouchSet) -> NDArray[np.float64]:
        """Return the time of each first row, shape (n,)."""
        pairs = zip(self.trial, self.first, strict=True)
        return np.array([touch.time_s[t][i] for t, i in pairs])

    def end_s(self, touch: TouchSet) -> NDArray[np.float64]:
        """Return the time of each last row, shape (n,)."""
        pairs = zip(self.trial, self.stop, strict=True)
        return np.array([touch.time_s[t][i - 1] for t, i in pairs])


_LEAST_PURE = 8
_QUARTER, _SHORT, _LONG, _FAST_HZ, _LONG_S = 4, 16, 256, 150.0, 2.56
"""A window is a quarter of the middle trial, at most 256 rows (2.56 s above 150 Hz) and no longer
than nine trials of ten; of trials shorter than 16 rows it is the whole. Source: our choice,
docs/decisions/0023."""


def usual_steps(touch: TouchSet) -> int:
    """Return how many rows a window has unless the user says so."""
    lengths = [len(rows) for rows in touch.rows]
    middle, low = int(np.median(lengths)), int(np.percentile(lengths, 10))
    rate_hz = touch.rate_hz
    longest = _LONG if rate_hz <= _FAST_HZ else round(_LONG_S * rate_hz)
    return max(lengths) if middle < _SHORT else max(2, min(middle // _QUARTER, low, longest))


def cut_pieces(touch: TouchSet, steps: int, stride: int) -> Pieces:
    """Return all windows; a trial shorter than one is one as a whole."""
    trial, first, stop = [], [], []
    for index, rows in enumerate(touch.rows):
        for start in range(0, max(1, len(rows) - steps + 1), stride):
            trial.append(index)
            first.append(start)
            stop.append(min(start + steps, len(rows)))
    n = len(trial)
    return Pieces(
        trial=np.array(trial, np.intp), first=np.array(first, np.intp),
        stop=np.array(stop, np.intp), view=np.full(n, ""), label_s=np.full(n, np.nan),
    )  # fmt: skip


def as_dataset(touch: TouchSet, pieces: Pieces, steps: int, stride: int) -> Dataset:
    """Return the pieces as a data set without values, for `splits.parse_split`."""
    n = len(pieces)
    windows = Windows(
        np.zeros((n, 1, 1), np.float32), np.ones((n, 1), bool), np.ones(n, np.float32),
        np.zeros(n, np.float32), pieces.start_s(touch), pieces.end_s(touch),
    )  # fmt: skip
    return Dataset(
        windows=windows,
        trial=pieces.trial,
        trials=touch.trials,
        sensor=SensorInfo(name="audit", channels=("-",), units=("1",), rate_hz=0.0),
        config=WindowConfig(steps=steps, stride=stride),
        digest="",
        notes=(),
    )


def honest_key(touch: TouchSet) -> str | None:
    """Return the group to hold out whole: the first that every class has at least two of.

    Sessions come first, then objects, then others with several trials a group; None where only
    the trials themselves remain. Groups of one class each need to be eight at least: fewer can be
    dealt out anew in too few ways to be sure of anything.
    """
    others = [key for key in sorted(touch.trials[0].groups) if key not in SESSIONS + OBJECTS]
    for key in touch.keys((*SESSIONS, *OBJECTS, *_files_of_several(others))):
        groups = touch.group(key)
        if groups is None or len(set(groups)) > 0.75 * len(touch):
            continue
        names = set(groups)
        pure = all(len(set(touch.y[groups == name])) == 1 for name in names)
        if pure and len(names) < _LEAST_PURE:
            continue
        if all(len(set(groups[touch.y == c])) > 1 for c in range(len(touch.classes))):
            return key
    return None


def _files_of_several(keys: list[str]) -> tuple[str, ...]:
    """Return groups that name files or runs of several trials."""
    known = ("run", "file", "recording")
    return tuple(key for key in known if key in keys)


def counts(touch: TouchSet) -> dict[str, int]:
    """Return how many trials each class has."""
    found = Counter(t.labels[touch.target] for t in touch.trials)
    return {name: found[name] for name in in_order(found)}


def group_values(touch: TouchSet) -> dict[str, dict[str, int]]:
    """Return every group that trials share, with each of its values in full and its trials."""
    found = {}
    for key in sorted({key for trial in touch.trials for key in trial.groups}):
        count = Counter(trial.groups[key] for trial in touch.trials if key in trial.groups)
        if len(count) < sum(count.values()):
            found[key] = {name: count[name] for name in in_order(count)}
    return found
