"""Slip warnings with other cameras than the simulated ones: 25 frames a second, larger images."""

from dataclasses import replace
from itertools import pairwise

import cv2
import numpy as np
import pytest

from taxel.bundles.grasp import read_grasp_bundle
from taxel.bundles.shipped import DEFAULT_WARNING, shipped_bundle
from taxel.frame_codec import decode_jpeg, encode_jpeg
from taxel.live.grasp_monitor import GraspMonitor
from taxel.live.slip_watch import SlipWatch
from taxel.sources.simulated.stepped_pour import SteppedPour
from taxel.training.slip.cups import paper_runs
from taxel.windows.pairs import FramePairer, FrameSet


@pytest.fixture(scope="module")
def grasp():
    """A pour that slips: its cameras, and 4 s of moments with a frame of each."""
    run = next(run for run in paper_runs(31_000) if run.kind == "pour")
    stepped = SteppedPour(run)
    return stepped.cameras, [tuple(stepped.step()[0]) for _ in range(240)]


def watched(cameras, moments):
    """Return each moment after the settled grasp, with the score and the slip (mm) there."""
    monitor = GraspMonitor(read_grasp_bundle(shipped_bundle(DEFAULT_WARNING)), cameras)
    pairer, found = FramePairer(2), []
    for frames in moments:
        for frame in frames:
            monitor.see(frame)
            pair = pairer.push(frame)
            if pair is not None:
                answer = monitor.push(pair)
                found.append((pair.time_s, answer.probability, answer.decision.slip.distance_mm))
    times, scores, slips = np.array(found).T
    known = times > 0.5
    return times[known], scores[known], slips[known]


def alike(found, expected, within_mm):
    """Whether scores and slips are those that are expected at the nearest moment."""
    nearest = np.abs(found[0][:, None] - expected[0]).argmin(axis=1)
    score, slip = (np.abs(found[k] - expected[k][nearest]) for k in (1, 2))
    warned = [times[scores > 0.5][0] for times, scores, _ in (found, expected)]
    assert warned[0] == pytest.approx(warned[1], abs=0.06)
    assert np.quantile(score, 0.9) < 0.1
    assert np.quantile(slip[expected[2][nearest] < 0.5], 0.9) < within_mm


def test_new_images_alone_warn_as_soon(grasp):
    """Simulated cameras send each image two or three times; a GelSight Mini sends it once."""
    cameras, moments = grasp
    before, new = [b"", b""], []
    for frames in moments:
        new.append(tuple(frame for frame in frames if frame.jpeg != before[frame.camera]))
        for frame in frames:
            before[frame.camera] = frame.jpeg
    slow = tuple(replace(camera, rate_hz=25.0) for camera in cameras)
    expected, found = watched(cameras, moments), watched(slow, new)

    assert len(found[0]) < 0.5 * len(expected[0])
    alike(found, expected, 0.02)


def test_larger_images_are_scaled_down(grasp):
    cameras, moments = grasp
    known: dict[bytes, bytes] = {}

    def large(frame):
        if frame.jpeg not in known:
            image = cv2.resize(decode_jpeg(frame.jpeg, None), (640, 480))
            known[frame.jpeg] = encode_jpeg(image)
        return replace(frame, jpeg=known[frame.jpeg])

    larger = tuple(
        replace(camera, width=640, height=480, mm_per_px=camera.mm_per_px / 2) for camera in cameras
    )
    found = watched(larger, [tuple(map(large, frames)) for frames in moments])

    alike(found, watched(cameras, moments), 0.05)  # coded twice


def test_of_sixty_new_images_a_second_half_are_followed(grasp):
    """Rates over so many images are learned from 25 a second."""
    cameras, moments = grasp
    noise = np.random.default_rng(0)
    watch, rows = SlipWatch(cameras), []
    for frames in moments[:80]:
        noisy = [
            decode_jpeg(frame.jpeg, None) ^ noise.integers(0, 2, (240, 320, 3), np.uint8)
            for frame in frames
        ]
        new = tuple(
            replace(frame, jpeg=encode_jpeg(image))
            for frame, image in zip(frames, noisy, strict=True)
        )
        rows += watch.see(FrameSet(new))
    changed = [not np.array_equal(a, b) for a, b in pairwise(rows)]
    assert np.mean(changed) == pytest.approx(0.5, abs=0.05)
