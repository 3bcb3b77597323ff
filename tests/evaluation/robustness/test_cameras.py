"""Faults of tactile cameras, and a grasp bundle watched through them."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from taxel.bundles.grasp import read_grasp_bundle
from taxel.bundles.shipped import CUP_POUR, shipped_bundle
from taxel.decisions.stability import Stability
from taxel.errors import BadInput
from taxel.evaluation.early_warning.events import RunOutcome
from taxel.evaluation.robustness.grasp_sweep import (
    Watched,
    grasp_point,
    plan_images,
    truth_labels,
    watch,
)
from taxel.evaluation.robustness.image_faults import (
    IMAGE_FAULTS,
    blur,
    exposure,
    fade,
    find_image_fault,
)
from taxel.frame_codec import decode_jpeg
from taxel.gel.markers import find_markers
from taxel.live.grasp_monitor import GraspMonitor
from taxel.recordings.reader import iterate_frames
from taxel.signals import Frame
from taxel.windows.camera_recordings import read_camera_recording


@pytest.fixture(scope="module")
def frames(pour_made_once: Path) -> list[Frame]:
    """The first half second: two cameras, 30 moments."""
    return [frame for frame, _ in zip(iterate_frames(pour_made_once), range(60), strict=False)]


def damaged(name: str, level: float, frames: list[Frame], seed: int = 0) -> list[Frame]:
    return list(IMAGE_FAULTS[name].make(frames, level, np.random.default_rng(seed)))


@pytest.mark.parametrize("name", sorted(IMAGE_FAULTS))
def test_every_fault_gives_frames_that_decode_and_the_same_twice(name: str, frames: list[Frame]):
    level = IMAGE_FAULTS[name].levels[1]
    first, again = (damaged(name, level, frames) for _ in range(2))

    assert first == again
    assert all(decode_jpeg(frame.jpeg, None).shape == (240, 320, 3) for frame in first[:4])
    stamps = {(frame.camera, frame.fitted_s) for frame in frames}
    assert {(frame.camera, frame.fitted_s) for frame in first} <= stamps


@pytest.mark.parametrize("name", ["bright", "image-noise", "fading", "jpeg", "exposure-step"])
def test_repeated_images_stay_repeated(name: str, frames: list[Frame]):
    """A 25 Hz camera in a 60 Hz video: health is told from equal bytes."""

    def repeats(of: list[Frame]) -> list[bool]:
        left = [frame.jpeg for frame in of if frame.camera == 0]
        return [a == b for a, b in pairwise(left)]

    assert repeats(damaged(name, IMAGE_FAULTS[name].levels[-1], frames)) == repeats(frames)
    assert any(repeats(frames))


def test_a_stop_doubles_the_light_and_white_stays_white():
    image = np.array([[[10, 100, 200]]], np.uint8)

    assert exposure(image, 1.0).tolist() == [[[20, 200, 255]]]
    assert exposure(image, -1.0).tolist() == [[[5, 50, 100]]]


def test_blur_keeps_the_light_and_takes_the_detail(frames: list[Frame]):
    image = decode_jpeg(frames[0].jpeg, None)
    soft = blur(image, 4.0)

    assert soft.mean() == pytest.approx(image.mean(), abs=0.5)
    assert (
        np.diff(soft.astype(float), axis=1).std() < 0.5 * np.diff(image.astype(float), axis=1).std()
    )


def test_ink_that_has_gone_leaves_no_markers_and_the_rest_as_it_was(frames: list[Frame]):
    image = decode_jpeg(frames[0].jpeg, None)
    gone = fade(image, 1.0)

    assert len(find_markers(image)) > 20
    assert len(find_markers(gone)) < 4
    assert np.median(np.abs(gone.astype(int) - image)) <= 1


def test_lost_markers_are_as_many_as_the_level_says(frames: list[Frame]):
    before = len(find_markers(decode_jpeg(frames[0].jpeg, None)))
    after = len(find_markers(decode_jpeg(damaged("marker-loss", 50.0, frames[:2])[0].jpeg, None)))

    assert 0.2 * before < after < 0.8 * before


def test_a_slower_camera_shows_fewer_images(frames: list[Frame]):
    shown = {frame.jpeg for frame in damaged("frame-rate", 10.0, frames) if frame.camera == 0}

    assert len(shown) == 5  # half a second of 10 a second
    assert len(damaged("frame-rate", 10.0, frames)) == len(frames)


def test_lost_frames_are_gone(frames: list[Frame]):
    many = [replace(frames[i % 60], fitted_s=float(i)) for i in range(3000)]

    assert len(damaged("frame-loss", 20.0, many)) == pytest.approx(2400, abs=100)


def test_an_unknown_fault_is_refused():
    with pytest.raises(BadInput, match="marker-loss"):
        find_image_fault("rain")
    with pytest.raises(BadInput, match="marker-loss"):
        plan_images(["rain"])


def test_truth_is_by_the_bundles_own_rule(pour_made_once: Path):
    pour = read_camera_recording(pour_made_once)
    low, high = (truth_labels(pour, rule) for rule in ("slip > 100 um", "slip > 600 um"))

    assert (low >= high).all()
    assert (truth_labels(pour, "slip") == low).all()
    with pytest.raises(BadInput, match="physics truth"):
        truth_labels(pour, "change")


@pytest.mark.slow
def test_a_bundle_is_watched_by_the_live_path_and_dead_cameras_are_unknown(pour_made_once: Path):
    bundle = read_grasp_bundle(shipped_bundle(CUP_POUR))
    pour = read_camera_recording(pour_made_once)
    clean = watch(bundle, GraspMonitor, pour)
    slow = watch(bundle, GraspMonitor, pour, "frame-rate", 1.0)

    assert (clean.states != Stability.UNKNOWN).mean() > 0.95
    assert (slow.states == Stability.UNKNOWN).mean() > 0.5
    assert clean.cup == "00"


def test_balanced_accuracy_weighs_both_kinds_alike_and_unknown_is_not_an_answer():
    """Of 8 stable moments all are right; of 2 unstable ones one is; two more are UNKNOWN."""
    states = np.array([0] * 8 + [1, 0] + [3, 3], np.int8)
    unstable = np.array([False] * 8 + [True] * 4)
    held = RunOutcome(event=False, warned_s=None, delay_s=None, lead_s=None, early=False,
                      false_alarms=2, judged_s=30.0, unknown_share=0.0, groups={})  # fmt: skip
    slipped = replace(held, event=True, lead_s=0.2, false_alarms=0, judged_s=0.0)
    runs = [Watched("a", unstable, states, slipped), Watched("b", unstable, states, held)]
    found = grasp_point(runs, "blur", 2.0, "px")

    assert found.accuracy == pytest.approx(0.75)
    assert (found.low, found.high) == pytest.approx((0.75, 0.75))
    assert found.answered == pytest.approx(10 / 12)
    assert found.grasps == 1.0
    assert found.outside == pytest.approx(4.0)
