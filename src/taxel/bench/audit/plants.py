"""Leaks to be planted in simulated recordings of both systems.

Each changes recordings that are clean, or splits them badly, in one or a few ways that the audit
must name. Knows nothing about how leaks are found.
"""

from __future__ import annotations

import csv
import json
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.evaluation.audit.reading import read_touch
from taxel.evaluation.audit.sides import Sides, named_sides, table_sides
from taxel.evaluation.audit.touch_set import Pieces, TouchSet, usual_steps
from taxel.labels.trials import Trial
from taxel.recordings.manifest import Manifest
from taxel.recordings.writer import Recorder
from taxel.signals import Samples, SensorInfo

Split = tuple[Pieces, Sides] | None
Planted = tuple[TouchSet, Split, Path | None]
"""Recordings, their split, and a run's folder."""


@dataclass(frozen=True, slots=True)
class Plant:
    """One way of spoiling clean recordings."""

    kinds: tuple[str, ...]
    """Findings that must be alarms."""
    make: Callable[[TouchSet, Path], Planted]
    """Clean recordings and a folder for files → spoilt ones."""
    arrays_only: bool = False


def _copies(touch: TouchSet, _: Path) -> Planted:
    """Copies of three trials as they are, of three scaled with noise, of three run backwards."""
    rng = np.random.default_rng(1)

    def near(rows: NDArray[np.float32]) -> NDArray[np.float32]:
        noise = rng.normal(0.0, 1.0, rows.shape) * 0.05 * rows.std(axis=0)
        return np.asarray(1.3 * rows + 2.0 + noise, np.float32)

    ways: Sequence[Callable[[NDArray[np.float32]], NDArray[np.float32]]] = (
        lambda rows: rows.copy(), near, lambda rows: rows[::-1].copy(),
    )  # fmt: skip
    spoilt = touch
    for place, index in enumerate(_lively(touch, 9)):
        spoilt = _append(spoilt, index, ways[place % 3](touch.rows[index]))
    return spoilt, None, None


def _copies_across(touch: TouchSet, folder: Path) -> Planted:
    """Copies of trials in the test part of a table, their originals in training."""
    spoilt, _, _ = _copies(touch, folder)
    names = [t.groups["recording"] if i < len(touch) else "copy" for i, t in
             enumerate(spoilt.trials)]  # fmt: skip
    lines = [[t.groups["recording"], t.start_s, t.end_s,
              "test" if names[i] == "copy" or i % 5 == 0 else "train"]
             for i, t in enumerate(spoilt.trials)]  # fmt: skip
    return spoilt, _table(spoilt, folder, ["recording", "start_s", "end_s", "side"], lines), None


def _shifted_at_250_hz(touch: TouchSet, folder: Path) -> Planted:
    """In files of 250 Hz, copies that start an odd number of rows later, or run backwards.

    Two as they are, two times 1.1 with noise, two backwards.
    """
    rng = np.random.default_rng(3)
    spoilt = touch
    for place, index in enumerate(_lively(touch, 6)):
        rows = touch.rows[index]
        if place % 3 == 1:
            rows = 1.1 * rows + rng.normal(0.0, 1.0, rows.shape) * 0.01 * rows.std(axis=0)
        elif place % 3 == 2:
            rows = rows[::-1]
        spoilt = _append(spoilt, index, rows[(1, 3, 7)[place % 3] :].astype(np.float32))
    return _as_files(spoilt, folder, 250.0), None, None


def _scaled_at_250_hz(touch: TouchSet, folder: Path) -> Planted:
    """Files of 250 Hz with mean 0 and deviation 1 over the whole set."""
    return _as_files(_scaled_before(touch, folder)[0], folder, 250.0), None, None


def _shorter(touch: TouchSet, _: Path) -> Planted:
    """Trials of all classes but the commonest are cut to half of the shortest trial."""
    short = min(map(len, touch.rows)) // 2
    keep = [len(r) if usual else max(3, short)
            for r, usual in zip(touch.rows, _usual(touch), strict=True)]  # fmt: skip
    return replace(
        touch,
        rows=tuple(r[:n] for r, n in zip(touch.rows, keep, strict=True)),
        time_s=tuple(t[:n] for t, n in zip(touch.time_s, keep, strict=True)),
    ), None, None  # fmt: skip


def _first_rows(touch: TouchSet, _: Path) -> Planted:
    """The first row is offset by a class's own pattern."""
    return _offset(touch, slice(0, 1)), None, None


def _levels(touch: TouchSet, _: Path) -> Planted:
    """All rows are offset by a class's own pattern."""
    return _offset(touch, slice(None)), None, None


def _own_sessions(touch: TouchSet, _: Path) -> Planted:
    """Each class in a session, by two operators, with two firmwares and at a time of its own."""
    order = np.argsort(touch.y, kind="stable")
    rank = np.empty(len(order), int)
    rank[order] = np.arange(len(order))
    trials = tuple(
        replace(t, groups={**t.groups, "session": f"day-{c}", "operator": f"person-{c}-{r % 2}"})
        for t, c, r in zip(touch.trials, touch.y, rank, strict=True)
    )
    return replace(
        touch, trials=trials,
        created=tuple(f"2026-01-01T{r // 60:02d}:{r % 60:02d}:00Z" for r in rank),
        files=tuple({**f, "firmware": f"1.{c}.{r // 2 % 2}"} for f, c, r in
                    zip(touch.files, touch.y, rank, strict=True)),
    ), None, None  # fmt: skip


def _scaled_before(touch: TouchSet, _: Path) -> Planted:
    """All rows are brought to mean 0 and deviation 1 over the whole set."""
    rows = np.concatenate(touch.rows).astype(np.float64)
    mean, spread = rows.mean(axis=0), rows.std(axis=0)
    spread = np.where(spread > 0, spread, 1.0)
    scaled = tuple(((r - mean) / spread).astype(np.float32) for r in touch.rows)
    return replace(touch, rows=scaled), None, None


def _scaled_run(touch: TouchSet, folder: Path) -> Planted:
    """A run whose scaling was fitted on all recordings."""
    rows = np.concatenate(touch.rows).astype(np.float64)
    spread = np.where(rows.std(axis=0) > 0, rows.std(axis=0), 1.0)
    scaling = {"kind": "standard", "offset": rows.mean(axis=0).tolist(),
               "factor": (1.0 / spread).tolist()}  # fmt: skip
    run = Path(tempfile.mkdtemp(dir=folder))
    (run / "run.json").write_text(json.dumps({"contract": {"scaling": scaling, "accuracy": {}}}))
    return touch, named(touch, f"group:{_group(touch)}"), run


def _random_windows(touch: TouchSet, _: Path) -> Planted:
    """Windows dealt out at random, with unseen sessions and objects claimed."""
    touch = _with_sessions(touch)
    objects = "object" if touch.group("object") is not None else "cup"
    return touch, named(touch, "random", ("session", objects)), None


def _window_table(touch: TouchSet, folder: Path) -> Planted:
    """Windows that overlap by half, one finger or camera each, labelled for their middle."""
    steps = usual_steps(touch)
    views = list(dict.fromkeys(touch.views))
    views = views if len(views) > 1 else ["finger-1", "finger-2"]
    lines = []
    for trial, time_s in zip(touch.trials, touch.time_s, strict=True):
        for number, start in enumerate(range(0, len(time_s) - steps + 1, max(1, steps // 2))):
            middle, end = time_s[start + steps // 2], time_s[start + steps - 1]
            for place, view in enumerate(views):
                side = "train" if (number + place) % 2 else "test"
                lines.append([trial.groups["recording"], time_s[start], end, view, middle, side])
    header = ["recording", "start_s", "end_s", "view", "label_s", "side"]
    return touch, _table(touch, folder, header, lines), None


def _places(touch: TouchSet, folder: Path) -> Planted:
    """Windows of the commonest class from the trials' beginning, all others from their end."""
    lines = []
    groups = touch.group(_group(touch))
    assert groups is not None
    steps = max(2, min(len(rows) for rows in touch.rows) // 4)
    each = zip(touch.trials, touch.time_s, _usual(touch), groups, strict=True)
    for trial, time_s, usual, group in each:
        at = 1 if usual else len(time_s) - steps
        lines.append([trial.groups["recording"], time_s[at], time_s[at + steps - 1], group])
    header = ["recording", "start_s", "end_s", "fold"]
    return touch, _table(touch, folder, header, lines), None


def _one_class(touch: TouchSet, folder: Path) -> Planted:
    """A fold for each class."""
    lines = [[t.groups["recording"], t.start_s, t.end_s, f"class-{c}"]
             for t, c in zip(touch.trials, touch.y, strict=True)]  # fmt: skip
    return touch, _table(touch, folder, ["recording", "start_s", "end_s", "fold"], lines), None


PLANTS: tuple[Plant, ...] = (
    Plant(("duplicates", "near-duplicates", "augmented copies"), _copies),
    Plant(("duplicates", "near-duplicates", "augmented copies"), _copies_across),
    Plant(
        ("duplicates", "near-duplicates", "augmented copies"), _shifted_at_250_hz, arrays_only=True
    ),
    Plant(("scaling",), _scaled_at_250_hz, arrays_only=True),
    Plant(("length",), _shorter),
    Plant(("first frame",), _first_rows),
    Plant(("level",), _levels),
    Plant(("name: session", "name: operator", "name: firmware", "order"), _own_sessions),
    Plant(("scaling",), _scaled_before),
    Plant(("scaling of the run",), _scaled_run, arrays_only=True),
    Plant(("trial", "same session", "same object", "window leak"), _random_windows),
    Plant(("overlap", "trial", "views", "future"), _window_table),
    Plant(("place",), _places),
    Plant(("one-class folds",), _one_class),
)


def _as_files(touch: TouchSet, folder: Path, rate_hz: float) -> TouchSet:
    """Return the trials as they are read from a file each, written at another rate."""
    made = Path(tempfile.mkdtemp(dir=folder))
    names = tuple(f"c{number}" for number in range(len(touch.views)))
    sensor = SensorInfo(name="array", channels=names, units=("V",) * len(names), rate_hz=rate_hz)
    for number, (trial, rows) in enumerate(zip(touch.trials, touch.rows, strict=True)):
        manifest = Manifest(sensor=sensor, labels=trial.labels, groups=trial.groups)
        with Recorder(made / f"{number:05d}.mcap", manifest) as recorder:
            recorder.write(Samples.from_values(rows, np.arange(len(rows)) / rate_hz))
    return read_touch(made, touch.target, lambda *_: None)


def _lively(touch: TouchSet, count: int) -> list[int]:
    """Return the trials in which most changes."""
    return [int(i) for i in np.argsort([-float(r.std(axis=0).sum()) for r in touch.rows])[:count]]


def _usual(touch: TouchSet) -> NDArray[np.bool_]:
    """Return which trials are of the commonest class, shape (trials,)."""
    return np.asarray(touch.y == np.bincount(touch.y).argmax())


def _group(touch: TouchSet) -> str:
    return "session" if touch.group("session") is not None else "cup"


def _with_sessions(touch: TouchSet) -> TouchSet:
    """Return the trials with sessions: their own, or one for two cups."""
    if touch.group("session") is not None:
        return touch
    trials = tuple(replace(t, groups={**t.groups, "session": f"day-{int(t.groups['cup']) // 2}"})
                   for t in touch.trials)  # fmt: skip
    return replace(touch, trials=trials)


def _append(touch: TouchSet, index: int, rows: NDArray[np.float32]) -> TouchSet:
    """Return the trials and one more: another recording like trial `index`, with other rows."""
    trial = touch.trials[index]
    name = f"copy-{len(touch)}"
    copy: Trial = replace(
        trial, recording=f"{name}.mcap",
        groups={**trial.groups, "recording": name, "trial": f"{name}#0"},
    )  # fmt: skip
    return replace(
        touch, trials=(*touch.trials, copy), rows=(*touch.rows, rows),
        time_s=(*touch.time_s, touch.time_s[index][: len(rows)]),
        created=(*touch.created, touch.created[index]),
        files=(*touch.files, touch.files[index]),
    )  # fmt: skip


def _offset(touch: TouchSet, part: slice) -> TouchSet:
    """Return the trials with some of their rows offset by three deviations of a class's own."""
    spread = np.concatenate(touch.rows).std(axis=0)
    rng = np.random.default_rng(2)
    pattern = rng.choice((-3.0, 3.0), (len(touch.classes), len(spread))) * spread
    rows = []
    for own, c in zip(touch.rows, touch.y, strict=True):
        changed = own.copy()
        changed[part] += pattern[c].astype(np.float32)
        rows.append(changed)
    return replace(touch, rows=tuple(rows))


def _table(
    touch: TouchSet, folder: Path, header: list[str], lines: Sequence[Sequence[object]]
) -> Split:
    path = Path(tempfile.mkdtemp(dir=folder)) / "folds.csv"
    with path.open("w", newline="") as file:
        csv.writer(file).writerows([header, *lines])
    return table_sides(touch, path, usual_steps(touch))


def named(touch: TouchSet, split: str, claimed: tuple[str, ...] = ()) -> Split:
    """Return a split by its name, in five folds."""
    return named_sides(touch, split, usual_steps(touch), 5, 0, claimed)
