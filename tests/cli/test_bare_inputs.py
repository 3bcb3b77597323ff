"""Verbs at the edge of what they take: nothing recorded, nothing moved, no size, no name."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from taxel.cli.main import main
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
