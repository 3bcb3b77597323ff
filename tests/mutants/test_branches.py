"""Branches of one part can be measured and stored alone; what is stored of the others stays."""

import json
import re
from pathlib import Path

import pytest
from mutants.branches import GOAL, PARTS, TESTS, command_of, guards_of
from mutants.places import ROOT, STORED

from mutants import branches, stored


@pytest.mark.parametrize("name", PARTS)
def test_nine_branches_in_ten_of_each_part_are_taken(name: str) -> None:
    row = json.loads(STORED.read_text())["branches"][name]

    assert row["taken"] >= GOAL * row["of"]


@pytest.mark.parametrize("name", PARTS)
def test_a_part_s_files_and_tests_are_there(name: str) -> None:
    assert all(list(ROOT.glob(sources)) for sources in PARTS[name])
    assert all((ROOT / test).exists() for test in TESTS[name])


def test_a_test_that_guards_two_parts_runs_once() -> None:
    both = guards_of(["camera path", "station", "windows"])

    assert len(set(both)) == len(both)
    assert "tests/live" in both
    assert "tests/live/station" not in both
    assert guards_of(["wire"]) == ["tests/wire"]


@pytest.mark.parametrize(("parts", "command"), [
    ([], "make coverage"),
    (["camera path", "wire"], "python -m mutants.branches 'camera path' wire --store"),
])  # fmt: skip
def test_the_command_beside_a_figure_measures_it(parts: list[str], command: str) -> None:
    assert command_of(parts) == command


def test_a_part_that_is_stored_leaves_the_others_as_they_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = {"taken": 5, "of": 10, "command": "make coverage", "commit": "abc"}
    monkeypatch.setattr(stored, "STORED", tmp_path / "stored.json")
    monkeypatch.setattr(stored, "_PAGE", tmp_path / "tests.md")
    (tmp_path / "stored.json").write_text(
        json.dumps({"mutants": {}, "branches": {"wire": before, "station": before}})
    )
    stored.store_branches({"station": (9, 10)}, command_of(["station"]))

    kept = json.loads((tmp_path / "stored.json").read_text())["branches"]
    assert kept["wire"] == before
    assert (kept["station"]["taken"], kept["station"]["of"]) == (9, 10)
    page = (tmp_path / "tests.md").read_text()
    assert "| station | 10 | 9 | 90.0% | `python -m mutants.branches station --store` |" in page
    assert re.search(r"wire .* 50.0% .* abc", page)


def test_a_part_that_is_none_is_refused_before_anything_runs(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.argv", ["branches", "statoin"])
    monkeypatch.setattr(branches, "_run_tests", lambda _: pytest.fail("it ran"))
    with pytest.raises(SystemExit, match="2"):
        branches.main()
    assert "needed parts of wire" in capsys.readouterr().err
