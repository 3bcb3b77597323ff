"""What a rule says is shown; what a person says is kept, and never half-written."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from taxel.cli.main import main
from taxel.labels.corrections import corrections_path
from taxel.recordings.manifest import Manifest
from taxel.recordings.reader import iterate_frames, read_manifest
from taxel.recordings.writer import Recorder
from taxel.training.frames.label_sheet import label_sheet
from taxel.training.frames.labels import frame_labels
from taxel.windows.camera_recordings import read_camera_recording

Out = pytest.CaptureFixture[str]


def label_json(capsys: Out, *words: str) -> dict:
    main(["label", *words, "--json"])
    return json.loads(capsys.readouterr().out)


def test_a_folder_gives_a_row_a_recording_and_the_rules_agreement(pour: Path, capsys: Out) -> None:
    shutil.copy(pour, pour.with_name("second.mcap"))
    found = label_json(capsys, str(pour.parent))

    assert [Path(row["recording"]).name for row in found["recordings"]] == [
        "pour.mcap",
        "second.mcap",
    ]
    (row, again) = found["recordings"]
    assert row["frames"] == 120
    assert row["onsets_s"] == again["onsets_s"]
    assert list(row["onsets_s"]) == ["change", "micro-slip", "slip", "gross-slip", "drop"]
    assert row["onset_s"] == row["onsets_s"]["change"]
    assert len(found["agreement"]) == 10
    assert {pair["frames"] for pair in found["agreement"]} == {240}
    assert found["person"] is None


def test_the_table_is_for_people(pour: Path, capsys: Out) -> None:
    main(["label", str(pour), "--rule", "micro-slip"])

    printed = capsys.readouterr().out
    assert "more than 20 µm" in printed
    assert "kappa" in printed
    assert "120" in printed


def test_a_correction_is_kept_shown_obeyed_and_taken_back(pour: Path, capsys: Out) -> None:
    words = [str(pour), "--onset", "1.35", "--author", "Ada [x]", "--note", "glare [/bold]"]
    main(["label", *words])
    printed = capsys.readouterr().out
    assert "unstable from 1.350 s by change" in printed
    assert "Ada [x]" in printed

    found = label_json(capsys, str(pour))
    assert found["recordings"][0]["corrections"]["change"]["author"] == "Ada [x]"
    assert found["person"]["second"] == "a person"
    held = read_camera_recording(pour)
    (labels,) = frame_labels([held], "change", [np.zeros((120, 2), np.float32)])
    assert held.time_s[labels.argmax()] - held.time_s[0] == pytest.approx(1.35, abs=1 / 60)
    assert found["recordings"][0]["unstable_share"] == pytest.approx(labels.mean())

    main(["label", str(pour), "--clear"])
    assert "taken back" in capsys.readouterr().out
    assert not corrections_path(pour).exists()
    main(["label", str(pour), "--clear"])
    assert "no correction" in capsys.readouterr().out


def test_a_frame_is_another_way_to_say_when(pour: Path, capsys: Out) -> None:
    found = label_json(capsys, str(pour), "--frame", "60", "--rule", "slip")

    pour_time = read_camera_recording(pour).time_s
    onset = found["recordings"][0]["corrections"]["slip"]["onset_s"]
    assert onset == pytest.approx(pour_time[60] - pour_time[0])
    assert found["recordings"][0]["unstable_share"] == 0.5


def test_stable_is_stable_throughout(pour: Path, capsys: Out) -> None:
    found = label_json(capsys, str(pour), "--stable")

    assert found["recordings"][0]["unstable_share"] == 0.0
    assert found["recordings"][0]["corrections"]["change"]["onset_s"] is None


def test_clearing_one_rule_leaves_the_others(pour: Path, capsys: Out) -> None:
    label_json(capsys, str(pour), "--stable", "--rule", "slip")
    label_json(capsys, str(pour), "--onset", "1")
    found = label_json(capsys, str(pour), "--clear")

    assert set(found["recordings"][0]["corrections"]) == {"slip"}


def test_without_physics_truth_a_person_can_still_label(pour: Path, capsys: Out) -> None:
    bare = pour.with_name("bare.mcap")
    known = read_manifest(pour)
    with Recorder(bare, Manifest.started_now(known.sensor.only(()), cameras=known.cameras)) as file:
        for frame in iterate_frames(pour):
            file.frame(frame)
    main(["label", str(bare), "--rule", "slip"])
    assert (
        "no physics truth for slip in 1 of 1 recording: label them"
        in capsys.readouterr().out.replace("\n", " ")
    )

    found = label_json(capsys, str(bare), "--rule", "slip", "--onset", "1")
    assert list(found["recordings"][0]["onsets_s"]) == ["change"]
    assert found["recordings"][0]["unstable_share"] == pytest.approx(0.5, abs=0.01)
    assert found["agreement"] == []
    (labels,) = frame_labels(
        [read_camera_recording(bare)], "slip", [np.zeros((120, 2), np.float32)]
    )
    assert labels.mean() == pytest.approx(0.5, abs=0.01)


def test_a_figure_is_written_whole(pour: Path, tmp_path: Path, capsys: Out) -> None:
    main(["label", str(pour), "--onset", "1", "--plot", str(tmp_path / "new" / "labels.png")])

    assert (tmp_path / "new" / "labels.png").read_bytes().startswith(b"\x89PNG")
    assert len(list((tmp_path / "new").iterdir())) == 1
    assert "labels.png" in capsys.readouterr().out


def test_the_sheet_keeps_rules_and_people_apart(pour: Path, tmp_path: Path, capsys: Out) -> None:
    (before,) = label_sheet([read_camera_recording(pour)], tmp_path / "cache")
    label_json(capsys, str(pour), "--stable")
    (after,) = label_sheet([read_camera_recording(pour)], tmp_path / "cache")

    np.testing.assert_array_equal(before.by_rule["change"], after.by_rule["change"])
    assert before.unstable_share("change") > after.unstable_share("change") == 0.0


CASES = {
    "outside the video": "cups/pour.mcap --onset 2.5",
    "before the video": "cups/pour.mcap --onset -1",
    "no number": "cups/pour.mcap --onset nan",
    "no such frame": "cups/pour.mcap --frame 120",
    "no such rule": "cups/pour.mcap --rule wobble --onset 1",
    "no such rule to show": "cups --rule wobble",
    "a folder with an onset": "cups --onset 1",
    "a folder with a frame": "cups --frame 1",
    "a folder to clear": "cups --clear",
    "a folder for a figure": "cups --plot figure.png",
    "two ways at once": "cups/pour.mcap --onset 1 --stable",
    "an author of nothing": "cups/pour.mcap --author Ada",
    "a figure of another kind": "cups/pour.mcap --onset 1 --plot figure.gif",
    "no recording": "nowhere.mcap",
    "a cut recording": "cut/cut.mcap --stable",
}


@pytest.mark.parametrize("name", CASES)
def test_one_plain_line_exit_code_2_and_nothing_written(
    name: str, pour: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Out
) -> None:
    (tmp_path / "cut").mkdir()
    (tmp_path / "cut" / "cut.mcap").write_bytes(pour.read_bytes()[:5000])
    monkeypatch.chdir(tmp_path)

    with pytest.raises(SystemExit) as ended:
        main(["label", *CASES[name].split()])

    captured = capsys.readouterr()
    assert ended.value.code == 2
    assert captured.out == ""
    assert captured.err.startswith("taxel: needed ")
    assert captured.err.count("\n") == 1
    written = {str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*") if path.is_file()}
    assert {path for path in written if not path.startswith("cache")} == {
        "cups/pour.mcap",
        "cut/cut.mcap",
    }
