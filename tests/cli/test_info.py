"""`taxel info` of a folder fits a terminal of 80 columns."""

from pathlib import Path

import pytest
import tyro

from taxel.cli.info import Info, _span
from taxel.cli.simulate.teng import Teng


def test_a_folder_fits_80_columns_and_says_what_its_groups_hold(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv("COLUMNS", "80")
    words = ["--output", str(tmp_path / "data"), "--scans-per-class", "2000"]
    tyro.cli(Teng, args=[*words, "--sessions", "2", "--json"]).run()
    capsys.readouterr()
    Info(tmp_path / "data").run()

    lines = capsys.readouterr().out.splitlines()
    table = lines[: next(i for i, line in enumerate(lines) if "check sums hold" in line)]
    assert any("session-1.mcap" in line for line in table)
    assert max(map(len, table)) <= 80
    assert not any("…" in line for line in table)
    assert "group session: session-1, session-2" in lines


def test_a_group_is_one_value_a_range_or_names():
    assert _span(["a", "a"]) == "a"
    assert _span(["9.5", "10", "-1"]) == "-1 to 10"
    assert _span([f"s{i}" for i in range(8)]) == "s0, s1, s2, s3, s4, s5 and 2 more"
