"""What a few touches give on a changed sensor pad, on sessions held out.

A pad is changed in the recorded volts: each channel by a gain, all by another humidity, then
clipped as the converter clips; what was clipped already stays so. A weaker pad may lose grasps
behind the gate: what gives no window is unanswered, and counts as wrong. All of a session's grasps
are judged alike, before and after, except the touches that may set its level. Knows nothing about
screens.

Background of our choices: docs/decisions/0028.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from taxel.bundles.contract import at_level
from taxel.bundles.levels import measure_level
from taxel.evaluation.adaptation.held_sessions import AdaptConfig, by_session, hold_out, run_of
from taxel.evaluation.metrics import by_trial
from taxel.evaluation.robustness.touches import recorded
from taxel.labels.joined import joined_label
from taxel.recordings.reader import list_recordings, read_manifest, read_recording
from taxel.recordings.writer import Recorder
from taxel.signals import Validity, flag_values
from taxel.sim.teng.constants import HUMIDITY_DECAY
from taxel.training.exemplars import Exemplars, all_exemplars
from taxel.training.fitting import Fitted
from taxel.training.run import Run
from taxel.windows.dataset import load_dataset
from taxel.windows.reference import parse_reference

TOUCHES = (1, 3, 5)
"""Reference touches. Source: our choice."""
GAIN = (0.5, 2.0)
"""A changed pad's gain. Source: as above."""
HUMIDITY_PCT = 10.0
"""A new humidity differs by up to this, percent. Source: our choice."""
ONE, ALL = "one pad changed", "all pads changed"


@dataclass(frozen=True, slots=True)
class PadPoint:
    """One changed pad, one held-out session; shares 0…1."""

    target: str
    session: str
    case: str
    touches: int
    unchanged: float
    """Share of the grasps predicted correctly before the change, session brought to level by three
    touches."""
    before: float
    """The same grasps after the change, by the level that held before it."""
    after: float
    """The same grasps brought to the level of these touches."""
    found_unchanged: float
    """Share of the grasps with any window above the gate, before the change."""
    found: float
    """The same after it; it does not depend on the level."""
    grasps: int
    """How many grasps were to be recognised."""


def measure_pads(
    paths: Sequence[Path], config: AdaptConfig, on_step: Callable[[str], None] = lambda _: None
) -> list[PadPoint]:
    """Measure bringing changed pads to level on data sets with several sessions.

    Raises:
        BadDataset: A data set has fewer than two sessions, or a target fewer than two classes.
    """
    return by_session(_one_session, paths, config, "pads", on_step)


def _one_session(path: Path, config: AdaptConfig, target: str, session: str) -> list[PadPoint]:
    """Measure with one session held out; runs in a process of its own."""
    torch.set_num_threads(1)
    held = hold_out(path, config, target, session)
    classes = held.classes
    file = next(
        path for path in list_recordings(path) if read_manifest(path).groups["session"] == session
    )
    run = run_of(held.dataset, held.train, classes, target, config.recipe)
    as_it_was = measure_level(file, run.contract, count=3).level
    rng = np.random.default_rng(held.number)
    points = []
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        for case in (ONE, ALL):
            changed = Path(scratch) / case / file.name  # grasps are named by their file
            changed.parent.mkdir()
            change_pads(file, changed, draw_gains(rng, case, len(run.contract.channels)))
            old, new = _windows(run, file, classes), _windows(run, changed, classes)
            grasps = grasps_to_test(run, file, [old, new])
            unchanged, before = (_right(run, setting, grasps, as_it_was) for setting in (old, new))
            found_old, found = (
                float(np.isin(grasps, setting.grasp).mean()) for setting in (old, new)
            )
            for touches in TOUCHES:
                level = measure_level(changed, run.contract, count=touches).level
                points.append(
                    PadPoint(
                        target, session, case, touches, unchanged, before,
                        _right(run, new, grasps, level), found_old, found, len(grasps),
                    )
                )  # fmt: skip
    return points


def draw_gains(rng: np.random.Generator, case: str, channels: int) -> NDArray[np.float64]:
    """Return each channel's change, shape (channels,): pads and one new humidity for all."""
    low, high = np.log(GAIN)
    gain = np.exp(rng.uniform(low, high, channels))
    if case == ONE:
        gain[np.arange(channels) != rng.integers(channels)] = 1.0
    return np.asarray(gain * np.exp(-HUMIDITY_DECAY * rng.uniform(-HUMIDITY_PCT, HUMIDITY_PCT)))


def change_pads(source: Path, output: Path, gain: NDArray[np.float64]) -> None:
    """Write a recording again as changed pads would have given it.

    Args:
        source: The recording.
        output: The new one.
        gain: What each channel is multiplied by, shape (channels,); cut at its full scale.

    Raises:
        BadInput: The new one exists.
        RecordingFailed: The disk refused.
    """
    recording = read_recording(source)
    full = recording.manifest.sensor.full_scale
    values = (recording.samples.values * gain).astype(np.float32)
    if full is not None:
        values = np.minimum(values, np.float32(full))
    # What the values do not show, such as a lost scan's 0, stays flagged.
    kept = recording.samples.validity & ~np.uint8(Validity.SATURATED | Validity.NOT_FINITE)
    flags = kept | flag_values(values, full)
    samples = replace(recording.samples, values=values, validity=flags)
    with Recorder(output, recording.manifest) as recorder:
        recorder.write(samples)
        for mark in recording.marks:
            recorder.mark(mark)


def grasps_to_test(run: Run, file: Path, cut: Sequence[Exemplars]) -> NDArray[np.str_]:
    """Return the names of a recording's grasps of known classes, with windows or without, shape
    (grasps,).

    Args:
        run: What predicts.
        file: The recording.
        cut: All windows of it as it was and as it is; the first touches of the known object that
            give windows in any of them may set a level and are left out.
    """
    contract = run.contract
    assert contract.reference is not None
    known = parse_reference(contract.reference.touches)
    recording = read_recording(file)
    trials = recorded(file, recording.manifest, recording.samples, recording.marks).trials
    touches = [trial.groups["trial"] for trial in trials if known.matches(trial)]
    used: set[str] = set()
    for windows in cut:
        there = set(windows.grasp)
        used |= set([name for name in touches if name in there][: max(TOUCHES)])
    names = [
        (trial.groups["trial"], joined_label(trial.labels, contract.target)) for trial in trials
    ]
    return np.array([name for name, label in names
                     if label in contract.classes and name not in used], str)  # fmt: skip


def _windows(run: Run, file: Path, classes: Sequence[str]) -> Exemplars:
    """Return all windows of a recording as measured."""
    contract = run.contract
    return all_exemplars(
        load_dataset(file, replace(contract.window, reference=None), usual=contract.followed_from),
        classes,
        contract.target,
    )


def _right(
    run: Run, windows: Exemplars, grasps: NDArray[np.str_], level: NDArray[np.float32]
) -> float:
    """Return the share of the grasps predicted correctly at a level, each by its windows joined."""
    own = windows[np.isin(windows.grasp, grasps)]
    if not len(own):
        return 0.0
    contract = at_level(run.contract, level)
    found = Fitted(run.networks, contract.scaling, []).probabilities(own.values, own.mask)
    _, number = np.unique(own.grasp, return_inverse=True)
    _, y, joined = by_trial(number.astype(np.intp), own.y, found)
    return float((joined.argmax(axis=1) == y).sum()) / len(grasps)
