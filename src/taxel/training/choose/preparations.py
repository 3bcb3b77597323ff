"""Windows that a data set may be cut into, derived from its own trials, channels and rate.

A short trial is a window as a whole; a long one is cut into windows of several lengths, among
which inner validation chooses. No gate, unless the array is the TENG hand, whose thresholds are
known. Knows nothing about models.

Source: docs/decisions/0039.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from threading import Lock

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadDataset
from taxel.models.grid_features import Grids, grids_of
from taxel.models.kernel_features import KernelFeatures
from taxel.models.touch_features import compute_features, pads_of
from taxel.plain_text import number_of
from taxel.sim.teng.constants import SENSORS
from taxel.training.choose.base import Base
from taxel.training.choose.kernels import KeptKernels
from taxel.windows.config import GATE_V, WindowConfig
from taxel.windows.dataset import Dataset, load_dataset
from taxel.windows.joining import follow_apart, join_datasets
from taxel.windows.rates import PAUSE_ROWS
from taxel.windows.windower import Windows

SHORT = 800
"""Rows up to which a whole trial is the only window: a touch, not a session. Source: our choice,
docs/decisions/0039."""
LENGTHS = (25, 100, 400)
"""Rows of windows that longer trials are cut into. Source: as above."""
MOST_VALUES = 60_000_000
"""Values of all whole trials, padded, up to which they are tried as windows. Source: as above."""
MOST_ROWS = 2500
"""Rows of the longest whole trial that is tried as one window. Source: as above."""
MOST_FAST_ROWS, SHORT_S = 50_000, 5.0
"""The same for trials that last no more than so many seconds, as a knock that a microphone hears:
a window of 400 of its rows holds no more than a moment. Source: as above."""
OVERLAP = 4
"""Training windows start so many times as often where there are few of them. Source: as above."""
FEW = 2000
MOST_WINDOWS = 6000
"""Windows that are learned from while choosing; of more, evenly spaced ones. Source: as above."""
ALIKE = 1.3
"""Marked trials of one recording are one window each where the longest has at most so many times
the rows of the short ones. Source: as above."""
INSIDE, LEAST_MARKED = 0.8, 20
"""Share of a marked trial that a window takes, so that live one always lies inside; and rows of a
trial below which it is one window as a whole. Source: as above."""
_TENG_GATES = ((0.6, 60), (GATE_V, 60), (GATE_V, 12))
"""Gate in volts and rows of the recipes teng-robust and teng: first what leaves hardly a touch
without a window (`docs/decisions/0039`)."""


@dataclass(frozen=True, slots=True)
class Prepared:
    """A data set cut in one way, with features that were computed of it."""

    config: WindowConfig
    """As it will run: windows one after another."""
    dataset: Dataset
    """Cut with overlap where there are few windows."""
    trial: NDArray[np.intp]
    """Each window's trial, an index into `Base.trials`, shape (n,)."""
    scored: NDArray[np.bool_]
    """Shape (n,): False for windows that overlap an earlier one: for training only."""
    kept: NDArray[np.intp]
    """Windows that are learned from while choosing."""
    stretch: NDArray[np.intp]
    """Shape (n,): which windows are joined before preparations are compared."""
    cache: dict[tuple[str, ...], NDArray[np.float32]] = field(default_factory=dict)
    tested_cache: dict[tuple[str, ...], NDArray[np.float32]] = field(default_factory=dict)
    """The same features where levels follow and trials are tested."""
    computing: Lock = field(default_factory=Lock)
    kernels: KeptKernels = field(default_factory=KeptKernels)
    """Features that are fitted, of the folds that were asked for last."""
    measured: Prepared | None = None
    """The same windows as measured, where levels follow here."""
    starts: bool = False
    """Whether each window begins where its trial does, and holds all of it."""
    unseen: NDArray[np.bool_] | None = None
    """Which trials of the data set nothing may be learned from, shape (trials,); None: none."""
    following: dict[str, Prepared] = field(default_factory=dict)
    """The same windows with levels that follow, as they were asked for."""

    @property
    def name(self) -> str:
        """Return it in words."""
        steps, gate = self.config.steps, self.config.gate
        rows = number_of(steps, "row")
        gated = f" above {gate:g}" if gate is not None else ""
        padded = ", padded" if self.dataset.windows.padded else ""
        follow = ", levels followed" if self.config.level_follow is not None else ""
        return f"{rows}{gated}{padded}{follow}"

    @property
    def plain(self) -> Prepared:
        """Return the same windows as measured: simple models are judged on those."""
        return self if self.measured is None else self.measured

    def followed(self, text: str) -> Prepared:
        """Return the same windows with levels that follow, made once.

        Args:
            text: As `WindowConfig.level_follow` has it.
        """
        with self.computing:
            if text not in self.following:
                self.following[text] = replace(
                    self, config=replace(self.config, level_follow=text),
                    dataset=follow_apart(self.dataset, text, self.unseen), cache={},
                    tested_cache={}, computing=Lock(),
                    kernels=KeptKernels(), measured=self, following={},
                )  # fmt: skip
            return self.following[text]

    @property
    def pads(self) -> tuple[int, ...]:
        """Return each channel's pad."""
        return pads_of(self.dataset.sensor.channels)

    @property
    def grids(self) -> Grids:
        """Return where channels lie, by their names."""
        return grids_of(self.dataset.sensor.channels)

    def features(self, blocks: tuple[str, ...]) -> NDArray[np.float32]:
        """Return features of the kept windows, shape (kept, features); computed once."""
        with self.computing:
            if blocks not in self.cache:
                self.cache[blocks] = self._computed(blocks, self.dataset.windows[self.kept])
            return self.cache[blocks]

    def tested_features(self, blocks: tuple[str, ...]) -> NDArray[np.float32]:
        """Return the same of the windows as they are where their trials are tested."""
        if self.dataset.tested_level is None:
            return self.features(blocks)
        with self.computing:
            if blocks not in self.tested_cache:
                self.tested_cache[blocks] = self._computed(blocks, self.dataset.tested(self.kept))
            return self.tested_cache[blocks]

    def _computed(self, blocks: tuple[str, ...], windows: Windows) -> NDArray[np.float32]:
        return compute_features(blocks, self.pads, windows.values, windows.mask, self.grids)

    def fitted_features(
        self, learned: NDArray[np.intp], wanted: NDArray[np.intp], seed: int
    ) -> tuple[KernelFeatures, NDArray[np.float32]]:
        """Return `KERNELS` fitted on some windows, and those features of some.

        Args:
            learned: Windows to learn from, as places in the data set.
            wanted: Windows whose features are wanted, likewise.
            seed: Of the windows that are looked at.
        """
        own = self.dataset.windows
        padded = self.config.pad
        return self.kernels.of(own.values, own.mask, learned, wanted, padded=padded, seed=seed)


def candidate_windows(base: Base) -> list[WindowConfig]:
    """Return the ways to cut that are tried, the most natural first, by the trials that are learned
    from; whether shorter ones are padded, by all.
    """
    sensor, rows = base.dataset.sensor, base.rows[base.own]
    rate_hz = base.dataset.config.grid_hz or sensor.rate_hz
    plain = replace(
        base.dataset.config,
        max_gap_s=max(base.dataset.config.max_gap_s, PAUSE_ROWS / max(rate_hz, 1e-6)),
    )
    if sensor.channels == SENSORS and set(sensor.units) == {"V"}:
        return [replace(plain, steps=steps, stride=steps, gate=gate, grid_hz=100.0, max_gap_s=0.8)
                for gate, steps in _TENG_GATES]  # fmt: skip
    longest = int(rows.max())
    alone = base.alone
    if longest <= SHORT and alone:
        return [_window(plain, longest, pad=bool((base.rows < longest).any()))]
    if longest == 1:
        return [plain]
    shortest = int(np.percentile(rows, 5))
    if not alone:
        return _within_marks(plain, longest, shortest)
    lengths = [n for n in LENGTHS if n <= longest]
    lengths = lengths or [max(1, shortest)]
    windows = [_window(plain, n, pad=bool(n > base.rows.min())) for n in reversed(lengths)]
    whole = longest * len(base.trials) * len(sensor.channels)
    brief = longest <= SHORT_S * sensor.rate_hz
    if longest <= (MOST_FAST_ROWS if brief else MOST_ROWS) and whole <= MOST_VALUES:
        windows.insert(0, _window(plain, longest, pad=bool((base.rows < longest).any())))
    return windows


def _within_marks(plain: WindowConfig, longest: int, shortest: int) -> list[WindowConfig]:
    """Return windows for trials that are marked stretches of longer recordings.

    Live, windows follow one another wherever the scans began: one lies inside each trial only where
    window and stride together are no longer than the trial. The whole trial is tried as well where
    all are about as long, and wins if it is clearly better; `live_note` says what that costs.

    Args:
        plain: What all windows have in common.
        longest: Rows of the longest trial.
        shortest: Rows of the short ones.
    """
    alike = longest <= min(SHORT, ALIKE * shortest)
    whole = [_window(plain, max(1, shortest), pad=False)] if alike else []
    most = int(INSIDE * shortest)
    if shortest < LEAST_MARKED:
        return whole or [_window(plain, max(1, shortest), pad=False)]
    lengths = [most] if alike else [n for n in reversed(LENGTHS) if n <= most] or [most]
    return [replace(_window(plain, n, pad=False), stride=min(n, shortest - n))
            for n in lengths] + whole  # fmt: skip


def live_note(base: Base, config: WindowConfig) -> tuple[str, ...]:
    """Return a warning on windows that live scans are cut into otherwise than these trials.

    Args:
        base: The recordings.
        config: What a window is.
    """
    if config.gate is not None or config.steps == 1:
        return ()
    if base.alone and config.pad:
        return (
            f"a trial of fewer than {config.steps} rows is decided where its recording ends: live, "
            "where scans stop",
        )
    if base.alone:
        whole = config.steps >= int(base.rows[base.own].max())
        return () if not whole else (
            f"a trial of fewer than {config.steps} rows gets no answer, because no training "
            "trial is that short: record some short ones if you need them",
        )  # fmt: skip
    room = np.clip((base.rows - config.steps + 1) / config.stride, 0.0, 1.0)
    decided = int(room.sum() + 0.5)
    if decided == len(base.rows):
        return ()
    return (
        f"windows of {number_of(config.steps, 'row')} were placed at each trial's start; live "
        "they follow one "
        f"another, so that about {decided} of {number_of(len(base.rows), 'such trial')} hold "
        "a whole one: begin a recording where a trial begins, or mark longer trials",
    )


def _window(plain: WindowConfig, steps: int, *, pad: bool) -> WindowConfig:
    return replace(plain, steps=steps, stride=steps, pad=pad)


def prepare(base: Base, config: WindowConfig, span: int) -> Prepared:
    """Cut the recordings; with overlap where there are few windows.

    Args:
        base: The recordings' rows.
        config: Rows in a window.
        span: Rows of the longest window that is tried: windows within that many rows are joined
            before they are compared.

    Raises:
        BadDataset: No window comes of it.
    """
    if config.level_follow is not None:
        text = config.level_follow
        return prepare(base, replace(config, level_follow=None), span).followed(text)
    stride = config.stride
    if config.steps > OVERLAP and _many(base, config) <= FEW:
        stride = max(1, config.stride // OVERLAP)
    if not base.alone and config.gate is None:  # a window must fit between two marks
        shortest = int(np.percentile(base.rows[base.own], 5))
        stride = min(stride, max(1, shortest - config.steps + 1))
    dataset = load_dataset(base.path, replace(config, stride=stride), target=base.target)
    if base.test is not None:
        dataset = join_datasets(dataset, base.test, base.target)
    places = {(trial.recording, trial.start_s): index for index, trial in enumerate(base.trials)}
    # A trial without a row in which every channel has a value is none of the base's.
    known = [i for i, t in enumerate(dataset.trials) if (t.recording, t.start_s) in places]
    if len(known) < len(dataset.trials):
        dataset = dataset.only_trials(known)
    own = np.array([places[trial.recording, trial.start_s] for trial in dataset.trials], np.intp)
    trial = own[dataset.trial]
    order = _place_in_trial(trial)
    every = config.stride // stride
    scored = order % max(1, every) == 0
    kept = np.arange(len(trial))
    if len(kept) > MOST_WINDOWS:
        kept = np.flatnonzero(scored)
        kept = kept[np.linspace(0, len(kept) - 1, min(len(kept), MOST_WINDOWS)).astype(int)]
    part = order * stride // max(1, span)
    _, stretch = np.unique(np.stack([trial, part]), axis=1, return_inverse=True)
    unseen = np.isin(own, sorted(base.unseen))
    starts = base.alone and config.steps >= int(base.rows[base.own].max())
    return Prepared(config, dataset, trial, scored, kept, stretch.ravel().astype(np.intp),
                    starts=starts, unseen=unseen if unseen.any() else None)  # fmt: skip


def prepare_all(base: Base) -> list[Prepared]:
    """Return the data set cut in each way that gives windows of all classes.

    Raises:
        BadDataset: None does.
    """
    windows = candidate_windows(base)
    span = max(config.steps for config in windows)
    preparations, refused = [], None
    lost: set[int] = set()
    for config in windows:
        try:
            prepared = prepare(base, config, span)
        except BadDataset as error:
            refused = error
            continue
        lost = set(base.y.tolist()) - set(base.y[prepared.trial].tolist())
        if not lost:
            preparations.append(prepared)
    if not preparations:
        names = base.dataset.classes(base.target)
        raise refused or BadDataset(
            f"windows of every class of {base.target!r}",
            f"none of {', '.join(names[number] for number in sorted(lost))}",
            "record longer trials of it, or, if values are missing there, see them with taxel info "
            "and import what is whole",
        )
    return preparations


def _many(base: Base, config: WindowConfig) -> int:
    return int(np.maximum(base.rows[base.own] // config.steps, 1).sum())


def _place_in_trial(trial: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return how many windows of its trial came before each, shape (n,)."""
    change = np.flatnonzero(np.r_[True, trial[1:] != trial[:-1]])
    return np.arange(len(trial)) - np.repeat(change, np.diff(np.r_[change, len(trial)]))
