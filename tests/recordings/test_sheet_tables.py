"""Claims about workbooks in an import table: a sheet is a text, and what holds for texts holds."""

from datetime import datetime, timedelta
from pathlib import Path

import openpyxl
import pytest

from taxel.cli.main import main
from taxel.errors import BadTable
from taxel.recordings.imports.importing import import_table
from taxel.recordings.imports.intervals import stem_of
from taxel.recordings.imports.notes import notes_of
from taxel.recordings.reader import read_recording

ROWS = [("ms", "a", "b"), (0, 1, 2), (10, 3, 4), (20, 5.5, 6)]


def workbook(path: Path, **sheets: list[tuple]) -> openpyxl.Workbook:
    """Write a workbook; its sheets are called as the arguments, with blanks for underscores."""
    book = openpyxl.Workbook()
    book.remove(book.active)
    for title, rows in sheets.items():
        own = book.create_sheet(title.replace("_", " "))
        for row in rows:
            own.append(row)
    path.parent.mkdir(exist_ok=True)
    book.save(path)
    return book


def bring(folder: Path, table: str):
    """Import by a table; return what came of it by name, and the notes."""
    (folder / "table.csv").write_text(table)
    facts = []
    made = import_table(folder / "table.csv", folder / "out", on_file=facts.append)
    return {path.stem: read_recording(path) for path in made}, notes_of(facts)


def test_the_first_sheet_is_read_with_a_note_and_others_by_their_names(tmp_path):
    workbook(tmp_path / "touch.xlsx", Day_1=ROWS, Day_2=[*ROWS, (30, 7, 8)])
    found, notes = bring(
        tmp_path, "file,label:object,channels,time\n"
        "touch.xlsx,cup,*[N],ms[ms]\ntouch.xlsx[Day 2],can,b[N],ms[ms]\n",
    )  # fmt: skip
    assert list(found) == ["touch", "touch-Day-2"]
    assert found["touch"].samples.values.tolist() == [[1, 2], [3, 4], [5.5, 6]]
    assert found["touch-Day-2"].samples.values.tolist() == [[2], [4], [6], [8]]
    assert found["touch-Day-2"].manifest.groups["file"] == "touch.xlsx[Day 2]"
    assert notes == ["touch.xlsx: the sheet 'Day 1', not 'Day 2' was read; to read another one, "
                     "write touch.xlsx[SHEET]"]  # fmt: skip


def test_a_pattern_may_name_a_sheet(tmp_path):
    for name in ("cup_1.xlsx", "can_2.xlsx"):
        workbook(tmp_path / name, Notes=[("n",)], Data=ROWS)
    found, notes = bring(tmp_path, "file,channels,time\n"
                         "{label:object}_*.xlsx[Data],*[N],ms[ms]\n")  # fmt: skip
    assert {own.manifest.labels["object"] for own in found.values()} == {"cup", "can"}
    assert list(found) == ["can_2-Data", "cup_1-Data"]
    assert not any("not imported" in note for note in notes)


def test_trials_labels_and_time_stamps_come_from_columns(tmp_path):
    start = datetime(2024, 3, 1, 12)
    rows = [("when", "a", "trial", "state")] + [
        (start + timedelta(milliseconds=10 * n), n, n // 4, "held" if n % 4 < 2 else "slip")
        for n in range(8)
    ]
    workbook(tmp_path / "t.xlsx", Log=rows)
    workbook(tmp_path / "labels.xlsx", Notes=[("n",)], Names=[("object",), ("cup",), ("can",)])
    found, _ = bring(
        tmp_path, "file,trials,label:object,label:state,channels,time\n"
        "t.xlsx,trial,from:labels.xlsx[Names]:object,rows:state,a[N],when[iso]\n",
    )  # fmt: skip
    assert [own.manifest.labels["object"] for own in found.values()] == ["cup", "can"]
    first = next(iter(found.values()))
    assert [mark.labels["state"] for mark in first.marks] == ["held", "slip"]
    assert first.manifest.sensor.rate_hz == pytest.approx(100.0)


def test_a_head_of_merged_cells_is_passed_over_where_names_are_stated(tmp_path):
    rows = [("Measured on Monday",), (), (None, "left pad", None), *ROWS]
    book = workbook(tmp_path / "t.xlsx", A=rows)
    book["A"].merge_cells("A1:C1")
    book["A"].merge_cells("B3:C3")
    book.save(tmp_path / "t.xlsx")
    found, notes = bring(tmp_path, "file,label:object,channels,time\nt.xlsx,cup,a[N] b[N],ms[ms]\n")
    assert found["t"].samples.values.shape == (3, 2)
    assert notes == ["t.xlsx: passed over lines 1 to 3 above the names"]


@pytest.mark.parametrize(("change", "message"), [
    ({"B1": "c"}, "needed the column 'a'; got no such column"),
    ({"B3": None}, "needed a finite number that 32 bits hold; got nan in .*line 3, column 'a'"),
    ({"B3": "#DIV/0!"}, "needed a number; got '#DIV/0!' in .*line 3, column 'a'"),
    ({"B3": "=A3*2"}, "formulas with stored values; got none in cell B3"),
    ({"B3": datetime(2024, 3, 1)}, "got '2024-03-01 00:00:00' in .*line 3, column 'a'"),
    ({"F3": "a remark"}, "nothing behind the last name's column .*got 'a remark' in .*line 3"),
    ({"A3": None, "B3": None, "C3": None}, "needed a finite number .*line 3"),
])  # fmt: skip
def test_what_cannot_be_is_refused_by_its_row_and_column(tmp_path, change, message):
    book = workbook(tmp_path / "t.xlsx", A=ROWS)
    for cell, value in change.items():
        book["A"][cell] = value
    book.save(tmp_path / "t.xlsx")
    with pytest.raises(BadTable, match=message):
        bring(tmp_path, "file,label:object,channels,time\nt.xlsx,cup,a[N] b[N],ms[ms]\n")


def test_a_sheet_that_is_not_there_is_refused_with_those_that_are(tmp_path):
    workbook(tmp_path / "t.xlsx", A=ROWS)
    with pytest.raises(BadTable, match=r"needed the sheet 'B'; got 'A' in .*t\.xlsx\[B\]"):
        bring(tmp_path, "file,label:object,channels,time\nt.xlsx[B],cup,a[N],ms[ms]\n")
    with pytest.raises(BadTable, match=r"a file to import; got .*u\.xlsx\[B\], which is not there"):
        bring(tmp_path, "file,label:object,channels,time\nu.xlsx[B],cup,a[N],ms[ms]\n")


@pytest.mark.parametrize("cell", ["data/t.xlsx", "data/t.xlsx[A]", "../outside/t.xlsx[A]"])
def test_a_sheet_leads_no_further_than_its_file(tmp_path, cell):
    workbook(tmp_path / "outside" / "t.xlsx", A=ROWS)
    inside = tmp_path / "inside"
    (inside / "data").mkdir(parents=True)
    (inside / "data" / "t.xlsx").symlink_to(tmp_path / "outside" / "t.xlsx")
    with pytest.raises(BadTable, match="which lies outside"):
        bring(inside, f"file,label:object,channels,time\n{cell},cup,a[N],ms[ms]\n")


def test_a_workbook_in_the_tables_place_is_named_with_its_sheets(tmp_path, refused_line):
    workbook(tmp_path / "t.xlsx", A=ROWS, B_2=ROWS)
    line = refused_line(["import", str(tmp_path / "t.xlsx"), "--output", str(tmp_path / "out")])
    assert "t.xlsx, which is a workbook with 2 sheets: A, B 2; write a table" in line


def test_without_openpyxl_the_line_says_what_to_install(tmp_path, refused_line, monkeypatch):
    workbook(tmp_path / "t.xlsx", A=ROWS)
    (tmp_path / "table.csv").write_text("file,channels,time\nt.xlsx,a[N],ms[ms]\n")
    monkeypatch.setattr("taxel.foreign.sheets.find_spec", lambda name: None)
    for name in ("table.csv", "t.xlsx"):
        line = refused_line(["import", str(tmp_path / name), "--output", str(tmp_path / "out")])
        assert "the package openpyxl" in line
        assert "pip install 'taxel[xlsx]'" in line


def test_recordings_of_sheets_have_names_that_files_may_have():
    names = ["a/t.xlsx[Day 1]", "t.XLSX[<x>]", "t.xlsx[é.b]", "t.xlsx", "t.xlsx[a"]
    assert [stem_of(name) for name in names] == ["t-Day-1", "t--x-", "t-é.b", "t", "t.xlsx[a"]


@pytest.fixture
def refused_line(capsys):
    def run(words: list[str]) -> str:
        with pytest.raises(SystemExit) as ended:
            main(words)
        assert ended.value.code == 2
        (line,) = capsys.readouterr().err.splitlines()
        return line

    return run
