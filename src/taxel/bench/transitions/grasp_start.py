"""Rows of `taxel bench transitions` on the start of a grasp, found by the images alone.

Grasps of test cups are simulated from open jaws on, rendered and JPEG-coded; what is found in each
is kept in a folder, so that a run that was stopped goes on. Brushes against one gel stand among
them. Knows nothing about how rows are printed.

Source: docs/decisions/0045.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, get_args

import numpy as np
from scipy.stats import binomtest

from taxel.bench.rows import Row, missing, row
from taxel.evaluation.early_warning.events import poisson_interval
from taxel.frame_codec import decode_jpeg, encode_jpeg
from taxel.labels.grasp_start import Rgb, find_starts
from taxel.recordings.whole import write_whole
from taxel.sim.pour.cups import FORCES_N, POSITIONS, Kind, PourRun, draw_cup
from taxel.sim.pour.scene_draws import draw_grasp
from taxel.sources.simulated.pour_sets import CAMERA_HZ, simulate_videos
from taxel.training.frames.features import default_cache
from taxel.training.slip.cups import FRAME_HZ, SEED, TEST_CUPS

SECONDS = 8.0
"""Length of a recording: open jaws, closing, lift, and what follows. Our choice."""
EARLY_S, LATE_S = 0.1, 1.0
"""A start that is detected so long before or after the true one is false, or missed. Our choice,
docs/decisions/0045."""
BRUSH_EVERY = 3
"""Of so many grasps one is followed by a brush against one gel. Our choice."""


@dataclass(frozen=True, slots=True)
class Detection:
    """One recording: the truth, and what was detected."""

    kind: str
    settled_s: float | None
    """None where nothing is grasped."""
    starts_s: tuple[float, ...]
    seconds: float


def starts_folder() -> Path:
    """Return where the detections are kept."""
    return default_cache() / "grasp-starts-1"


def start_runs() -> Iterator[tuple[str, PourRun]]:
    """Yield what is rendered: (file's name, run)."""
    kinds: tuple[Kind, ...] = get_args(Kind)
    for number, cup in enumerate(TEST_CUPS):
        position, force_n = POSITIONS[number % 3], FORCES_N[number // 3 % len(FORCES_N)]
        kind = kinds[number % len(kinds)]
        run = draw_grasp(SEED, draw_cup(SEED, cup), position, force_n, kind, 30, approach=True)
        yield f"{cup}.json", run
        if number % BRUSH_EVERY == 0:
            yield f"{cup}-brush.json", brushed(run)


def brushed(run: PourRun) -> PourRun:
    """Return a run whose jaws stop as soon as the first gel touches the cup."""
    assert run.scene is not None
    assert run.approach is not None
    never = replace(run.approach, lag_s=1e6, settled_s=1e6)
    return replace(run, scene=replace(run.scene, approach=never))


def detect(run: PourRun) -> Detection:
    """Simulate a recording and find the starts in its images."""
    track, videos = simulate_videos(run, CAMERA_HZ, FRAME_HZ, SECONDS)
    images = [
        [decode_jpeg(encode_jpeg(image), video.info) for image in video.images] for video in videos
    ]

    def shown() -> Iterator[tuple[list[Rgb], float]]:
        for moment, time_s in enumerate(track.time_s):
            newest = [
                images[side][int(video.times.shown[moment])] for side, video in enumerate(videos)
            ]
            yield newest, float(time_s)

    settled_s = run.approach.settled_s if run.approach is not None else None
    return Detection(
        kind="brush" if settled_s is None or settled_s > SECONDS else run.kind,
        settled_s=None if settled_s is None or settled_s > SECONDS else settled_s,
        starts_s=tuple(start for start, _ in find_starts(shown(), len(videos))),
        seconds=SECONDS,
    )


def render(folder: Path) -> None:
    """Simulate what is not kept yet: about ten minutes of one core."""
    import cv2

    cv2.setNumThreads(1)
    folder.mkdir(parents=True, exist_ok=True)
    for name, run in start_runs():
        if not (folder / name).exists():
            write_whole(folder / name, json.dumps(asdict(detect(run))).encode())


def kept(folder: Path) -> list[Detection]:
    """Return the detections so far."""
    found = []
    for name, _ in start_runs():
        if (folder / name).exists():
            values: dict[str, Any] = json.loads((folder / name).read_text())
            found.append(Detection(**{**values, "starts_s": tuple(values["starts_s"])}))
    return found


def grasp_start_rows() -> list[Row]:
    """Simulate what is missing and return the rows."""
    render(starts_folder())
    return rows_of(kept(starts_folder()))


def rows_of(detections: list[Detection]) -> list[Row]:
    """Return share found, delay and false starts of recordings."""
    name = "start of a grasp, found by itself"
    grasps = [grasp for grasp in detections if grasp.settled_s is not None]
    if not grasps:
        return [missing(f"{name}: share found", "share", ">= 0.98", "nothing simulated yet")]
    delays, false = [], 0
    for moment in detections:
        true = [
            start - moment.settled_s
            for start in moment.starts_s
            if moment.settled_s is not None and -EARLY_S <= start - moment.settled_s <= LATE_S
        ]
        delays += true[:1]
        false += len(moment.starts_s) - len(true[:1])
    minutes = sum(moment.seconds for moment in detections) / 60.0
    low, high = binomtest(len(delays), len(grasps)).proportion_ci(0.95, "exact")
    least, most = poisson_interval(false, minutes)
    brushes = len(detections) - len(grasps)
    few = ""
    if len(grasps) < len(TEST_CUPS):
        few = f" (asked: {len(TEST_CUPS)} cups; go on with --full)"
    return [
        row(f"{name}: share found", len(delays) / len(grasps), "share", ">=", 0.98,
            f"{len(delays)} of {len(grasps)} on test cups, all kinds, found within {LATE_S:g} s; "
            f"95 % {low:.3f} … {high:.3f}, exact binomial{few}"),
        row(f"{name}: median delay after both gels bear the force",
            float(np.median(delays)) if delays else float("inf"), "s", "<=", 0.3,
            f"5 to 95 %: {np.percentile(delays or [np.nan], 5):.2f} to "
            f"{np.percentile(delays or [np.nan], 95):.2f} s"),
        row(f"{name}: false starts", false / minutes, "1/min", "<=", 0.1,
            f"{false} in {minutes:.1f} min, {brushes} brushes against one gel among them; 95 % "
            f"{least:.2f} … {most:.2f}, exact Poisson"),
    ]  # fmt: skip
