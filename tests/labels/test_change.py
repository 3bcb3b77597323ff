"""The paper's rule sees a changed image, and nothing in noise, exposure or glitches."""

from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taxel.errors import BadInput
from taxel.labels.change import (
    ChangeConfig,
    ChangeMeter,
    change_signal,
    debounced,
    label_change,
    normalised_blocks,
    thresholds,
)

RATE_HZ = 60.0
SETTLED = ChangeConfig().settled(RATE_HZ)


def video(
    n: int = 90, change_at: int | None = None, gain_from: int | None = None, noise: float = 2.0
) -> Iterator[np.ndarray]:
    """A lit gel with markers 32 px apart, 12 px wide, that move by 1 px, or gets brighter."""
    rng = np.random.default_rng(0)
    gel = np.full((96, 128, 3), (90.0, 110.0, 130.0))
    gel[(np.arange(96) % 32 < 12)[:, None] & (np.arange(128) % 32 < 12)] *= 0.4
    for i in range(n):
        image = np.roll(gel, 1, axis=1) if change_at is not None and i >= change_at else gel
        if gain_from is not None and i >= gain_from:
            image = image * 1.08
        yield np.clip(np.rint(image + rng.normal(0, noise, image.shape)), 0, 255).astype(np.uint8)


def test_the_onset_is_exact_on_a_step() -> None:
    config = ChangeConfig(least_change=0.3)
    labels = label_change(change_signal(video(change_at=50), SETTLED), RATE_HZ, config)

    assert labels.dtype == np.int8
    assert labels.tolist() == [0] * 50 + [1] * 40


@pytest.mark.parametrize("noise", [0.7, 2.3])
def test_noise_alone_is_no_change(noise: float) -> None:
    """At the smallest and the largest noise measured on real sensors."""
    assert not label_change(change_signal(video(noise=noise), SETTLED), RATE_HZ).any()


def test_exposure_is_no_change() -> None:
    """A step of 8 % in brightness, in the first frames or later, is not touch."""
    assert not label_change(change_signal(video(gain_from=5), SETTLED), RATE_HZ).any()
    assert not label_change(change_signal(video(gain_from=60), SETTLED), RATE_HZ).any()


def test_brightness_cancels_exactly() -> None:
    rgb = np.random.default_rng(1).integers(10, 60, (32, 40, 3)).astype(np.uint8)

    assert np.allclose(normalised_blocks(rgb, 8), normalised_blocks(rgb * np.uint8(4), 8))


def test_blocks_are_means_in_per_cent_of_the_median() -> None:
    rgb = np.full((8, 24, 3), 100, np.uint8)
    rgb[:, 16:] = 150

    assert normalised_blocks(rgb, 8)[0, :, 0].tolist() == [100.0, 100.0, 150.0]


def test_frame_by_frame_equals_the_whole_video() -> None:
    meter = ChangeMeter(SETTLED)
    parts = [meter.push(frame) for frame in video(change_at=40)]

    assert [len(part) for part in parts[: SETTLED.stop]] == [0] * (SETTLED.stop - 1) + [
        SETTLED.stop
    ]
    assert np.array_equal(np.concatenate(parts), change_signal(video(change_at=40), SETTLED))


def test_the_threshold_follows_the_noise_of_the_settled_stretch() -> None:
    signal = np.zeros(60)
    signal[SETTLED] = np.tile([1.0, 2.0, 3.0], 5)

    config = ChangeConfig(least_change=0.3)
    assert thresholds(signal, RATE_HZ, config)[0] == pytest.approx(2.0 + 6.0 * 1.4826 * 1.0)
    assert thresholds(np.ones(60), RATE_HZ, config)[0] == pytest.approx(1.3)


def test_either_camera_shows_a_change() -> None:
    still = np.ones(60)
    moved = np.where(np.arange(60) >= 40, 5.0, 1.0)
    labels = label_change(np.stack([still, moved], axis=1), RATE_HZ)

    assert labels.tolist() == [0] * 40 + [1] * 20


def test_glitches_go_and_gaps_close() -> None:
    flags = np.array([0, 1, 0, 0, 0, 1, 1, 1, 0, 1, 1, 1, 0, 0, 0], bool)

    assert debounced(flags, 3).astype(int).tolist() == [0] * 5 + [1] * 7 + [0] * 3


@given(st.lists(st.booleans(), min_size=1, max_size=40), st.integers(1, 5))
def test_debounced_flags_stay_debounced(flags: list[bool], least: int) -> None:
    once = debounced(np.array(flags), least)

    assert np.array_equal(debounced(once, least), once)


@pytest.mark.parametrize(
    ("frames", "message"),
    [
        ([np.zeros((16, 16), np.uint8)], "colour"),
        ([np.zeros((16, 16, 3), np.uint8), np.zeros((16, 24, 3), np.uint8)], "one size"),
        ([np.zeros((16, 16, 3), np.uint8)] * 5, "at least 24 frames"),
        ([np.zeros((4, 4, 3), np.uint8)], "at least 8×8"),
        ([], "at least 24 frames"),
    ],
)
def test_bad_videos_are_refused(frames: list[np.ndarray], message: str) -> None:
    with pytest.raises(BadInput, match=message):
        change_signal(frames, SETTLED)


def test_a_signal_that_is_short_or_broken_is_refused() -> None:
    with pytest.raises(BadInput, match="at least 24"):
        label_change(np.ones(10), RATE_HZ)
    with pytest.raises(BadInput, match="finite"):
        label_change(np.full(60, np.nan), RATE_HZ)
    with pytest.raises(BadInput, match="frame rate"):
        ChangeConfig().settled(0.0)


def test_slow_cameras_still_settle_on_three_frames() -> None:
    assert ChangeConfig().settled(10.0) == slice(2, 5)
