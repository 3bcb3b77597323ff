"""A pour seen by both cameras, moment by moment, so that its grip may follow what they show.

While nothing is commanded, frames and truth are those of `simulate_videos`, to the last
byte: a camera's image is never newer than the moment that shows it, so what has been
simulated so far is all that its picture needs. Knows nothing about models, decisions,
files or waiting.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from taxel.frame_codec import encode_jpeg
from taxel.signals import Frame, Samples
from taxel.sim.gelsight.mini import GelCamera, camera_times, draw_sensor
from taxel.sim.pour.cup_pour import Gel, PourTrack
from taxel.sim.pour.cups import PourRun
from taxel.sim.pour.gel_shear import LayerMoment
from taxel.sim.pour.grip_response import GrippedPour, GripResponseConfig
from taxel.sim.pour.state import GelMotion, HandleShape, truth_columns
from taxel.sim.pour.views import (
    LayerView,
    gel_motion,
    handle_shape,
    layer_motion,
    layer_state,
    with_layers,
)
from taxel.sources.simulated.pour_sets import (
    CAMERA_HZ,
    FINE,
    SIDES,
    camera_info,
    frame_of,
    motion_at,
)


class SteppedPour:
    """One pour, simulated up to the moment that was asked for last.

    Args:
        run: What is tried.
        camera_hz: Images a second that the cameras take.
        frame_hz: Moments a second.
        duration_s: Length, seconds.
        response: How the gripper answers to `grip`.
        most_lost: Images in a row that a camera may lose; None as in data sets, without a limit.
        gel: How the gels shear.
    """

    def __init__(
        self,
        run: PourRun,
        camera_hz: float = CAMERA_HZ,
        frame_hz: float = 60.0,
        duration_s: float = 6.0,
        response: GripResponseConfig | None = None,
        most_lost: int | None = None,
        gel: Gel = 1,
    ) -> None:
        self.run = run
        self._pour = GrippedPour(run, response)
        self._frame_hz = frame_hz
        self._fine = round(duration_s * frame_hz * FINE)
        self._fine_s = np.arange(self._fine) / (frame_hz * FINE)
        self.moments = len(range(0, self._fine, FINE))
        """How many there are."""
        self._shapes = (handle_shape(run, 0), handle_shape(run, 1))
        self._motions = (_still(self._fine), _still(self._fine))
        self._layers = self._pour.sim.layers() if gel == 2 else None
        self._layer: list[LayerMoment] = []
        self._truth = np.zeros((self.moments, len(truth_columns(gel, run.scene is not None)[0])))
        self._done = 0
        self._eyes = [
            _Eye(
                run,
                side,
                shape,
                _Taking(camera_hz, frame_hz, duration_s, most_lost, gel),
                self._layer,
            )
            for side, shape in enumerate(self._shapes)
        ]
        self.cameras = tuple(eye.info for eye in self._eyes)
        """The cameras, in the order of `Frame.camera`."""

    @property
    def ended(self) -> bool:
        """True once the last moment was given."""
        return self._done == self.moments

    @property
    def time_s(self) -> float:
        """The newest moment that was given, seconds since the grasp; minus infinity before."""
        return (self._done - 1) / self._frame_hz if self._done else -np.inf

    @property
    def commanded_n(self) -> float:
        """The command that the gripper now obeys, newtons."""
        return self._pour.gripper.target_n

    @property
    def force_n(self) -> float:
        """What the gripper's own force is now, newtons."""
        return self._pour.gripper.force_n

    def grip(self, force_n: float, after_s: float = 0.0) -> None:
        """Command a grip force; it works as late and as gradually as the gripper does.

        Args:
            force_n: Newtons, cut to the gripper's limits.
            after_s: How long after the newest moment the command is given, seconds.

        Raises:
            BadInput: The force is no number.
        """
        self._pour.gripper.command(force_n, after_s)

    def prepare(self) -> None:
        """Make the gels that the cameras see, which takes most of a second, before they are asked
        for: the first `step` does it otherwise.
        """
        for eye in self._eyes:
            eye.prepare()

    def step(self, look: bool = True) -> tuple[list[Frame], Samples]:
        """Go on to the next moment; return a frame a camera, and the truth.

        Args:
            look: False simulates without pictures, which is an order of magnitude faster.

        Raises:
            ValueError: The pour has ended.
        """
        if self.ended:
            raise ValueError("needed a pour that has not ended")
        index, self._done = self._done, self._done + 1
        if index == 0:
            self._keep(0)
        for fine in range((index - 1) * FINE + 1, index * FINE + 1) if index else ():
            self._pour.step(1.0 / (self._frame_hz * FINE))
            self._keep(fine)
        time_s = index / self._frame_hz
        self._truth[index] = self._state()
        until = slice(0, index * FINE + 1)
        frames = []
        if look:
            for eye, motion in zip(self._eyes, self._motions, strict=True):
                frames.append(eye.look(motion, self._fine_s[until], index, time_s))
        scan = Samples.from_values(self._truth[index : index + 1], np.array([time_s]))
        return frames, replace(scan, counter=np.array([index]))

    def _state(self) -> NDArray[np.float64]:
        """Return the truth now; let gels of version 2 follow."""
        state = self._pour.sim.state
        if self._layers is None:
            return state
        self._layer.append(self._layers.step(self._pour.sim.hold()))
        return with_layers(state, layer_state(self._layer[-1], self._layer[0]))

    def track(self) -> PourTrack:
        """Return the truth so far, and how the gels moved."""
        run, known = self.run, slice(0, max(0, self._done - 1) * FINE + 1)
        pours = run.flow_g_s > 0
        motions = (_part(self._motions[0], known), _part(self._motions[1], known))
        if self._layer:
            left, right = motions
            motions = (layer_motion(left, self._layer, 0), layer_motion(right, self._layer, 1))
        return PourTrack(
            time_s=np.arange(self._done) / self._frame_hz,
            motions=motions,
            shapes=self._shapes,
            truth=self._truth[: self._done],
            pour_start_s=run.start_s if pours else float("inf"),
            pour_end_s=run.start_s + run.amount_g / run.flow_g_s if pours else float("inf"),
            layer=tuple(self._layer),
        )

    def _keep(self, fine: int) -> None:
        row, patch = self._pour.sim.gel(), self._pour.sim.patch_mm
        for side, motion in enumerate(self._motions):
            _copy(gel_motion([row], side, np.array([patch])), motion, fine)


@dataclass(frozen=True, slots=True)
class _Taking:
    """How both cameras take images; see `SteppedPour`."""

    camera_hz: float
    frame_hz: float
    duration_s: float
    most_lost: int | None
    gel: Gel


class _Eye:
    """One camera of a pour that goes on."""

    def __init__(
        self,
        run: PourRun,
        side: int,
        shape: HandleShape,
        taking: _Taking,
        layer: list[LayerMoment],
    ) -> None:
        seed = run.seed * 2 + side
        sensor = draw_sensor(run.seed, side)
        self._side = side
        camera_hz, frame_hz, gel = taking.camera_hz, taking.frame_hz, taking.gel
        self._times = camera_times(
            camera_hz, frame_hz, taking.duration_s, seed, most_lost=taking.most_lost
        )
        self._camera: GelCamera | None = None
        self._make = (shape, sensor, seed)
        self._seen = _still(len(self._times.taken_s))
        self._number, self._jpeg = -1, b""
        self._shear = LayerView(layer, frame_hz, side) if gel == 2 else None
        self.info = camera_info(
            SIDES[side], sensor, camera_hz, frame_hz, gel, approach=run.approach is not None
        )

    def prepare(self) -> GelCamera:
        """Make this camera's gel, once."""
        if self._camera is None:
            self._camera = GelCamera(*self._make)
        return self._camera

    def look(
        self, motion: GelMotion, fine_s: NDArray[np.float64], index: int, time_s: float
    ) -> Frame:
        """Return the frame of a moment up to which the gel's motion is known."""
        shown = int(self._times.shown[index])
        if shown != self._number:
            camera = self.prepare()
            taken_s = self._times.taken_s[shown : shown + 1]
            first = max(int(np.searchsorted(fine_s, taken_s[0], side="right")) - 1, 0)
            near = slice(first, min(first + 2, len(fine_s)))
            _copy(motion_at(_part(motion, near), fine_s[near], taken_s), self._seen, shown)
            face = None if self._shear is None else self._shear.at(float(taken_s[0]))
            image = camera.frame(self._seen, shown, float(taken_s[0]), face)
            self._number, self._jpeg = shown, encode_jpeg(image)
        return frame_of(self._side, self._jpeg, shown, self._times, time_s)


def _still(count: int) -> GelMotion:
    """Return a motion whose moments are to be filled in."""
    pair, single = (count, 2), (count,)
    return GelMotion(
        depth_mm=np.zeros(single),
        object_mm=np.zeros(pair),
        object_rad=np.zeros(single),
        gel_mm=np.zeros(pair),
        gel_rad=np.zeros(single),
        patch_mm=np.zeros(pair),
    )


def _part(motion: GelMotion, part: slice) -> GelMotion:
    return GelMotion(
        depth_mm=motion.depth_mm[part],
        object_mm=motion.object_mm[part],
        object_rad=motion.object_rad[part],
        gel_mm=motion.gel_mm[part],
        gel_rad=motion.gel_rad[part],
        patch_mm=motion.patch_mm[part],
    )


def _copy(motion: GelMotion, into: GelMotion, index: int) -> None:
    """Fill in one moment."""
    into.depth_mm[index] = motion.depth_mm[0]
    into.object_mm[index] = motion.object_mm[0]
    into.object_rad[index] = motion.object_rad[0]
    into.gel_mm[index] = motion.gel_mm[0]
    into.gel_rad[index] = motion.gel_rad[0]
    into.patch_mm[index] = motion.patch_mm[0]
