"""Claims about features on disk and heads that learn from them."""

import signal
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from taxel.errors import BadDataset
from taxel.frame_codec import decode_jpeg
from taxel.training.frames.features import FrameFeatures, Progress, extract, load_kept, save_kept
from taxel.training.frames.heads import PAPER, HeadConfig, Track, fit_head
from taxel.training.frames.labels import change_signals, frame_labels, rate_of
from taxel.windows.camera_recordings import frame_sets, read_camera_recordings
from taxel.windows.rest import SETTLE


@dataclass
class Means:
    """A backbone that counts what it is given: the mean of each colour."""

    key: str = "means"
    features: int = 3
    in_order: bool = False
    places: bool = False
    seen: int = 0

    def of(self, images: Sequence[NDArray[np.uint8]]) -> NDArray[np.float32]:
        self.seen += len(images)
        return np.stack([image.mean(axis=(0, 1)) for image in images]).astype(np.float32)


KILLED = """
import os, signal, sys
from pathlib import Path
import numpy as np
from taxel.training.frames.features import save_kept
np.save = lambda *_, **__: os.kill(os.getpid(), signal.SIGKILL)
save_kept(Path(sys.argv[1]), np.ones((2, 3), np.float32))
"""


LIMITED = """
import resource, signal, sys
from pathlib import Path
import numpy as np
from taxel.training.frames.features import save_kept
resource.setrlimit(resource.RLIMIT_FSIZE, (4000, 4000))
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
try:
    save_kept(Path(sys.argv[1]), np.ones((10, 2304), np.float32))
except OSError as error:
    print(error)
"""


def test_each_different_image_is_computed_once_and_never_again(
    few_pours: Path, tmp_path: Path
) -> None:
    pours = read_camera_recordings(few_pours)[:2]
    backbone, steps = Means(), list[Progress]()
    first = extract(pours, backbone, tmp_path, steps.append)
    assert backbone.seen == sum(pour.images for pour in pours) < 2 * sum(map(len, pours))
    assert (steps[-1].recordings, steps[-1].frames) == (2, backbone.seen)
    again = Means()
    second = extract(pours, again, tmp_path)
    assert again.seen == 0
    for cached, other in zip(first, second, strict=True):
        np.testing.assert_array_equal(cached.all(), other.all())
    assert first[0].all().shape == (len(pours[0]), 2, 3)


def test_a_damaged_cache_is_computed_again(few_pours: Path, tmp_path: Path) -> None:
    pours = read_camera_recordings(few_pours)[:1]
    expected = extract(pours, Means(), tmp_path)[0].all()
    (file,) = (tmp_path / "features" / "means").glob("*.npy")
    file.write_bytes(file.read_bytes()[:100])
    np.testing.assert_array_equal(extract(pours, Means(), tmp_path)[0].all(), expected)


def test_in_order_extractors_see_every_frame_of_a_camera(few_pours: Path, tmp_path: Path) -> None:
    pours = read_camera_recordings(few_pours)[:1]
    means = extract(pours, Means(), tmp_path)[0].all()
    ordered = extract(pours, Means(key="ordered", in_order=True), tmp_path)[0].all()
    np.testing.assert_array_equal(ordered, means)


@dataclass
class Halves(Means):
    """Two places of an image, its left and its right half: the mean of each colour."""

    key: str = "halves"
    places: bool = True

    def of(self, images: Sequence[NDArray[np.uint8]]) -> NDArray[np.float32]:
        parts = np.stack([np.array_split(image, 2, axis=1) for image in images])
        return parts.mean(axis=(2, 3), dtype=np.float32)


def test_places_are_compared_with_the_grasp_at_rest_before_their_mean_is_taken(
    few_pours: Path, tmp_path: Path
) -> None:
    pours = read_camera_recordings(few_pours)[:1]
    found = extract(pours, Halves(), tmp_path)[0].all()
    images = [
        [decode_jpeg(frame.jpeg, pours[0].cameras[frame.camera]) for frame in moment.frames]
        for moment in frame_sets(pours[0].path, 2)
    ]
    apart = np.stack([Halves().of(pair) for pair in images])  # frames, cameras, places, colours
    rest = np.median(apart[SETTLE], axis=0)
    np.testing.assert_allclose(found, np.abs(apart - rest).mean(axis=2), atol=1e-4)
    whole = np.abs(apart.mean(axis=2) - np.median(apart.mean(axis=2)[SETTLE], axis=0))
    assert found[60:].mean() > 1.5 * whole[60:].mean()  # halves that change apart do not cancel


def test_a_head_takes_features_that_were_compared_as_they_are() -> None:
    recordings = tracks(4, 0)
    config = HeadConfig(frames=4, epochs=1, tare="local-size")
    head = fit_head(recordings, config)
    values = recordings[0].features()
    np.testing.assert_allclose(head.scale(values), (values - head.offset) * head.factor, rtol=1e-6)
    other = fit_head(recordings, replace(config, tare="none"))
    np.testing.assert_array_equal(head.probabilities(values), other.probabilities(values))


def test_a_correction_by_hand_wins_over_the_rule(few_pours: Path, tmp_path: Path) -> None:
    from taxel.labels.corrections import Correction, corrections_path, write_correction

    pours = read_camera_recordings(few_pours)[:1]
    signals = change_signals(pours, tmp_path)
    try:
        write_correction(pours[0].path, Correction(rule="change", onset_s=None), 1.4)
        assert frame_labels(pours, "change", signals)[0].max() == 0
    finally:
        corrections_path(pours[0].path).unlink()


def tracks(count: int, seed: int) -> list[Track]:
    """Recordings in which the first feature rises when the label does."""
    random = np.random.default_rng(seed)
    made = []
    for _ in range(count):
        labels = (np.arange(120) >= random.integers(40, 100)).astype(np.int8)
        values = random.normal(size=(120, 2, 6)).astype(np.float32) + random.normal(size=(1, 2, 6))
        values[:, :, 0] += 6.0 * labels[:, None]
        row = np.arange(240).reshape(120, 2)
        made.append(Track(values.reshape(240, 6).astype(np.float32), row, labels))
    return made


@pytest.mark.slow
@pytest.mark.parametrize("head", ["lstm", "transformer"])
def test_a_head_learns_what_is_there_to_learn(head: str) -> None:
    config = HeadConfig(head=head, frames=4, epochs=6, stride=1)
    trained = fit_head(tracks(8, 0), config)
    right = []
    for track in tracks(4, 1):
        found = trained.probabilities(track.features())
        wanted = np.lib.stride_tricks.sliding_window_view(track.labels, 4).max(axis=1)
        right.append((found > 0.5) == wanted)
    assert np.concatenate(right).mean() > 0.97


def test_a_head_is_the_same_for_the_same_seed() -> None:
    config = HeadConfig(frames=4, epochs=1)
    values = tracks(1, 2)[0].features()
    first, other = (fit_head(tracks(3, 0), config).probabilities(values) for _ in range(2))
    np.testing.assert_array_equal(first, other)
    changed = fit_head(tracks(3, 0), replace(config, seed=1)).probabilities(values)
    assert not np.array_equal(first, changed)


def test_features_may_lie_on_disk(tmp_path: Path) -> None:
    """A memory map trains to the same head: memory need not hold the data set."""
    own = tracks(2, 0)
    mapped = []
    for number, track in enumerate(own):
        np.save(tmp_path / f"{number}.npy", track.values)
        values = np.load(tmp_path / f"{number}.npy", mmap_mode="r")
        mapped.append(replace(track, values=values))
    config = HeadConfig(frames=4, epochs=1)
    values = own[0].features()
    np.testing.assert_array_equal(
        fit_head(own, config).probabilities(values), fit_head(mapped, config).probabilities(values)
    )


@pytest.mark.parametrize("ahead", [0, 20])
def test_no_window_joins_frames_from_before_and_after_an_outage(ahead: int) -> None:
    """A head learns and is scored as if both sides were recordings of their own."""
    rng = np.random.default_rng(0)
    values = rng.normal(size=(80, 3)).astype(np.float32)
    row = np.stack([np.arange(80)] * 2, axis=1)
    labels = (np.arange(80) % 40 < 15).astype(np.int8)
    time_s = np.arange(80) / 25 + np.where(np.arange(80) >= 40, 3.0, 0.0)
    config = HeadConfig(epochs=1, frames=4, tare="none", stride=1, ahead=ahead)
    head = fit_head([Track(values, row, labels, time_s, 0.2)], config)
    apart = [Track(values, row[part], labels[part]) for part in (slice(40), slice(40, None))]
    other = fit_head(apart, config)
    judged = head.judged(FrameFeatures(values, row, time_s, 0.2))

    assert np.flatnonzero(np.isnan(judged)).tolist() == [37, 38, 39]
    each = np.concatenate([other.probabilities(track.features()) for track in apart])
    np.testing.assert_allclose(judged[~np.isnan(judged)], each, rtol=1e-5)


def test_simulated_recordings_give_every_window(few_pours: Path) -> None:
    """A recording without an outage gives the same windows as if its times were not known."""
    for pour in read_camera_recordings(few_pours):
        assert pour.gap_s == 0.2
        assert pour.whole(8).all()


def test_the_rate_of_frames_leaves_outages_out(few_pours: Path) -> None:
    pour = read_camera_recordings(few_pours)[0]
    assert rate_of(pour) == (len(pour) - 1) / (pour.time_s[-1] - pour.time_s[0])
    later = pour.time_s + np.where(np.arange(len(pour)) >= 40, 3.0, 0.0)
    assert rate_of(replace(pour, time_s=later)) == pytest.approx(rate_of(pour), rel=1e-3)


def test_a_recording_shorter_than_a_window_has_no_probability_and_stops_no_training() -> None:
    long, short = tracks(2, 0)
    short = replace(short, row=short.row[:20], labels=short.labels[:20])
    head = fit_head([short, long], HeadConfig(frames=30, epochs=1))
    assert head.judged(FrameFeatures(short.values, short.row)).shape == (0,)


def test_recordings_too_short_for_a_window_are_refused_with_a_plain_line() -> None:
    with pytest.raises(BadDataset, match=r"needed recordings with 121 moments in a row.* fewer"):
        fit_head(tracks(2, 0), HeadConfig(frames=121))


def test_the_papers_settings_leave_features_as_they_are() -> None:
    """A head trained as the paper trained sees the backbone's numbers, not standardised ones."""
    rng = np.random.default_rng(0)
    values = rng.normal(50.0, 20.0, (40, 3)).astype(np.float32)
    track = Track(
        values, np.stack([np.arange(40)] * 2, axis=1), np.repeat([0, 1], 20).astype(np.int8)
    )
    paper = fit_head([track], replace(PAPER, epochs=1, frames=4))
    ours = fit_head([track], HeadConfig(epochs=1, frames=4, tare="none", stride=1))

    assert np.array_equal(paper.scale(track.features()), track.features())
    assert abs(ours.scale(track.features()).mean()) < 0.01


def test_what_a_killed_process_left_in_the_cache_goes_with_the_next_that_is_kept(
    tmp_path: Path,
) -> None:
    killed = subprocess.run([sys.executable, "-c", KILLED, str(tmp_path / "a.npy")], check=False)
    assert killed.returncode == -signal.SIGKILL
    assert len(list(tmp_path.iterdir())) == 1

    save_kept(tmp_path / "b.npy", np.ones((2, 3), np.float32))

    assert list(tmp_path.iterdir()) == [tmp_path / "b.npy"]
    np.testing.assert_array_equal(load_kept(tmp_path / "b.npy", 3), np.ones((2, 3)))


@pytest.mark.skipif(sys.platform == "win32", reason="needs RLIMIT_FSIZE")
def test_features_that_do_not_fit_are_refused_in_the_systems_words(tmp_path: Path) -> None:
    """Not in NumPy's, "23040 requested and 968 written"; and nothing half-written stays."""
    done = subprocess.run([sys.executable, "-c", LIMITED, str(tmp_path / "a.npy")],
                          capture_output=True, text=True, check=True)  # fmt: skip

    assert done.stdout == (
        f"needed room in the cache, {tmp_path}; got File too large; free space, or choose another "
        "folder with --cache or $TAXEL_CACHE.\n"
    )
    assert list(tmp_path.iterdir()) == []
