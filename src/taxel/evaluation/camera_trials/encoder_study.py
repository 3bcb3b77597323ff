"""Labelled trials with the images that are probed, and the probe of any network on them.

Rows may differ from fold to fold, so that a network may be pretrained fold by fold. Nothing is
chosen on a test object. Knows nothing about screens, files or how a network was trained.

Background of our choices: docs/decisions/0058.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from torch import nn

from taxel.errors import BadDataset
from taxel.evaluation.camera_trials.probe import (
    Labelled,
    ProbeResult,
    Rows,
    pooled,
    probe,
    probe_once,
)
from taxel.evaluation.camera_trials.probe_features import network_features
from taxel.evaluation.camera_trials.sides import TrialSplit, split_trials
from taxel.plain_text import number_of
from taxel.training.camera_trials.learning import Learning
from taxel.training.encoder.videos import TouchVideo
from taxel.windows.camera_trials import CameraTrial

_TRIES: Final = 1000
"""Draws of objects before it is said that none has every class. Source: our choice."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ProbeSet:
    """Labelled trials with the images that are probed."""

    y: NDArray[np.intp]
    objects: NDArray[np.str_]
    split: TrialSplit
    videos: Sequence[TouchVideo]
    """Of all trials in their order, a trial's cameras one after another."""

    @property
    def trial(self) -> NDArray[np.intp]:
        """Shape (rows,): each pooled row's trial."""
        return np.repeat(np.arange(len(self.y)), len(self.videos[0].images))

    @property
    def labelled(self) -> Labelled:
        """What pooled rows are of."""
        return Labelled(self.trial, self.y, self.objects)

    def rows_of(self, module: nn.Module) -> Rows:
        """Return a network's pooled rows."""
        found = network_features(module, self.videos)
        return pooled(found.reshape(len(self.y), -1, *found.shape[1:]))


def slip_probe_set(trials: Sequence[CameraTrial], videos: Sequence[TouchVideo] = ()) -> ProbeSet:
    """Return who slipped in gelsight-slip, and five folds that hold out whole objects.

    Args:
        trials: Those of gelsight-slip, each with its label `outcome` and its group `object`.
        videos: Of all trials in their order, a trial's cameras one after another; none where
            rows are computed elsewhere.
    """
    y = np.array([trial.labels["outcome"] == "slip" for trial in trials]).astype(np.intp)
    groups = [trial.groups for trial in trials]
    return ProbeSet(
        y=y,
        objects=np.array([own["object"] for own in groups]),
        split=split_trials(groups, y, "group:object", 5, 0),
        videos=videos,
    )


def probe_all(probed: ProbeSet, rows: Mapping[str, list[Rows]]) -> dict[str, ProbeResult]:
    """Return each network's probe.

    Args:
        probed: The trials.
        rows: Name → rows of each fold.
    """
    return {name: probe(name, own, probed.labelled, probed.split) for name, own in rows.items()}


def few_objects(
    probed: ProbeSet, rows: Sequence[Rows], objects: int, draws: int, seed: int = 0
) -> tuple[float, float]:
    """Return accuracy and its deviation over draws, each fold's probe fitted on few objects.

    Args:
        probed: The trials.
        rows: Of each fold.
        objects: Labelled ones; every class is among them.
        draws: How often they are drawn.
        seed: Of the draws.

    Raises:
        BadDataset: No draw of so many objects has every class.
    """
    right = np.zeros((draws, len(probed.y)))
    for own, fold in zip(rows, probed.split.folds, strict=True):
        learning = Learning(own, probed.trial, probed.y, probed.objects, int(probed.y.max()) + 1)
        test = learning.part(fold.test_rows)
        for draw in range(draws):
            random = np.random.default_rng((seed, draw))
            part = learning.part(
                few_trials(probed.y, probed.objects, fold.train_rows, objects, random)
            )
            found, _ = probe_once(part, test, seed)
            right[draw, fold.test_rows] = found.argmax(axis=1) == test.y
    by_draw = right.mean(axis=1)
    return float(by_draw.mean()), float(by_draw.std())


def few_trials(
    y: NDArray[np.intp],
    groups: NDArray[np.str_],
    train: NDArray[np.intp],
    objects: int,
    random: np.random.Generator,
) -> NDArray[np.intp]:
    """Return the trials of some objects drawn among which every class is.

    Args:
        y: Shape (trials,): class.
        groups: Shape (trials,): object.
        train: Trials to draw from.
        objects: How many; all of them where there are fewer.
        random: What is drawn from.

    Raises:
        BadDataset: No such draw has every class.
    """
    names, classes = np.unique(groups[train]), set(y.tolist())
    for _ in range(_TRIES):
        drawn = random.choice(names, min(objects, len(names)), replace=False)
        chosen = train[np.isin(groups[train], drawn)]
        if set(y[chosen].tolist()) == classes:
            return chosen
    raise BadDataset(
        f"{number_of(objects, 'object')} with every class between them",
        f"none in {_TRIES} draws from the {number_of(len(names), 'object')} of a training side",
        "draw more objects, or record the missing class",
    )
