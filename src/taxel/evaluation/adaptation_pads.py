"""What a few touches give on a changed sensor pad, on sessions held out.

A pad is changed in the recorded volts: each channel by a gain, all by another humidity, then
clipped as the converter clips; what was clipped already stays so. Knows nothing about screens.
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
from taxel.evaluation.adaptation import AdaptConfig, run_of, told
from taxel.processes import side_by_side
from taxel.recordings.reader import list_recordings, read_manifest, read_recording
from taxel.recordings.writer import Recorder
from taxel.signals import flag_values
from taxel.sim.teng_constants import HUMIDITY_DECAY
from taxel.training.adapt.exemplars import Exemplars, all_exemplars
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
    """The same windows' accuracy before the change, session brought to level by three touches."""
    before: float
    """After the change, by the level that held before it."""
    after: float
    """Brought to the level of these touches."""


def measure_pads(
    paths: Sequence[Path], config: AdaptConfig, on_step: Callable[[str], None] = lambda _: None
) -> list[PadPoint]:
    """Measure bringing changed pads to level on data sets with several sessions.

    Raises:
        BadDataset: The recordings do not make such a data set.
    """
    jobs = [(path, config, target, place) for path in paths for target in config.targets
            for place in range(len(list_recordings(path)))[: config.sessions]]  # fmt: skip
    found = side_by_side(
        _one_session,
        jobs,
        lambda points: on_step(f"pads · {points[0].target} · {points[0].session} held out"),
        config.workers,
    )
    return [point for points in found for point in points]


def _one_session(path: Path, config: AdaptConfig, target: str, place: int) -> list[PadPoint]:
    """Measure with one session held out; runs in a process of its own."""
    torch.set_num_threads(1)
    dataset = load_dataset(path, config.recipe.window, target=target)
    classes = dataset.classes(target)
    everything = all_exemplars(dataset, classes, target)
    file = list_recordings(path)[place]
    session = read_manifest(file).groups["session"]
    run = run_of(dataset, everything[everything.session != session], classes, target, config.recipe)
    as_it_was = measure_level(file, run.contract, count=3).level
    rng = np.random.default_rng(place)
    points = []
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        for case in (ONE, ALL):
            changed = Path(scratch) / f"{case}.mcap"
            change_pads(file, changed, draw_gains(rng, case, len(run.contract.channels)))
            before = _accuracy(run, changed, classes, as_it_was)
            unchanged = _accuracy(run, file, classes, as_it_was)
            for touches in TOUCHES:
                level = measure_level(changed, run.contract, count=touches).level
                points.append(
                    PadPoint(
                        target, session, case, touches, unchanged, before,
                        _accuracy(run, changed, classes, level),
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
    """Write a recording again as changed pads would have given it."""
    recording = read_recording(source)
    full = recording.manifest.sensor.full_scale
    values = (recording.samples.values * gain).astype(np.float32)
    if full is not None:
        values = np.minimum(values, np.float32(full))
    samples = replace(recording.samples, values=values, validity=flag_values(values, full))
    with Recorder(output, recording.manifest) as recorder:
        recorder.write(samples)
        for mark in recording.marks:
            recorder.mark(mark)


def _accuracy(run: Run, file: Path, classes: Sequence[str], level: NDArray[np.float32]) -> float:
    """Return the accuracy at a level on all grasps but the first touches of the known object."""
    contract = run.contract
    assert contract.reference is not None
    known = parse_reference(contract.reference.touches)
    dataset = load_dataset(file, replace(contract.window, reference=None), target=contract.target)
    first = [i for i, one in enumerate(dataset.trials) if known.matches(one)][: max(TOUCHES)]
    windows: Exemplars = all_exemplars(dataset, classes, contract.target)
    test = windows[~np.isin(dataset.trial, first)]
    levelled = replace(run, contract=at_level(contract, level))
    return float((told(levelled, test) == test.y).mean())
