"""Claims about joining cameras: each frame once, partners close in time, order kept."""

from taxel.signals import Frame
from taxel.windows.pairs import FramePairer, join_frames


def frame(camera: int, time_s: float) -> Frame:
    return Frame(
        camera=camera, jpeg=b"", counter=0, device_s=time_s, arrival_s=time_s, fitted_s=time_s
    )


def times(frames: list[Frame]) -> list[tuple[float, ...]]:
    return [tuple(f.fitted_s for f in s.frames) for s in join_frames(frames, 2)]


def test_frames_of_one_moment_make_a_set() -> None:
    frames = [frame(c, n / 60) for n in range(4) for c in (0, 1)]
    assert times(frames) == [(n / 60, n / 60) for n in range(4)]


def test_the_newest_of_a_fast_camera_wins() -> None:
    frames = [frame(0, 0.00), frame(0, 0.02), frame(1, 0.03)]
    assert times(frames) == [(0.02, 0.03)]


def test_partners_too_far_apart_are_let_go() -> None:
    pairer = FramePairer(2, skew_s=0.05)
    assert pairer.push(frame(0, 0.0)) is None
    assert pairer.push(frame(1, 0.2)) is None
    found = pairer.push(frame(0, 0.21))
    assert found is not None
    assert found.time_s == 0.21
    assert pairer.dropped == 1


def test_one_camera_needs_no_partner() -> None:
    assert len(list(join_frames([frame(0, n / 25) for n in range(5)], 1))) == 5


def test_a_silent_camera_gives_no_set() -> None:
    assert times([frame(0, n / 60) for n in range(50)]) == []
