"""Train the recogniser of camera trials that is kept, and make its bundle.

It learns from all trials but those that a split names as test trials for good. Knows nothing
about images or screens.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from taxel import __version__
from taxel.bundles.trials import IN_RUN, TrialContract, trial_bundle_bytes
from taxel.evaluation.camera_trials.learned_trials import fingerprints
from taxel.evaluation.camera_trials.sides import TrialSplit, order_of
from taxel.evaluation.camera_trials.trial_set import TrialSet
from taxel.gel.scale import mm_per_row_px
from taxel.plain_text import finite, json_text
from taxel.recordings.whole import whole_folder, write_whole
from taxel.training.camera_trials.blend import TrialBlend, fit_blend
from taxel.training.camera_trials.image_network import ImageNetwork
from taxel.training.camera_trials.onnx_graph import blend_to_onnx
from taxel.windows.camera_trials import CameraTrial
from taxel.windows.trial_crops import FAMILIES, PLACES

_CHECKED = 32
"""Crops that a bundle is checked on."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FinalRecogniser:
    """A recogniser of camera trials as a bundle, with the figures of its training."""

    bundle: bytes
    parity: float
    """Largest difference between the bundle's probabilities and the trained models'."""
    members: Mapping[str, float]
    """Member → weight."""
    places: Mapping[str, float]
    """Crop's place → weight; empty where there is one crop."""
    inner: Mapping[str, float]
    """Member → log-loss on inner folds, nats."""
    trials: int
    """How many were learned from."""


def fit_final(
    trials: TrialSet,
    images: Sequence[CameraTrial],
    split: TrialSplit,
    seed: int,
    measured: Mapping[str, float],
    on_step: Callable[[str], None] = lambda line: None,
) -> FinalRecogniser:
    """Fit the blend and write it as a bundle.

    Args:
        trials: The trials, cut and looked at.
        images: The same, as they were read.
        split: With one fold only, its test trials are not learned from.
        seed: Of models and inner folds.
        measured: What was measured on trials held out.
        on_step: Called with a line before each fit.

    Raises:
        BadBundle: The exported model gives something else than the trained one.
    """
    learned = np.arange(len(trials.y), dtype=np.intp)
    if len(split.folds) == 1:
        learned = split.folds[0].train_rows
    rows = trials.rows
    order = order_of(split, trials.groups, trials.y)
    learning = trials.learning(rows, split.group, trials.extras, order).part(learned)
    blend = fit_blend(learning, trials.cameras, trials.widths, seed, on_step=on_step)
    on_step("training: checking the bundle, and naming its trials")
    views, network = kept_views(trials, blend)
    crop_rows = learning.rows[:, : sum(trials.widths[name] for name in views)]
    at = np.linspace(0, len(crop_rows) - 1, min(_CHECKED, len(crop_rows))).astype(int)
    both = np.concatenate(
        [blend.crops(crop_rows[at]), blend.novelty.measure(crop_rows[at])[:, None]], axis=1
    )
    first = images[0]
    digests = "".join(images[index].digest for index in learned.tolist())
    contract = TrialContract(
        target=trials.target,
        classes=trials.classes,
        crop=trials.layout.crop,
        places=trials.layout.places,
        moving=trials.layout.moving,
        step=trials.layout.step,
        weights=named_places(blend),
        views=views,
        versions=tuple(FAMILIES[name].key for name in views),
        cameras=trials.cameras,
        width=first.width,
        height=first.height,
        rate_hz=first.rate_hz,
        mm_per_px=mm_per_row_px(first.width, first.mm_per_px),
        sharpness=blend.sharpness,
        threshold=blend.threshold if isfinite(blend.threshold) else None,
        data_digest=hashlib.sha256(digests.encode()).hexdigest(),
        measured=measured,
        software=f"taxel {__version__}",
        learned=fingerprints([images[index] for index in learned.tolist()]),
        network="" if network is None else network.words,
        names=first.cameras,
    )
    bundle, parity = trial_bundle_bytes(
        contract,
        blend_to_onnx(blend, crop_rows.shape[1]),
        crop_rows[at],
        both.astype(np.float32),
        None if network is None else network.model,
    )
    weights = {m.words: float(w) for m, w in zip(blend.members, blend.weights, strict=True)}
    return FinalRecogniser(
        bundle=bundle,
        parity=parity,
        members=weights,
        places=contract.weights,
        inner=blend.inner,
        trials=len(learned),
    )


def named_places(blend: TrialBlend) -> dict[str, float]:
    """Return what each crop of a trial counts, by its place; empty where there is one."""
    found = blend.places.tolist()
    return dict(zip(PLACES, found, strict=True)) if len(found) > 1 else {}


def kept_views(trials: TrialSet, blend: TrialBlend) -> tuple[tuple[str, ...], ImageNetwork | None]:
    """Return the views that a bundle needs: not the network's, the last, where no member sees it.

    Then the bundle is 7 MB smaller, and live no image passes through the network.
    """
    views = tuple(trials.cut.rows)
    if any("network" in member.views for member in blend.members):
        return views, trials.network
    return tuple(name for name in views if name != "network"), None


def save_trial_run(
    output: Path, final: FinalRecogniser, result: Mapping[str, Any]
) -> dict[str, Any]:
    """Write a run's folder, whole or not at all; return what `run.json` in it says.

    Args:
        output: The folder; an older run there is replaced.
        final: What was trained.
        result: What was measured on trials held out; empty where nothing was.

    Raises:
        RecordingFailed: The disk refused.
    """
    about = {
        **result,
        "run": str(output),
        "replaced": output.exists(),
        "bytes": len(final.bundle),
        "parity": final.parity,
        "members": dict(final.members),
        "crop_weights": dict(final.places),
        "inner_loss": dict(final.inner),
        "learned_trials": final.trials,
    }
    with whole_folder(output) as made:
        write_whole(made / IN_RUN, final.bundle)
        write_whole(made / "run.json", json_text(finite(about), 1))
    return about
