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


@pytest.mark.usefixtures("_nothing_moves")
@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("--closed 2000", "--closed of 0 to 1000; got 2000;"),
        ("--closed -1", "--closed of 0 to 1000; got -1;"),
        ("--contact-ma 0", "--contact-ma of 1 to 32767; got 0;"),
        ("--contact-ma 40000", "--contact-ma of 1 to 32767; got 40000;"),
        ("--fingers 3 9", "--fingers among 1 to 4; got 3 9;"),
    ],
)
def test_a_number_out_of_its_limits_is_refused_by_its_option_before_the_hand_is_connected(
    words: str, expected: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["hand", "move", "sim://hand?speed=max", "--arm", *words.split()])

    assert ended.value.code == 2
    assert expected in " ".join(capsys.readouterr().err.split())
