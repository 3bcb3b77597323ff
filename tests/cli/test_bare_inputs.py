"""Verbs at the edge of what they take: nothing recorded, nothing moved, no size, no name."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from taxel.cli.devices import doctor, flash
from taxel.cli.devices.calibrate_cycles import _unit
from taxel.cli.main import main
from taxel.cli.training import train_trials, tune
from taxel.errors import BadSource
from taxel.models.catalogue import MODELS, Network
from taxel.recordings.manifest import Manifest
from taxel.recordings.writer import Recorder
from taxel.signals import SensorInfo

Refused = Callable[[list[str]], str]


def test_the_power_of_an_empty_recording_is_refused_in_one_line(
    tmp_path: Path, refused: Refused
) -> None:
    """It ended in a traceback."""
    info = SensorInfo(name="a", channels=("x",), units=("V",), rate_hz=100.0)
    with Recorder(tmp_path / "empty.mcap", Manifest.started_now(info, now_s=0.0)):
        pass
    assert "10 scans; got 0" in refused(["power", str(tmp_path / "empty.mcap")])


@pytest.mark.parametrize("words", ["--steps 0", "--steps -1", "--channels 0", "--classes 0"])
def test_models_of_no_size_are_refused_in_one_line(words: str, refused: Refused) -> None:
    """They ended in a traceback, or gave a count of parameters of no network."""
    assert words.split()[0] in refused(["models", *words.split()])


@pytest.mark.parametrize("action", ["status", "stop"])
def test_of_a_hand_that_was_only_listened_to_nothing_is_claimed(
    action: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """It said that the fingers rest, whatever they did."""
    main(["hand", action, "sim://hand?speed=max"])
    line = capsys.readouterr().out
    assert f"{action}: listened for 0.50 s" in line
    assert "fingers rest" not in line


def test_what_a_search_found_is_valid_json_where_there_is_no_interval(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One session alone has no interval: tune.json held NaN, which is no JSON."""
    monkeypatch.setattr("taxel.training.run.save_run", lambda *_: None)
    tune._save(tmp_path, run=None, about={"outer": {"interval": (math.nan, math.nan)}})  # type: ignore[arg-type]

    def refuse(word: str) -> None:
        raise ValueError(word)

    text = (tmp_path / "tune.json").read_text()
    assert json.loads(text, parse_constant=refuse) == {"outer": {"interval": [None, None]}}


@pytest.mark.parametrize("named", [".", "../pours", "pours.csv"])
def test_a_run_of_camera_trials_is_named_for_its_data_from_within_them(
    named: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """taxel train-trials . wrote to a folder -run."""
    made: list[Path] = []
    (tmp_path / "pours").mkdir()
    monkeypatch.chdir(tmp_path / "pours")
    monkeypatch.setattr(train_trials.TrainTrials, "_train", lambda _, output: made.append(output))
    train_trials.TrainTrials(trials=Path(named)).run()
    assert made == [Path("pours-run")]
    assert os.listdir() == []


def test_where_a_process_cannot_be_bound_to_cores_all_of_them_are_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On macOS the machine was said to have one core."""
    monkeypatch.delattr(os, "sched_getaffinity")
    monkeypatch.setattr(os, "cpu_count", lambda: 8)
    (found,) = [check for check in doctor.examine(tmp_path) if check.name == "processor cores"]
    assert (found.ok, found.found) == (True, "8")


def test_a_port_that_never_opens_is_named_in_words(monkeypatch: pytest.MonkeyPatch) -> None:
    """It named nothing: got ;."""
    port = SimpleNamespace(is_open=False, trouble="", take=list, close=lambda: None)
    monkeypatch.setattr(flash, "_serial_port", lambda: lambda *_: port)
    with pytest.raises(BadSource, match="got a port that does not open"):
        flash.hear_hello("/dev/ttyACM0", 500_000, 0.02)


def test_heights_of_taps_have_the_unit_of_the_channel_that_was_tapped() -> None:
    """Of an array whose first channel is a thermometer they were degrees."""
    info = SensorInfo(name="a", channels=("t", "x", "y"), units=("degC", "V", "V"), rate_hz=1.0)
    assert _unit(info, ["x", "y"]) == "V"
    assert _unit(info, ["t", "x"]) == "degC, V"


def test_the_median_slip_of_an_even_number_of_pours_lies_between_the_middle_two(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """It was the larger of them."""
    rows = [{"run": f"r{um}", "force_n": 15.0, "outcome": "hold", "slip_um": um}
            for um in (10.0, 30.0)]  # fmt: skip
    monkeypatch.setattr("taxel.sources.simulated.pour_folder.write_pours", lambda *_, **__: rows)
    main(["simulate", "cup-pour", "--output", str(tmp_path / "cups"), "--forces-n", "15"])
    assert "20 µm" in capsys.readouterr().out


def test_the_largest_models_are_counted_without_memory_for_them(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """12.8 billion numbers took 50 GB only to be counted."""
    import torch

    built: list[str] = []
    network = MODELS["cnn1d"]
    assert isinstance(network, Network)

    def build(*sizes: int) -> torch.nn.Module:
        assert torch.get_default_device().type == "meta"
        built.append("cnn1d")
        return network.build(*sizes)

    monkeypatch.setitem(MODELS, "cnn1d", replace(network, build=build))
    sizes = [word for name in ("steps", "channels", "classes") for word in (f"--{name}", "10000")]
    main(["models", *sizes, "--json"])
    (row,) = (row for row in json.loads(capsys.readouterr().out) if row["name"] == "cnn1d")
    assert built == ["cnn1d"]
    assert row["parameters"] > 12e9


def test_epochs_are_either_given_or_searched(refused: Refused) -> None:
    """The search overruled the number that was given, without a word."""
    words = ["tune", "data", "--settings", "learning-rate", "epochs", "--epochs", "4"]
    line = refused(words)
    assert "--epochs or epochs in --settings; got both" in line
