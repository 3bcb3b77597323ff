"""Claims about the simulated pour whose gripper obeys while it runs."""

import numpy as np
import pytest

from taxel.errors import BadInput
from taxel.signals import Frame
from taxel.sim.pour.cup_pour import CupPourConfig, Gel, list_runs
from taxel.sim.pour.cups import PourRun
from taxel.sim.pour.scene_draws import draw_grasp
from taxel.sources.opening import open_source
from taxel.sources.simulated.pour import SimPour
from taxel.sources.simulated.pour_sets import simulate_videos, video_frames
from taxel.sources.simulated.stepped_pour import SteppedPour

RUNS = list_runs(CupPourConfig(cups=1, first_cup=4001, forces_n=(15.0,), negatives=1.0))
LIFTED = draw_grasp(0, RUNS[0].cup, "lower", 15.0, "lift", approach=True)
CARRIED = draw_grasp(0, RUNS[0].cup, "lower", 15.0, "carry")
GRIP = 5
"""Column of the true grip in the truth."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("run", "camera_hz", "gel"),
    [
        (RUNS[0], 25.0, 1),
        (RUNS[1], 60.0, 1),
        (RUNS[0], 25.0, 2),
        (LIFTED, 25.0, 1),
        (CARRIED, 25.0, 2),
    ],
)
def test_without_commands_frames_and_truth_are_the_recorded_ones_to_the_last_byte(
    run: PourRun, camera_hz: float, gel: Gel
) -> None:
    track, videos = simulate_videos(run, camera_hz, 60.0, 1.0, gel)
    pour = SteppedPour(run, camera_hz, 60.0, 1.0, gel=gel)
    for frames, samples in video_frames(track, videos):
        own_frames, own_samples = pour.step()
        assert own_frames == frames
        np.testing.assert_array_equal(own_samples.values, samples.values)
        assert own_samples.fitted_s == samples.fitted_s
    assert pour.ended
    np.testing.assert_array_equal(pour.track().truth, track.truth)
    assert pour.cameras == tuple(video.info for video in videos)


@pytest.mark.parametrize("gel", [1, 2])
def test_looking_away_changes_nothing_of_what_is_seen_later(gel: Gel) -> None:
    seen, away = (SteppedPour(RUNS[0], duration_s=1.0, gel=gel) for _ in range(2))
    for index in range(60):
        frames, _ = seen.step()
        others, _ = away.step(look=index > 40)
        assert others == (frames if index > 40 else [])


def test_a_pour_cannot_go_on_after_its_end() -> None:
    pour = SteppedPour(RUNS[0], duration_s=1.0)
    for _ in range(60):
        pour.step(look=False)
    with pytest.raises(ValueError, match="has not ended"):
        pour.step()


def test_a_command_shows_in_the_truth_and_in_the_pictures_after_its_latency() -> None:
    quiet, held = SteppedPour(RUNS[0], 60.0), SteppedPour(RUNS[0], 60.0)
    pairs = []
    for index in range(60):
        pairs.append((quiet.step(), held.step()))
        if index == 29:
            held.grip(50.0)
    equal = [a[0] == b[0] for a, b in pairs]
    assert all(equal[:30])
    assert not any(equal[38:])
    force = np.array([b[1].values[0, GRIP] for _, b in pairs])
    assert force[30] < 16.0
    assert force[40] > 40.0
    assert np.diff(force).max() <= 300.0 / 60 * 1.04


Driven = tuple[list[Frame], np.ndarray]


def drive(url: str, force_n: float | None, at_s: float = 0.5) -> Driven:
    """Return all frames and the true grip of a source that is told one force."""
    frames: list[Frame] = []
    grips: list[np.ndarray] = []
    ordered = False
    with open_source(url) as source:
        assert isinstance(source, SimPour)
        while not source.ended:
            grips.append(source.read().values[:, GRIP])
            frames += source.frames()
            if frames and force_n and not ordered:
                ordered = frames[-1].fitted_s - frames[0].fitted_s >= at_s
                if ordered:
                    source.grip(force_n)
    return frames, np.concatenate(grips)


URL = "sim://cup-pour?cup=4001&force_n=15&runs=2&duration_s=1&camera_hz=5&speed=max"


@pytest.fixture(scope="module")
def quiet() -> Driven:
    return drive(URL, None)


def test_a_live_source_obeys_until_its_grasp_ends_and_starts_the_next_one_anew(
    quiet: Driven,
) -> None:
    _, held = drive(URL, 40.0)
    np.testing.assert_array_equal(held[:30], quiet[1][:30])
    assert 38.0 < held[55] < 42.0
    np.testing.assert_array_equal(held[60:], quiet[1][60:])


def test_a_command_for_a_grasp_that_is_over_is_not_given_to_the_next(
    quiet: Driven,
) -> None:
    frames, truth = quiet
    last = [frame.fitted_s for frame in frames if frame.camera == 0][59] - frames[0].fitted_s
    _, held = drive(URL, 40.0, at_s=last)
    np.testing.assert_array_equal(held, truth)


def test_a_force_that_is_no_number_is_refused() -> None:
    with open_source(URL) as source:
        assert isinstance(source, SimPour)
        source.read()
        source.frames()
        assert source.commanded_n == 15.0
        with pytest.raises(BadInput):
            source.grip(float("nan"))
