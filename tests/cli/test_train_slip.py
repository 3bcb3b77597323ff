"""`taxel train-slip` refuses what cannot be meant before anything is simulated."""

from pathlib import Path

import pytest

from taxel.cli.main import main


@pytest.mark.parametrize(
    ("words", "needed"),
    [
        ("--cups 4", "needed --cups from 8 to 480; got 4"),
        ("--cups 481", "needed --cups from 8 to 480; got 481"),
        ("--false-alarms 0", "--false-alarms above 0"),
        ("--head rule --seed 3", "--seed"),
    ],
)
def test_what_cannot_be_meant_is_refused_in_one_line(
    words: str, needed: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = str(tmp_path / "slip.taxel")
    with pytest.raises(SystemExit) as ended:
        main(["train-slip", str(tmp_path / "poses"), "--output", output, *words.split()])

    assert ended.value.code == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert needed in line
    assert list(tmp_path.iterdir()) == []
