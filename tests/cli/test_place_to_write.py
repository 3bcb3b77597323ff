"""Long training asks first whether its result can be written, and what it starts from."""

from __future__ import annotations

from pathlib import Path

import pytest

from taxel.cli.main import main


@pytest.mark.parametrize(
    ("words", "needed"),
    [
        ("distil d --backbone densenet121 --output file/x.safetensors", "which is no folder"),
        ("train-encoder d --output file/more/x.safetensors", "which is no folder"),
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
