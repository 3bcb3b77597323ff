"""Claims about files that cannot be read as the import table says, and may be left out."""

import json
from pathlib import Path

import numpy as np
import pytest

from taxel.cli.main import main
from taxel.errors import BadTable
from taxel.recordings.imports.importing import ImportOptions, import_table
from taxel.recordings.imports.notes import FileFacts, notes_of
from taxel.recordings.reader import list_recordings

FLAG = "; --skip-unreadable leaves such files out."
PATTERN = "{label:object}_*.csv,*[N],ms[ms]\n"


def put(folder: Path, good: str, empty: str = "", cut: str = "") -> Path:
    """Write files by their names, of each kind; return a table with one line for all of them."""
    for name in good.split():
        (folder / f"{name}.csv").write_text("ms,a,b\n0,1,2\n10,2,3\n20,3,4\n")
    for name in empty.split():
        (folder / f"{name}.csv").write_text("")
    for name in cut.split():
        (folder / f"{name}.csv").write_text("ms,a,b\n0,1,2\n10,2,3\n20,3")
    (folder / "table.csv").write_text("file,channels,time\n" + PATTERN)
    return folder / "table.csv"


def skipping(table: Path, **options: bool) -> tuple[list[str], list[str]]:
    """Import without what cannot be read; return the recordings' names and the notes."""
    facts: list[FileFacts] = []
    made = import_table(table, table.parent / "out", on_file=facts.append,
                        options=ImportOptions(skip_unreadable=True, **options))  # fmt: skip
    assert made == list_recordings(table.parent / "out")
    return [path.stem for path in made], notes_of(facts)


def test_files_that_cannot_be_read_are_left_out_and_named_on_demand(tmp_path, capsys):
    table = put(tmp_path, "cup_1 cup_4 jar_1", empty="cup_2", cut="cup_3 jar_2")
    words = ["import", str(table), "--output", str(tmp_path / "out"), "--skip-unreadable"]
    main([*words, "--json"])
    printed = capsys.readouterr()
    found = json.loads(printed.out)
    assert [Path(path).stem for path in found["recordings"]] == ["cup_1", "cup_4", "jar_1"]
    assert found["notes"][-4:] == [
        "3 files were left out, since they cannot be read as the table says",
        f"left out cup_2.csv: needed rows of numbers; got the empty file {tmp_path}/cup_2.csv",
        f"left out cup_3.csv: needed 3 cells in every line; got 2 in {tmp_path}/cup_3.csv, line 4",
        f"left out jar_2.csv: needed 3 cells in every line; got 2 in {tmp_path}/jar_2.csv, line 4",
    ]
    main([*words, "--overwrite"])
    assert [line.removeprefix("note: ") for line in capsys.readouterr().err.splitlines()] == (
        found["notes"]
    )


def test_of_many_files_the_first_ten_are_named(tmp_path):
    names = [f"cup_{number}" for number in range(1, 13)]
    _, notes = skipping(put(tmp_path, "cup_13", empty=" ".join(names)))
    assert [note.partition(":")[0] for note in notes[1:]] == [
        "12 files were left out, since they cannot be read as the table says",
        *(f"left out {name}.csv" for name in names[:10]), "left out 2 more files",
    ]  # fmt: skip


@pytest.mark.parametrize("name", ["cup_1", "cup_2", "cup_3"])
def test_without_the_option_a_single_file_stops_all_and_the_option_is_named(tmp_path, name):
    """Be it the first of them: then the next one is read, to know that it is not the table."""
    table = put(tmp_path, "cup_1 cup_2 cup_3")
    put(tmp_path, "", empty=name)
    with pytest.raises(BadTable) as refusal:
        import_table(table, tmp_path / "out")
    assert str(refusal.value) == ("needed rows of numbers; got the empty file "
                                  f"{tmp_path}/{name}.csv; leave the file out{FLAG}")  # fmt: skip
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("skip", [False, True])
@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ("*.csv,z[N],ms[ms]\n", "the column 'z'; got"),
        ("cup_1.csv,a[N],ms[ms]\ncup_2.csv,a,ms[ms]\n", "channels as NAME"),
        ("*.tsv,a[N],ms[ms]\n", "a file that matches"),
        ("cup_1.csv,z[N],ms[ms]\ncup_2.csv,z[N],ms[ms]\n", "the column 'z'; got"),
        ("cup_1.csv,a[N],ms[ms]\n*.txt,z[N],ms[ms]\n", "the column 'z'; got"),
    ],
)
def test_a_fault_of_the_table_is_refused_all_the_same(tmp_path, lines, words, skip):
    """Where it holds for all files, for those of a line, or is known before any is opened."""
    table = put(tmp_path, "cup_1 cup_2")
    for name in ("jar_1", "jar_2"):
        (tmp_path / f"{name}.txt").write_text((tmp_path / "cup_1.csv").read_text())
    table.write_text("file,channels,time\n" + lines)
    with pytest.raises(BadTable, match=words) as refusal:
        import_table(table, tmp_path / "out", options=ImportOptions(skip_unreadable=skip))
    assert FLAG not in str(refusal.value)
    assert not (tmp_path / "out").exists()


def test_a_refusal_says_that_none_of_the_files_can_be_read(tmp_path):
    table = put(tmp_path, "", empty="cup_1", cut="cup_2")
    words = rf"cup_1\.csv, and none of the 2 files of {table}, line 2 can be read; leave"
    with pytest.raises(BadTable, match=words):
        skipping(table)


def test_a_file_of_many_trials_is_left_out_as_a_whole(tmp_path):
    """Be it that it cannot be opened, or that a value in its last trial is none."""
    values = np.random.default_rng(0).normal(size=(3, 9, 2))
    np.savez(tmp_path / "anna.npz", X=values, y=[0, 1, 0])
    values[2, 4, 1] = np.nan
    np.savez(tmp_path / "bo.npz", X=values, y=[0, 1, 0])
    (tmp_path / "cy.npz").write_bytes((tmp_path / "anna.npz").read_bytes()[:200])
    table = tmp_path / "table.csv"
    table.write_text("file,trials,axes,label:object,channels,time\n"
                     "{group:who}.npz,X,trials rows channels,from:y,*[N],rate:100Hz\n")  # fmt: skip
    made, notes = skipping(table)
    assert made == ["anna-1", "anna-2", "anna-3"]
    assert [note.partition(":")[0] for note in notes[-3:]] == [
        "2 files were left out, since they cannot be read as the table says",
        "left out bo.npz", "left out cy.npz",
    ]  # fmt: skip
    for bad in ("cy", "bo"):
        with pytest.raises(BadTable, match=rf"{bad}\.npz.*{FLAG}"):
            import_table(table, tmp_path / "other")
        (tmp_path / f"{bad}.npz").unlink()


def test_a_link_that_leads_nowhere_is_left_out(tmp_path):
    """As of a file that git-annex did not fetch."""
    table = put(tmp_path, "cup_1 cup_2")
    (tmp_path / "cup_3.csv").symlink_to("elsewhere")
    made, notes = skipping(table)
    assert made == ["cup_1", "cup_2"]
    assert "which is not there" in notes[-1]


def test_intervals_of_a_file_that_is_left_out_do_no_harm(tmp_path):
    table = put(tmp_path, "cup_1 cup_2", empty="cup_3")
    intervals = tmp_path / "intervals.txt"
    intervals.write_text("file,start_s,end_s\ncup_1.csv,0,0.02\ncup_3.csv,0,0.02\n")
    made = import_table(table, tmp_path / "out", intervals=intervals,
                        options=ImportOptions(skip_unreadable=True))  # fmt: skip
    assert [path.stem for path in made] == ["cup_1", "cup_2"]


def test_what_is_left_out_does_not_remove_a_recording_that_no_import_wrote(tmp_path):
    """Its name is that of a recording which would have been written again."""
    table = put(tmp_path, "cup_1", empty="cup_2")
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "cup_2.mcap").write_text("precious")
    with pytest.raises(BadTable, match=r"with cup_2\.mcap;"):
        skipping(table, overwrite=True)
    assert (tmp_path / "out" / "cup_2.mcap").read_text() == "precious"


def test_videos_cannot_be_left_out(tmp_path, capsys):
    (tmp_path / "table.csv").write_text("left,right,label:slip\na.mp4,b.mp4,held\n")
    words = ["import", str(tmp_path / "table.csv"), "--output", str(tmp_path / "out")]
    with pytest.raises(SystemExit) as ended:
        main([*words, "--skip-unreadable"])
    assert ended.value.code == 2
    assert "leave --skip-unreadable out" in capsys.readouterr().err
