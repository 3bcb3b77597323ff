"""What each rule and each person says of a set of pours, side by side.

Knows nothing about tables, figures or models.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.labels.agreement import Agreement, agreement, onset_s
from taxel.labels.corrections import Correction, apply_correction
from taxel.labels.rules import RULES, rule_named
from taxel.sim.pour.state import has_truth
from taxel.training.frames.features import Progress
from taxel.training.frames.labels import change_signals, corrections_of, rule_labels
from taxel.windows.camera_recordings import CameraRecording

PERSON = "a person"
"""Name of the corrected labels beside those of the rules."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PourLabels:
    """One pour's labels by every rule that can be worked out, and what a person says."""

    pour: CameraRecording
    signal: NDArray[np.float32]
    """Shape (n, cameras): change against the settled frames, per cent of the brightness."""
    by_rule: Mapping[str, NDArray[np.int8]]
    """Each shape (n,): 0 stable, 1 unstable, as the rule itself says."""
    corrections: Mapping[str, Correction]
    """By rule."""

    def labels(self, rule: str) -> NDArray[np.int8] | None:
        """Return the labels that hold, shape (n,), or None: a person's before the rule's."""
        own = self.by_rule.get(rule)
        correction = self.corrections.get(rule)
        if correction is None:
            return own
        return apply_correction(np.zeros(len(self.pour), np.int8), self.pour.time_s, correction)

    def onset(self, rule: str) -> float | None:
        """Return a rule's own first unstable moment, seconds after the first frame."""
        labels = self.by_rule.get(rule)
        return None if labels is None else onset_s(labels, self.time_s)

    def unstable_share(self, rule: str) -> float:
        """Return the share of frames that are unstable, 0…1; NaN where nobody has said."""
        labels = self.labels(rule)
        return float("nan") if labels is None else float(labels.mean())

    @property
    def time_s(self) -> NDArray[np.float64]:
        """Shape (n,): seconds after the first frame."""
        return np.asarray(self.pour.time_s - self.pour.time_s[0])


def label_sheet(
    pours: Sequence[CameraRecording],
    cache: Path,
    on_progress: Callable[[Progress], None] = lambda _: None,
) -> list[PourLabels]:
    """Return each pour's labels, by every rule that its data allow, and a person's corrections.

    Args:
        pours: The recordings.
        cache: Folder for what can be computed again.
        on_progress: Called after each recording.

    Raises:
        BadInput: A video is shorter than the settled stretch, or a file of corrections is damaged.
        RecordingFailed: The disk refused.
    """
    corrections = [corrections_of(pour) for pour in pours]
    signals = change_signals(pours, cache, on_progress=on_progress)
    return [
        PourLabels(
            pour=pour,
            signal=signal,
            by_rule={rule: rule_labels(pour, rule, signal) for rule in rules_of(pour)},
            corrections=correction,
        )
        for pour, signal, correction in zip(pours, signals, corrections, strict=True)
    ]


def rules_of(pour: CameraRecording) -> tuple[str, ...]:
    """Return the rules that can be worked out on a pour: those on images, and with truth all."""
    truth = has_truth(pour.sensor.channels)
    return tuple(name for name, rule in RULES.items() if truth or rule.needs == "images")


def rule_agreement(sheet: Sequence[PourLabels]) -> list[Agreement]:
    """Return a row for each pair of the rules that all pours have, as the rules themselves say."""
    shared = [name for name in RULES if all(name in entry.by_rule for entry in sheet)]
    return agreement(
        {name: [entry.by_rule[name] for entry in sheet] for name in shared},
        [entry.time_s for entry in sheet],
    )


def person_agreement(sheet: Sequence[PourLabels], rule: str) -> Agreement | None:
    """Return how far a rule agrees with the person who corrected it; None without corrections.

    Only the corrected pours count.

    Raises:
        BadInput: There is no such rule.
    """
    rule_named(rule)
    both = [entry for entry in sheet if rule in entry.corrections and rule in entry.by_rule]
    corrected = [labels for entry in both if (labels := entry.labels(rule)) is not None]
    if not both:
        return None
    (row,) = agreement(
        {rule: [entry.by_rule[rule] for entry in both], PERSON: corrected},
        [entry.time_s for entry in both],
    )
    return row
