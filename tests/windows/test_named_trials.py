"""Camera trials that cannot be used together: the message names the trial and its file."""

from pathlib import Path

import numpy as np
import pytest

from taxel.errors import BadDataset, BadInput, BadSource, BadTable
from taxel.evaluation.audit.reading import read_touch
from taxel.evaluation.camera_trials.trial_set import load_trial_set
from taxel.frame_codec import encode_jpeg
from taxel.recordings.imports.video_rows import read_video_rows
from taxel.recordings.imports.videos import import_videos
from taxel.recordings.manifest import NO_ARRAY, Manifest
from taxel.recordings.writer import Recorder
from taxel.signals import CameraInfo, Frame
from taxel.training.encoder.videos import read_touch_videos
from taxel.training.frames.labels import change_signals
from taxel.windows.camera_recordings import camera_images, read_camera_recording
from taxel.windows.camera_trials import read_camera_trials

WIDTH, HEIGHT = 32, 24


def picture(number: int, width: int = WIDTH) -> bytes:
    level = np.array([number % 200, 90, 30], np.uint8)
    return encode_jpeg(np.broadcast_to(level, (HEIGHT, width, 3)))


def images(folder: Path, count: int, width: int = WIDTH, odd: int = -1) -> str:
    """Write a folder of images, one of them wider where that is asked for."""
    folder.mkdir()
    for number in range(count):
        own = picture(number, WIDTH + 8 if number == odd else width)
        (folder / f"f{number}.jpg").write_bytes(own)
    return folder.name


def table(folder: Path, *rows: str) -> Path:
    path = folder / "trials.csv"
    path.write_text("\n".join(["camera:left,camera:right,label:kind", *rows]) + "\n")
    return path


def record(path: Path, count: int, rate_hz: float = 25.0, odd: int = -1) -> Path:
    cameras = (CameraInfo(name="left", width=WIDTH, height=HEIGHT, rate_hz=rate_hz),)
    with Recorder(path, Manifest(sensor=NO_ARRAY, cameras=cameras, labels={"kind": "a"})) as made:
        for number in range(count):
            time_s = number / rate_hz
            jpeg = picture(number, WIDTH + 8 if number == odd else WIDTH)
            made.frame(Frame(camera=0, jpeg=jpeg, counter=number, device_s=time_s,
                             arrival_s=time_s, fitted_s=time_s))  # fmt: skip
    return path


@pytest.mark.parametrize(
    ("count", "width", "message"),
    [
        (12, WIDTH + 8, r"all cameras of the trial 0001-own.*32×24 in .*own and 40×24 in .*other;"),
        (7, WIDTH, r"at most in the trial 0001-own; got 12 in .*own and 7 in .*other;"),
    ],
)
def test_unlike_cameras_of_a_trial(tmp_path: Path, count: int, width: int, message: str):
    images(tmp_path / "own", 12)
    images(tmp_path / "other", count, width)
    with pytest.raises(BadTable, match=message):
        read_camera_trials(table(tmp_path, "own,other,a"))


def test_an_image_of_another_size_within_a_camera(tmp_path: Path):
    """Read in place, and imported."""
    images(tmp_path / "own", 12)
    images(tmp_path / "other", 12, odd=7)
    path = table(tmp_path, "own,other,a")
    message = r"throughout .*other; got one of 40 × 24 px, f7\.jpg, in the trial 0001-own;"
    (trial,) = read_camera_trials(path)
    with pytest.raises(BadTable, match=message):
        list(trial.read(1))
    with pytest.raises(BadTable, match=message):
        import_videos(read_video_rows(path, tmp_path), tmp_path / "made")
    assert not (tmp_path / "made").exists()


def test_trials_of_unlike_size_or_too_short_for_the_crop(tmp_path: Path):
    for name in ("own", "other"):
        images(tmp_path / name, 12)
    images(tmp_path / "short", 9)
    images(tmp_path / "wide", 12, WIDTH + 8)
    trials = read_camera_trials(table(tmp_path, "own,other,a", "wide,wide,b"))
    with pytest.raises(BadDataset, match="got 32×24 in 0001-own and 40×24 in 0002-wide;"):
        load_trial_set(trials, "kind", tmp_path)
    trials = read_camera_trials(table(tmp_path, "own,other,a", "short,short,b"))
    with pytest.raises(BadInput, match="8 to 9 frames, the shortest trial's, 0002-short; got 11"):
        load_trial_set(trials, "kind", tmp_path, crop=11)


def test_a_video_too_short_for_the_touch_encoder(tmp_path: Path):
    (tmp_path / "set").mkdir()
    record(tmp_path / "set" / "long.mcap", 60)
    record(tmp_path / "set" / "short.mcap", 20)
    with pytest.raises(BadDataset, match=r"at least 48 frames .*got 20 in short;"):
        read_touch_videos(tmp_path / "set")


def test_a_recording_that_ends_before_its_grasp_has_settled(tmp_path: Path):
    """At 60 frames a second that takes 24."""
    pours = [read_camera_recording(record(tmp_path / f"{n}.mcap", n, 60.0)) for n in (40, 15)]
    with pytest.raises(BadDataset, match=r"at least 24 frames .*got 15 in .*15\.mcap;"):
        change_signals(pours, tmp_path)


def test_a_recorded_image_of_another_size(tmp_path: Path):
    path = record(tmp_path / "odd.mcap", 20, odd=7)
    message = r"32 × 24 px; got one of 40 × 24 px from left in .*odd\.mcap;"
    with pytest.raises(BadSource, match=message):
        list(camera_images(read_camera_recording(path), 0))
    with pytest.raises(BadSource, match=message):
        read_touch(path, "kind", lambda *_: None)
