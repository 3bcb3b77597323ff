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

from taxel.bundles.grasp import SLIP_COLUMNS, GraspBundle
from taxel.decisions.reasons import REASONS
from taxel.decisions.stability import StabilityConfig, StabilityDecision, StabilityMonitor
from taxel.errors import BadSource
from taxel.gel.slip_features import SlipFeatures
from taxel.gel.slip_signal import Slip
from taxel.live.camera_eye import CameraEye
from taxel.live.camera_health import CameraHealth
from taxel.live.grasp_starts import GraspStarts
from taxel.live.slip_watch import SlipWatch, taken_of
from taxel.side_by_side import SideBySide
from taxel.signals import CameraInfo, Frame
from taxel.windows.pairs import FrameSet
from taxel.windows.rest import compared, seen, settled
from taxel.windows.sequence import FeatureRing, largest_gap_s


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
    gels: tuple[Slip, ...] = ()
    """The slip over each gel; empty for a bundle that looks at something else."""
    began: bool = False
    """True where a grasp was found to begin, at this moment."""


class GraspMonitor:
    """Turn sets of frames of one grasp into decisions.

    The first moments are the settled grasp, against which all later ones are seen: until
    they are over the state is UNKNOWN. Call `reset` when a new grasp begins, `over` when one has
    ended: the state is then NO_GRASP until the next frames, which begin another.

    Args:
        bundle: Features, head and thresholds.
        cameras: The source's.
        config: Thresholds in place of the bundle's.
        find: Find each grasp's start in the images; the first ones must show untouched gels. Until
            then, and once the gels are untouched again, the state is NO_GRASP. None: where the
            cameras ask for it.

    Raises:
        BadBundle: The bundle was not made for such cameras.
    """

    def __init__(
        self,
        bundle: GraspBundle,
        cameras: tuple[CameraInfo, ...],
        config: StabilityConfig | None = None,
        find: bool | None = None,
    ) -> None:
        bundle.contract.check_cameras(cameras)
        self.bundle = bundle
        # Repeated frames repeat their probability; frozen input is recognised by the bytes.
        self._config = replace(config or bundle.contract.stability, frozen_s=float("inf"))
        self._settle = bundle.contract.settle_of(cameras)
        self._rate_hz = bundle.contract.rate_of(cameras)
        self._cameras = cameras
        self._health = CameraHealth(cameras)
        self._watched = False
        self._begun = self._ended = False
        self._beside = SideBySide(len(cameras))
        find = any(camera.finds_grasps for camera in cameras) if find is None else find
        self._starts = GraspStarts(len(cameras)) if find else None
        self._forget()
        self._over = self._before_any = find

    def reset(self) -> None:
        """Forget the grasp: the next frames are another one's settled first moments."""
        if self._starts is not None:
            self._starts.hold()
        self._before_any = False
        self._forget()

    def _forget(self) -> None:
        contract = self.bundle.contract
        self._monitor = StabilityMonitor(self._config)
        gap_s = largest_gap_s(min(camera.rate_hz for camera in self._cameras))
        sensors, features = self.bundle.offset.shape
        self._ring = FeatureRing(contract.frames, sensors, features, gap_s)
        self._watch: SlipWatch | None = None
        if contract.features in SLIP_COLUMNS:
            columns = SLIP_COLUMNS[contract.features]
            self._watch = SlipWatch(self._cameras, self._settle, columns)
        size = contract.width, contract.height
        self._eyes = [CameraEye(camera, size) for camera in self._cameras]
        self._fresh: set[int] = set()
        self._over = False
        self._slips: list[SlipFeatures] | None = None
        self._early: list[tuple[tuple[NDArray[np.uint8], ...], float]] = []
        self._early_rows: list[tuple[NDArray[np.float32], float]] = []
        self._rows = np.zeros_like(self.bundle.offset)
        self._rest: NDArray[np.float32] | None = None

    def over(self, time_s: float, now_s: float | None = None) -> StabilityDecision:
        """End the grasp; return NO_GRASP, or UNKNOWN where a camera is gone.

        Frames that the source does not send between two grasps are not missed for as long as it
        said (`CameraInfo.pause_s`); a camera that streams on is watched as ever.

        Args:
            time_s: When it ended, on the frames' clock, seconds.
            now_s: This moment on the same clock, seconds; `time_s` by default.
        """
        if self._starts is not None:
            self._starts = GraspStarts(len(self._cameras))
        self._before_any = False
        self._leave()
        self._monitor.over(time_s)
        now_s = time_s if now_s is None else now_s
        # A mark from ahead, as of a damaged recording, must not keep cameras from being missed.
        pause_s = max(camera.pause_s for camera in self._cameras)
        self._health.rest(min(time_s, now_s) + pause_s)
        return self.at(now_s)

    def _leave(self) -> None:
        before = self._monitor
        self._forget()
        self._monitor, self._over = before, True

    def end(self) -> None:
        """Note that the source has ended: no more frames come."""
        self._ended = True

    @property
    def settling(self) -> bool:
        """True until the settled first moments are over; the last of them takes long."""
        return self._rest is None

    def see(self, frame: Frame) -> None:
        """Look after a camera's health by every frame of it, also those that make no set.

        Without this `push` goes by the sets that it is given.
        """
        self._watched = self._begun = True
        self._health.see(frame)

    def push(
        self, frame_set: FrameSet, now_s: float | None = None, heard_s: float | None = None
    ) -> GraspAnswer:
        """Take in the newest frame of each camera; return the decision.

        Args:
            frame_set: The frames.
            now_s: This moment on the frames' clock, seconds; the frames' own by default.
            heard_s: When it was last looked which frames have come, seconds; `now_s` by default.
                A camera is missed by this: frames that wait while a model computes have come.
        """
        started = perf_counter()
        self._begun, self._over = True, self._over and self._starts is not None
        if not self._watched:
            for frame in frame_set.frames:
                self._health.see(frame)
        probability, doubt, began = float("nan"), "", False
        try:
            images, fresh = self._look(frame_set)
        except BadSource as error:
            doubt = error.got
        else:
            window, began = self._next_window(images, fresh, frame_set)
            if window is not None:
                probability = self.bundle.probability(window)
        arrived_s = max(frame.arrival_s for frame in frame_set.frames)
        looked_s = now_s if heard_s is None else heard_s
        doubt = doubt or self._health.doubt(arrived_s if looked_s is None else looked_s)
        now = frame_set.time_s if now_s is None else now_s
        if doubt:
            decision = self._monitor.doubt(doubt, now)
        elif self._over:
            decision = self._monitor.over(now, self._before_any)
        elif self._rest is None or len(self._ring) < self.bundle.contract.frames:
            decision = self._monitor.doubt(self._waiting(), now)
        else:
            decision = self._weighed(probability, frame_set.time_s, now_s)
        gels: tuple[Slip, ...] = ()
        if self._watch is not None:
            gels = self._watch.gels
            slip = self._watch.slip
            if self._unseen() is not None:
                slip = replace(slip, seen=False)  # one gel's is older than its image: no measure
            decision = replace(decision, slip=slip)
        latency_s = perf_counter() - started
        return GraspAnswer(decision, probability, frame_set.time_s, latency_s, gels, began)

    def at(self, now_s: float) -> StabilityDecision:
        """Return the state when no frame came: UNKNOWN once a camera is gone."""
        if self._ended:
            return self._monitor.doubt(REASONS["source over"].say(), now_s)
        doubt = self._health.doubt(now_s)
        if doubt and self._begun:
            return self._monitor.doubt(doubt, now_s)
        if self._over:
            return self._monitor.over(now_s, self._before_any)
        return self._monitor.at(now_s)

    def late(self) -> dict[str, float]:
        """Return the cameras that deliver clearly later than the others: name, seconds."""
        return self._health.late()

    def _weighed(self, probability: float, time_s: float, now_s: float | None) -> StabilityDecision:
        """Return the state by the newest number: never STABLE where slip is not followed."""
        decision = self._monitor.push(probability, time_s, True, now_s)
        unseen = self._unseen()
        if unseen is None or decision.alarm or probability >= self._config.warn:
            return decision
        return self._monitor.doubt(unseen, time_s if now_s is None else now_s)

    def _unseen(self) -> str | None:
        """Return why the slip over a gel is not known; None where all are followed."""
        if self._watch is None:
            return None
        exchanged = self._watch.exchanged
        if exchanged is not None:
            return REASONS["exchanged"].say(camera=self._cameras[exchanged].name)
        lost = self._watch.lost(self._config.largest_age_s)
        return None if lost is None else REASONS["slip lost"].say(camera=self._cameras[lost].name)

    def _waiting(self) -> str:
        """Return what is waited for before the first answer, and how long it will take."""
        contract = self.bundle.contract
        if self._rest is None:
            early = max(len(self._early), len(self._early_rows))
            early = early if self._watch is None else self._watch.waiting
            left = max(self._settle.stop, contract.frames) - early
            return REASONS["settling"].say(left_s=max(0, left) / self._rate_hz)
        left = contract.frames - len(self._ring)
        return REASONS["window"].say(left_s=left / self._rate_hz)

    def _look(self, found: FrameSet) -> tuple[tuple[NDArray[np.uint8], ...], list[int]]:
        """Return the images, and which cameras show another one than those returned before."""
        changed = [
            camera
            for camera, (eye, frame) in enumerate(zip(self._eyes, found.frames, strict=True))
            if eye.differs(frame.jpeg)
        ]
        self._fresh.update(changed)  # still new later, where another camera's cannot be decoded
        self._beside.map(lambda camera: self._eyes[camera].see(found.frames[camera].jpeg), changed)
        images = []
        for eye in self._eyes:
            if eye.image is None:
                raise BadSource("a frame of each camera", REASONS["no input"].say(), "wait")
            images.append(eye.image)
        fresh, self._fresh = sorted(self._fresh), set()
        return tuple(images), fresh

    def _next_window(
        self, images: tuple[NDArray[np.uint8], ...], fresh: list[int], found: FrameSet
    ) -> tuple[NDArray[np.float32] | None, bool]:
        """Return the window of a grasp that is made, and whether it was found to begin now."""
        if self._starts is None:
            return self._window(images, fresh, found), False
        ready, began = self._starts.take(images, fresh, found)
        if began:
            self._before_any = False
            eyes, self._eyes = self._eyes, []
            self._forget()
            self._eyes = eyes
        elif not ready and not self._over:
            eyes, self._eyes = self._eyes, []
            self._leave()
            self._eyes = eyes
        window = None
        for earlier in ready:
            window = self._window(*earlier)
        return window, began

    def _window(
        self, images: tuple[NDArray[np.uint8], ...], fresh: Sequence[int], found: FrameSet
    ) -> NDArray[np.float32] | None:
        """Return the scaled window that ends with these images; None while it is not complete."""
        if self._watch is not None:
            return self._slip_window(self._watch, images, found)
        if self.bundle.backbone is not None:
            if fresh:
                rows = self.bundle.backbone.run(frames=np.stack([images[c] for c in fresh]))
                if self._rows.shape[1:] != rows.shape[1:]:  # of each place of the image
                    self._rows = np.zeros((len(images), *rows.shape[1:]), np.float32)
                self._rows = self._rows.copy()
                self._rows[list(fresh)] = rows
            return self._next(self._rows, found.time_s)
        if self._slips is None:
            self._early.append((images, found.time_s))
            if len(self._early) < self._settle.stop:
                return None
            return self._begin()
        return self._next(self._gel_rows(images, fresh), found.time_s)

    def _slip_window(
        self, watch: SlipWatch, images: tuple[NDArray[np.uint8], ...], found: FrameSet
    ) -> NDArray[np.float32] | None:
        """Take in a moment's slip; return the scaled window that ends with it."""
        window = None
        taken_s = [taken_of(frame) for frame in found.frames]
        for row in watch.push(images, taken_s, found.time_s):
            self._rest = self._rows
            window = self._ring.push((row - self.bundle.offset) * self.bundle.factor)
        return window

    def _begin(self) -> NDArray[np.float32] | None:
        """Set up the gels' references, then go through the frames that were waiting."""
        self._slips = []
        for camera in range(self.bundle.contract.cameras):
            part = [images[camera] for images, _ in self._early[self._settle]]
            different = [
                image for i, image in enumerate(part) if i == 0 or image is not part[i - 1]
            ]
            self._slips.append(SlipFeatures(different))
        window = None
        before: tuple[NDArray[np.uint8], ...] | None = None
        for images, time_s in self._early:
            fresh = [
                c for c, image in enumerate(images) if before is None or image is not before[c]
            ]
            window = self._next(self._gel_rows(images, fresh), time_s)
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

    def _next(self, rows: NDArray[np.float32], time_s: float) -> NDArray[np.float32] | None:
        """Take in a moment's features; return the scaled window that ends with it."""
        if self._rest is not None:
            return self._ring.push(self._scaled(rows, self._rest), time_s)
        self._early_rows.append((rows, time_s))
        if len(self._early_rows) < self._settle.stop:
            return None
        self._rest = settled(np.stack([row for row, _ in self._early_rows[self._settle]]))
        window = None
        for row, taken_s in self._early_rows:
            window = self._ring.push(self._scaled(row, self._rest), taken_s)
        self._early_rows = []
        return window

    def _scaled(self, rows: NDArray[np.float32], rest: NDArray[np.float32]) -> NDArray[np.float32]:
        tare = self.bundle.contract.tare
        change = compared(rows, rest) if tare == "local-size" else seen(rows, rest, tare)
        return np.asarray((change - self.bundle.offset) * self.bundle.factor, np.float32)
