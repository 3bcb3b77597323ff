"""Camera recordings and tables as data: what is read, what is refused, images one by one (0049)."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from taxel.errors import BadDataset, BadTable
from taxel.frame_codec import decode_jpeg, encode_jpeg
from taxel.jobs.local import LocalEngine
from taxel.jobs.running import use_engine
from taxel.recordings.manifest import NO_ARRAY, Manifest
from taxel.recordings.reader import iterate_tactile, read_manifest
from taxel.recordings.writer import Recorder
from taxel.signals import CameraInfo, Frame, Mark, Samples, SensorInfo
from taxel.windows import camera_recordings, camera_trials
from taxel.windows.camera_recordings import (
    check_order,
    image_size,
    read_camera_recording,
    read_camera_recordings,
)
from taxel.windows.camera_trials import are_camera_trials, read_camera_trials

FORCE = SensorInfo(name="force", channels=("n",), units=("N",), rate_hz=100.0)


def picture(level: int, width: int = 32) -> bytes:
    return encode_jpeg(np.full((24, width, 3), level, np.uint8))


def record(
    path: Path, levels: Sequence[int], names: tuple[str, ...] = ("left", "right"),
    sensor: SensorInfo = NO_ARRAY, marked: bool = True, widths: tuple[int, ...] = (32, 32),
) -> Path:  # fmt: skip
    """Write a frame of each camera 20 times a second; an array's scan is its own time."""
    cameras = tuple(CameraInfo(name=name, width=width, height=24, rate_hz=20.0)
                    for name, width in zip(names, widths, strict=False))  # fmt: skip
    manifest = Manifest(sensor=sensor, cameras=cameras, groups={"cup": "3"}, labels={"kind": "p"})
    with Recorder(path, manifest) as recorder:
        if sensor.channels:
            time_s = np.arange(2, 60) / 100.0
            recorder.write(Samples.from_values(time_s[:, None], time_s))
        for number, level in enumerate(levels):
            for camera in range(len(names)):
                recorder.frame(Frame(
                    camera=camera, jpeg=picture(level + camera, widths[camera]), counter=number,
                    device_s=float("nan"), arrival_s=number / 20, fitted_s=number / 20,
                ))  # fmt: skip
        if marked:
            recorder.mark(Mark(start_s=0.0, end_s=9.0, labels={"kind": "q"}, groups={"cup": "4"}))
    return path


LEVELS = [50, 50, 90, 90, 90, 20, 20, 50, 130, 130, 170, 10]


def test_equal_images_are_counted_once_and_the_latest_scan_stands_beside(tmp_path: Path):
    pour = read_camera_recording(record(tmp_path / "a.mcap", LEVELS, sensor=FORCE))

    assert (len(pour), pour.name, pour.images) == (12, "a", 2 * 6)
    assert pour.image[:, 0].tolist() == [0, 0, 2, 2, 2, 4, 4, 0, 6, 6, 8, 10]
    assert pour.image[:, 1].tolist() == [1, 1, 3, 3, 3, 5, 5, 1, 7, 7, 9, 11]
    np.testing.assert_allclose(pour.time_s, np.arange(12) / 20, atol=1e-9)
    latest = np.clip(np.arange(12) * 0.05, 0.02, 0.59)
    np.testing.assert_allclose(pour.beside[:, 0], latest, atol=1e-6)
    assert (pour.groups["cup"], pour.labels["kind"]) == ("4", "q")


def test_without_an_array_nothing_stands_beside_and_without_a_mark_the_whole_is_the_trial(
    tmp_path: Path,
):
    pour = read_camera_recording(record(tmp_path / "a.mcap", LEVELS, marked=False))

    assert pour.beside.shape == (12, 0)
    assert (pour.groups["cup"], pour.labels["kind"]) == ("3", "p")


def test_an_array_without_a_scan_stands_beside_as_zeros():
    values = np.zeros((0, 2), np.float32)
    beside = camera_recordings._latest(values, np.zeros(0), np.arange(3.0))
    assert beside.tolist() == [[0.0, 0.0]] * 3


def test_too_short_a_recording_and_unlike_ones_are_refused(tmp_path: Path):
    record(tmp_path / "short.mcap", LEVELS[:11])
    with pytest.raises(BadDataset, match=r"at least 12 moments.*11 in"):
        read_camera_recordings(tmp_path)
    (tmp_path / "short.mcap").unlink()
    record(tmp_path / "one.mcap", LEVELS, names=("left",))
    record(tmp_path / "whole.mcap", LEVELS)
    for read in (read_camera_recordings, read_camera_trials):
        with pytest.raises(BadDataset, match="some with 1 and some with 2"):
            read(tmp_path)


def test_workers_read_the_same_as_this_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    for name, levels in (("a", LEVELS), ("b", LEVELS[::-1]), ("c", LEVELS * 2)):
        record(tmp_path / "set" / f"{name}.mcap", levels, sensor=FORCE)
    here = read_camera_recordings(Path("set"))
    with use_engine(LocalEngine(2)):
        there = read_camera_recordings(Path("set"))
        record(tmp_path / "set" / "short.mcap", LEVELS[:11])
        with pytest.raises(BadDataset, match=r"11 in .*short.mcap"):
            read_camera_recordings(Path("set"))

    assert [pour.path for pour in there] == [Path(f"set/{name}.mcap") for name in "abc"]
    for own, other in zip(here, there, strict=True):
        np.testing.assert_array_equal(own.image, other.image)
        np.testing.assert_array_equal(own.time_s, other.time_s)
        np.testing.assert_array_equal(own.beside, other.beside)
        assert (own.digest, own.groups, own.labels) == (other.digest, other.groups, other.labels)
        assert (own.cameras, own.sensor) == (other.cameras, other.sensor)


def test_images_of_another_size_are_named_with_their_camera_and_recording(tmp_path: Path):
    same = [read_camera_recording(record(tmp_path / f"{name}.mcap", LEVELS)) for name in "ab"]
    wide = read_camera_recording(record(tmp_path / "wide.mcap", LEVELS, widths=(40, 40)))
    mixed = read_camera_recording(record(tmp_path / "mixed.mcap", LEVELS, widths=(32, 48)))

    assert image_size(same) == (32, 24)
    with pytest.raises(BadDataset, match=r"32×24 of left in a\.mcap and 40×24 of left in wide"):
        image_size([*same, wide])
    with pytest.raises(BadDataset, match=r"40×24 of left in wide\.mcap and 32×24 of left in b"):
        image_size([wide, *same[::-1]])
    with pytest.raises(BadDataset, match=r"32×24 of left in mixed.* and 48×24 of right in mixed"):
        image_size([mixed])
    with pytest.raises(BadDataset, match="48×24 of right in mixed"):
        read_camera_trials(tmp_path / "mixed.mcap")


def test_the_same_cameras_in_another_order_are_refused(tmp_path: Path):
    pours = [read_camera_recording(record(tmp_path / f"{name}.mcap", LEVELS)) for name in "ab"]
    other = read_camera_recording(record(tmp_path / "c.mcap", LEVELS, names=("thumb", "index")))
    check_order([*pours, other])
    swapped = read_camera_recording(record(tmp_path / "d.mcap", LEVELS, names=("right", "left")))
    with pytest.raises(BadDataset, match=r"left, right in a\.mcap and right, left in d\.mcap"):
        check_order([*pours, other, swapped])


def test_a_trial_s_images_are_those_of_its_recording(tmp_path: Path):
    record(tmp_path / "a.mcap", LEVELS)
    (trial,) = read_camera_trials(tmp_path / "a.mcap")
    assert [own.digest for own in read_camera_trials(tmp_path)] == [trial.digest]
    cameras = read_camera_recording(tmp_path / "a.mcap").cameras

    assert (trial.frames, trial.width, trial.height, trial.rate_hz) == (12, 32, 24, 20.0)
    for camera in (0, 1):
        found = list(trial.read(camera))
        assert len(found) == 12
        for level, image in zip(LEVELS, found, strict=True):
            expected = decode_jpeg(picture(level + camera), cameras[camera])
            np.testing.assert_array_equal(image, expected)
    some = trial.images(1, [2, 7])
    assert sorted(some) == [2, 7]
    assert abs(int(some[7].mean()) - 51) <= 1


def table(folder: Path, *lines: str) -> Path:
    path = folder / "trials.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


def test_what_holds_camera_trials_is_known_by_its_first_file(tmp_path: Path):
    (tmp_path / "cups").mkdir()
    (tmp_path / "arrays").mkdir()
    (tmp_path / "empty").mkdir()
    record(tmp_path / "cups" / "a.mcap", LEVELS)
    with Recorder(tmp_path / "arrays" / "a.mcap", Manifest(sensor=FORCE)) as recorder:
        recorder.write(Samples.from_values(np.zeros((5, 1)), np.arange(5) / 100.0))

    assert are_camera_trials(tmp_path / "cups")
    assert are_camera_trials(table(tmp_path, "left,right,label:kind"))
    assert not are_camera_trials(table(tmp_path, "file,label:kind"))
    assert not are_camera_trials(tmp_path / "arrays")
    assert not are_camera_trials(tmp_path / "empty")
    assert not are_camera_trials(tmp_path / "gone.csv")
    assert not are_camera_trials(tmp_path / "gone")


def frames_of(folder: Path, name: str, levels: Sequence[int]) -> str:
    (folder / name).mkdir()
    for number, level in enumerate(levels):
        (folder / name / f"{number:03d}.jpg").write_bytes(picture(level))
    return name


def test_a_table_names_folders_of_images(tmp_path: Path):
    left, right = frames_of(tmp_path, "l", LEVELS), frames_of(tmp_path, "r", LEVELS[::-1])
    path = table(tmp_path, "left,right,label:kind,rate", f"{left},{right},ball,25")
    (trial,) = read_camera_trials(path)

    assert (trial.cameras, trial.frames, trial.rate_hz) == (("left", "right"), 12, 25.0)
    assert trial.labels == {"kind": "ball"}
    means = [round(float(image.mean())) for image in trial.read(1)]
    np.testing.assert_allclose(means, LEVELS[::-1], atol=1)
    other = frames_of(tmp_path, "other", LEVELS)
    (tmp_path / "wide").mkdir()
    for number, level in enumerate(LEVELS):
        (tmp_path / "wide" / f"{number:03d}.jpg").write_bytes(picture(level, 48))
    with pytest.raises(BadTable, match=r"32×24 in .*l and 48×24 in .*wide"):
        read_camera_trials(table(tmp_path, "left,right,label:kind,rate", "l,wide,ball,25"))
    mixed = table(tmp_path, "camera:a,camera:b,label:kind,rate", f"{left},{right},ball,25",
                  f"{other},,ball,25")  # fmt: skip
    with pytest.raises(ValueError, match="camera"):
        read_camera_trials(mixed)


def test_a_folder_is_tried_as_each_public_data_set_in_turn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    def other(path: Path) -> list[object]:
        raise BadTable("a data set's folder", str(path), "name another")

    readers = {"first": other, "second": lambda path: [path], "third": other}
    monkeypatch.setattr(camera_trials, "KNOWN_VIDEOS", readers)
    assert camera_trials.known_videos(tmp_path) == "second"
    monkeypatch.setattr(camera_trials, "KNOWN_VIDEOS", {"first": other})
    assert camera_trials.known_videos(tmp_path) == ""

    monkeypatch.setattr(camera_trials, "KNOWN_VIDEOS", readers)
    (tmp_path / "a.mcap").touch()
    assert camera_trials.known_videos(tmp_path) == ""  # recordings come first


def test_a_recording_with_two_labelled_stretches_is_no_camera_trial(tmp_path: Path):
    """The first one's label stood for the frames of both."""
    record(tmp_path / "a.mcap", LEVELS)
    assert [trial.labels["kind"] for trial in read_camera_trials(tmp_path)] == ["q"]
    manifest = read_manifest(tmp_path / "a.mcap")
    with Recorder(tmp_path / "b.mcap", manifest) as recorder:
        for number, level in enumerate(LEVELS):
            for camera in range(2):
                recorder.frame(Frame(
                    camera=camera, jpeg=picture(level), counter=number,
                    device_s=float("nan"), arrival_s=number / 20, fitted_s=number / 20,
                ))  # fmt: skip
        for start, kind in ((0.0, "p"), (0.3, "q")):
            recorder.mark(Mark(start_s=start, end_s=start + 0.25, labels={"kind": kind}))

    with pytest.raises(BadDataset, match=r"one labelled stretch in each.*got 2 in .*b\.mcap"):
        read_camera_trials(tmp_path)


def marked(path: Path, start_s: float, end_s: float) -> Path:
    """Copy a recording with one mark."""
    with Recorder(path, read_manifest(path.with_name("a.mcap"))) as recorder:
        for frame in iterate_tactile(path.with_name("a.mcap")):
            recorder.frame(frame)
        recorder.mark(Mark(start_s=start_s, end_s=end_s, labels={"kind": "q"}))
    return path


def test_a_trial_is_its_labelled_stretch_not_what_was_recorded_around_it(tmp_path: Path):
    """Frames of an unlabelled next grasp stood for the first one's label."""
    (whole,) = read_camera_trials(record(tmp_path / "a.mcap", LEVELS, marked=False))
    (part,) = read_camera_trials(marked(tmp_path / "b.mcap", 0.2, 0.45))

    assert (whole.frames, part.frames) == (12, 6)
    for camera in (0, 1):
        expected = list(whole.read(camera))[4:10]
        np.testing.assert_array_equal(list(part.read(camera)), expected)
    only = tmp_path / "only" / "a.mcap"
    only.parent.mkdir()
    record(only, LEVELS[4:10], marked=False)
    assert part.digest == read_camera_trials(only)[0].digest != whole.digest
    assert read_camera_trials(marked(tmp_path / "c.mcap", 0.0, 0.55))[0].digest == whole.digest


def test_a_labelled_stretch_without_a_frame_is_refused(tmp_path: Path):
    record(tmp_path / "a.mcap", LEVELS, marked=False)
    with pytest.raises(BadDataset, match=r"within the labelled stretch; got none in .*b\.mcap"):
        read_camera_trials(marked(tmp_path / "b.mcap", 3.0, 4.0))


@pytest.mark.parametrize(("stated", "rate_hz"), [("50", 50.0), ("", 25.0)])
def test_a_rate_in_the_table_comes_before_that_of_the_images(
    tmp_path: Path, stated: str, rate_hz: float
):
    """Images without a rate count as 25 a second."""
    frames_of(tmp_path, "l", LEVELS)
    (trial,) = read_camera_trials(table(tmp_path, "camera:left,rate", f"l,{stated}"))

    assert trial.rate_hz == rate_hz


def test_a_recording_s_own_images_have_one_digest_and_files_that_of_their_import_too(
    tmp_path: Path,
):
    (recorded,) = read_camera_trials(record(tmp_path / "a.mcap", LEVELS))
    frames_of(tmp_path, "l", LEVELS)
    (read,) = read_camera_trials(table(tmp_path, "camera:left", "l"))

    assert recorded.digests() == (recorded.digest,)
    assert read.digests()[0] == read.digest
    assert len(read.digests()) == 2
