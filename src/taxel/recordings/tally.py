"""Count, scan by scan, what a recording holds and what it lost, in constant memory.

Knows nothing about files.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from taxel.plain_text import number_of
from taxel.signals import UNUSABLE, Frame, Samples, Validity


@dataclass(slots=True)
class FrameTally:
    """The ledger of one camera: how many frames, how fast, how many repeated or lost."""

    frames: int = 0
    first_s: float | None = None
    """Fitted time of the first frame, seconds."""
    last_s: float | None = None
    """Fitted time of the last frame, seconds."""
    repeated: int = 0
    """Frames whose bytes are those of the one before."""
    counter_gaps: int = 0
    """Places at which the device's counter skipped."""
    lost_frames: int = 0
    """Frames that the device's counter says were taken and that are not here."""
    _last_counter: int = -1
    _last_jpeg: bytes = b""

    def add(self, frame: Frame) -> None:
        """Take in the frame that follows those before."""
        self.frames += 1
        self.first_s = frame.fitted_s if self.first_s is None else self.first_s
        self.last_s = frame.fitted_s
        self.repeated += frame.jpeg == self._last_jpeg
        if frame.counter >= 0 and self._last_counter >= 0:
            skipped = max(0, frame.counter - self._last_counter - 1)
            self.counter_gaps += skipped > 0
            self.lost_frames += skipped
        self._last_counter, self._last_jpeg = frame.counter, frame.jpeg

    def as_dict(self) -> dict[str, float | int | None]:
        """Return the ledger as plain values."""
        span_s = 0.0 if self.first_s is None or self.last_s is None else self.last_s - self.first_s
        return {
            "frames": self.frames,
            "duration_s": span_s,
            "rate_hz": (self.frames - 1) / span_s if span_s > 0 else None,
            "repeated": self.repeated,
            "counter_gaps": self.counter_gaps,
            "lost_frames": self.lost_frames,
        }


def camera_line(ledger: Mapping[str, Any]) -> str:
    """Return a camera's ledger, as `FrameTally.as_dict` gives it, for a person."""
    rate = ledger["rate_hz"]
    measured = "rate unknown" if rate is None else f"{rate:.2f} frames/s measured"
    why = " (the camera had no newer image)" if ledger["repeated"] else ""
    return (
        f"{number_of(ledger['frames'], 'frame')} in {ledger['duration_s']:.2f} s, {measured}, "
        f"{ledger['repeated']} repeated{why}, "
        f"{ledger['lost_frames']} lost"
    )


@dataclass(slots=True)
class Tally:
    """The ledger of a run of scans: how many, how fast, how many lost or unusable."""

    scans: int = 0
    marks: int = 0
    first_s: float | None = None
    """Fitted time of the first scan, seconds."""
    last_s: float | None = None
    """Fitted time of the last scan, seconds."""
    counter_gaps: int = 0
    """Places at which the device's counter skipped."""
    lost_scans: int = 0
    """Scans that the counter says were taken and that are not here."""
    backward_steps: int = 0
    """Places at which the counter stood still or went back, as after a device's reboot."""
    unusable_values: int = 0
    saturated_values: int = 0
    _last_counter: int = -1

    def add(self, samples: Samples) -> None:
        """Take in scans that follow those before."""
        if len(samples) == 0:
            return
        self.scans += len(samples)
        if self.first_s is None:
            self.first_s = float(samples.fitted_s[0])
        self.last_s = float(samples.fitted_s[-1])
        self._count_gaps(samples)
        if samples.validity.any():
            self.unusable_values += int(np.count_nonzero(samples.validity & np.uint8(UNUSABLE)))
            self.saturated_values += int(
                np.count_nonzero(samples.validity & np.uint8(Validity.SATURATED))
            )

    @property
    def duration_s(self) -> float:
        """Fitted time from the first to the last scan, seconds."""
        return 0.0 if self.first_s is None or self.last_s is None else self.last_s - self.first_s

    @property
    def rate_hz(self) -> float | None:
        """Measured scans a second; None with fewer than two scans."""
        return (self.scans - 1) / self.duration_s if self.duration_s > 0 else None

    def as_dict(self) -> dict[str, float | int | None]:
        """Return the ledger as plain values, for a report or a recording's statistics."""
        return {
            "scans": self.scans,
            "marks": self.marks,
            "first_s": self.first_s,
            "last_s": self.last_s,
            "duration_s": self.duration_s,
            "rate_hz": self.rate_hz,
            "counter_gaps": self.counter_gaps,
            "lost_scans": self.lost_scans,
            "backward_steps": self.backward_steps,
            "unusable_values": self.unusable_values,
            "saturated_values": self.saturated_values,
        }

    def _count_gaps(self, samples: Samples) -> None:
        known = samples.counter[samples.counter >= 0]
        if len(known) == 0:
            return
        before = known[:1] - 1 if self._last_counter < 0 else np.array([self._last_counter])
        steps = np.diff(np.concatenate([before, known]))
        self.counter_gaps += int(np.count_nonzero(steps > 1))
        self.lost_scans += int((steps[steps > 1] - 1).sum())
        self.backward_steps += int(np.count_nonzero(steps < 1))
        self._last_counter = int(known[-1])
