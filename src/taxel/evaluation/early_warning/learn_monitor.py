"""Learn a grasp monitor for use: head on all cups, thresholds and scores on cups held out.

It is written as the bundle that runs live. Knows nothing about screens.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from taxel import __version__
from taxel.bundles.contract import RATE_RANGE
from taxel.bundles.grasp import GraspContract, write_grasp_bundle
from taxel.decisions.stability import StabilityConfig
from taxel.errors import BadDataset
from taxel.evaluation.early_warning.grasp_warnings import INNER_FOLDS, monitor_tracks
from taxel.evaluation.early_warning.tuning_stability import Tuned, tune
from taxel.evaluation.splits import TrialFold
from taxel.evaluation.transitions.data import CameraSet, Judged, judge_fold
from taxel.evaluation.transitions.tables import WindowScores, score_windows
from taxel.labels.rules import rule_named
from taxel.models.counting import keras_parameters
from taxel.models.transition import find_transition
from taxel.training.curves import Curve
from taxel.training.frames.features import FrameFeatures
from taxel.training.frames.heads import HeadConfig, TrainedHead, fit_head, tracks_of
from taxel.training.frames.labels import rate_of
from taxel.windows.camera_recordings import CameraRecording, digest_of_all, image_size
from taxel.windows.rest import SETTLE
from taxel.windows.sequence import sequence_windows

if TYPE_CHECKING:
    from taxel.training.frames.extractors import BackboneExtractor

_CHECK_WINDOWS = 32
"""Windows stored in a bundle for the check on load."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LearntMonitor:
    """A head, its thresholds, and what both are worth on cups that the head had not seen."""

    head: TrainedHead
    """Trained on all pours."""
    stability: StabilityConfig
    tuned: Tuned | None
    """None where the recordings hold no truth to tune on: the thresholds are the defaults."""
    windows: WindowScores | None
    """Windows of cups held out; None where there are fewer than two cups."""
    curves: tuple[Curve, ...] = ()
    """How each head learned that left out some cups, and the last one on all."""


def learn_monitor(
    data: CameraSet,
    features: Sequence[FrameFeatures],
    config: HeadConfig,
    *,
    on_step: Callable[[str], None] = lambda _: None,
) -> LearntMonitor:
    """Train on all pours; tune and score on heads that left out groups of cups.

    Args:
        data: Pours with labels.
        features: Of the pours, in their order.
        config: How a head is trained.
        on_step: Called with a line before each training.
    """
    cups = data.cups()
    names = sorted(set(cups.tolist()))
    judged: list[Judged] = []
    curves: list[Curve] = []
    if len(names) > 1:
        for part in np.array_split(np.array(names), min(INNER_FOLDS, len(names))):
            on_step(f"without cup {', '.join(part)}")
            held = np.isin(cups, part)
            fold = TrialFold.of("+".join(part), np.flatnonzero(~held), np.flatnonzero(held))
            found, trained = judge_fold(features, data.labels, fold, config, watch=True)
            judged.append(found)
            curves.append(Curve(f"without cup {', '.join(part)}", trained.history))
    tuned = None
    if judged and rule_named(data.rule).needs == "truth":
        tuned = tune(monitor_tracks(data, judged, config.frames))
    on_step("all cups")
    head = fit_head(tracks_of(features, data.labels), config)
    return LearntMonitor(
        head=head,
        stability=tuned.config if tuned else StabilityConfig(),
        tuned=tuned,
        windows=score_windows(judged) if judged else None,
        curves=(*curves, Curve("all cups", head.history)),
    )


def write_monitor(
    path: Path,
    learnt: LearntMonitor,
    data: CameraSet,
    features: Sequence[FrameFeatures],
    name: str,
    backbone: BackboneExtractor | None,
) -> tuple[GraspContract, float]:
    """Write a monitor's bundle; return its contract and its largest difference from PyTorch.

    Args:
        path: The file; an older one is replaced.
        learnt: The monitor.
        data: What it learned from.
        features: Of the recordings, in their order.
        name: Of the features.
        backbone: What computes them; None for those of the gel.

    Raises:
        BadBundle: The bundle gives other probabilities.
        RecordingFailed: The disk refused.
    """
    from taxel.models.export_onnx import export_head

    contract = _contract(learnt, data, name, backbone)
    longest = max(features, key=lambda own: len(own.row))
    windows, expected = _check(longest if len(features[0].row) < contract.frames else features[0],
                               learnt.head)  # fmt: skip
    head = export_head(learnt.head.module, contract.frames, windows.shape[3])
    model = backbone.model if backbone else None
    return contract, write_grasp_bundle(path, contract, head, model, windows, expected)


def check_alike(pours: Sequence[CameraRecording]) -> None:
    """Refuse recordings that no bundle serves together, before anything is computed.

    Raises:
        BadDataset: Their images differ in size, or their rates by more than live allows.
    """
    image_size(pours)
    first = rate_of(pours[0])
    least, most = RATE_RANGE
    for pour in pours:
        if not least <= rate_of(pour) / first <= most:
            raise BadDataset(
                f"recordings of about one rate, within {least:g} to {most:g} of the first one's",
                f"{first:.3g} frames/s in {pours[0].path.name} and {rate_of(pour):.3g} in "
                f"{pour.path.name}",
                "put those of each rate in a folder of their own",
            )  # fmt: skip


def _contract(
    learnt: LearntMonitor, data: CameraSet, name: str, backbone: BackboneExtractor | None
) -> GraspContract:
    camera = data.pours[0].cameras[0]
    config = learnt.head.config
    parameters = (
        keras_parameters(learnt.head.module)
        if backbone is None
        else find_transition(f"{name}+{config.head}").parameters
    )
    return GraspContract(
        features=name,
        weights=backbone.weights.words if backbone else "",
        head=config.head,
        frames=config.frames,
        tare=config.tare,
        settle=(SETTLE.start, SETTLE.stop),
        cameras=len(data.pours[0].cameras),
        width=camera.width,
        height=camera.height,
        rate_hz=rate_of(data.pours[0]),
        rule=data.rule,
        offset=tuple(tuple(map(float, row)) for row in learnt.head.offset),
        factor=tuple(tuple(map(float, row)) for row in learnt.head.factor),
        stability=learnt.stability,
        parameters=parameters,
        data_digest=digest_of_all(data.pours),
        measured=_measured(learnt),
        software=f"taxel {__version__}",
        names=tuple(own.name for own in data.pours[0].cameras),
    )


def _measured(learnt: LearntMonitor) -> dict[str, float]:
    """Return what cups held out gave, by its name; what is no number is left out."""
    measured: dict[str, float] = {}
    if learnt.windows is not None:
        measured |= {"balanced accuracy": learnt.windows.balanced, "AUC": learnt.windows.auc}
    if learnt.tuned is not None:
        measured |= {
            "median lead (s)": learnt.tuned.lead_median_s,
            "missed": learnt.tuned.missed_share,
            "false alarms a minute": learnt.tuned.false_alarms_per_min,
        }
    return {key: value for key, value in measured.items() if np.isfinite(value)}


def _check(
    features: FrameFeatures, head: TrainedHead
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return scaled windows of a recording and what the head gives for them."""
    own = features.all()
    windows = sequence_windows(head.scale(own), head.config.frames)
    part = np.linspace(0, len(windows) - 1, min(_CHECK_WINDOWS, len(windows))).astype(int)
    return np.ascontiguousarray(windows[part]), head.probabilities(own)[part]
