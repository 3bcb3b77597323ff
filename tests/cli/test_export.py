"""Claims about `taxel export` and `taxel import lerobot` as they are typed."""

import json
from pathlib import Path

import numpy as np
import pytest

from taxel.cli.main import main
from taxel.recordings.manifest import Manifest
from taxel.recordings.reader import read_recording
from taxel.recordings.writer import Recorder
from taxel.signals import Samples, SensorInfo


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """A second of three channels at 200 Hz, with a label."""
    sensor = SensorInfo(name="pads", channels=("a", "b", "c"), units=("N",) * 3, rate_hz=200.0)
    path = tmp_path / "r" / "a.mcap"
    with Recorder(path, Manifest(sensor=sensor, labels={"shape": "cube"})) as recorder:
        values = np.random.default_rng(0).random((200, 3))
        recorder.write(Samples.from_values(values, np.arange(200) / 200))
    return path


@pytest.mark.parametrize(
    ("kind", "output", "made"),
    [
        ("lerobot", "o", "o/meta/info.json"),
        ("ros2", "o", "o/a/metadata.yaml"),
        ("parquet", "o", "o/a.scans.parquet"),
        ("foxglove", "o.json", "o.json"),
    ],
)
def test_each_kind_writes_what_it_says(kind, output, made, recording, tmp_path, capsys):
    """The output is there, is not replaced unasked, and is with --overwrite."""
    pytest.importorskip("pyarrow", reason="pyarrow is not installed (taxel[export])")
    words = ["export", kind, str(recording.parent), "--output", str(tmp_path / output)]
    main([*words, "--json"])
    assert json.loads(capsys.readouterr().out)
    assert (tmp_path / made).is_file()
    with pytest.raises(SystemExit) as stopped:
        main(words)
    assert stopped.value.code == 2
    assert "--overwrite" in capsys.readouterr().err
    main([*words, "--overwrite"])


def test_lerobot_there_and_back(recording, tmp_path, capsys):
    pytest.importorskip("pyarrow", reason="pyarrow is not installed (taxel[export])")
    main(["export", "lerobot", str(recording), "--output", str(tmp_path / "set")])
    assert "1 episode, 25 frames of 8 scans, 25 frames/s" in capsys.readouterr().out
    back = ["import", "lerobot", "--data", str(tmp_path / "set"), "--output", str(tmp_path / "b")]
    main(back)
    before, after = read_recording(recording), read_recording(tmp_path / "b" / "a.mcap")
    assert after.samples.values.tobytes() == before.samples.values.tobytes()
    assert after.manifest.labels == {"shape": "cube"}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["export", "lerobot", "{r}", "--output", "{o}", "--fps", "0"], "--fps above 0"),
        (["export", "video", "{r}", "--output", "{o}"], "cameras"),
        (["export", "csv", "{r}"], "lerobot, ros2"),
        (["import", "lerobot", "--output", "{o}"], "--data"),
        (["import", "lerobot", "--data", "{r}", "--output", "{o}"], "meta/info.json"),
        (["import", "lerobot", "--data", "d", "--output", "{o}", "--missing", "keep"], "--missing"),
    ],
)  # fmt: skip
def test_bad_input_is_one_line_and_leaves_nothing(words, message, recording, tmp_path, capsys):
    pytest.importorskip("av", reason="av is not installed (taxel[export])")
    names = {"r": recording.parent, "o": tmp_path / "o"}
    with pytest.raises(SystemExit) as stopped:
        main([word.format(**names) for word in words])
    assert stopped.value.code == 2
    line = capsys.readouterr().err.strip()
    assert message in line
    assert "\n" not in line
    assert not (tmp_path / "o").exists()
