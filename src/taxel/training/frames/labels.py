"""Labels of a pour's frames, by rule: from its truth, or from its images through the cache.

Knows nothing about windows, heads or splits.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadDataset
from taxel.labels.change import ChangeConfig, change_signal, excess_of, label_change
from taxel.labels.corrections import Correction, apply_correction, read_corrections
from taxel.labels.rules import rule_named
from taxel.labels.slip import label_truth
from taxel.plain_text import number_of
from taxel.sim.pour.state import TRUTH_CHANNELS, has_truth
from taxel.training.frames.features import Progress, extract
from taxel.training.frames.jobs import fill_cache
from taxel.windows.camera_recordings import CameraRecording


@dataclass(frozen=True, slots=True)
class ChangeExtractor:
    """Each frame's change against the settled first ones, per cent of the brightness."""

    settled: slice
    features: int = 1
    in_order: bool = True
    places: bool = False

    @property
    def key(self) -> str:
        """Name for the cache."""
        return f"change-1-{self.settled.start}-{self.settled.stop}"

    def of(self, images: Sequence[NDArray[np.uint8]]) -> NDArray[np.float32]:
        return change_signal(images, self.settled)[:, None].astype(np.float32)


def change_signals(
    pours: Sequence[CameraRecording],
    cache: Path,
    config: ChangeConfig | None = None,
    on_progress: Callable[[Progress], None] = lambda _: None,
) -> list[NDArray[np.float32]]:
    """Return each pour's change signal, shape (n, cameras).

    Raises:
        BadDataset: A video ends before the settled stretch does.
    """
    config = config or ChangeConfig()
    extractors = [ChangeExtractor(config.settled(rate_of(pour))) for pour in pours]
    for pour, extractor in zip(pours, extractors, strict=True):
        if len(pour) < extractor.settled.stop:
            raise BadDataset(
                f"videos of at least {number_of(extractor.settled.stop, 'frame')} "
                f"({config.settled_to_s:g} s)",
                f"{len(pour)} in {pour.path}", "record for longer, or leave it out",
            )  # fmt: skip
    fill_cache(pours, extractors, cache, on_progress)
    found = []
    for pour, extractor in zip(pours, extractors, strict=True):
        (signal,) = extract([pour], extractor, cache)
        found.append(signal.all()[:, :, 0])
        on_progress(Progress(len(found), len(pours), 0, 0.0))
    return found


def frame_labels(
    pours: Sequence[CameraRecording], rule: str, signals: Sequence[NDArray[np.float32]]
) -> list[NDArray[np.int8]]:
    """Return each pour's labels, shape (n,): 0 stable, 1 unstable.

    A person's correction beside a recording wins over the rule, and needs no truth.

    Args:
        pours: The recordings.
        rule: A name in `RULES`.
        signals: Their change signals, for a rule on images.

    Raises:
        BadInput: There is no such rule.
        BadDataset: A recording lacks the truth that the rule needs.
    """
    rule_named(rule)
    labels = []
    for pour, signal in zip(pours, signals, strict=True):
        correction = corrections_of(pour).get(rule)
        own = np.zeros(len(pour), np.int8) if correction else rule_labels(pour, rule, signal)
        labels.append(apply_correction(own, pour.time_s, correction))
    return labels


def rule_labels(pour: CameraRecording, rule: str, signal: NDArray[np.float32]) -> NDArray[np.int8]:
    """Return a rule's own label of each frame, shape (n,), without a person's corrections.

    Args:
        pour: The recording.
        rule: A name in `RULES`.
        signal: Its change signal, shape (n, cameras), for a rule on images.

    Raises:
        BadInput: There is no such rule.
        BadDataset: The recording lacks the truth that the rule needs.
    """
    if rule_named(rule).needs == "images":
        return label_change(signal.astype(np.float64), rate_of(pour))
    return label_truth(truth_of(pour), rule)


def frame_excess(
    pours: Sequence[CameraRecording], signals: Sequence[NDArray[np.float32]]
) -> list[NDArray[np.float32]]:
    """Return each pour's change over its threshold, shape (n, cameras): unstable above 1."""
    return [
        excess_of(signal.astype(np.float64), rate_of(pour)).astype(np.float32)
        for pour, signal in zip(pours, signals, strict=True)
    ]


def corrections_of(pour: CameraRecording) -> dict[str, Correction]:
    """Return a person's corrections by rule.

    Raises:
        BadInput: Their file is damaged.
    """
    return read_corrections(pour.path, duration_of(pour))


def duration_of(pour: CameraRecording) -> float:
    """Return the time from a pour's first frames to its last, seconds."""
    return float(pour.time_s[-1] - pour.time_s[0])


def truth_of(pour: CameraRecording) -> NDArray[np.float32]:
    """Return the physics truth at each frame, shape (n, 8).

    Raises:
        BadDataset: The recording has none.
    """
    if not has_truth(pour.sensor.channels):
        raise BadDataset(
            "recordings with the simulator's physics truth for this rule",
            f"{pour.path} without it",
            "choose the rule change, or label by hand with: taxel label",
        )
    return pour.beside[:, : len(TRUTH_CHANNELS)]


def rate_of(pour: CameraRecording) -> float:
    """Return the measured rate of a pour's frames, hertz; outages do not count."""
    steps_s = np.diff(pour.time_s)
    follows = steps_s <= pour.gap_s
    if follows.all() or not follows.any():
        return (len(pour) - 1) / duration_of(pour)
    return int(follows.sum()) / float(steps_s[follows].sum())
