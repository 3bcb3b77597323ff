"""The touch encoder probed on objects of which no image was seen, beside other image networks.

Two variants: pretrained in simulation alone, and then further on the images of each fold's training
objects; in each fold inner folds choose. Nothing is chosen on a test object. Knows nothing about
screens.

Background of our choices: docs/decisions/0058.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from torch import Tensor, nn

from taxel.errors import BadDataset
from taxel.evaluation.camera_trials.probe import Labelled, Probed, Rows, pooled, probe, probe_once
from taxel.evaluation.camera_trials.probe_features import network_features
from taxel.evaluation.camera_trials.sides import TrialSplit
from taxel.models.backbones.touch import TouchEncoder
from taxel.models.backbones.weight_files import backbone_tensors, tensor_digest
from taxel.training.checkpoints import load_weights, save_weights
from taxel.training.encoder.fit import EncoderConfig, fit_encoder
from taxel.training.encoder.videos import TouchVideo, data_digest
from taxel.training.fine_tuning import KeptEpochs
from taxel.training.trial_blend import Learning

FIRST: Final = EncoderConfig(epochs=5, steps=100)
"""In simulation. Source: our choice, for two cores."""
FURTHER: Final = EncoderConfig(epochs=2, steps=50, learning_rate=1e-3)
"""From there on simulated and real images."""
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

    def seen(self, fold: int) -> list[TouchVideo]:
        """Return the videos of a fold's training objects."""
        held = set(self.objects[self.split.folds[fold].test_rows].tolist())
        return [video for video in self.videos if video.groups["object"] not in held]


def kept_encoder(
    folder: Path,
    videos: Sequence[TouchVideo],
    config: EncoderConfig,
    start: Mapping[str, Tensor] | None,
    on_step: Callable[[str], None],
) -> TouchEncoder:
    """Return an encoder from a folder, or pretrain it and keep it there."""
    begun = tensor_digest(start)[:16] if start else ""
    name = f"{data_digest(videos)[:16]}-{config}-{begun}".replace(" ", "")
    path = folder / f"{name}.safetensors"
    module = TouchEncoder().eval()
    if path.exists():
        load_weights(path, module)
        return module
    folder.mkdir(parents=True, exist_ok=True)
    checkpoint = path.with_suffix(".checkpoint")
    module = fit_encoder(
        videos, config, start=start, kept=KeptEpochs(checkpoint),
        on_step=lambda step, of, loss: on_step(f"pretraining {step}/{of}, loss {loss:.3f}"),
    ).encoder  # fmt: skip
    save_weights(path, module, {})
    checkpoint.unlink(missing_ok=True)
    return module


def encoder_rows(
    probed: ProbeSet,
    simulated: Sequence[TouchVideo],
    folder: Path,
    on_step: Callable[[str], None],
) -> dict[str, list[Rows]]:
    """Return both variants' rows of each fold.

    Args:
        probed: The trials.
        simulated: Videos of the simulator.
        folder: Where encoders are kept.
        on_step: Called with a line at each step.
    """
    first = kept_encoder(folder, simulated, FIRST, None, on_step)
    alone = probed.rows_of(first)
    start = backbone_tensors(first)
    further = []
    for fold in range(len(probed.split.folds)):

        def announce(line: str, fold: int = fold) -> None:
            on_step(f"fold {fold + 1}, {line}")

        own = [*simulated, *probed.seen(fold)]
        further.append(probed.rows_of(kept_encoder(folder, own, FURTHER, start, announce)))
    return {
        "touch, simulation only": [alone] * len(further),
        "touch, simulation and training objects": further,
    }


def chosen_by_inner(variants: Mapping[str, list[Rows]], found: Sequence[Probed]) -> list[Rows]:
    """Return in each fold the rows of the variant whose inner loss is least."""
    best = np.argmin([each.inner for each in found], axis=0)
    rows = list(variants.values())
    return [rows[variant][fold] for fold, variant in enumerate(best.tolist())]


def probe_all(
    probed: ProbeSet, rows: Mapping[str, list[Rows]], on_step: Callable[[str], None]
) -> dict[str, Probed]:
    """Return each network's probe.

    Args:
        probed: The trials.
        rows: Name → rows of each fold.
        on_step: Called with a line before each fold.
    """
    return {
        name: probe(name, own, probed.labelled, probed.split, on_step=on_step)
        for name, own in rows.items()
    }


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
        kept = train[np.isin(groups[train], drawn)]
        if set(y[kept].tolist()) == classes:
            return kept
    raise BadDataset(
        f"{objects} objects that have every class between them",
        f"none in {_TRIES} draws from the {len(names)} objects of a training side",
        "draw more objects, or record the missing class",
    )
