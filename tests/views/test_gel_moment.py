"""A moment is measured against the settled frames, with every frame between looked at."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from taxel.errors import BadInput
from taxel.frame_codec import encode_jpeg
from taxel.gel.markers import MarkerFlow, MarkerTracker
from taxel.recordings.reader import read_manifest
from taxel.signals import CameraInfo, Frame
from taxel.views.figures.gel import gels_figure
from taxel.views.gel_moment import Moment, look, touch_of
from taxel.windows.camera_recordings import frame_sets
from taxel.windows.pairs import FrameSet

RATE_HZ = 60.0
CAMERA = CameraInfo(name="only", width=320, height=240, rate_hz=RATE_HZ, mm_per_px=0.06)
SPACING_PX = 40


def dots(shift_px: float) -> np.ndarray:
    y, x = np.mgrid[:240, :320]
    far = np.hypot((x - shift_px) % SPACING_PX - 20, y % SPACING_PX - 20)
    return np.repeat(np.where(far < 6, 45, 110)[..., None], 3, axis=2).astype(np.uint8)


def moving(frames: int, px_a_frame: float, still: int = 30) -> Iterator[FrameSet]:
    """Dots that stand still and then move to the right; times start at 7 s."""
    for index in range(frames):
        time_s = 7 + index / RATE_HZ
        jpeg = encode_jpeg(dots(px_a_frame * max(0, index - still)), quality=98)
        yield FrameSet(
            (Frame(camera=0, jpeg=jpeg, counter=index, device_s=time_s, arrival_s=time_s,
                   fitted_s=time_s),)
        )  # fmt: skip


def test_dots_are_followed_further_than_their_spacing() -> None:
    """Two images alone could not tell a movement of one spacing from none."""
    seen = look(moving(47, 3.0), [CAMERA], Moment(frame=46))
    flow = seen.touches[0].flow

    middle = flow.seen & (flow.reference[:, 0] < 200)
    np.testing.assert_allclose(flow.shift[middle, 0], 48.0, atol=0.5)
    assert middle.sum() >= 10
    assert seen.time_s == pytest.approx(46 / RATE_HZ)
    alone = MarkerTracker(dots(0.0)).track(dots(48.0))
    assert np.median(alone.shift[:, 0]) < 20


def test_no_frame_beyond_the_moment_is_read() -> None:
    sets = moving(60, 0.0)
    look(sets, [CAMERA], Moment(at_s=35 / RATE_HZ))

    assert round((next(sets).time_s - 7) * RATE_HZ) == 36


def test_a_moment_among_the_settled_frames_can_be_seen() -> None:
    assert look(moving(40, 0.0), [CAMERA], Moment(frame=2)).frame == 2


def test_without_a_moment_it_is_the_last_within_the_time() -> None:
    assert look(moving(40, 0.0), [CAMERA], Moment()).frame == 39
    assert look(moving(40, 0.0), [CAMERA], Moment(until_s=0.5)).frame == 30


@pytest.mark.parametrize("moment", [Moment(frame=40), Moment(at_s=0.7)])
def test_a_moment_after_the_end_is_refused(moment: Moment) -> None:
    with pytest.raises(BadInput, match="frame from 0 to 39"):
        look(moving(40, 0.0), [CAMERA], moment)


def test_a_video_without_settled_frames_is_refused() -> None:
    with pytest.raises(BadInput, match="at least 24 frames"):
        look(moving(20, 0.0), [CAMERA], Moment(frame=1))


@pytest.mark.slow
def test_a_pour_is_described_in_words_and_drawn(pour: Path) -> None:
    cameras = read_manifest(pour).cameras
    seen = look(frame_sets(pour, 2), cameras, Moment(at_s=1.5))

    for touch in seen.touches:
        figures = touch.figures()
        assert figures["contact_mm2"] > 20
        assert "uncalibrated" in touch.words()
        assert 0 < figures["dots_seen"] <= figures["dots"]
    names = [camera.name for camera in cameras]
    drawn = gels_figure(dict(zip(names, seen.touches, strict=True)), "a pour", kind="svg")
    assert drawn.count(b"<svg") == 1


def test_a_flow_that_was_followed_is_drawn_as_it_is() -> None:
    image = dots(0.0)
    none = MarkerFlow(np.zeros((0, 2), np.float32), np.zeros((0, 2), np.float32), np.zeros(0, bool))

    followed = MarkerTracker(image).track(image)
    drawn, bare = (
        gels_figure({"left": touch_of(image, image, flow)}, "dots") for flow in (followed, none)
    )
    assert drawn != bare
