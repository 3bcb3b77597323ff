"""Watch recordings of grasps as live, one after another, and keep the states.

Knows nothing about truth, scores or screens.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Final

import numpy as np

from taxel.bundles.grasp import read_grasp_bundle
from taxel.decisions.grasp_track import GraspTrack
from taxel.errors import BadBundle
from taxel.live.frame_loop import ends_grasp
from taxel.live.grasp_monitor import GraspMonitor
from taxel.models.devices import CPU
from taxel.recordings.reader import read_recording
from taxel.windows.camera_recordings import frame_sets

_ROUNDED_S: Final = 1e-6
"""By which times of a mark and of a frame may differ, seconds: recordings round both."""


def watch_grasps(bundle: Path, path: Path, device: str = CPU) -> list[GraspTrack]:
    """Return what a bundle says of each grasp of a recording, with its own thresholds.

    A mark with an outcome ends a grasp; a recording without any is one grasp.

    Args:
        bundle: The file of a bundle that watches a grasp.
        path: The recording.
        device: On which ONNX Runtime runs the bundle.

    Raises:
        BadBundle: The bundle cannot be used, or was not made for such cameras.
        BadRecording: The recording is damaged.
    """
    opened = read_grasp_bundle(bundle, device=device)
    recording = read_recording(path)
    manifest = recording.manifest
    try:
        monitor = GraspMonitor(opened, manifest.tactile)
    except BadBundle as error:  # of a folder of recordings, which one?
        mend = "leave this recording out, or name a bundle for such cameras"
        raise BadBundle(error.needed, f"{error.got}: {path}", mend) from error
    ends = sorted((mark for mark in recording.marks if ends_grasp(mark)), key=lambda m: m.end_s)
    grasps = [(mark.end_s, mark.labels, mark.groups) for mark in ends] or [(math.inf, {}, {})]
    sets = frame_sets(path, len(manifest.tactile))
    found = next(sets, None)
    tracks = []
    for end_s, labels, groups in grasps:
        states: list[int] = []
        times: list[float] = []
        scores: list[float] = []
        while found is not None and found.time_s <= end_s + _ROUNDED_S:
            answer = monitor.push(found)
            states.append(int(answer.decision.state))
            times.append(found.time_s)
            scores.append(answer.probability)
            found = next(sets, None)
        if times:
            monitor.over(times[-1])
        tracks.append(
            GraspTrack(
                states=np.array(states, np.int8), time_s=np.array(times), scores=np.array(scores),
                labels={**manifest.labels, **labels}, groups={**manifest.groups, **groups},
            )
        )  # fmt: skip
    return tracks
