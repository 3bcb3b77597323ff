"""Check whether each tactile camera can be trusted now: frozen, gone, or late.

Works on stamps and JPEG bytes alone, in live and in recorded time: every time is passed in.
Knows nothing about pixels, models or where frames come from.

Background of our choices: docs/decisions/0015.
"""

from __future__ import annotations

import math
from collections import deque
from statistics import median

from taxel.decisions.reasons import REASONS, SIMULATED
from taxel.signals import CameraInfo, Frame

FROZEN_CADENCES = 2.6
"""Time without a different image, in the camera's own cadence, after which it is frozen: the
third missing image is caught, jitter of 0.4 cadences included, and two images lost in a row are not
yet. Source: our choice, docs/decisions/0015."""
GONE_S = 0.080
"""Time without any frame after which a camera is gone, seconds, for fast ones. Our choice."""
GONE_PERIODS = 2.2
"""As above for slow ones, in nominal frame periods: 88 ms at 25 Hz, which leaves 12 ms of the 100
to notice; one lost frame (2 periods) is not reported. Our choice."""
LATE_PERIODS = 1.5
"""A camera whose frames arrive so much later than another's, in its frame periods, is late."""
_RECENT = 30
"""Images that the cadence, and frames that the delivery, are learned from."""
_FEW = 5
"""Different images before the cadence is believed."""
_SLOWEST_S = 0.100
"""Slowest cadence that is believed, seconds: stock sensors deliver 10 images a second or more."""
_NATURAL = 1.75
"""Times between images beyond this many medians are of lost ones, and no part of the cadence."""


class CameraHealth:
    """Watch every frame of a source's cameras; say when they cannot be believed.

    A stream may repeat each image, as 60 Hz videos of 25 Hz cameras do: the cadence is that of
    *different* images, learned from the past only. Images lost in transit look like a frozen
    camera for as long as they are missing, rightly so.

    Args:
        cameras: The source's, in the order of `Frame.camera`.
    """

    def __init__(self, cameras: tuple[CameraInfo, ...]) -> None:
        self._infos = cameras
        self.reset()

    def reset(self) -> None:
        """Forget all frames, as at the start of another stream."""
        self._watched = [_Watched(info.rate_hz) for info in self._infos]

    def see(self, frame: Frame) -> bool:
        """Take in a frame, in the order of arrival; return whether its image is a new one."""
        return self._watched[frame.camera].see(frame)

    def doubt(self, now_s: float) -> str:
        """Return why the cameras cannot be believed at this moment; empty when they can.

        Args:
            now_s: This moment, on the clock of `Frame.arrival_s`, seconds.
        """
        for info, watched in zip(self._infos, self._watched, strict=True):
            reason = watched.doubt(info, now_s)
            if reason:
                return reason
        return ""

    def gone(self, now_s: float) -> str:
        """Return which camera, of those that have sent frames, is gone; empty where none is.

        Args:
            now_s: As for `doubt`.
        """
        for info, watched in zip(self._infos, self._watched, strict=True):
            if reason := watched.gone(info, now_s):
                return reason
        return ""

    def rest(self, until_s: float) -> None:
        """Expect no frame before a moment; that ends with each camera's next frame.

        Args:
            until_s: On the clock of `Frame.arrival_s`, seconds.
        """
        for watched in self._watched:
            watched.rest(until_s)

    def late(self) -> dict[str, float]:
        """Return how far cameras are behind the promptest, seconds, by name; the late ones only.

        Compared is what passes from a frame's taking to its arrival, the median of the last 30;
        where a camera's clock had to be fitted to its arrivals, a steady delay cannot be seen.
        """
        delays = [watched.delay_s() for watched in self._watched]
        known = [delay for delay in delays if math.isfinite(delay)]
        if len(known) < 2:
            return {}
        return {
            info.name: delay - min(known)
            for info, delay in zip(self._infos, delays, strict=True)
            if delay - min(known) >= LATE_PERIODS / info.rate_hz
        }

    def cadence_s(self, camera: int) -> float:
        """Return the time between different images that a camera is held to, seconds."""
        return self._watched[camera].cadence_s


class _Watched:
    """One camera's recent past."""

    def __init__(self, rate_hz: float) -> None:
        self._period_s = 1.0 / rate_hz if rate_hz > 0 else _SLOWEST_S
        self._slowest_s = max(_SLOWEST_S, self._period_s)
        self._gone_s = max(GONE_S, GONE_PERIODS * self._period_s)
        self._jpeg = b""
        self._image_s = math.nan
        """When the newest different image was taken."""
        self._arrival_s = math.nan
        """When the newest frame came."""
        self._rest_s = -math.inf
        """Until when no frame is due."""
        self._frozen = False
        self._spans: deque[float] = deque(maxlen=_RECENT)
        self._delays: deque[float] = deque(maxlen=_RECENT)
        self.cadence_s = self._slowest_s

    def see(self, frame: Frame) -> bool:
        self._arrival_s, self._rest_s = frame.arrival_s, -math.inf
        self._delays.append(frame.arrival_s - frame.fitted_s)
        if frame.jpeg == self._jpeg:
            if math.isnan(self._image_s):
                self._image_s = frame.fitted_s  # after a rest
            # By the frames' own stamps: how late they arrive must not look like standing still.
            still_s = frame.fitted_s - self._image_s
            self._frozen = still_s > FROZEN_CADENCES * self.cadence_s
            return False
        if math.isfinite(self._image_s) and not self._frozen:
            self._learn(frame.fitted_s - self._image_s)
        self._jpeg, self._image_s, self._frozen = frame.jpeg, frame.fitted_s, False
        return True

    def doubt(self, info: CameraInfo, now_s: float) -> str:
        if not self._jpeg:
            return REASONS["no frame yet"].say(camera=info.name)
        if (gone := self.gone(info, now_s)) or not self._frozen:
            return gone
        # A simulator repeats an image for so long on purpose only.
        return (SIMULATED if info.simulated else "") + REASONS["frozen"].say(camera=info.name)

    def gone(self, info: CameraInfo, now_s: float) -> str:
        if not now_s - max(self._arrival_s, self._rest_s) > self._gone_s:  # NaN: no frame yet
            return ""
        silent_ms = 1e3 * (now_s - self._arrival_s)
        return REASONS["gone"].say(camera=info.name, silent_ms=silent_ms)

    def rest(self, until_s: float) -> None:
        self._rest_s = until_s
        self._image_s, self._frozen = math.nan, False  # the pause is no time between two images

    def delay_s(self) -> float:
        """Return the median delay from taking to arrival, seconds; NaN before 30 frames."""
        return median(self._delays) if len(self._delays) == _RECENT else math.nan

    def _learn(self, span_s: float) -> None:
        """Take in the time between two different images; those with lost ones between are left.

        The mean of the natural ones, not their median: 25 Hz in a 60 Hz video is a mixture of
        2 and 3 frames, whose median is 33 ms and whose mean is 40.
        """
        self._spans.append(span_s)
        if len(self._spans) >= _FEW:
            natural_s = _NATURAL * median(self._spans)
            natural = [span for span in self._spans if span <= natural_s]
            cadence_s = sum(natural) / len(natural) if natural else self._slowest_s
            self.cadence_s = min(max(cadence_s, self._period_s), self._slowest_s)
