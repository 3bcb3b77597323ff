"""A moment of tactile cameras: a line a camera, a figure, and no other than what was asked."""

import json
from pathlib import Path

import pytest

from taxel.cli.main import main
from taxel.recordings.manifest import Manifest
from taxel.recordings.reader import iterate_frames, read_manifest
from taxel.recordings.writer import Recorder
from taxel.windows.camera_recordings import read_camera_recording

Out = pytest.CaptureFixture[str]


def view_json(capsys: Out, *words: str) -> dict:
    main(["view", *words, "--json"])
    return json.loads(capsys.readouterr().out)


@pytest.mark.slow
def test_a_moment_gives_a_line_a_camera(pour: Path, capsys: Out) -> None:
    main(["view", str(pour), "--at", "1.5"])

    when, left, right = capsys.readouterr().out.splitlines()
    assert when.startswith("1.5")
    assert left.startswith("left: contact ")
    assert right.startswith("right: contact ")
    assert "dots seen" in left


@pytest.mark.slow
def test_time_and_frame_name_the_same_moment(pour: Path, capsys: Out) -> None:
    time_s = read_camera_recording(pour).time_s
    by_frame = view_json(capsys, str(pour), "--frame", "90")
    by_time = view_json(capsys, str(pour), "--at", f"{time_s[90] - time_s[0]:.6f}")

    assert by_frame == by_time
    assert by_frame["frame"] == 90
    assert by_frame["time_s"] == pytest.approx(time_s[90] - time_s[0])


@pytest.mark.slow
def test_the_last_frame_is_a_moment_and_the_settled_ones_too(pour: Path, capsys: Out) -> None:
    last = view_json(capsys, str(pour), "--frame", "119")
    first = view_json(capsys, str(pour), "--frame", "0")

    assert (first["frame"], last["frame"]) == (0, 119)
    for camera in first["cameras"]:
        assert abs(camera["turned_deg"]) < 1
        assert camera["moved_mm"] < 0.05
        assert camera["contact_mm2"] > 20
        assert camera["dots_seen"] > 0.8 * camera["dots"] > 0


@pytest.mark.slow
def test_a_figure_of_all_cameras_is_written_whole(pour: Path, tmp_path: Path, capsys: Out) -> None:
    main(["view", str(pour), "--at", "1", "--png", str(tmp_path / "new" / "gel.png")])

    assert (tmp_path / "new" / "gel.png").read_bytes().startswith(b"\x89PNG")
    assert len(list((tmp_path / "new").iterdir())) == 1
    assert "gel.png" in capsys.readouterr().out


@pytest.mark.slow
def test_a_source_is_read_until_the_moment_only(capsys: Out) -> None:
    found = view_json(capsys, "sim://cup-pour?cup=0&force_n=15&position=upper", "--at", "0.6")

    assert found["time_s"] == pytest.approx(0.6, abs=0.02)
    assert [camera["camera"] for camera in found["cameras"]] == ["left", "right"]


def test_the_array_beside_cameras_is_viewed_as_before(pour: Path, capsys: Out) -> None:
    assert view_json(capsys, str(pour))["scans"] == 120


@pytest.mark.slow
def test_cameras_alone_are_looked_at_in_their_last_moment(pour: Path, capsys: Out) -> None:
    bare = pour.with_name("bare.mcap")
    known = read_manifest(pour)
    with Recorder(bare, Manifest.started_now(known.sensor.only(()), cameras=known.cameras)) as file:
        for frame in iterate_frames(pour):
            file.frame(frame)

    assert view_json(capsys, str(bare))["frame"] == 119
    assert view_json(capsys, str(bare), "--seconds", "1")["time_s"] == pytest.approx(1, abs=0.02)


CASES = {
    "after the end": "cups/pour.mcap --at 2.5",
    "a frame after the end": "cups/pour.mcap --frame 120 --png gel.png",
    "before the start": "cups/pour.mcap --at -1",
    "a frame before the start": "cups/pour.mcap --frame -1",
    "no number": "cups/pour.mcap --at nan",
    "two moments": "cups/pour.mcap --at 1 --frame 3",
    "a moment and a length": "cups/pour.mcap --at 1 --seconds 3",
    "an array only": "sim://teng --at 1",
    "a figure of another kind": "cups/pour.mcap --at 1 --png gel.jpg",
    "a folder": "cups --at 1",
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_one_plain_line_exit_code_2_and_nothing_written(
    name: str, pour: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Out
) -> None:
    monkeypatch.chdir(tmp_path)
    before = sorted(tmp_path.rglob("*"))

    with pytest.raises(SystemExit) as ended:
        main(["view", *CASES[name].split()])

    captured = capsys.readouterr()
    assert ended.value.code == 2
    assert captured.out == ""
    assert captured.err.startswith("taxel: needed ")
    assert captured.err.count("\n") == 1
    assert sorted(tmp_path.rglob("*")) == before
