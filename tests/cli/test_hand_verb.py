"""`taxel hand`: what is to be kept can be written, or nothing moves."""

from __future__ import annotations

from pathlib import Path

import pytest

from taxel.cli.main import main
from taxel.recordings.part_file import open_part

MOVE = ["hand", "move", "sim://hand?speed=max", "--closed", "200", "--arm"]


@pytest.fixture
def _nothing_moves(monkeypatch: pytest.MonkeyPatch) -> None:
    def connect(_: object) -> None:
        raise AssertionError("the hand was connected")

    monkeypatch.setattr("taxel.actions.actuators.HandActuator.connect", connect)


@pytest.mark.usefixtures("_nothing_moves")
@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("--record file/h.mcap", "a folder to write h.mcap in"),
        ("--plot file/h.png", "a folder to write h.png in"),
        ("--record h.txt", "ends in .mcap"),
        ("--plot h.txt", "ends in .png"),
        ("--record old.mcap", "add --overwrite"),
        ("--plot old.png", "add --overwrite"),
        ("--record held.mcap --overwrite", "another taxel that is recording to it"),
    ],
)
def test_a_file_that_could_not_be_written_is_refused_before_the_hand_moves(
    words: str,
    expected: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("file", "old.mcap", "old.png"):
        Path(name).touch()
    with open_part(Path("held.mcap"), overwrite=False), pytest.raises(SystemExit) as ended:
        main([*MOVE, *words.split()])

    assert ended.value.code == 2
    assert expected in capsys.readouterr().err
