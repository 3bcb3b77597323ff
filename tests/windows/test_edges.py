"""What would go wrong at an edge without being seen: one claim a rule (0049)."""

import weakref
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import pywt
from numpy.typing import NDArray

from taxel.errors import BadDataset, BadTable
from taxel.gel.touch_poses import TouchFollower
from taxel.labels.trials import TIME, Trial
from taxel.recordings.manifest import Manifest
from taxel.recordings.writer import Recorder
from taxel.signals import Samples, SensorInfo, Validity
from taxel.windows import camera_trials, trial_crops
from taxel.windows.camera_trials import (
    CameraTrial,
    are_camera_trials,
    read_camera_trials,
    refuse_footage,
)
from taxel.windows.checks import rare_note
from taxel.windows.config import WindowConfig
from taxel.windows.dataset import load_dataset
from taxel.windows.denoise import denoise
from taxel.windows.grid import Grid
from taxel.windows.reference import ReferenceTouches
from taxel.windows.rest import SETTLE
from taxel.windows.sequence import window_starts
from taxel.windows.trial_crops import FAMILIES, PIXELS, STATISTICS, Scene, look_at
from taxel.windows.trial_mirrors import mirrors
from taxel.windows.windower import Windower

PAIR = SensorInfo(name="t", channels=("touch", "free"), units=("V", "V"), rate_hz=100.0)


def trial(recording: str = "a.mcap", **labels: str) -> Trial:
    return Trial(recording=recording, start_s=0.0, end_s=1.0, labels=labels, groups={})


def samples(values: list[list[float]], first: int = 0) -> Samples:
    array = np.array(values, np.float32)
    return Samples.from_values(array, (first + np.arange(len(array))) / 100.0)


def write_image(path: Path) -> None:
    cv2.imwrite(str(path), np.zeros((8, 8, 3), np.uint8))


def test_a_folder_of_images_and_a_single_one_are_called_what_they_are(tmp_path: Path) -> None:
    write_image(tmp_path / "a.png")
    with pytest.raises(BadTable, match="images or videos alone"):
        refuse_footage(tmp_path)
    with pytest.raises(BadTable, match="one video or image"):
        refuse_footage(tmp_path / "a.png")


@pytest.mark.parametrize("place", ["slip", "mug/take-1"])
def test_images_in_a_folder_of_each_class_belong_in_a_table(tmp_path: Path, place: str) -> None:
    """The line asked for recordings, and named only commands that make new ones."""
    (tmp_path / place).mkdir(parents=True)
    write_image(tmp_path / place / "a.png")
    with pytest.raises(BadTable, match=r"name them in a table .* camera:NAME,label:NAME"):
        refuse_footage(tmp_path)
    (tmp_path / "trials.csv").write_text("left,label:slip\n")
    refuse_footage(tmp_path)  # whoever reads the folder names its table


def test_videos_beside_their_table_are_not_asked_for_another(tmp_path: Path) -> None:
    write_image(tmp_path / "a.png")
    (tmp_path / "other.csv").write_text("file,label:slip\n")
    with pytest.raises(BadTable, match="images or videos alone"):
        refuse_footage(tmp_path)
    (tmp_path / "mine.csv").write_text("left,label:slip\n")
    refuse_footage(tmp_path)  # whoever reads the folder names its table
    (tmp_path / "newer.csv").write_text("left,label:slip\n")
    with pytest.raises(BadTable, match=r"one table of camera trials.* mine.csv, newer.csv; name"):
        refuse_footage(tmp_path)


def test_an_image_beside_a_recording_is_no_footage(tmp_path: Path) -> None:
    write_image(tmp_path / "a.png")
    (tmp_path / "b.mcap").write_bytes(b"")
    refuse_footage(tmp_path)


def test_a_public_set_s_own_folder_holds_camera_trials(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert not are_camera_trials(tmp_path)
    monkeypatch.setattr(camera_trials, "known_videos", lambda _: "a-set")
    assert are_camera_trials(tmp_path)


def test_videos_outside_of_the_table_s_folder_are_asked_for_by_name(tmp_path: Path) -> None:
    (tmp_path / "trials.csv").write_text("camera:left,label:x\n../a.mp4,y\n")
    with pytest.raises(BadTable, match="which lies outside"):
        read_camera_trials(path=tmp_path / "trials.csv", outside=False)
    with pytest.raises(BadTable, match="got no file"):  # looked for there
        read_camera_trials(path=tmp_path / "trials.csv", outside=True)


def test_a_class_with_more_than_a_fifth_of_the_commonest_s_trials_is_not_rare() -> None:
    balls = [trial(shape="ball")] * 9
    assert rare_note([*balls, *[trial(shape="cube")] * 2], "shape") == []


def test_a_known_object_is_known_by_its_very_name() -> None:
    touches = ReferenceTouches(key="object", value="b", count=1)
    named = {name: touches.matches(trial(object=name)) for name in "abc"}
    assert named == {"a": False, "b": True, "c": False}


def test_the_settled_grasp_lies_between_the_exposure_and_the_first_pour() -> None:
    """At 60 Hz: from 0.15 s to 0.4 s."""
    assert (SETTLE.start, SETTLE.stop) == (0.15 * 60, 0.4 * 60)


def test_two_frames_of_one_moment_follow_each_other() -> None:
    starts = window_starts(3, 2, time_s=np.array([0.0, 0.0, 1.0]), largest_gap_s=2.0)
    assert starts.tolist() == [0, 1]


def test_windows_too_short_for_a_wavelet_stay_as_they_are() -> None:
    short, none = np.ones((2, 2, 1), np.float32), np.ones((0, 64, 1), np.float32)
    assert denoise(short, pywt.Wavelet("db2")) is short
    assert denoise(none, pywt.Wavelet("db2")) is none


def test_trials_of_two_recordings_have_no_common_time(tmp_path: Path) -> None:
    for name in ("a", "b"):
        manifest = Manifest(sensor=PAIR, labels={"shape": name}, groups={})
        with Recorder(tmp_path / f"{name}.mcap", manifest) as recorder:
            recorder.write(samples([[0.0, 0.0]] * 20))
    dataset = load_dataset(tmp_path, WindowConfig(steps=10, stride=10, grid_hz=None))
    with pytest.raises(BadDataset, match="2 recordings, each with a clock of its own"):
        dataset.group(TIME)


def test_a_call_that_completes_no_tick_gives_no_row_and_no_time() -> None:
    grid = Grid(10.0, 100.0, 1.0)
    grid.push(samples([[0.0, 0.0]] * 3))
    rows = grid.push(samples([[0.0, 0.0]], first=3))
    assert (len(rows.time_s), len(rows.values), len(rows.flags)) == (0, 0, 0)


def test_what_the_untouched_channel_does_not_know_is_zero_in_all() -> None:
    config = WindowConfig(steps=2, stride=2, grid_hz=None, subtract="free", fill=0.0)
    windower = Windower(config, PAIR)
    came = samples([[5.0, 1.0], [5.0, 7.0]])
    came.validity[1, 1] = Validity.MISSING
    (window,) = windower.push(came).values
    assert window.tolist() == [[4.0, 0.0], [0.0, 0.0]]


def test_what_is_left_of_a_stretch_behind_a_whole_window_is_not_padded() -> None:
    windower = Windower(WindowConfig(steps=4, stride=4, grid_hz=None, pad=True), PAIR)
    pushed = windower.push(samples([[float(row), 0.0] for row in range(6)]))
    assert (len(pushed), len(windower.flush())) == (1, 0)


def levels(*greys: int) -> Scene:
    """One image a grey level."""
    return Scene([np.full((120, 160, 3), grey, np.uint8) for grey in greys], 25.0, 0.065)


@pytest.mark.parametrize("family", ["slip", "moves"])
def test_touch_is_followed_from_a_crop_s_first_three_images(
    family: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    references: list[int] = []

    class Follower(TouchFollower):
        def __init__(self, images: Sequence[NDArray[np.uint8]]) -> None:
            references.append(len(images))
            super().__init__(images)

    monkeypatch.setattr(trial_crops, "TouchFollower", Follower)
    look_at([family], [levels(*[50] * 9)])
    assert references == [3]


def test_of_a_short_crop_the_last_image_stands_still() -> None:
    shown = look_at(["pixels"], [levels(50, 50, 50, 50, 90)])["pixels"][:, 0]
    assert shown[4:, PIXELS.index("since")] == pytest.approx(40.0, abs=1.0)
    assert shown[5:, PIXELS.index("step")] == pytest.approx(0.0)


@pytest.mark.parametrize("course", ["step", "since"])
def test_in_a_mirror_each_place_is_that_of_the_other_side(course: str) -> None:
    width = FAMILIES["pixels"].columns * STATISTICS
    across, down, _ = mirrors({"pixels": width}, 1)
    first = PIXELS.index(f"{course}_0")
    places = np.arange(12).reshape(3, 4)
    assert (across.order[first : first + 12] - first).tolist() == places[:, ::-1].ravel().tolist()
    assert (down.order[first : first + 12] - first).tolist() == places[::-1].ravel().tolist()


def files(frames: int, images: Iterable[int]) -> CameraTrial:
    """A trial of two cameras' files, which give these grey levels."""
    return CameraTrial(
        name="a", labels={}, groups={}, cameras=("left", "right"), frames=frames, width=8, height=8,
        rate_hz=25.0, mm_per_px=None, digest="0", turned="0", recorded=False,
        read=lambda camera: (np.full((8, 8, 3), 40 * grey, np.uint8) for grey in images),
    )  # fmt: skip


def test_what_a_file_holds_beyond_a_trial_s_frames_is_not_in_its_digest() -> None:
    assert files(2, range(5)).digests() == files(2, range(2)).digests()
    assert files(3, range(5)).digests() != files(2, range(2)).digests()


@pytest.mark.parametrize("step", [1, 3])
def test_crops_are_read_in_one_go_and_one_at_a_time(step: int) -> None:
    """All crops of a trial at once took 14 GB of two cameras of 3280×2464; of a fast camera, whose
    crops are of one image in some, those between are let go."""
    alive: list[int] = []
    most = 0

    def read(camera: int) -> Iterator[NDArray[np.uint8]]:
        for number in range(30):
            image = np.full((8, 8, 3), number + camera, np.uint8)
            alive.append(number)
            weakref.finalize(image, alive.remove, number)
            yield image

    def levels_of(images: list[list[NDArray[np.uint8]]]) -> list[list[int]]:
        nonlocal most
        most = max(most, len(alive))
        return [[int(image[0, 0, 0]) for image in own] for own in images]

    trial = replace(files(30, ()), read=read)
    starts, span = [0, 0, 3, 15, 17], 4 * step + 1

    assert list(map(levels_of, trial.crops(starts, span, step))) == [
        [[*range(own, own + span, step)] for own in (start, start + 1)] for start in starts
    ]
    assert most <= 2 * (5 + 5 * (step > 1) + 1)  # those of the next crop that lie among them
