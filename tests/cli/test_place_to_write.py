"""Long training asks first whether its result can be written, and what it starts from."""

from __future__ import annotations

from pathlib import Path

import pytest

from taxel.cli.main import main
from taxel.errors import BadInput
from taxel.recordings.whole import check_place


@pytest.mark.parametrize(
    ("words", "needed"),
    [
        ("distil d --backbone densenet121 --output file/x.safetensors", "which is no folder"),
        ("train-encoder d --output file/more/x.safetensors", "which is no folder"),
        ("train-backbone d --backbone edge --output file/x.safetensors", "which is no folder"),
        ("train-encoder d --output card.safetensors", "the folder card.json"),
        ("distil d --backbone densenet121 --output x.safetensors --start no", "no no"),
        ("distil d --backbone densenet121 --output x.safetensors --cache file", "no folder"),
        ("distil file --backbone densenet121 --output x.safetensors", "file, which is a file"),
        ("distil d --backbone densenet121 --output x.safetensors --seed 99999999999", "within 0"),
        ("train-encoder d --output x.safetensors --seed 99999999999", "--seed within 0 and"),
    ],
)
def test_it_is_refused_before_anything_is_read(
    words: str, needed: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    (tmp_path / "d").mkdir()  # empty: were it read, the message would say so
    (tmp_path / "card.json").mkdir()
    (tmp_path / "file").write_text("mine")
    with pytest.raises(SystemExit) as ended:
        main(words.split())
    assert ended.value.code == 2
    printed = capsys.readouterr().err.strip()
    assert len(printed.splitlines()) == 1
    assert needed in printed
    assert sorted(path.name for path in tmp_path.iterdir()) == ["card.json", "d", "file"]
    assert (tmp_path / "file").read_text() == "mine"


@pytest.mark.parametrize(
    ("words", "needed"),
    [
        ("reproduce table-4-1 --html file/page.html", "file, which is no folder"),
        ("reproduce table-4-1 --epochs 0", "--epochs of at least 1"),
        ("reproduce grasp-warnings --data none --plot file/x.png", "file, which is no folder"),
        ("sweep file --data none --plot file/x.png", "file, which is no folder"),
        ("bench faults --page file/page.md", "file, which is no folder"),
        ("bench faults --page d", "the folder d"),
        ("report no --audit --output file/x.html", "file, which is no folder"),
    ],
)
def test_a_study_asks_first_whether_its_figures_can_be_written(
    words: str, needed: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    """Some take minutes, and simulate sensors before."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(
        "taxel.sources.simulated.data_sets.simulate_presets",
        lambda *_: pytest.fail("it has begun"),
    )
    monkeypatch.setattr("taxel.bench.rows.measure", lambda *_: pytest.fail("it has begun"))
    (tmp_path / "d").mkdir()
    (tmp_path / "file").write_text("mine")
    with pytest.raises(SystemExit) as ended:
        main(words.split())
    assert ended.value.code == 2
    printed = capsys.readouterr().err.strip()
    assert len(printed.splitlines()) == 1
    assert needed in printed
    assert sorted(path.name for path in tmp_path.iterdir()) == ["d", "file"]


def test_a_simulated_hand_has_a_scan_for_each_session(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        main(["simulate", "teng", "--output", "set", "--scans-per-class", "1"])
    assert ended.value.code == 2
    assert capsys.readouterr().err == (
        "taxel: needed a scan for each of 6 sessions; got 3; simulate more a class.\n"
    )
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(not Path("/proc/self").is_dir(), reason="no /proc on this system")
def test_a_folder_that_takes_no_files_though_its_mode_says_so_is_refused() -> None:
    """Root may write to /proc by its mode, and still makes no file there."""
    with pytest.raises(BadInput, match="/proc, which may not be written"):
        check_place(Path("/proc/h.mcap"))


def test_a_place_to_write_is_left_as_it_was(tmp_path: Path) -> None:
    check_place(tmp_path / "more" / "h.mcap")
    assert list(tmp_path.iterdir()) == []
