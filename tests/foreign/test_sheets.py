"""Claims about sheets of workbooks: what is read is what stands in the cells, and all else is one
error, soon and in little memory.
"""

import io
import subprocess
import sys
import zipfile
from datetime import datetime, time, timedelta
from itertools import zip_longest
from pathlib import Path

import openpyxl
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mutations import changed_bytes

from taxel.errors import BadFile, MissingExtra
from taxel.foreign import sheet_child, sheets
from taxel.foreign.sheets import chosen_of, file_behind, is_sheet, sheet_lines, sheet_names

SHEET = "xl/worksheets/sheet1.xml"
TEXTS = "xl/sharedStrings.xml"
KINDS = "[Content_Types].xml"
MAIN = 'xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"'


def write(path: Path, *rows: tuple, sheets: dict[str, list[tuple]] | None = None) -> Path:
    """Write a workbook of one sheet of these rows, or of several."""
    book = openpyxl.Workbook()
    book.remove(book.active)
    for title, own in (sheets or {"Sheet": list(rows)}).items():
        sheet = book.create_sheet(title)
        for row in own:
            sheet.append(row)
    book.save(path)
    return path


def with_part(path: Path, part: str, content: bytes, way: int = zipfile.ZIP_DEFLATED) -> Path:
    """Replace a part of a workbook, or add its shared texts, which openpyxl does not write."""
    with zipfile.ZipFile(path) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    if part == TEXTS and part not in parts:
        kind = "application/vnd.openxmlformats-officedocument.spreadsheetml.sharedStrings+xml"
        entry = f'<Override PartName="/{TEXTS}" ContentType="{kind}"/></Types>'.encode()
        parts[KINDS] = parts[KINDS].replace(b"</Types>", entry)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, own in {**parts, part: content}.items():
            archive.writestr(name, own, compress_type=way if name == part else None)
    return path


def sheet_xml(rows: str, before: str = "") -> bytes:
    head = '<?xml version="1.0"?>'
    return f"{head}{before}<worksheet {MAIN}><sheetData>{rows}</sheetData></worksheet>".encode()


def lines(path: Path) -> list[str]:
    return list(sheet_lines(path, 2**30))


def test_cells_come_as_they_stand_and_rows_keep_their_numbers(tmp_path):
    path = write(
        tmp_path / "a.xlsx",
        (), ("t", 'a "pad"', "Force, N\nleft"), (0, 0.1, 1e300), (), (2.0, True, "é;\tx"),
        (datetime(2024, 3, 1, 12, 0, 0, 250000), time(1, 2, 3), timedelta(seconds=3.5)),
        (None, None, None, " "), (),
    )  # fmt: skip
    assert lines(path) == [
        "#", 't\t"a ""pad"""\tForce, N left', "0\t0.1\t1e+300", "\t\t",
        "2\tTRUE\té; x", "2024-03-01 12:00:00.250000\t01:02:03\t00:00:03.500000",
    ]  # fmt: skip


def test_the_first_sheet_that_is_not_hidden_is_read_or_the_one_that_is_named(tmp_path):
    own = {"Notes": [("n",)], "Day 1": [("x",)], "Day 2": [("y",)]}
    path = write(tmp_path / "A.XLSX", sheets=own)
    book = openpyxl.load_workbook(path)
    book["Notes"].sheet_state = "hidden"
    book.save(path)

    assert lines(path) == ["x"]
    assert chosen_of(path) == "'Day 1', not 'Notes', 'Day 2'"
    named = tmp_path / "A.XLSX[Day 2]"
    assert (lines(named), chosen_of(named)) == (["y"], "")
    assert (is_sheet(named), file_behind(named)) == (True, path)
    assert sheet_names(path) == list(own)
    with pytest.raises(BadFile, match="needed the sheet 'Day 3'; got 'Notes', 'Day 1', 'Day 2' in"):
        lines(tmp_path / "A.XLSX[Day 3]")


def test_a_sheet_is_read_once_and_again_when_it_changes(tmp_path, monkeypatch):
    path = write(tmp_path / "a.xlsx", ("x", "y"), (1, 2))
    first = lines(path)
    beside = [a == b for a, b in zip_longest(sheet_lines(path, 99), sheet_lines(path, 99))]
    assert beside == [True, True]
    with monkeypatch.context() as patch:
        patch.setattr(sheets.subprocess, "Popen", None)
        assert lines(path) == first
    write(path, ("x", "z", "more"))
    assert lines(path) == ["x\tz\tmore"]


@pytest.mark.parametrize(("cell", "is_refused"), [
    ('<c r="B2"><f>A2*2</f></c>', True),
    ('<c r="B2"><f>A2*2</f><v></v></c>', True),
    ('<c r="B2"><f t="shared" si="0"/><v/></c>', True),
    ('<c r="B2"><f>A2*2</f><v>3.5</v></c>', False),
    ('<c r="B2" t="str"><f>IF(A2,"","x")</f><v></v></c>', False),
])  # fmt: skip
def test_a_formula_without_a_stored_value_is_no_empty_cell(tmp_path, cell, is_refused):
    path = write(tmp_path / "a.xlsx", ("x", "y"))
    rows = f'<row r="1"><c r="A1"><v>1</v></c></row><row r="2">{cell}<c r="C2"><v>7</v></c></row>'
    with_part(path, SHEET, sheet_xml(rows))
    if not is_refused:
        assert lines(path)[1] in ("\t3.5\t7", "\t\t7")
        return
    with pytest.raises(
        BadFile, match=r"formulas with stored values; got none in cell B2 in .*save"
    ):
        lines(path)


@pytest.mark.parametrize(("content", "message"), [
    (b"", "another kind of file"),
    (b"a,b\n1,2\n", "another kind of file"),
    (b"\xd0\xcf\x11\xe0" + bytes(600), r"an old one \(\.xls\), or one with a password"),
    (b"PK\3\4" + bytes(600), "a whole workbook"),
])  # fmt: skip
def test_what_is_no_workbook_is_refused(tmp_path, content, message):
    (tmp_path / "a.xlsx").write_bytes(content)
    with pytest.raises(BadFile, match=message):
        lines(tmp_path / "a.xlsx")


def test_a_pipe_is_refused_and_a_missing_file_is_missing(tmp_path):
    (tmp_path / "a.xlsx").mkdir()
    with pytest.raises((BadFile, OSError)):
        lines(tmp_path / "a.xlsx")
    with pytest.raises(FileNotFoundError):
        lines(tmp_path / "b.xlsx")


def test_without_openpyxl_the_line_says_what_to_install(tmp_path, monkeypatch):
    path = write(tmp_path / "a.xlsx", ("x",))
    monkeypatch.setattr(sheets, "find_spec", lambda name: None)
    with pytest.raises(MissingExtra, match=r"pip install 'taxel\[xlsx\]'"):
        lines(path)


def test_what_a_sheet_says_of_its_size_counts_for_nothing(tmp_path):
    path = write(tmp_path / "a.xlsx", ("x",))
    rows = '<row r="1"><c r="A1"><v>1</v></c><c r="B1"><v>2</v></c></row>'
    for size in ("A1:XFD1048576", "A1", "ZZZ9:A1"):
        xml = sheet_xml(rows).replace(
            b"<sheetData>", f'<dimension ref="{size}"/><sheetData>'.encode()
        )
        with_part(path, SHEET, xml)
        assert lines(path) == ["1\t2"], size


def test_a_million_empty_rows_are_nothing(tmp_path):
    path = write(tmp_path / "a.xlsx", ("x",))
    rows = '<row r="1"><c r="A1"><v>1</v></c></row>' + "".join(
        f'<row r="{n}"/>' for n in range(2, 200_000)
    )
    with_part(path, SHEET, sheet_xml(rows + '<row r="1000000"/>'))
    assert lines(path) == ["1"]


@pytest.mark.parametrize(("rows", "message"), [
    ('<row r="999999999999"><c><v>1</v></c></row>', "at most 1,048,576 rows"),
    ('<row r="1"><c r="ZZZ1"><v>1</v></c></row>', "16,384 columns"),
    ('<row r="1"><c r="XFD1"><v>1</v></c></row><row r="9000"><c r="A9000"><v>1</v></c></row>',
     "at most 134,217,728 cells"),
    (f'<row r="1"><c t="inlineStr"><is><t>{"x" * 33_000}</t></is></c></row>',
     "cells of at most 32,767 characters"),
    ('<row r="1"><c r="A1" t="s"><v>5</v></c></row>', "a whole workbook.*IndexError"),
    ('<row r="1"><c r="A1" t="s"><v>5</v></c>', "a whole workbook.*ParseError"),
])  # fmt: skip
def test_rows_that_no_program_writes_are_refused(tmp_path, rows, message):
    path = with_part(write(tmp_path / "a.xlsx", (1,)), SHEET, sheet_xml(rows))
    with pytest.raises(BadFile, match=message):
        lines(path)


def test_a_bomb_is_refused_before_it_is_unpacked(tmp_path):
    path = write(tmp_path / "a.xlsx", (1,))
    with_part(path, SHEET, sheet_xml(" " * 30_000_000))
    with pytest.raises(BadFile, match="unpacks to 1,024 MiB at most, and to 100 times its size"):
        lines(path)


@pytest.mark.parametrize("way", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_a_part_in_a_way_of_packing_without_a_bound_is_refused(tmp_path, way):
    path = with_part(write(tmp_path / "a.xlsx", (1,)), TEXTS, b"<sst/>", way)
    with pytest.raises(BadFile, match="parts are stored or deflated"):
        lines(path)


ENTITIES = [
    '<!DOCTYPE a [<!ENTITY e SYSTEM "file:///etc/hostname">]>',
    "<!DOCTYPE a [<!ENTITY b '" + "x" * 100 + "'>"
    + "".join(f"<!ENTITY {chr(98 + n)} '{('&' + chr(97 + n) + ';') * 40}'>" for n in range(1, 9))
    + "<!ENTITY e '&j;&j;'>]>",
]  # fmt: skip


@pytest.mark.parametrize("before", ENTITIES, ids=["external", "ever more"])
def test_entities_are_not_followed(tmp_path, before):
    rows = '<row r="1"><c t="inlineStr"><is><t>&e;</t></is></c></row>'
    path = with_part(write(tmp_path / "a.xlsx", (1,)), SHEET, sheet_xml(rows, before))
    with pytest.raises(BadFile, match=r"a whole workbook.*ParseError|at most 32,767"):
        lines(path)


@pytest.mark.skipif(sys.platform != "linux", reason="the system keeps no such limit")
@pytest.mark.parametrize(("old", "new"), [
    ("MEMORY = 1024 * 2**20", "MEMORY = 16 * 2**20"),
    ("LEAST_CPU_S, BYTES_A_SECOND = 60, 2 * 2**20", "LEAST_CPU_S, BYTES_A_SECOND = 1, 2 * 2**30"),
])  # fmt: skip
def test_a_workbook_that_takes_too_much_ends_the_child_only(tmp_path, monkeypatch, old, new):
    """The child has 16 MiB here, or one second: 400,000 texts need more of both."""
    path = write(tmp_path / "a.xlsx", (1,))
    texts = "".join(f"<si><t>{n}</t></si>" for n in range(400_000))
    with_part(path, TEXTS, f"<sst {MAIN}>{texts}</sst>".encode())
    script = tmp_path / "child.py"
    whole = sheets._CHILD.read_text()
    script.write_text(whole.replace(old, new))
    assert script.read_text() != whole
    monkeypatch.setattr(sheets, "_CHILD", script)
    with pytest.raises(BadFile, match="where it breaks off or takes too much time"):
        lines(path)


def test_a_child_that_sleeps_is_ended(tmp_path, monkeypatch):
    path = write(tmp_path / "a.xlsx", (1,))
    (tmp_path / "child.py").write_text("import time; time.sleep(60)")
    monkeypatch.setattr(sheets, "_CHILD", tmp_path / "child.py")
    monkeypatch.setattr(sheets, "_LEAST_S", 0.2)
    with pytest.raises(BadFile, match="takes too much time"):
        lines(path)


def test_foreign_names_are_shown_safely(tmp_path):
    path = write(tmp_path / "a.xlsx", sheets={"a\u202eb": [(1,)]})
    with pytest.raises(BadFile) as refused:
        lines(tmp_path / "a.xlsx[x]")
    assert "\u202e" not in str(refused.value)
    assert path.is_file()


UNSHARED = [HealthCheck.function_scoped_fixture]
"""Examples write over one another's file."""


@pytest.mark.parametrize("part", ["", SHEET, TEXTS, "xl/workbook.xml", "xl/styles.xml"])
@settings(settings.get_profile("fuzz"), suppress_health_check=UNSHARED)
@given(data=st.data())
def test_changed_bytes_give_rows_or_one_reason(tmp_path, part, data):
    """Of the file, or of a part of it: in this process, as each child takes half a second."""
    path = tmp_path / "honest.xlsx"
    if not path.exists():
        write(path, ("t", "a"), (datetime(2024, 3, 1), 0.5), (time(1), "x"), (None, True))
        with_part(path, TEXTS, f"<sst {MAIN}><si><t>cup</t></si><si><t>can</t></si></sst>".encode())
    content = path.read_bytes()
    if part:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            broken = data.draw(changed_bytes(archive.read(part)))
        other = tmp_path / "broken.xlsx"
        other.write_bytes(content)
        with_part(other, part, broken)
    else:
        other = tmp_path / "broken.xlsx"
        other.write_bytes(data.draw(changed_bytes(content)))
    out = io.BytesIO()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sheet_child, "limit", lambda cpu_s: None)
        found = sheet_child.reply(str(other), "", out)
    assert set(found) in ({"needed", "got", "mend"}, {"names", "count", "name", "rows", "width"})
    text = out.getvalue().decode()
    if "rows" in found:
        assert text.count("\n") == found["rows"]


def test_the_child_loads_nothing_of_taxel():
    """It runs as a script, which takes a third of a second."""
    code = (f"import runpy, sys; sys.argv = ['', 'gone.xlsx']; "
            f"runpy.run_path({str(sheets._CHILD)!r}, run_name='__main__'); "
            "assert not [name for name in sys.modules if name.startswith('taxel')]")  # fmt: skip
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True)
    assert b'"needed"' in done.stderr
