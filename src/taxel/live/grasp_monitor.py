"""The live path of a grasp: frames in, states out, by the stages that training used.

One new set of frames costs one backbone pass a camera and the head: the window's other
features come from a ring. Adds no maths of its own. Knows nothing about screens or training
frameworks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from taxel.bundles.grasp import GraspBundle
from taxel.decisions.stability import StabilityConfig, StabilityDecision, StabilityMonitor
from taxel.errors import BadSource
from taxel.frame_codec import decode_jpeg
from taxel.gel.slip_features import SlipFeatures
from taxel.live.camera_health import CameraHealth
from taxel.signals import CameraInfo, Frame
from taxel.windows.pairs import FrameSet
from taxel.windows.rest import seen, settled
from taxel.windows.sequence import FeatureRing


@dataclass(frozen=True, slots=True)
class GraspAnswer:
    """One moment with its decision."""

    decision: StabilityDecision
    probability: float
    """Of "unstable", 0…1; NaN where there is none yet."""
    time_s: float
    """When the newest frame was taken, fitted clock, seconds."""
    latency_s: float
    """From the frames in hand to the decision, decoding included, seconds."""


class GraspMonitor:
    """Turn sets of frames of one grasp into decisions.

    The first moments are the settled grasp, against which all later ones are seen: until
    they are over the state is UNKNOWN. Call `reset` when a new grasp begins.

    Args:
        bundle: Features, head and thresholds.
        cameras: The source's.
        config: Thresholds in place of the bundle's.

    Raises:
        BadBundle: The bundle was not made for such cameras.
    """

    def __init__(
        self,
        bundle: GraspBundle,
        cameras: tuple[CameraInfo, ...],
        config: StabilityConfig | None = None,
    ) -> None:
        bundle.contract.check_cameras(cameras)
        self.bundle = bundle
        # Repeated frames repeat their probability; frozen input is told from the bytes.
        self._config = replace(config or bundle.contract.stability, frozen_s=float("inf"))
        self._settle = slice(*bundle.contract.settle)
        self._health = CameraHealth(cameras)
        self._watched = False
        self.reset()

    def reset(self) -> None:
        """Forget the grasp: the next frames are another one's settled first moments."""
        contract = self.bundle.contract
        self._monitor = StabilityMonitor(self._config)
        self._ring = FeatureRing(contract.frames, contract.cameras, self.bundle.offset.shape[1])
        self._eyes = [_Eye() for _ in range(contract.cameras)]
        self._slips: list[SlipFeatures] | None = None
        self._early: list[tuple[NDArray[np.uint8], ...]] = []
        self._early_rows: list[NDArray[np.float32]] = []
        self._rows = np.zeros_like(self.bundle.offset)
        self._rest: NDArray[np.float32] | None = None

    @property
    def settling(self) -> bool:
        """True until the settled first moments are over; the last of them takes long."""
        return self._rest is None

    def see(self, frame: Frame) -> None:
        """Look after a camera's health by every frame of it, also those that make no set.

        Without this `push` goes by the sets that it is given.
        """
        self._watched = True
        self._health.see(frame)

    def push(self, found: FrameSet, now_s: float | None = None) -> GraspAnswer:
        """Take in the newest frame of each camera; return the decision.

        Args:
            found: The frames.
            now_s: This moment on the frames' clock, seconds; the frames' own by default.
        """
        started = perf_counter()
        if not self._watched:
            for frame in found.frames:
                self._health.see(frame)
        probability, doubt = float("nan"), ""
        try:
            images, fresh = self._look(found)
        except BadSource as error:
            doubt = str(error)
        else:
            window = self._window(images, fresh)
            if window is not None:
                probability = self.bundle.probability(window)
        arrived_s = max(frame.arrival_s for frame in found.frames)
        doubt = doubt or self._health.doubt(arrived_s if now_s is None else now_s)
        now = found.time_s if now_s is None else now_s
        if doubt:
            decision = self._monitor.doubt(doubt, now)
        elif self._rest is None or len(self._ring) < self.bundle.contract.frames:
            decision = self._monitor.at(now)
        else:
            decision = self._monitor.push(probability, found.time_s, True, now_s)
        return GraspAnswer(decision, probability, found.time_s, perf_counter() - started)

    def at(self, now_s: float) -> StabilityDecision:
        """Return the state when no frame came: UNKNOWN once a camera is gone."""
        told = self._monitor.at(now_s)
        doubt = self._health.doubt(now_s)
        begun = any(eye.image is not None for eye in self._eyes)
        return self._monitor.doubt(doubt, now_s) if doubt and begun else told

    def late(self) -> dict[str, float]:
        """Return the cameras that deliver clearly later than the others: name, seconds."""
        return self._health.late()

    def _look(self, found: FrameSet) -> tuple[tuple[NDArray[np.uint8], ...], list[int]]:
        """Return the images, and which cameras show another one than before."""
        fresh = [
            camera
            for camera, (eye, frame) in enumerate(zip(self._eyes, found.frames, strict=True))
            if eye.see(frame.jpeg)
        ]
        images = []
        for eye in self._eyes:
            if eye.image is None:
                raise BadSource("a frame of each camera", "none yet", "wait")
            images.append(eye.image)
        return tuple(images), fresh

    def _window(
        self, images: tuple[NDArray[np.uint8], ...], fresh: Sequence[int]
    ) -> NDArray[np.float32] | None:
        """Return the scaled window that ends with these images; None while it is not complete."""
        if self.bundle.backbone is not None:
            if fresh:
                rows = self.bundle.backbone.run(frames=np.stack([images[c] for c in fresh]))
                self._rows = self._rows.copy()
                self._rows[list(fresh)] = rows
            return self._next(self._rows)
        if self._slips is None:
            self._early.append(images)
            if len(self._early) < self._settle.stop:
                return None
            return self._begin()
        return self._next(self._gel_rows(images, fresh))

    def _begin(self) -> NDArray[np.float32] | None:
        """Set up the gels' references, then go through the frames that were waiting."""
        self._slips = []
        for camera in range(self.bundle.contract.cameras):
            part = [images[camera] for images in self._early[self._settle]]
            different = [one for i, one in enumerate(part) if i == 0 or one is not part[i - 1]]
            self._slips.append(SlipFeatures(different))
        window = None
        before: tuple[NDArray[np.uint8], ...] | None = None
        for images in self._early:
            fresh = [c for c, one in enumerate(images) if before is None or one is not before[c]]
            window = self._next(self._gel_rows(images, fresh))
            before = images
        self._early = []
        return window

    def _gel_rows(
        self, images: tuple[NDArray[np.uint8], ...], fresh: Sequence[int]
    ) -> NDArray[np.float32]:
        self._rows = self._rows.copy()
        for camera in fresh:
            assert self._slips is not None
            self._rows[camera] = self._slips[camera].push(images[camera])
        return self._rows

    def _next(self, rows: NDArray[np.float32]) -> NDArray[np.float32] | None:
        """Take in a moment's features; return the scaled window that ends with it."""
        if self._rest is not None:
            return self._ring.push(self._scaled(rows, self._rest))
        self._early_rows.append(rows)
        if len(self._early_rows) < self._settle.stop:
            return None
        self._rest = settled(np.stack(self._early_rows[self._settle]))
        window = None
        for row in self._early_rows:
            window = self._ring.push(self._scaled(row, self._rest))
        self._early_rows = []
        return window

    def _scaled(self, rows: NDArray[np.float32], rest: NDArray[np.float32]) -> NDArray[np.float32]:
        change = seen(rows, rest, self.bundle.contract.tare)
        return np.asarray((change - self.bundle.offset) * self.bundle.factor, np.float32)


class _Eye:
    """What one camera showed last."""

    def __init__(self) -> None:
        self.image: NDArray[np.uint8] | None = None
        self._jpeg = b""

    def see(self, jpeg: bytes) -> bool:
        """Take in a frame; return whether it differs from the one before.

        Raises:
            BadSource: It cannot be decoded; the one before is kept.
        """
        if jpeg == self._jpeg:
            return False
        self.image = decode_jpeg(jpeg)
        self._jpeg = jpeg
        return True
