"""Camera trials with one label, cut and looked at: what recognisers learn from and are judged on.

Knows nothing about splits, models or screens.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import takewhile
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.bundles.contract import RATE_RANGE
from taxel.errors import BadDataset
from taxel.labels.class_order import in_order, refuse_reserved
from taxel.training.camera_trials.features import (
    TrialRows,
    further_crops,
    moved_crops,
    trial_rows,
)
from taxel.training.camera_trials.image_network import ImageNetwork
from taxel.training.camera_trials.learning import Extras, Learning
from taxel.training.camera_trials.one_trial import Cuts
from taxel.windows.camera_trials import CameraTrial
from taxel.windows.trial_crops import LARGEST_RATIO, MOVEMENT, THUMB, USUAL, thumb_of
from taxel.windows.trial_layout import Layout, choose_layout, count_between, count_shifted
from taxel.windows.trial_shifts import ASKED, SHIFTED

Rows = NDArray[np.float32]

JUDGED: Final = "features of trials"
LEARNED: Final = "features of further crops, only learned from"
COPIED: Final = "features of shifted copies"
"""The passes over the trials."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sight:
    """What crops are looked at with, and which others beside those that trials are judged by."""

    views: tuple[str, ...] = USUAL
    """Names in `FAMILIES`, but for the image network's."""
    network: ImageNetwork | None = None
    """An image network to look through, too."""
    extras: bool = False
    """Whether further crops and shifted copies are made to learn from."""
    moving: bool = False
    """Whether three crops are taken from the part of a trial in which something moves."""
    asked: bool = False
    """Whether a shifted copy of each crop is made to compare models on."""

    @property
    def all_views(self) -> tuple[str, ...]:
        """The views, the network's last."""
        return self.views if self.network is None else (*self.views, "network")


@dataclass(frozen=True, slots=True, kw_only=True)
class LabelledTrials:
    """What a split of camera trials needs to know of them; no image is looked at."""

    target: str
    classes: tuple[str, ...]
    y: NDArray[np.intp]
    """Shape (trials,): index into `classes`."""
    names: tuple[str, ...]
    groups: tuple[Mapping[str, str], ...]

    @property
    def labels(self) -> list[str]:
        """Each trial's class."""
        return [self.classes[number] for number in self.y.tolist()]

    def values_of(self, group: str) -> NDArray[np.str_]:
        """Return a group's value of each trial, shape (trials,); those that lack it stand alone."""
        return np.array([own.get(group, f"trial {i}") for i, own in enumerate(self.groups)])


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialSet(LabelledTrials):
    """Labelled camera trials, cut and looked at."""

    lengths: NDArray[np.intp]
    """Shape (trials,): frames."""
    cameras: int
    layout: Layout
    cut: TrialRows
    first: Rows
    """Shape (trials, cameras · 48): each one's first frame, small and grey."""
    extras: Extras = field(default_factory=Extras)
    """What is only learned from: further crops of the views of movement, which stand first, and
    shifted copies of pictures."""
    network: ImageNetwork | None = None
    """What the view of that name looked through; None where there is no such view."""

    @property
    def widths(self) -> dict[str, int]:
        """View → numbers a crop."""
        return {name: rows.shape[1] for name, rows in self.cut.rows.items()}

    @property
    def rows(self) -> Rows:
        """Shape (n, columns): all views side by side."""
        return np.concatenate(list(self.cut.rows.values()), axis=1)

    def learning(
        self,
        rows: Rows,
        group: str,
        extras: Extras | None = None,
        order: NDArray[np.float64] | None = None,
    ) -> Learning:
        """Return all crops with these rows; trials that lack the group stand alone.

        Args:
            rows: Shape (n, columns): of the crops, in their order.
            group: What is held out whole.
            extras: What helps to learn; nothing unless given.
            order: Shape (trials,): numbers that grow from earlier to later trials, where later ones
                are tested.
        """
        values, own = self.values_of(group), extras or Extras()
        return Learning(rows, self.cut.trial, self.y, values, len(self.classes), own, order)


def labelled_trials(trials: Sequence[CameraTrial], target: str | None) -> LabelledTrials:
    """Return the trials' classes, names and groups.

    Args:
        trials: At least two.
        target: The label; the only one where there is one, unless given.

    Raises:
        BadDataset: A trial lacks the label, or there is one class only.
    """
    target = target or _only_label(trials)
    lacking = [trial.name for trial in trials if target not in trial.labels]
    if lacking:
        known = sorted({name for trial in trials for name in trial.labels})
        raise BadDataset(
            f"the label {target!r} on every trial",
            f"none on {lacking[0]}{f' and {len(lacking) - 1} more' if lacking[1:] else ''}",
            f"labels are {', '.join(known) or 'none'}; name one with --target, or fill the table",
        )
    labels = [trial.labels[target] for trial in trials]
    classes = in_order(set(labels))
    refuse_reserved(classes, target)
    if len(classes) < 2:
        raise BadDataset(f"two or more classes of {target!r}", f"only {classes[0]!r}",
                         "record others too, or name another label with --target")  # fmt: skip
    return LabelledTrials(
        target=target,
        classes=classes,
        y=np.array([classes.index(label) for label in labels], np.intp),
        names=tuple(trial.name for trial in trials),
        groups=tuple(dict(trial.groups) for trial in trials),
    )


def load_trial_set(
    trials: Sequence[CameraTrial],
    target: str | None,
    cache: Path,
    *,
    crop: int | None = None,
    sight: Sight = Sight(),
    on_trial: Callable[[str, int, int], None] = lambda name, done, of: None,
) -> TrialSet:
    """Return trials with their label, cut and looked at.

    Args:
        trials: At least two.
        target: The label; the only one where there is one, unless given.
        cache: Folder for what is computed.
        crop: Frames in a crop; chosen by the shortest trial unless given.
        sight: What they are looked at with.
        on_trial: Called with the pass over the trials, trials done and in all.

    Raises:
        BadDataset: A trial lacks the label, there is one class only, cameras differ in size or
            rate, or images are hundreds of times as long as wide.
        BadInput: The crop does not fit.
    """
    labelled = labelled_trials(trials, target)
    sizes = {(trial.width, trial.height): trial.name for trial in reversed(trials)}
    if len(sizes) > 1:
        raise BadDataset("images of one size in all trials",
                         " and ".join(f"{w}×{h} in {sizes[w, h]}" for w, h in sorted(sizes)[:3]),
                         "bring them to one size, or make a table of each")  # fmt: skip
    ((width, height),) = sizes
    if max(width, height) > LARGEST_RATIO * min(width, height):
        raise BadDataset(f"images whose sides differ by a factor of at most {LARGEST_RATIO}",
                         f"{width}×{height}", "cut them to what was touched")  # fmt: skip
    lengths = [trial.frames for trial in trials]
    least, most = (chosen(trials, key=lambda trial: trial.rate_hz) for chosen in (min, max))
    layout = choose_layout(lengths, crop, rate_hz=least.rate_hz, moving=sight.moving)
    if layout.crop > 1 and most.rate_hz > least.rate_hz * RATE_RANGE[1]:  # images have no rate
        raise BadDataset(
            f"trials of about one rate, within a factor of {RATE_RANGE[1]:g}",
            f"{least.rate_hz:g} frames/s in {least.name} and {most.rate_hz:g} in {most.name}",
            "correct the table's column rate, or make a table of each rate",
        )  # fmt: skip
    views, network = sight.all_views, sight.network
    cut = trial_rows(trials, Cuts(layout, network=network), views, cache, partial(on_trial, JUDGED))
    found = TrialSet(
        target=labelled.target,
        classes=labelled.classes,
        y=labelled.y,
        names=labelled.names,
        groups=labelled.groups,
        lengths=np.array(lengths, np.intp),
        cameras=len(trials[0].cameras),
        layout=layout,
        cut=cut,
        first=_first_looks(trials, layout, cut),
        network=sight.network,
    )
    return with_extras(found, trials, cache, sight, on_trial)


def _first_looks(trials: Sequence[CameraTrial], layout: Layout, cut: TrialRows) -> Rows:
    """Return each trial's first frame, 8×6 grey, shape (trials, cameras · 48)."""
    if not layout.moving and "stills" in cut.shown:
        return np.asarray(thumbs_of(cut)[cut.place == 0], np.float32)
    looks = [
        [thumb_of(trial.images(camera, [0])[0]) for camera in range(len(trial.cameras))]
        for trial in trials
    ]
    return np.array(looks, np.float32).reshape(len(trials), -1)


def thumbs_of(cut: TrialRows) -> Rows:
    """Return each crop's first frame, 8×6 grey, shape (n, cameras · 48)."""
    first = cut.shown["stills"][:, 0, :, : THUMB[0] * THUMB[1]]
    return np.ascontiguousarray(first.reshape(len(first), -1))


def with_extras(
    found: TrialSet,
    trials: Sequence[CameraTrial],
    cache: Path,
    sight: Sight,
    on_trial: Callable[[str, int, int], None] = lambda name, done, of: None,
) -> TrialSet:
    """Return trials with what helps to learn: further crops, shifted copies, copies to compare on.

    Args:
        found: The trials, cut and looked at.
        trials: The same, as they were read.
        cache: Folder for what is computed.
        sight: Which of these are made.
        on_trial: Called with the pass over the trials, trials done and in all.
    """
    views, network, layout, cut = sight.all_views, sight.network, found.layout, found.cut
    further = moved = asked = None
    moving = tuple(takewhile(MOVEMENT.__contains__, views))
    if sight.extras and moving:
        between = None
        if count := count_between(layout, len(trials)):
            on_between = partial(on_trial, LEARNED)
            between = trial_rows(trials, Cuts(layout, between=count), moving, cache, on_between)
        further = further_crops(cut, between, moving)
    on_copy = partial(on_trial, COPIED)
    seen = tuple(name for name in views if name in SHIFTED)
    if sight.extras and seen and (count := count_shifted(layout, len(trials))):
        moved = moved_crops(
            cut, trial_rows(trials, Cuts(layout, copies=count), seen, cache, on_copy)
        )
    seen = tuple(name for name in views if name in ASKED)
    if sight.asked and seen:
        own = trial_rows(trials, Cuts(layout, copies=1, network=network), seen, cache, on_copy)
        asked = moved_crops(cut, own)
    return replace(found, extras=Extras(further, moved, asked))


def _only_label(trials: Sequence[CameraTrial]) -> str:
    known = sorted(set.intersection(*(set(trial.labels) for trial in trials)))
    if len(known) == 1:
        return known[0]
    raise BadDataset(
        "one label to predict", f"{len(known)} on every trial: {', '.join(known) or 'none'}",
        "name one with --target",
    )  # fmt: skip
