"""One recording of the simulated cup pour.

Joins dynamics, optics and camera clock, and writes what a lab would have recorded, with the
physics truth beside the images. Knows nothing about sets, windows or the command line.

Background of our choices: docs/decisions/0012.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.errors import RecordingFailed
from taxel.frame_codec import encode_jpeg
from taxel.recordings.manifest import Manifest
from taxel.recordings.writer import Recorder
from taxel.signals import FOUND, GRASPS, CameraInfo, Frame, Mark, Samples, SensorInfo
from taxel.sim.gelsight.mini import (
    CameraTimes,
    GelCamera,
    SensorNuisance,
    camera_times,
    draw_sensor,
)
from taxel.sim.pour.cup_pour import (
    SIM_VERSION,
    CupPourConfig,
    Gel,
    PourTrack,
    simulate_pour,
)
from taxel.sim.pour.cups import PourRun
from taxel.sim.pour.gel_shear_constants import GEL_VERSION
from taxel.sim.pour.state import GelMotion, truth_columns
from taxel.sim.pour.views import LayerView

SIDES = ("left", "right")
CAMERA_HZ = 25.0
"""Images a second of a GelSight Mini as sold; a 60 Hz video repeats them. Source:
docs/explanation/physics-gel."""
FINE = 2
"""Moments of the dynamics a video frame, between which a camera's image is interpolated."""
ARRIVAL_S = 0.004
"""From the camera to the host. Source: our choice."""


@dataclass(frozen=True, slots=True)
class SimulatedVideo:
    """What one camera delivers in one run."""

    info: CameraInfo
    times: CameraTimes
    images: Iterator[NDArray[np.uint8]]
    """The camera's different images in order, each shape (240, 320, 3)."""


def sensor_info(frame_hz: float, gel: Gel = 1, scene: bool = False) -> SensorInfo:
    """Return what the truth beside the images is.

    Args:
        frame_hz: Moments a second.
        gel: How the gels shear; with 2 there is more to say.
        scene: True where the gripper moves, or a grasp is made: there is more to say, too.
    """
    channels, units = truth_columns(gel, scene)
    return SensorInfo(
        name="truth",
        channels=channels,
        units=units,
        rate_hz=frame_hz,
        serial=f"sim://cup-pour {SIM_VERSION}",
    )


def simulate_videos(
    run: PourRun, camera_hz: float, frame_hz: float, duration_s: float, gel: Gel = 1
) -> tuple[PourTrack, tuple[SimulatedVideo, ...]]:
    """Return a run's track at the frames' times, and what both cameras see."""
    fine = simulate_pour(run, frame_hz * FINE, duration_s, gel, layer_every=FINE)
    videos = []
    for side, name in enumerate(SIDES):
        times = camera_times(camera_hz, frame_hz, duration_s, run.seed * 2 + side)
        sensor = draw_sensor(run.seed, side)
        camera = GelCamera(fine.shapes[side], sensor, run.seed * 2 + side)
        motion = motion_at(fine.motions[side], fine.time_s, times.taken_s)
        info = camera_info(
            name, sensor, camera_hz, frame_hz, gel, approach=run.approach is not None
        )
        shear = LayerView(fine.layer, frame_hz, side) if gel == 2 else None
        videos.append(SimulatedVideo(info, times, _images(camera, motion, times, shear)))
    part = slice(None, None, FINE)
    track = PourTrack(
        time_s=fine.time_s[part],
        motions=fine.motions,
        shapes=fine.shapes,
        truth=fine.truth[part],
        pour_start_s=fine.pour_start_s,
        pour_end_s=fine.pour_end_s,
        layer=fine.layer,
    )
    return track, tuple(videos)


def camera_info(
    name: str,
    sensor: SensorNuisance,
    camera_hz: float,
    frame_hz: float,
    gel: Gel = 1,
    approach: bool = False,
) -> CameraInfo:
    """Return what one simulated camera is.

    Args:
        name: One of `SIDES`.
        sensor: Its nuisances.
        camera_hz: Images a second that it takes.
        frame_hz: Frames a second that it delivers.
        gel: How its gel shears.
        approach: True where the gel is untouched at first.
    """
    details = {"camera_hz": f"{camera_hz:g}"}
    if approach:
        details[GRASPS] = FOUND
    if gel == 2:
        details["gel"] = GEL_VERSION
    return CameraInfo(
        name=name,
        width=320,
        height=240,
        rate_hz=frame_hz,
        mm_per_px=sensor.mm_per_px,
        serial=f"sim://cup-pour {SIM_VERSION} {name}",
        details=details,
    )


def write_run(
    folder: Path | str, run: PourRun, config: CupPourConfig, camera_hz: float
) -> dict[str, Any]:
    """Simulate a run and write its recording into a folder that is there; return its row.

    A recording that a killed worker left there is replaced.

    Args:
        folder: Where the recording goes.
        run: The cup and how it is tried.
        config: Frames a second, length and version of the gel.
        camera_hz: Images a second of each camera.

    Raises:
        RecordingFailed: The folder is gone, or the disk refused.
    """
    track, videos = simulate_videos(run, camera_hz, config.frame_hz, config.duration_s, config.gel)
    row = describe_run(run, track)
    manifest = Manifest.started_now(
        sensor_info(config.frame_hz, config.gel, run.scene is not None),
        groups=groups_of(run),
        now_s=0.0,
        cameras=tuple(video.info for video in videos),
    )
    folder = Path(folder)
    if not folder.is_dir():  # the folder's owner was killed: nobody would remove it again
        raise RecordingFailed(f"needed the folder {folder}; it is gone; start again.")
    with Recorder(folder / f"{run.name}.mcap", manifest, overwrite=True) as recorder:
        for frames, samples in video_frames(track, videos):
            recorder.write(samples)
            for frame in frames:
                recorder.frame(frame)
        recorder.mark(mark_of(run, track, row))
    return row


def video_frames(
    track: PourTrack, videos: tuple[SimulatedVideo, ...]
) -> Iterator[tuple[list[Frame], Samples]]:
    """Yield, at each moment of the video, a frame a camera and the truth."""
    latest: list[tuple[int, bytes]] = [(-1, b"")] * len(videos)
    for index, time_s in enumerate(track.time_s):
        frames = []
        for camera, video in enumerate(videos):
            shown = int(video.times.shown[index])
            while latest[camera][0] < shown:
                latest[camera] = (latest[camera][0] + 1, encode_jpeg(next(video.images)))
            frames.append(frame_of(camera, latest[camera][1], shown, video.times, float(time_s)))
        scan = Samples.from_values(track.truth[index : index + 1], track.time_s[[index]])
        yield frames, replace(scan, counter=np.array([index]))


def frame_of(camera: int, jpeg: bytes, shown: int, times: CameraTimes, time_s: float) -> Frame:
    """Return the frame that a camera delivers at a moment.

    Args:
        camera: Which one.
        jpeg: The image that it shows.
        shown: That image's number.
        times: The camera's.
        time_s: The moment, seconds.
    """
    return Frame(
        camera=camera,
        jpeg=jpeg,
        counter=shown,
        device_s=float(times.taken_s[shown]) + 10.0,
        arrival_s=time_s + ARRIVAL_S,
        fitted_s=time_s,
    )


def groups_of(run: PourRun) -> dict[str, str]:
    """Return what must not be split, and nuisances worth keeping."""
    groups = {
        "cup": f"{run.cup.index:02d}",
        "position": run.position,
        "force_n": f"{run.force_n:g}",
        "kind": run.kind,
        "run": run.name,
        "start_s": f"{run.start_s:.3f}",
    }
    if run.approach is not None:
        groups["contact_s"] = f"{run.approach.contact_s:.3f}"
        groups["settled_s"] = f"{run.approach.settled_s:.3f}"
    if run.scene is not None and run.scene.path.stop is not None:
        groups["stopped_s"] = f"{run.scene.path.stop.at_s:.3f}"
    return groups


def mark_of(run: PourRun, track: PourTrack, row: dict[str, Any]) -> Mark:
    """Return the whole run as one trial, with what became of it."""
    return Mark(
        start_s=float(track.time_s[0]),
        end_s=float(track.time_s[-1]),
        labels={"outcome": row["outcome"]},
        groups=groups_of(run),
    )


def describe_run(run: PourRun, track: PourTrack) -> dict[str, Any]:
    """Return a run's row for people: what it was and what became of it."""
    slip_um, dropped = track.truth[:, 0], track.truth[-1, 7] > 0
    gross = slip_um > 300
    outcome = "drop" if dropped else "gross slip" if gross.any() else "hold"
    return {
        "run": run.name,
        "cup": run.cup.index,
        "position": run.position,
        "force_n": run.force_n,
        "kind": run.kind,
        "outcome": outcome,
        "slip_um": float(slip_um[-1]),
        "rotation_deg": float(track.truth[-1, 2]),
        "start_s": run.start_s,
        "gross_slip_s": float(track.time_s[np.argmax(gross)]) if gross.any() else None,
    }


def _images(
    camera: GelCamera, motion: GelMotion, times: CameraTimes, shear: LayerView | None
) -> Iterator[NDArray[np.uint8]]:
    for index, taken_s in enumerate(times.taken_s):
        face = None if shear is None else shear.at(float(taken_s))
        yield camera.frame(motion, index, float(taken_s), face)


def motion_at(
    motion: GelMotion, time_s: NDArray[np.float64], taken_s: NDArray[np.float64]
) -> GelMotion:
    """Return a motion at other moments, by straight lines between those known.

    Args:
        motion: At the known moments.
        time_s: Those moments, seconds, shape (known,), rising.
        taken_s: When images were taken, seconds on the same clock, shape (n,).
    """

    def at(values: NDArray[np.float64]) -> NDArray[np.float64]:
        if values.ndim == 1:
            return np.asarray(np.interp(taken_s, time_s, values))
        return np.stack([np.interp(taken_s, time_s, column) for column in values.T], axis=1)

    return GelMotion(
        depth_mm=at(motion.depth_mm),
        object_mm=at(motion.object_mm),
        object_rad=at(motion.object_rad),
        gel_mm=at(motion.gel_mm),
        gel_rad=at(motion.gel_rad),
        patch_mm=at(motion.patch_mm),
    )
