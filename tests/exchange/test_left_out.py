"""Claims about what an export leaves out, and what an import does not replace: it is named."""

import json
from pathlib import Path

import pytest

from taxel.cli.main import main
from taxel.errors import BadTable
from taxel.recordings.reader import iterate_frames, iterate_jpeg, read_recording
from taxel.recordings.writer import Recorder
from taxel.signals import Mark

pytest.importorskip("pyarrow.parquet", reason="pyarrow is not installed (taxel[export])")


@pytest.fixture
def folder(make, tmp_path) -> Path:
    """Two recordings of two cameras; in the second one, only the left camera gave images."""
    whole = tmp_path / "recordings" / "whole.mcap"
    whole.parent.mkdir()
    make(whole, array=False)
    with Recorder(whole.with_name("half.mcap"), read_recording(whole).manifest) as recorder:
        for frame in iterate_frames(whole, 0):
            recorder.frame(frame)
    return whole.parent


@pytest.mark.parametrize(
    ("cut", "lack"),
    [
        ("recording", "scan, or no image of a camera"),
        ("mark", "labelled interval that holds a frame"),
    ],
)
def test_a_recording_that_gives_no_episode_is_named(cut, lack, folder, tmp_path, capsys):
    """A data set must not lack a recording that its folder held, without a word."""
    command = ["export", "lerobot", str(folder), "--output", str(tmp_path / "set")]
    main([*command, "--episodes", cut])
    assert f"left out 1 recording with no {lack}: half.mcap" in capsys.readouterr().out


def test_tasks_hold_the_labels_of_all_intervals_at_a_frame(make, tmp_path):
    """Where two overlap, the labels of the second were left out without a word."""
    from taxel.exchange.lerobot_write import write_lerobot

    path = make(tmp_path / "r.mcap", array=False, seconds=0.2)
    end_s = [frame.fitted_s for frame in iterate_frames(path, 0)][2]
    with Recorder(tmp_path / "more.mcap", read_recording(path).manifest) as recorder:
        for frame in iterate_jpeg(path):
            recorder.frame(frame)
        for mark in (
            Mark(start_s=end_s, end_s=101.0, labels={"grasp": "slip"}),
            Mark(start_s=100.0, end_s=end_s, labels={"grasp": "stable"}),
            Mark(start_s=100.0, end_s=101.0, labels={"texture": "rough"}),
        ):
            recorder.mark(mark)
    written = write_lerobot([tmp_path / "more.mcap"], tmp_path / "set")
    shared = "shape: sphere, texture: rough"
    assert written.tasks == [f"grasp: stable, {shared}", f"grasp: slip, {shared}"]


def test_images_that_a_silent_camera_gave_long_before_are_warned_of(make, tmp_path, capsys):
    """The right camera's last image, 1.4 s old in the end, stood beside the left one's."""
    path = make(tmp_path / "r.mcap", array=False)
    with Recorder(tmp_path / "silent.mcap", read_recording(path).manifest) as recorder:
        for frame in iterate_jpeg(path):
            if frame.camera == 0 or frame.counter < 5:
                recorder.frame(frame)
    for name, warned in (("r", False), ("silent", True)):
        recording, output = tmp_path / f"{name}.mcap", tmp_path / f"{name}-set"
        main(["export", "lerobot", str(recording), "--output", str(output)])
        printed = " ".join(capsys.readouterr().out.split())
        assert ("the images of a frame are up to 1.4 s apart" in printed) == warned


@pytest.mark.parametrize("as_json", [False, True])
def test_an_interval_without_a_frame_is_named(as_json, make, tmp_path, capsys):
    """Other intervals of its recording give episodes, so that the recording is not left out."""
    path = make(tmp_path / "r.mcap", array=False)
    late = Mark(start_s=150.0, end_s=151.0, labels={"grasp": "lost"})
    with Recorder(tmp_path / "more.mcap", read_recording(path).manifest) as recorder:
        for frame in iterate_jpeg(path):
            recorder.frame(frame)
        for mark in (*read_recording(path).marks, late):
            recorder.mark(mark)
    command = ["export", "lerobot", str(tmp_path / "more.mcap"), "--output", str(tmp_path / "set")]
    main([*command, "--episodes", "mark", *["--json"] * as_json])
    printed = capsys.readouterr().out
    if as_json:
        found = json.loads(printed)
        assert (found["episodes"], found["marks_left_out"]) == (2, ["more_0002"])
        assert found["recordings_left_out"] == []
    else:
        assert "left out 1 labelled interval without a frame: more_0002" in printed


def test_a_camera_without_images_has_no_video_and_the_line_says_so(folder, tmp_path, capsys):
    """A name that is printed with "0 frames" would be looked for."""
    pytest.importorskip("av")
    main(["export", "video", str(folder), "--output", str(tmp_path / "videos")])
    lines = capsys.readouterr().out.splitlines()
    missing = tmp_path / "videos" / "half.right.mkv"
    assert f"{missing}: not written, as the camera gave no image" in lines
    assert not missing.exists()


@pytest.mark.parametrize(
    ("overwrite", "message"),
    [(False, "which is not empty; choose another --output"), (True, "with notes.txt; move")],
)
def test_a_folder_in_the_way_of_an_import_is_not_called_a_damaged_data_set(
    overwrite, message, folder, tmp_path
):
    """The data set is whole: nobody is to copy it again."""
    from taxel.exchange.lerobot_read import import_lerobot

    main(["export", "lerobot", str(folder), "--output", str(tmp_path / "set")])
    (tmp_path / "back").mkdir()
    (tmp_path / "back" / "notes.txt").write_text("mine")
    with pytest.raises(BadTable, match=message):
        import_lerobot(tmp_path / "set", tmp_path / "back", overwrite=overwrite)
    assert [path.name for path in (tmp_path / "back").iterdir()] == ["notes.txt"]


@pytest.mark.parametrize("kind", ["lerobot", "video", "parquet", "ros2"])
@pytest.mark.parametrize("own", ["README.md", "meta/notes.txt"])
def test_somebodys_file_beside_what_was_exported_is_not_replaced(kind, own, make, tmp_path, capsys):
    """--overwrite removed it with the folder, such as the card of a data set."""
    if kind == "video":
        pytest.importorskip("av")
    recording = make(tmp_path / "r.mcap")
    command = ["export", kind, str(recording), "--output", str(tmp_path / "set"), "--overwrite"]
    main(command)
    main(command)
    mine = tmp_path / "set" / own
    mine.parent.mkdir(exist_ok=True)
    mine.write_text("mine")
    with pytest.raises(SystemExit) as stopped:
        main(command)
    assert stopped.value.code == 2
    assert f"set with {own}; move what you need" in capsys.readouterr().err
    assert mine.read_text() == "mine"
