"""Labels that a terminal, Rich, HTML or matplotlib would obey: accepted, literal, distinct."""

import html
import json
import re
from pathlib import Path

import pytest

from taxel.bench.faults.hostile_labels import CHANNELS, CLASSES, TRAINING, write_table
from taxel.cli.main import main
from taxel.plain_text import short_names, visible
from taxel.recordings.reader import read_manifest


@pytest.fixture(scope="module")
def imported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Recordings imported from a table that names all of these: two sessions of each class."""
    folder = tmp_path_factory.mktemp("hostile")
    main(["import", str(write_table(folder)), "--output", str(folder / "recordings")])
    return folder


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]):
    """Run a verb; give its output, of which no character may be obeyed."""

    def run(*words: object) -> str:
        capsys.readouterr()
        main([str(word) for word in words])
        captured = capsys.readouterr()
        for text in captured:
            assert all(line.isprintable() for line in text.split("\n")), text
            assert "Traceback" not in text
            assert not re.search("^all checksums valid", text, re.MULTILINE)
        return captured.out

    return run


def test_recordings_keep_the_labels_and_info_shows_each_literally(imported, run):
    paths = sorted((imported / "recordings").glob("*.mcap"))
    kept = {read_manifest(path).labels["object"] for path in paths}
    shown = run("info", imported / "recordings")
    line = next(line for line in shown.splitlines() if line.startswith("label object:"))

    assert kept == set(CLASSES)
    for name in CLASSES:
        assert f"{visible(name)}=2" in line
    assert r"day\x1b[31m1" in shown
    printed = run("info", paths[0])
    assert r"pad[/red]\x1b[5m" in printed
    assert all(visible(channel) in printed for channel in CHANNELS)
    row = json.loads(run("info", paths[0], "--json"))
    assert row["labels"]["object"] in CLASSES


@pytest.mark.slow
def test_the_audit_quotes_them_and_stays_whole(imported, run):
    shown = run("audit", imported / "recordings", "--target", "object", "--all")

    for name in CLASSES:
        assert visible(name) in re.sub(r"\n", "", shown)
    assert json.loads(run("audit", imported / "recordings", "--target", "object", "--json"))


@pytest.mark.slow
def test_from_training_to_a_live_answer_every_class_is_itself(imported, run, tmp_path):
    shown = run("train", imported / "recordings", "--output", tmp_path / "run", "--fold-count", "2",
                *TRAINING)  # fmt: skip
    table = shown[shown.index("confusion") :]
    for name in CLASSES:
        assert table.count(f" {visible(name)} ") or table.count(f"{visible(name)} ")
    heads = next(line for line in table.splitlines() if "true ↓" in line)
    columns = heads.split("predicted →")[1].split()
    cut = [short_names(sorted(CLASSES), most, end="") for most in range(4, 40)]
    found = [names for names in cut if columns == " ".join(names).split()]  # as the line allows
    assert found
    assert len(set(found[0])) == len(CLASSES)

    bundle = tmp_path / "b[red]\x1b[1m.taxel"
    run("bundle", tmp_path / "run", "--output", bundle)
    run("report", tmp_path / "run", "--no-latency", "--data", imported / "recordings",
        "--output", tmp_path / "report.html")  # fmt: skip
    page = (tmp_path / "report.html").read_text()
    assert "<script" not in page
    assert all(line.isprintable() for line in page.split("\n"))
    for name in CLASSES:
        assert html.escape(visible(name)) in page

    recording = min((imported / "recordings").glob("*.mcap"))
    (answer,) = json.loads(run("live", bundle, f"{recording}", "--json"))
    assert set(answer["answers"]) <= {*CLASSES, "UNKNOWN"}
    printed = run("live", bundle, recording)
    assert any(visible(name) in printed for name in answer["answers"])


@pytest.mark.slow
def test_tables_with_figures_and_raw_touch_are_drawn(imported, run, tmp_path):
    recording = min((imported / "recordings").glob("*.mcap"))
    run(
        "evaluate",
        imported / "recordings",
        "--fold-count",
        "2",
        "--html",
        tmp_path / "e.html",
        *TRAINING,
    )
    run("view", recording)
    run("view", recording, "--png", tmp_path / "touch.png")

    page = (tmp_path / "e.html").read_text()
    assert all(line.isprintable() for line in page.split("\n"))
    assert (tmp_path / "touch.png").stat().st_size > 10_000


def test_a_refusal_quotes_a_name_on_one_line(imported, refused, tmp_path):
    line = refused(["info", str(tmp_path / "no\x1b[2J\nall checksums valid.mcap")])

    assert line.isprintable()
    assert r"\x1b[2J" in line


def test_a_word_that_no_verb_knows_is_quoted_literally(capsys):
    """As a shell's * gives them, where a folder holds files of such names."""
    for words in (["info", "a", "b\x1b[2J\x9b31m"], ["info", "a", "\udcff\x1b[2J"], ["x\x1b[2J"]):
        with pytest.raises(SystemExit) as ended:
            main(words)
        captured = capsys.readouterr()
        assert ended.value.code == 2
        assert all(line.isprintable() for line in (captured.out + captured.err).split("\n"))
        assert r"\x1b[2J" in captured.err


def test_a_label_that_is_no_text_is_refused_in_one_line(refused, tmp_path):
    """A shell hands on any bytes; a recording holds UTF-8."""
    for words in (["--label", "object=\udcff"], ["--group", "\ud800=1"]):
        line = refused(["record", "sim://teng?speed=max", "--seconds", "0.1", *words,
                        "--output", str(tmp_path / "a.mcap")])  # fmt: skip
        assert "UTF-8" in line
        assert not list(tmp_path.iterdir())
