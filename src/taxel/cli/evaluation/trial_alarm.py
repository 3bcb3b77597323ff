"""`taxel evaluate-trials BUNDLE TRIALS --alarm CLASS`: the recogniser as a station's alarm."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from taxel.errors import BadInput
from taxel.plain_text import finite

if TYPE_CHECKING:
    from rich.console import RenderableType

    from taxel.bundles.trials import TrialContract
    from taxel.evaluation.camera_trials.sides import Groups
    from taxel.evaluation.camera_trials.trial_alarms import TrialAlarms
    from taxel.windows.camera_trials import CameraTrial


@dataclass(frozen=True, slots=True, kw_only=True)
class AlarmStudy:
    """What is asked: an alarm for one class, on some trials.

    Raises:
        BadInput: The bundle does not have the class, or no trial says what it is.
    """

    label: str
    contract: TrialContract
    trials: Sequence[CameraTrial]
    """Those without the bundle's label are left out."""
    group_of: Callable[[Groups], str | None]
    """From the groups of trials, the one that intervals are resampled by; None where each trial
    stands alone. It is asked about those that have the label, as for the bundle's score."""

    def __post_init__(self) -> None:
        """Refuse a class that is never recognised, before any trial is watched."""
        target, classes = self.contract.target, self.contract.classes
        if self.label not in classes:
            raise BadInput(f"a class of {target}: {', '.join(classes)}", f"--alarm {self.label}",
                           "name one of them")  # fmt: skip
        if not any(self._labels()):
            raise BadInput(f"trials with the label {target} beside --alarm", "none that has it",
                           f"add a column label:{target}, or leave --alarm out")  # fmt: skip

    def watched(self, file: tuple[Path, str], on_trial: Callable[[int, int], None]) -> WatchedStudy:
        """Watch the trials as live, and weigh the alarms.

        Args:
            file: The bundle, and its SHA-256, hexadecimal.
            on_trial: Called with trials done and in all.
        """
        from taxel.evaluation.camera_trials.trial_alarms import trial_alarms
        from taxel.live.trial_courses import watch_side_by_side

        known = [trial for trial, own in zip(self.trials, self._labels(), strict=True) if own]
        courses = watch_side_by_side(self.contract, file, known, on_trial)
        own = np.array([trial.labels[self.contract.target] == self.label for trial in known])
        key = self.group_of([trial.groups for trial in known])
        groups = [trial.name if key is None else trial.groups[key] for trial in known]
        column = self.contract.classes.index(self.label)
        found = trial_alarms(courses, own, groups, self.label, column)
        foreign = sum(trial.labels[self.contract.target] not in self.contract.classes
                      for trial in known)  # fmt: skip
        return WatchedStudy(self.contract.target, found, key or "trial", foreign)

    def _labels(self) -> list[str]:
        return [trial.labels.get(self.contract.target, "") for trial in self.trials]


@dataclass(frozen=True, slots=True)
class WatchedStudy:
    """Alarms of watched trials, and how they are printed."""

    target: str
    found: TrialAlarms
    resampled: str
    """Group that intervals are resampled by."""
    foreign: int = 0
    """Trials of a class that the bundle does not know, which count among all others."""

    def table(self) -> RenderableType:
        """Return them as a table in the terminal."""
        from taxel.views.tables.trial_alarms import trial_alarm_table

        return trial_alarm_table(self.found, self.target, self.resampled, self.foreign)

    def record(self) -> dict[str, Any]:
        """Return them as plain values, for --json."""
        beside = {"resampled": self.resampled, "foreign": self.foreign}
        return dict(finite(asdict(self.found) | beside))
