"""Claims about the verbs simulate and view, where no one watches."""

import json
from pathlib import Path

import numpy as np
import pytest

from taxel.cli.main import main
from taxel.cli.recordings.simulate.teng import Teng
from taxel.errors import BadInput
from taxel.recordings.reader import list_recordings, read_recording
from taxel.windows.config import GATE_V


def simulate(folder: Path, **settings) -> list[Path]:
    Teng(output=folder, **{"scans_per_class": 2000, **settings}).run()
    return list_recordings(folder)


def test_one_recording_a_session_with_its_grasps(tmp_path, capsys):
    paths = simulate(tmp_path / "set", sessions=3, json=True)
    rows = json.loads(capsys.readouterr().out)
    assert [path.stem for path in paths] == ["session-1", "session-2", "session-3"]
    for path, row in zip(paths, rows, strict=True):
        recording = read_recording(path)
        assert recording.manifest.groups["session"] == path.stem == row["session"]
        assert len(recording.samples) == row["scans"] == 2000
        assert len(recording.marks) == row["grasps"] > 0
        gated = (recording.samples.values > GATE_V).any(axis=1).sum()
        assert gated == row["gated"]
    assert list(tmp_path.iterdir()) == [tmp_path / "set"]


def test_the_same_seed_writes_the_same_values(tmp_path):
    first, again = simulate(tmp_path / "a", seed=3), simulate(tmp_path / "b", seed=3)
    other = simulate(tmp_path / "c", seed=4)
    values = [read_recording(paths[0]).samples.values for paths in (first, again, other)]
    np.testing.assert_array_equal(values[0], values[1])
    assert not np.array_equal(values[0], values[2])


def test_the_paper_preset_has_one_session_a_class_and_is_called_leaky(tmp_path, capsys):
    paths = simulate(tmp_path / "set", preset="paper")
    assert {path.stem for path in paths} == {
        *("shape-sphere", "shape-cylinder", "shape-rectangle"),
        *("material-aluminium", "material-glass", "material-plastic"),
    }
    assert "leaky" in capsys.readouterr().out


def test_commands_are_printed_as_a_shell_takes_them(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    simulate(Path("my set"), sessions=1)
    printed = capsys.readouterr().out
    assert "look:  taxel view 'my set/session-1.mcap'" in printed
    assert "next:  taxel train 'my set' --target shape --output runs/shape" in printed


def test_an_existing_folder_is_left_alone(tmp_path, capsys):
    (tmp_path / "set").mkdir()
    (tmp_path / "set" / "mine.txt").write_text("mine")
    with pytest.raises(SystemExit) as caught:
        main(["simulate", "teng", "--output", str(tmp_path / "set"), "--quick"])
    assert caught.value.code == 2
    line = capsys.readouterr().err
    assert "does not exist yet" in line
    assert line.count("\n") == 1
    assert [path.name for path in tmp_path.rglob("*")] == ["set", "mine.txt"]


@pytest.mark.parametrize(
    "settings",
    [
        {"seed": -1},
        {"rate_hz": float("nan")},
        {"rate_hz": 0.01},
        {"sessions": 0},
        {"scans_per_class": 0},
        {"dust": (0.0, 7.0)},
        {"force_n": (5.0, 1.0)},
        {"humidity_pct": (-5.0, 50.0)},
    ],
)
def test_settings_out_of_bounds_write_nothing(tmp_path, settings):
    (name,) = settings
    with pytest.raises(BadInput, match=name):
        simulate(tmp_path / "set", **settings)
    assert list(tmp_path.iterdir()) == []


def test_a_view_that_nobody_watches_is_a_summary(capsys):
    main(["view", "sim://teng?rate_hz=100", "--seconds", "3"])
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("teng sim-teng-")
    assert 298 <= int(lines[0].split()[-2]) <= 302  # three seconds of the fitted clock
    assert len(lines) == 2 + 12


def test_a_view_as_json_is_one_object(tmp_path, capsys):
    path = simulate(tmp_path / "set", sessions=1, json=True)[0]
    capsys.readouterr()
    main(["view", str(path), "--json", "--seconds", "4"])
    summary = json.loads(capsys.readouterr().out)
    assert (summary["scans"], summary["lost_scans"]) == (400, 0)
    assert summary["rate_hz"] == pytest.approx(100, rel=0.01)
    assert [channel["unit"] for channel in summary["channels"]] == ["V"] * 12


def test_a_figure_is_written_whole(tmp_path):
    main(["view", "sim://teng?rate_hz=100", "--png", str(tmp_path / "new" / "touch.png")])
    assert (tmp_path / "new" / "touch.png").read_bytes().startswith(b"\x89PNG")
    assert len(list((tmp_path / "new").iterdir())) == 1


def test_a_figure_of_an_array_beside_json_leaves_the_summary_on_the_output(tmp_path, capsys):
    """--json printed a line of text there."""
    main(["view", "sim://teng?rate_hz=100", "--png", str(tmp_path / "touch.png"), "--json"])
    assert 495 <= json.loads(capsys.readouterr().out)["scans"] <= 505
    assert (tmp_path / "touch.png").exists()


@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [
        ["serial:///dev/null"],
        ["gone.mcap"],
        ["sim://teng", "--seconds", "0"],
        ["sim://teng", "--png", "touch.jpg"],
    ],
)
def test_a_view_of_nothing_is_one_plain_line(words, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as caught:
        main(["view", *words])
    assert caught.value.code == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("taxel: needed ")
    assert captured.err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []
