"""Exact poses of object and gel where the gels shear as layers, as a follower would see them.

A layer's face moves differently at each place, so "the gel's pose" depends on which places are
asked: here it is that of the dots which a follower finds in the image of the settled grasp, with
the follower's own weights around the imprint. One image of each camera is rendered, the rest is
computed. Knows nothing about noise, heads, thresholds or scores.

Source: docs/decisions/0037.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.frame_codec import decode_jpeg, encode_jpeg
from taxel.gel.touch_poses import TouchFollower
from taxel.sim.gelsight.camera import HEIGHT_PX, WIDTH_PX
from taxel.sim.gelsight.mini import (
    CameraTimes,
    GelCamera,
    SensorNuisance,
    camera_times,
    draw_sensor,
)
from taxel.sim.gelsight.shear import face_moved, face_place
from taxel.sim.pour.cup_pour import PourTrack, simulate_pour
from taxel.sim.pour.cups import PourRun
from taxel.sim.pour.state import GelMotion
from taxel.sim.pour.views import LayerView
from taxel.sources.simulated.pour_sets import CAMERA_HZ, FINE, SIDES, camera_info, motion_at
from taxel.training.slip.cups import DURATION_S, FRAME_HZ, GelRows, PourRows, pour_rows, true_rows
from taxel.windows.rest import SETTLE

_EDGE_PX: Final = 8.0
"""Distance from the image's border within which a dot is not seen whole: half a large dot."""
_MIDDLE_PX: Final = np.array([(WIDTH_PX - 1) / 2, (HEIGHT_PX - 1) / 2])


def layer_pours(runs: Sequence[PourRun]) -> list[PourRows]:
    """Return pours' exact poses, the gel's at the dots that a follower uses.

    Args:
        runs: What is tried; simulated one by one, half a second each.
    """
    return [_layer_pour(run) for run in runs]


def _layer_pour(run: PourRun) -> PourRows:
    track = simulate_pour(run, FRAME_HZ * FINE, DURATION_S, 2, FINE)
    first, second = (_gel_rows(run, track, side) for side in range(len(SIDES)))
    return pour_rows(run, track, (first, second))


def _gel_rows(run: PourRun, track: PourTrack, side: int) -> GelRows:
    """Return one camera's rows: those of the simulator, but for the gel's motion."""
    seed = run.seed * 2 + side
    times = camera_times(CAMERA_HZ, FRAME_HZ, DURATION_S, seed)
    motion = motion_at(track.motions[side], track.time_s, times.taken_s)
    sensor = draw_sensor(run.seed, side)
    camera = GelCamera(track.shapes[side], sensor, seed)
    view = LayerView(track.layer, FRAME_HZ, side)
    rows = true_rows(motion, times)
    gel, rim = _gel_at_dots(camera, sensor, side, motion, times, view, rows.object)
    return replace(rows, gel=gel, rim=rim)


def _gel_at_dots(
    camera: GelCamera,
    sensor: SensorNuisance,
    side: int,
    motion: GelMotion,
    times: CameraTimes,
    view: LayerView,
    handle: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the rigid motion of the face at the dots, in the contact and around its rim.

    Shape (2, images, 3), mm and rad.

    The follower's weights go with the imprint, and so with the handle's exact pose.
    """
    settled = sorted(set(times.shown[SETTLE].tolist()))
    reference = settled[len(settled) // 2]
    reference_s = float(times.taken_s[reference])
    rest = view.at(reference_s)
    image = camera.frame(motion, reference, reference_s, rest)
    info = camera_info(SIDES[side], sensor, CAMERA_HZ, FRAME_HZ, 2)
    follower = TouchFollower([decode_jpeg(encode_jpeg(image), info)])
    to_px = 1.0 / sensor.mm_per_px
    printed = face_place(rest, (follower.dots - _MIDDLE_PX) * sensor.mm_per_px)
    to_poses = np.array([to_px, to_px, 1.0])
    poses = np.empty((2, len(times.taken_s), 3))
    for index, taken_s in enumerate(times.taken_s):
        moved = (printed + face_moved(view.at(float(taken_s)), printed)) * to_px
        inside = np.asarray((np.abs(moved) < _MIDDLE_PX - _EDGE_PX).all(axis=1), np.bool_)
        pose = (handle[index] - handle[reference]) * to_poses
        poses[:, index] = follower.carried(moved + _MIDDLE_PX, inside, pose)
    return np.asarray(poses / to_poses)
