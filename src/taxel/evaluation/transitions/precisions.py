"""What a backbone's engine and precision cost: one head, its features computed in several ways.

Knows nothing about tables or screens.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.bundles.engine import EngineName, Precision
from taxel.evaluation.splits import TrialFold
from taxel.evaluation.transitions.data import CameraSet
from taxel.evaluation.transitions.step_times import time_step
from taxel.training.frames.extractors import BackboneExtractor
from taxel.training.frames.features import FrameFeatures, Progress, extract
from taxel.training.frames.heads import HeadConfig, TrainedHead, fit_head, tracks_of
from taxel.windows.camera_recordings import CameraRecording
from taxel.windows.sequence import label_windows

WAYS: tuple[tuple[EngineName, Precision], ...] = (
    ("onnxruntime", "f32"),
    ("onnxruntime", "int8"),
    ("openvino", "f32"),
    ("openvino", "bf16"),
    ("openvino", "int8"),
)
"""The first is what the others are compared with, and what heads learn from."""
THRESHOLD = 0.5
"""A window from this probability on is called unstable, as in the tables."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PrecisionRow:
    """One way to compute features, judged on the held-out cup."""

    model: str
    """backbone+head."""
    engine: EngineName
    precision: Precision
    accuracy: float
    """0…1, windows of the held-out cup."""
    lost: float
    """Accuracy lost against the first way, 0…1; below 0 where it is better."""
    differ: float
    """Share of windows whose decision differs from the first way's, 0…1."""
    largest_difference: float
    """Between probabilities."""
    step_ms: float
    """Median of a streaming step."""
    windows: int


@dataclass(frozen=True, slots=True)
class Ways:
    """How one backbone's features are computed."""

    tried: Sequence[tuple[EngineName, Precision]] = WAYS
    """Engines and precisions; the first is what the others are compared with."""
    threads: int = 1
    """Of the engine, for the step's time."""


def compare_precisions(
    pours: CameraSet,
    fold: TrialFold,
    head: HeadConfig,
    open_way: Callable[[EngineName, Precision, Sequence[CameraRecording]], BackboneExtractor],
    ways: Ways,
    cache: Path,
    *,
    on_progress: Callable[[str, Progress], None] = lambda _way, _progress: None,
) -> list[PrecisionRow]:
    """Train a head once, on features of the first way; judge all ways on the held-out cup.

    Args:
        pours: Labelled recordings.
        fold: Which cups are learned from, and which is judged.
        head: How the head is trained.
        open_way: Opens the backbone; gets the training recordings to calibrate on.
        ways: How features are computed.
        cache: Folder for features.
        on_progress: Called with the way's name after each recording.
    """
    training = [pours.pours[i] for i in fold.train_rows]
    testing = [pours.pours[i] for i in fold.test_rows]
    labels = np.concatenate(
        [
            label_windows(pours.labels[i], head.frames)[pours.pours[i].whole(head.frames)]
            for i in fold.test_rows
        ]
    )
    trained: TrainedHead | None = None
    reference: NDArray[np.float32] | None = None
    rows: list[PrecisionRow] = []
    for engine, precision in ways.tried:
        extractor = open_way(engine, precision, training)
        name = f"{engine} {precision}"

        def show(done: Progress, name: str = name) -> None:
            on_progress(name, done)

        if trained is None:
            known = extract(training, extractor, cache, show)
            trained = fit_head(tracks_of(known, [pours.labels[i] for i in fold.train_rows]), head)
        probabilities = _probabilities(trained, extract(testing, extractor, cache, show))
        reference = probabilities if reference is None else reference
        right = float(((probabilities >= THRESHOLD) == labels).mean())
        model = f"{extractor.backbone}+{head.head}"
        step = time_step(
            model, head.frames, engine=engine, precision=precision, threads=ways.threads,
            extractor=extractor,
        )  # fmt: skip
        rows.append(
            PrecisionRow(
                model=model, engine=engine, precision=precision, accuracy=right,
                lost=rows[0].accuracy - right if rows else 0.0,
                differ=float(((probabilities >= THRESHOLD) != (reference >= THRESHOLD)).mean()),
                largest_difference=float(np.abs(probabilities - reference).max()),
                step_ms=step.stream_ms, windows=len(labels),
            )
        )  # fmt: skip
    return rows


def _probabilities(head: TrainedHead, features: Sequence[FrameFeatures]) -> NDArray[np.float32]:
    judged = np.concatenate([head.judged(feature) for feature in features])
    return np.asarray(judged[~np.isnan(judged)], np.float32)
