"""Claims about the watchers of cameras: frozen, gone and late are told in time, health never is."""

import numpy as np
import pytest

from taxel.clock import ManualClock
from taxel.live.camera_health import CameraHealth
from taxel.signals import CameraInfo, Frame
from taxel.sources.opening import open_source

DELAY_S = 0.004


def info(name: str = "left", rate_hz: float = 25.0) -> CameraInfo:
    return CameraInfo(name=name, width=320, height=240, rate_hz=rate_hz)


def frame(time_s: float, image: int, camera: int = 0, delay_s: float = DELAY_S) -> Frame:
    return Frame(
        camera=camera,
        jpeg=b"\xff\xd8" + image.to_bytes(4, "big") + bytes(2000) + b"\xff\xd9",
        counter=0,
        device_s=time_s,
        arrival_s=time_s + delay_s,
        fitted_s=time_s,
    )


def healthy(health: CameraHealth, rate_hz: float, seconds: float, image_hz: float) -> float:
    """Show it a camera that is well; return when the last frame was taken."""
    times = np.arange(round(seconds * rate_hz)) / rate_hz
    for time_s in times:
        health.see(frame(time_s, int(time_s * image_hz + 1e-6)))
        assert health.doubt(time_s + DELAY_S) == ""
    return float(times[-1])


@pytest.mark.parametrize("rate_hz", [10.0, 25.0, 60.0])
def test_a_frozen_camera_is_reported_by_the_third_repeated_frame(rate_hz: float):
    health = CameraHealth((info(rate_hz=rate_hz),))
    last_s = healthy(health, rate_hz, 2.0, rate_hz)
    doubts = []
    for missing in (1, 2, 3):
        now_s = last_s + missing / rate_hz
        health.see(frame(now_s, int(last_s * rate_hz + 1e-6)))
        doubts.append(health.doubt(now_s + DELAY_S))

    assert doubts == ["", "", "the left camera is frozen"]


def test_a_25_hz_camera_in_a_60_hz_stream_is_held_to_its_own_cadence():
    """Repeats of two and three frames are natural; the third missing image is not."""
    health = CameraHealth((info(rate_hz=60.0),))
    last_s = healthy(health, 60.0, 3.0, 25.0)
    assert health.cadence_s(0) == pytest.approx(0.04, rel=0.03)

    shown_s = np.ceil(int(last_s * 25 + 1e-6) / 25 * 60) / 60  # the last image's first frame
    noticed_s = next(
        now_s
        for now_s in last_s + np.arange(1, 20) / 60
        if not health.see(frame(now_s, int(last_s * 25 + 1e-6))) and health.doubt(now_s + DELAY_S)
    )
    assert 2 / 25 < noticed_s - shown_s <= 3 / 25 + 1e-9


def test_a_frozen_camera_is_believed_again_with_its_next_image():
    health = CameraHealth((info(),))
    last_s = healthy(health, 25.0, 1.0, 25.0)
    for missing in range(1, 6):
        health.see(frame(last_s + missing / 25, 24))
    assert health.doubt(last_s + 0.2 + DELAY_S) == "the left camera is frozen"
    health.see(frame(last_s + 0.24, 99))

    assert health.doubt(last_s + 0.24 + DELAY_S) == ""
    assert health.cadence_s(0) == pytest.approx(0.04)


def test_lateness_alone_does_not_look_frozen():
    """Each frame comes 200 ms late, as over a slow link: late it may be, frozen it is not."""
    health = CameraHealth((info(),))
    for number in range(60):
        health.see(frame(number / 25, number // 2, delay_s=0.2))
        assert health.doubt(number / 25 + 0.2) == ""


@pytest.mark.parametrize("rate_hz", [25.0, 30.0, 60.0, 120.0])
def test_a_camera_that_is_gone_is_reported_within_100_ms(rate_hz: float):
    health = CameraHealth((info(rate_hz=rate_hz),))
    last_s = healthy(health, rate_hz, 1.0, rate_hz) + DELAY_S
    noticed_s = next(s for s in np.arange(0.0, 0.2, 0.001) if health.doubt(last_s + s))

    assert max(0.08, 2 / rate_hz) <= noticed_s <= 0.095
    assert health.doubt(last_s + 0.5) == "the left camera is gone: no frame for 500 ms"


def test_one_lost_frame_is_not_reported():
    health = CameraHealth((info(),))
    for number in range(100):
        if number % 10 == 7:
            assert health.doubt((number + 0.9) / 25 + DELAY_S) == ""
        else:
            health.see(frame(number / 25, number))
            assert health.doubt(number / 25 + DELAY_S) == ""


def test_a_camera_that_never_sent_a_frame_is_doubted():
    health = CameraHealth((info("left"), info("right")))
    health.see(frame(0.0, 1))

    assert health.doubt(0.01) == "the right camera has sent no frame yet"


def test_a_camera_two_frames_behind_the_other_is_reported_by_name_and_delay():
    health = CameraHealth((info("left"), info("right")))
    for number in range(40):
        health.see(frame(number / 25, number, camera=0))
        health.see(frame(number / 25, number, camera=1, delay_s=DELAY_S + 2 / 25))

    assert health.late() == {"right": pytest.approx(0.08)}
    assert health.doubt(39 / 25 + DELAY_S + 0.08) == ""


def test_one_frame_behind_and_single_late_frames_are_not_reported():
    health = CameraHealth((info("left"), info("right")))
    for number in range(60):
        health.see(frame(number / 25, number, camera=0))
        stray_s = 0.5 if number % 5 == 0 else 0.04
        health.see(frame(number / 25, number, camera=1, delay_s=DELAY_S + stray_s))

    assert health.late() == {}


def test_of_images_that_are_not_lost_a_simulated_pour_is_never_doubted():
    """A whole pour with exposure jitter and repeats, in recorded time."""
    with open_source(
        "sim://cup-pour?speed=max&runs=1&seed=5&duration_s=3", ManualClock()
    ) as source:
        health, doubts, frames = CameraHealth(source.cameras), set(), 0
        while not source.ended:
            source.read()
            for frame in source.frames():
                health.see(frame)
                frames += 1
                if frames > 2:
                    doubts.add(health.doubt(frame.arrival_s))

    assert (doubts, frames) == ({""}, 360)


def test_reset_forgets_everything():
    health = CameraHealth((info(),))
    healthy(health, 25.0, 1.0, 25.0)
    health.reset()

    assert health.doubt(0.0) == "the left camera has sent no frame yet"
    assert health.cadence_s(0) == pytest.approx(0.1)
