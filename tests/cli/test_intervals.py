"""Long recordings become labelled ones by verbs alone, at import or afterwards."""

import json
from pathlib import Path

import pytest

from taxel.cli.main import main
from taxel.sources.opening import open_source

Out = pytest.CaptureFixture[str]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Two files of 4 s at 100 Hz, a table of them and one of their intervals."""
    monkeypatch.chdir(tmp_path)
    rows = "".join(f"{n / 100:.2f},{n % 7}\n" for n in range(400))
    for name in ("one", "two"):
        (tmp_path / f"{name}.csv").write_text("t,a\n" + rows)
    table = "file;group:session;channels;time\none.csv;s1;a[N];t[s]\ntwo.csv;s2;a[N];t[s]\n"
    (tmp_path / "table.csv").write_text(table)
    lines = "".join(f"{f}.csv,{n},{n + 1},{o}\n" for f in ("one", "two")
                    for n, o in ((0, "cup"), (2, "Cup")))  # fmt: skip
    (tmp_path / "intervals.csv").write_text("file,start_s,end_s,label:object\n" + lines)
    return tmp_path


def test_intervals_at_import_and_afterwards_give_the_same_marks(folder: Path, capsys: Out):
    main(["import", "table.csv", "--intervals", "intervals.csv", "--output", "my marked"])
    printed = capsys.readouterr().out
    assert "'Cup', 'cup' differ in case or blanks only" in printed
    assert "next: taxel info 'my marked'" in printed
    main(["import", "table.csv", "--output", "raw", "--json"])
    assert json.loads(capsys.readouterr().out)["notes"] == []
    main(["label", "raw", "--intervals", "intervals.csv", "--output", "later"])
    assert "later: 2 recordings, 4 marks; next: taxel info later" in capsys.readouterr().out

    main(["info", "my marked"])
    at_import = capsys.readouterr().out
    main(["info", "later"])
    afterwards = capsys.readouterr().out
    assert "marks object: Cup=2, cup=2" in at_import
    assert afterwards == at_import.replace("my marked", "later")


def test_a_replay_gives_each_mark_behind_its_scans(folder: Path):
    main(["import", "table.csv", "--intervals", "intervals.csv", "--output", "marked"])

    found, last_s = [], 0.0
    with open_source("replay://marked/one.mcap?speed=max") as source:
        while not source.ended:
            samples = source.read()
            last_s = float(samples.fitted_s[-1]) if len(samples) else last_s
            for mark in source.marks():
                found.append((mark.labels["object"], mark.groups["session"]))
                assert mark.end_s <= last_s

    assert found == [("cup", "s1"), ("Cup", "s1")]


def test_label_refuses_what_cannot_be_meant(folder: Path, refused):
    main(["import", "table.csv", "--output", "raw"])
    intervals = ["--intervals", "intervals.csv"]

    assert "--intervals and --output together" in refused(["label", "raw", *intervals])
    assert "--output beside --overwrite" in refused(["label", "raw", "--overwrite"])
    both = ["label", "raw", *intervals, "--output", "out", "--onset", "1"]
    assert "no --intervals beside --onset" in refused(both)
    assert "'two.csv'" in refused(["label", "raw/one.mcap", *intervals, "--output", "out"])
    assert not (folder / "out").exists()
