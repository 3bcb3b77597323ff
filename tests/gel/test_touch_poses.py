"""Object and gel are followed apart, to micrometres, and as fast as the cameras deliver."""

from itertools import islice

import cv2
import numpy as np
import pytest

from taxel.errors import BadSource
from taxel.frame_codec import decode_jpeg, encode_jpeg
from taxel.gel.imprint_pose import ImprintFollower
from taxel.gel.touch_poses import TouchFollower
from taxel.sim.pour.cup_pour import CupPourConfig, list_runs
from taxel.sim.pour.state import TRUTH_CHANNELS
from taxel.sources.simulated.pour_sets import motion_at, simulate_videos
from taxel.training.slip.cups import gel_about_middle
from taxel.windows.rest import SETTLE

MIDDLE = np.array([159.5, 119.5])


def moved_by(x, y, turn):
    """The affine map of a pose about the image's middle."""
    cos, sin = np.cos(turn), np.sin(turn)
    shift = MIDDLE + np.array([x, y]) - np.array([[cos, -sin], [sin, cos]]) @ MIDDLE
    return np.float32([[cos, -sin, shift[0]], [sin, cos, shift[1]]])


@pytest.fixture(scope="module")
def world(paint, dot_grid):
    """Return a function: an image with dots and a textured imprint, each moved."""
    dots = dot_grid(31.5)
    rng = np.random.default_rng(3)
    fine = cv2.GaussianBlur(rng.normal(0, 1, (240, 320)), (0, 0), 3.0)
    fine = fine * 0.15 / fine.std()
    y, x = np.mgrid[:240, :320]
    fine *= np.hypot((x - 160) / 110, (y - 120) / 80) < 1

    def image(gel=(0.0, 0.0, 0.0), held=(0.0, 0.0, 0.0), seed=0):
        shade = cv2.warpAffine(fine, moved_by(*held), (320, 240), flags=cv2.INTER_CUBIC)
        turned = (dots - MIDDLE) @ np.array(
            [[np.cos(gel[2]), np.sin(gel[2])], [-np.sin(gel[2]), np.cos(gel[2])]]
        ) + MIDDLE + gel[:2]  # fmt: skip
        lit = paint(turned).astype(float) * (1 + shade[..., None] * np.array([1.0, 0.2, -0.8]))
        lit += np.random.default_rng(seed).normal(0, 1.0, lit.shape)
        return np.clip(np.rint(lit), 0, 255).astype(np.uint8)

    return image


@pytest.mark.slow
def test_object_and_gel_are_followed_apart(world):
    follower = TouchFollower([world(seed=s) for s in range(3)])
    for step in range(1, 9):
        share = step / 8
        pose = follower.follow(
            world((1.0 * share, 0.5 * share, 0.01 * share),
                  (4.0 * share, 2.0 * share, 0.06 * share), seed=step)
        )  # fmt: skip

    assert pose.seen
    assert pose.object == pytest.approx([4.0, 2.0, 0.06], abs=0.15)
    assert pose.object[2] == pytest.approx(0.06, abs=0.002)
    assert pose.gel == pytest.approx([1.0, 0.5, 0.01], abs=0.1)
    assert pose.gel[2] == pytest.approx(0.01, abs=0.001)


def test_slip_is_measured_at_the_imprints_middle(world):
    """A turn about a place away from the image's middle is no shift of that place."""
    follower = TouchFollower([world(seed=s) for s in range(3)])
    pose = follower.follow(world(held=(0.0, 0.0, 0.03), seed=9))

    assert np.hypot(*pose.slip[:2]) < 0.5
    assert pose.slip[2] == pytest.approx(0.03, abs=0.002)


def test_nothing_moves_where_nothing_moves(world):
    follower = TouchFollower([world(seed=s) for s in range(3)])
    poses = np.stack([follower.follow(world(seed=20 + s)).slip for s in range(6)])

    assert np.abs(poses[:, :2]).max() < 0.06
    assert np.abs(poses[:, 2]).max() < 0.002


@pytest.mark.parametrize("first", [False, True])
@pytest.mark.parametrize("turn", [0.17, -0.22])
def test_a_push_that_turns_both_in_one_image_is_followed(world, turn, first):
    """Further than the imprint's own fit reaches, and the outer dots by half a spacing."""
    follower = TouchFollower([world(seed=s) for s in range(3)])
    if not first:
        follower.follow(world(seed=7))
    for seed in (8, 9):
        pose = follower.follow(world((1.0, 0.5, turn), (1.2, 0.6, 1.1 * turn), seed=seed))

    assert pose.seen
    assert pose.gel == pytest.approx([1.0, 0.5, turn], abs=0.2)
    assert pose.object[2] == pytest.approx(1.1 * turn, abs=0.005)
    assert pose.object[:2] == pytest.approx([1.2, 0.6], abs=0.4)


def test_a_push_while_the_imprint_is_lost_is_caught_up_with(world, monkeypatch):
    follower = TouchFollower([world(seed=s) for s in range(3)])
    follower.follow(world(seed=7))
    pushed = (1.0, 0.5, 0.2), (1.2, 0.6, 0.22)
    with monkeypatch.context() as lost:
        lost.setattr("taxel.gel.imprint_pose._Key.align", lambda *_: None)
        assert not follower.follow(world(*pushed, seed=8)).seen
    pose = follower.follow(world(*pushed, seed=9))

    assert pose.seen
    assert pose.object[2] == pytest.approx(0.22, abs=0.005)


@pytest.mark.slow
def test_a_long_turn_goes_on_from_a_new_key_image(world):
    follower = ImprintFollower(world())
    for step in range(1, 15):
        found = follower.follow(world(held=(0.0, 0.0, 0.03 * step), seed=step))

    assert found.seen
    assert found.pose[2] == pytest.approx(0.42, abs=0.01)


def test_streaming_equals_batch(world):
    reference = [world(seed=s) for s in range(2)]
    frames = [world(held=(0.4 * i, 0.0, 0.01 * i), seed=i) for i in range(5)]
    follower = TouchFollower(reference)

    alone = [follower.follow(frame) for frame in frames]
    again = TouchFollower(reference)

    for pose, frame in zip(alone, frames, strict=True):
        other = again.follow(frame)
        assert np.array_equal(pose.object, other.object)
        assert np.array_equal(pose.gel, other.gel)
        assert np.array_equal(pose.spread, other.spread)


@pytest.mark.parametrize("level", [0, 128, 255])
def test_an_empty_image_is_not_followed(level):
    image = np.full((240, 320, 3), level, np.uint8)

    pose = TouchFollower([image]).follow(image)

    assert not pose.seen
    assert np.array_equal(pose.slip, np.zeros(3))


def test_black_images_in_between_leave_the_last_pose(world):
    follower = TouchFollower([world()])
    before = follower.follow(world(held=(2.0, 0.0, 0.0), seed=1))
    dark = follower.follow(np.zeros((240, 320, 3), np.uint8))
    after = follower.follow(world(held=(2.0, 0.0, 0.0), seed=2))

    assert not dark.seen
    assert np.array_equal(dark.object, before.object)
    assert after.seen
    assert after.object[0] == pytest.approx(2.0, abs=0.15)


def test_images_of_another_shape_are_refused(world):
    with pytest.raises(BadSource, match="shape"):
        TouchFollower([world()]).follow(np.zeros((120, 160, 3), np.uint8))


def errors_of(run, seconds):
    """Each gel's errors of object less gel (mm, mm, rad), and true and followed turn."""
    track, videos = simulate_videos(run, 25.0, 60.0, seconds)
    found = []
    for side, video in enumerate(videos):
        taken_s = video.times.taken_s
        fine_s = np.arange(len(track.motions[side].depth_mm)) / 120.0
        motion = motion_at(track.motions[side], fine_s, taken_s)
        slip_um = np.interp(taken_s, track.time_s, track.truth[:, TRUTH_CHANNELS.index("slip")])
        count = int(np.argmax(slip_um > 350)) if (slip_um > 350).any() else len(taken_s)
        images = [
            decode_jpeg(encode_jpeg(image), video.info) for image in islice(video.images, count)
        ]
        settled = sorted(i for i in set(video.times.shown[SETTLE].tolist()) if i < count)
        follower = TouchFollower([images[i] for i in settled])
        poses = [follower.follow(image) for image in images]
        mm = video.info.mm_per_px
        followed = np.stack([pose.object - pose.gel for pose in poses]) * (mm, mm, 1.0)
        held = np.column_stack([motion.object_mm, motion.object_rad])
        true = (held - gel_about_middle(motion))[:count]
        followed, true = (each - np.median(each[settled], axis=0) for each in (followed, true))
        used = taken_s[:count] > 0.4
        found.append((followed[used] - true[used], true[used][:, 2], followed[used][:, 2]))
    return found


@pytest.mark.slow
def test_error_budget_against_the_simulators_truth():
    """Median over 26 camera-pours, slip below 350 µm, JPEG included: a quarter above what was
    measured, 4.1 µm, 4.4 µm, 2.5 mrad and 0.97.

    What was asked, 4 µm, 3 µm and 2.5 mrad, is judged by rows of `taxel bench transitions` over
    hundreds of camera-pours.
    """
    rms, gains = [], []
    for cup in range(31_000, 31_005):
        runs = list_runs(CupPourConfig(cups=1, first_cup=cup))
        for run in runs[cup % 4 :: 5]:
            for error, true, followed in errors_of(run, 3.5):
                rms.append(np.sqrt((error**2).mean(axis=0)))
                if np.ptp(true) > 0.03:
                    gains.append(np.polyfit(true, followed, 1)[0])
    x, y, turn = np.median(rms, axis=0)

    assert len(rms) >= 20
    assert x <= 0.0051
    assert y <= 0.0055
    assert turn <= 0.0031
    assert 0.9 <= np.median(gains) <= 1.05
