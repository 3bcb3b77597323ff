"""What each of two gels sees of one pour: the right one looks at the cup from behind.

Knows nothing about forces, pixels or files.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from taxel.sim.pour.cups import PourRun
from taxel.sim.pour.elastic_layer import LayerPatch
from taxel.sim.pour.gel_shear import LayerMoment
from taxel.sim.pour.state import TRUTH_CHANNELS, GelMotion, HandleShape

Array = NDArray[np.float64]
GelRow = tuple[Array, Array, Array, float | Array]
"""The handle's move (3,), each gel's move (2, 2) and twist (2,), and depth of both or of each."""


def gel_motion(rows: Sequence[GelRow], side: int, patches: Array) -> GelMotion:
    """Return one gel's view of how handle and gel move.

    Args:
        rows: What `PourSim.gel` gave, a moment each.
        side: 0 left, 1 right.
        patches: Shape (moments, 2): the contact's half axes, millimetres.
    """
    mirror = 1.0 if side == 0 else -1.0
    place = np.stack([row[0] for row in rows])
    moved = np.stack([row[1][side] for row in rows])
    turn = np.array([row[2][side] for row in rows])
    flip = np.array([mirror, 1.0])
    depth = np.array([row[3] for row in rows])
    return GelMotion(
        depth_mm=depth if depth.ndim == 1 else depth[:, side],
        object_mm=place[:, :2] * flip,
        object_rad=place[:, 2] * mirror,
        gel_mm=moved * flip,
        gel_rad=turn * mirror,
        patch_mm=patches,
    )


def handle_shape(run: PourRun, side: int) -> HandleShape:
    """Return what a gel sees of a run's handle."""
    mirror = 1.0 if side == 0 else -1.0
    cup = run.cup
    return HandleShape(
        radius_across_mm=cup.radius_across_mm,
        radius_along_mm=cup.bend_mm * (1.0 if side == 0 else 1.3),
        width_mm=cup.width_mm,
        axis_rad=mirror * (run.tilt_rad + 0.7 * run.along),
        texture_um=cup.texture_um,
        texture_mm=cup.texture_mm,
        texture_along=cup.texture_along,
        texture_seed=int(np.random.default_rng([15, cup.index, side]).integers(2**31)),
    )


@dataclass(frozen=True, slots=True)
class FaceShear:
    """How the face of one gel is sheared at one moment, as its camera sees it."""

    patch: LayerPatch
    source_mm2: NDArray[np.float32]
    """Shape (cells, 2): see `LayerPatch.field`."""
    middle_mm: Array
    """Shape (2,): the contact's middle (x, y) on the unmoved face."""
    angle_rad: float
    """Direction of the contact's long axis on the unmoved face, 0 = vertical, clockwise."""


def face_shear(moment: LayerMoment, side: int) -> FaceShear:
    """Return one gel's view of both gels' state; the right one sees it mirrored."""
    source, middle, angle = (
        moment.source_mm2[side], moment.middle_mm[side], float(moment.angle_rad[side])
    )  # fmt: skip
    if side == 1:
        flip = np.array([-1.0, 1.0], np.float32)
        source, middle, angle = source[moment.patch.mirror] * flip, middle * flip, -angle
    return FaceShear(moment.patch, source, middle, angle)


class LayerView:
    """One gel's view of a growing list of moments, and of what lies between them.

    Args:
        layer: Moments, evenly spaced from time zero on; it may grow.
        rate_hz: Of these.
        side: 0 left, 1 right.
    """

    def __init__(self, layer: Sequence[LayerMoment], rate_hz: float, side: int) -> None:
        self._layer, self._rate_hz, self._side = layer, rate_hz, side

    def at(self, time_s: float) -> FaceShear:
        """Return how the face is sheared, by a straight line between the moments around it.

        Args:
            time_s: Since the grasp; before and after all moments the nearest holds.
        """
        place = min(max(time_s * self._rate_hz, 0.0), len(self._layer) - 1.0)
        first = int(place)
        here = face_shear(self._layer[first], self._side)
        share = place - first
        if share < 1e-9:
            return here
        then = face_shear(self._layer[first + 1], self._side)
        if here.patch is not then.patch:  # the contact changed its size by a step
            return then if share > 0.5 else here
        mixed = (1.0 - np.float32(share)) * here.source_mm2 + np.float32(share) * then.source_mm2
        middle = (1.0 - share) * here.middle_mm + share * then.middle_mm
        angle = (1.0 - share) * here.angle_rad + share * then.angle_rad
        return FaceShear(here.patch, mixed, middle, angle)


def layer_motion(motion: GelMotion, layer: Sequence[LayerMoment], side: int) -> GelMotion:
    """Return a gel's motion with the movement of a layer's face in place of the brushes'.

    Args:
        motion: Of n moments.
        layer: At evenly spaced ones of them, from the first on.
        side: 0 left, 1 right.
    """
    mirror = 1.0 if side == 0 else -1.0
    moved = np.stack([moment.moved_mm[side] - layer[0].moved_mm[side] for moment in layer])
    turn = np.array([moment.turn_rad[side] - layer[0].turn_rad[side] for moment in layer])
    count = len(motion.depth_mm)
    return replace(
        motion,
        gel_mm=_between(moved, count) * np.array([mirror, 1.0]),
        gel_rad=_between(turn[:, None], count)[:, 0] * mirror,
    )


def layer_truth(layer: Sequence[LayerMoment], count: int) -> Array:
    """Return what is recorded of gels that shear as layers, shape (count, 6): `LAYER_CHANNELS`."""
    return _between(np.stack([layer_state(moment, layer[0]) for moment in layer]), count)


def with_layers(truth: Array, layers: Array) -> Array:
    """Return truth with the layers' columns in their place; the last axis is that of columns."""
    own = len(TRUTH_CHANNELS)
    return np.concatenate([truth[..., :own], layers, truth[..., own:]], axis=-1)


def layer_state(moment: LayerMoment, first: LayerMoment) -> Array:
    """Return one row of that truth, shape (6,).

    Args:
        moment: The gels now.
        first: The gels at the grasp.
    """
    turn = np.degrees(moment.turn_rad - first.turn_rad)
    return np.concatenate([moment.slip_um, moment.at_limit, turn])


def _between(values: Array, count: int) -> Array:
    """Return values (n, d) at `count` moments; they are known at every so many of them."""
    if len(values) == count:
        return values
    every = -(-count // len(values))
    known = np.arange(len(values)) * every
    return np.stack([np.interp(np.arange(count), known, column) for column in values.T], axis=1)
