"""Claims about imports: each row becomes a recording, or nothing is written at all."""

import gzip

import numpy as np
import pytest

from taxel.cli.main import main
from taxel.errors import BadTable
from taxel.recordings.imports.importing import ImportOptions, import_table
from taxel.recordings.reader import iterate_blocks, list_recordings, read_recording
from taxel.signals import Validity

HEADER = "file,label:object,group:session,channels,time,sensor,full_scale\n"
HOOK = """
import numpy as np

def read(path):
    values = np.array([[float(x) for x in line.split("|")] for line in path.read_text().split()])
    return values, np.arange(len(values)) / 50.0, ("left", "right"), ("N", "N")

def wrong(path):
    return np.zeros((3, 2)), np.zeros(3), ("only one",), ("N",)

def broken(path):
    raise KeyError("oops")
"""


@pytest.fixture
def folder(tmp_path):
    """Two good tables and an import table for them."""
    for name in ("a", "b"):
        rows = "".join(f"{10 * i},{i},{i * 0.5}\n" for i in range(1, 9))
        (tmp_path / f"{name}.csv").write_text("t,x,y\n" + rows)
    (tmp_path / "table.csv").write_text(
        HEADER + "a.csv,cup,1,x[V] y[V],t[ms],pad,3.5\nb.csv,ball,2,x[V],t[ms],,\n"
    )
    return tmp_path


def test_each_row_becomes_a_recording(folder):
    """Values, times, labels, groups, units and saturation as the table says."""
    made = import_table(folder / "table.csv", folder / "out")
    assert made == list_recordings(folder / "out") == [folder / "out/a.mcap", folder / "out/b.mcap"]
    first, second = map(read_recording, made)
    np.testing.assert_array_equal(first.samples.values[:, 0], np.arange(1, 9))
    np.testing.assert_allclose(first.samples.fitted_s, np.arange(1, 9) * 0.01)
    assert first.manifest.labels == {"object": "cup"}
    assert first.manifest.groups == {"file": "a.csv", "session": "1"}
    assert first.manifest.sensor.name == "pad"
    assert first.manifest.sensor.rate_hz == 100.0
    assert (first.samples.validity[:, 0] & Validity.SATURATED > 0).tolist() == [False] * 3 + [
        True
    ] * 5
    assert second.manifest.sensor.units == ("V",)
    assert second.statistics["ended"] == "imported"


def test_the_same_import_gives_the_same_bytes(folder):
    """Nothing of the clock or of chance enters an imported recording."""
    import_table(folder / "table.csv", folder / "one")
    import_table(folder / "table.csv", folder / "two")
    for name in ("a.mcap", "b.mcap"):
        assert (folder / "one" / name).read_bytes() == (folder / "two" / name).read_bytes()


def test_kept_cells_are_flagged(folder):
    """An empty cell is a NaN that says so, never a zero."""
    (folder / "a.csv").write_text("t,x,y\n10,1,2\n20,,3\n")
    made = import_table(folder / "table.csv", folder / "out", options=ImportOptions(missing="keep"))
    samples = read_recording(made[0]).samples
    assert np.isnan(samples.values[1, 0])
    assert samples.validity.tolist() == [[0, 0], [Validity.NOT_FINITE, 0]]


def test_a_column_of_a_group_that_is_empty_everywhere_is_none(folder):
    """Somebody who has no sessions may leave the column as it came with the table."""
    (folder / "table.csv").write_text(HEADER + "a.csv,cup,,x[V],t[ms],,\nb.csv,cup,,x[V],t[ms],,\n")
    made = import_table(folder / "table.csv", folder / "out")
    assert [dict(read_recording(path).manifest.groups) for path in made] == [
        {"file": "a.csv"}, {"file": "b.csv"},
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ("", "a column 'file'.*got the empty file"),
        (" \n,,\n", "a column 'file'.*got the empty file"),
        ("\nfile,layout\n", "an empty line 1"),
        ("t,x,y\n1,2,3\n", "got the columns 't', 'x', 'y' in .*if it is itself a file of data"),
        ("time,x\n1,2\n", "got the columns 'time', 'x' in .*if it is itself a file of data"),
        ("0.1,2\n0.2,3\n", "got the columns '0.1', '2' in .*if it is itself a file of data"),
        ("file,object\na.csv,cup\n", "got 'object' in .*call it label:object or group:object"),
        (HEADER, "a row for each file"),
        ("name\na.csv\n", "'name'"),
        ("file,file\na.csv,b.csv\n", "each column once"),
        (HEADER + "a.csv,cup\n", "line 2"),
        (HEADER + "a.csv,,1,x[V],t[ms],,\n", "'label:object'"),
        (
            HEADER + "a.csv,cup,1,x[V],t[ms],,\nb.csv,cup,,x[V],t[ms],,\n",
            "'group:session'; got nothing in .*line 3, where other lines have it: a split",
        ),
        (HEADER + "gone.csv,cup,1,x[V],t[ms],,\n", "gone.csv"),
        (HEADER + "a.csv,cup,1,x,t[ms],,\n", "name each unit"),
        (HEADER + "a.csv,cup,1,x[V],t[h],,\n", "rate:100Hz"),
        (HEADER + "a.csv,cup,1,z[V],t[ms],,\n", "'z'"),
        (HEADER + "a.csv,cup,1,x[V],t[ms],,much\n", "full_scale"),
        (HEADER + "a.csv,cup,1,x[V],t[ms],,\na.csv,cup,1,x[V],t[ms],,\n", "each file in one row"),
        (HEADER + "a.csv,cup,1,x[V],t[ms],,\nz/../a.csv,cup,1,x[V],t[ms],,\n", "each file in one"),
        (HEADER + "a.csv,cup,1,x[V],t[ms],,\na.npy,cup,1,1[V],1[s],,\n", "names differ"),
        ("file,layout\na.csv,matlab\n", "icub"),
        ("file,layout\na.csv,hook.py:read\n", "--allow-code"),
    ],
)
def test_a_wrong_import_table_is_one_plain_line_and_no_output(folder, table, words):
    """The line names the table or the file; the output folder does not appear."""
    (folder / "table.csv").write_text(table)
    with pytest.raises(BadTable, match=words) as caught:
        import_table(folder / "table.csv", folder / "out")
    assert "\n" not in str(caught.value)
    assert not (folder / "out").exists()


@pytest.mark.parametrize("name", ["x.npy", "x.NPY", "x.xlsx"])
def test_a_file_of_data_in_the_tables_place_is_called_one(folder, name):
    """Not a text in a wrong encoding."""
    (folder / name).write_bytes(b"\x93NUMPY\x00\xff")
    with pytest.raises(BadTable, match=r"an import table: .*write a table with a line for it"):
        import_table(folder / name, folder / "out")
    with pytest.raises(BadTable, match=r"got the folder .*write a table that names its files"):
        import_table(folder, folder / "out")


@pytest.mark.parametrize(
    ("table", "mend"),
    [
        ("file,label,channels,time\na.csv,cup,*[V],t[ms]\n", "got 'label' .* as in label:object"),
        ("file,group,channels,time\na.csv,1,*[V],t[ms]\n", "got 'group' .* as in group:session"),
        ("file,channels,time\na.csv,x[V],y[V],t[ms]\n", "got 4 .*; put blanks, not commas"),
        ("file,channels,time\na.csv,x[V],y[V],rate:9Hz\n", "got 4 .*; put blanks, not commas"),
        ("file,label:object,channels,time\na.csv,cup,big,x[V],t[ms]\n", "got 5 .*; mend the line"),
        ("file,label:object\na.csv,cup\n", r"write a column channels, as a\[N\] b\[N\]"),
        ("file,channels,time\nin/a.csv,*[V],t[ms]\n", "check the path, which is relative to the"),
    ],
)
def test_first_tables_of_somebody_new_are_answered_with_what_to_write(folder, table, mend):
    (folder / "table.csv").write_text(table)
    with pytest.raises(BadTable, match=mend):
        import_table(folder / "table.csv", folder / "out")
    assert not (folder / "out").exists()


def test_the_command_line_says_the_same_in_one_line(folder, capsys):
    """It looks at the first line before, to see whether it names videos."""
    np.save(folder / "x.npy", np.zeros((3, 2)))
    with pytest.raises(SystemExit) as ended:
        main(["import", str(folder / "x.npy"), "--output", str(folder / "out")])
    assert ended.value.code == 2
    assert capsys.readouterr().err.startswith("taxel: needed an import table: a CSV")


def test_the_tables_own_words_may_have_capitals(folder):
    """As spreadsheets write a first word; what a label is called stays as it is."""
    table = (folder / "table.csv").read_text().replace(HEADER, HEADER.title())
    assert table.startswith("File,Label:Object,")
    (folder / "table.csv").write_text(table)
    (folder / "iv.csv").write_text("File,Start_s,End_s,Label:Way\na.csv,0,0.02,up\n")
    first, _ = import_table(folder / "table.csv", folder / "out", intervals=folder / "iv.csv")
    recording = read_recording(first)
    assert recording.manifest.labels == {"Object": "cup"}
    assert recording.manifest.groups == {"file": "a.csv", "Session": "1"}
    assert recording.marks[0].labels == {"Way": "up"}


def test_one_bad_file_among_good_ones_leaves_nothing(folder):
    """The import is complete or not there, and leaves no scratch behind."""
    (folder / "b.csv").write_text("t,x,y\n10,1,2\n20,text,3\n")
    before = sorted(path.name for path in folder.iterdir())
    with pytest.raises(BadTable, match=r"b\.csv, line 3"):
        import_table(folder / "table.csv", folder / "out")
    assert sorted(path.name for path in folder.iterdir()) == before


def test_a_layout_of_ones_own_reads_what_it_likes(folder):
    """The hook's function gives values, times, names and units; channels may be chosen."""
    (folder / "hook.py").write_text(HOOK)
    (folder / "a.txt").write_text("1|2\n3|4\n")
    (folder / "table.csv").write_text("file,layout,channels\na.txt,hook.py:read,right[N]\n")
    allowed = ImportOptions(allow_code=True)
    (made,) = import_table(folder / "table.csv", folder / "out", options=allowed)
    recording = read_recording(made)
    assert recording.samples.values.tolist() == [[2.0], [4.0]]
    assert recording.manifest.sensor.channels == ("right",)


@pytest.mark.parametrize(
    ("layout", "words"),
    [
        ("hook.py:wrong", "one name and one unit"),
        ("hook.py:broken", "KeyError"),
        ("hook.py:absent", "function absent"),
        ("gone.py:read", "not there"),
        ("bad.py:read", "SyntaxError"),
    ],
)
def test_a_wrong_layout_is_one_plain_line(folder, layout, words):
    """A user's own code may fail in any way; the message stays a line."""
    (folder / "hook.py").write_text(HOOK)
    (folder / "bad.py").write_text("def read(:\n")
    (folder / "table.csv").write_text(f"file,layout\na.csv,{layout}\n")
    with pytest.raises(BadTable, match=words):
        import_table(folder / "table.csv", folder / "out", options=ImportOptions(allow_code=True))
    assert not (folder / "out").exists()


INTERVALS = "file,start_s,end_s,label:object,group:try\na.csv,0.02,0.05,egg,1\n"


def test_intervals_become_marks_behind_their_scans(folder):
    """A file without intervals keeps its own label; the marks' label wins over the file's."""
    (folder / "iv.csv").write_text(INTERVALS + "a.csv,0.05,0.08,cup,2\n")
    made = import_table(folder / "table.csv", folder / "out", intervals=folder / "iv.csv")

    first, second = map(read_recording, made)
    assert [(round(m.start_s, 3), round(m.end_s, 3)) for m in first.marks] == [
        (0.03, 0.05), (0.06, 0.08)
    ]  # fmt: skip
    assert [(m.labels, m.groups) for m in first.marks] == [
        ({"object": "egg"}, {"try": "1"}), ({"object": "cup"}, {"try": "2"})
    ]  # fmt: skip
    assert len(first.samples) == 8
    assert second.marks == []
    order = ["mark" if block.marks else len(block.samples) for block in iterate_blocks(made[0])]
    assert order == [5, "mark", 3, "mark"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (INTERVALS + "b.csv,0.05,0.09,egg,1\n", "within 0 and 0.08 s"),
        (INTERVALS + "c.csv,0,0.05,egg,1\n", "among a, b"),
    ],
)
def test_a_wrong_interval_leaves_nothing(folder, text, words):
    (folder / "iv.csv").write_text(text)
    before = sorted(path.name for path in folder.iterdir())
    with pytest.raises(BadTable, match=words):
        import_table(folder / "table.csv", folder / "out", intervals=folder / "iv.csv")
    assert sorted(path.name for path in folder.iterdir()) == before


@pytest.fixture
def days(folder):
    """Two days, a folder each, in which trials have the same names; one more name is its own."""
    for day in ("day1", "day2"):
        (folder / day).mkdir()
        (folder / day / "trial0.csv").write_text((folder / "a.csv").read_text())
    lines = [f"{file},x[V],t[ms]\n" for file in ("day1/trial0.csv", "b.csv", "day2/trial0.csv")]
    (folder / "table.csv").write_text("file,channels,time\n" + "".join(lines))
    return folder


def test_files_that_share_a_name_are_called_by_their_folders(days):
    """Only these; however their paths are written."""
    made = import_table(days / "table.csv", days / "out")
    assert [path.name for path in made] == ["day1-trial0.mcap", "b.mcap", "day2-trial0.mcap"]
    assert [read_recording(path).manifest.groups["file"] for path in made] == [
        "day1/trial0.csv", "b.csv", "day2/trial0.csv"
    ]  # fmt: skip

    text = (days / "table.csv").read_text().replace("day2/", f"{days}/day1/../day2/")
    (days / "table.csv").write_text(text)
    again = import_table(days / "table.csv", days / "again")
    assert [path.name for path in again] == [path.name for path in made]


def test_a_link_to_a_file_of_the_same_name_is_the_same_file(days):
    (days / "day2" / "trial0.csv").unlink()
    (days / "day2" / "trial0.csv").symlink_to(days / "day1" / "trial0.csv")
    with pytest.raises(BadTable, match="each file in one row"):
        import_table(days / "table.csv", days / "out")


def test_a_name_made_of_folders_may_be_taken(days):
    (days / "day1-trial0.csv").write_text((days / "a.csv").read_text())
    with (days / "table.csv").open("a") as table:
        table.write("day1-trial0.csv,x[V],t[ms]\n")
    with pytest.raises(BadTable, match="names differ"):
        import_table(days / "table.csv", days / "out")


@pytest.mark.parametrize("second", ["day2/trial0.csv", "./day2/trial0", "day2-trial0"])
def test_intervals_find_files_that_share_a_name(days, second):
    (days / "iv.csv").write_text(
        "file,start_s,end_s,label:object\nb.csv,0,0.02,cup\nday1/trial0.csv,0,0.03,cup\n"
        f"{second},0,0.05,egg\n"
    )
    made = import_table(days / "table.csv", days / "out", intervals=days / "iv.csv")
    assert [read_recording(path).marks[0].labels["object"] for path in made] == [
        "cup", "cup", "egg"
    ]  # fmt: skip

    (days / "iv.csv").write_text("file,start_s,end_s,label:object\ntrial0.csv,0,0.02,cup\n")
    with pytest.raises(BadTable, match=r"among day1-trial0, b, day2-trial0; got 'trial0\.csv'"):
        import_table(days / "table.csv", days / "two", intervals=days / "iv.csv")


def test_a_file_with_neither_label_nor_interval_is_named(folder):
    (folder / "table.csv").write_text("file,channels,time\na.csv,x[V],t[ms]\nb.csv,x[V],t[ms]\n")
    (folder / "iv.csv").write_text(INTERVALS)
    with pytest.raises(BadTable, match=r"none for .*b\.csv"):
        import_table(folder / "table.csv", folder / "out", intervals=folder / "iv.csv")


@pytest.mark.parametrize("ending", [".CSV", ".Csv.GZ", ".NPY"])
def test_endings_in_capitals_are_the_same(folder, ending):
    """Cameras, loggers and spreadsheets write them so; they are no part of the name, either."""
    text = (folder / "a.csv").read_bytes()
    columns, time = ("2[V]", "1[ms]") if ending == ".NPY" else ("x[V]", "t[ms]")
    path = folder / f"c{ending}"
    if ending == ".NPY":
        with path.open("wb") as file:
            np.save(file, np.array([[10.0, 1.0], [20.0, 2.0]]))
    else:
        path.write_bytes(gzip.compress(text) if ending.endswith("GZ") else text)
    (folder / "table.csv").write_text(f"file,channels,time\nc{ending},{columns},{time}\n")
    (folder / "iv.csv").write_text(f"file,start_s,end_s,label:object\nc{ending},0,0.02,egg\n")
    (made,) = import_table(folder / "table.csv", folder / "out", intervals=folder / "iv.csv")
    assert made.name == "c.mcap"
    assert read_recording(made).samples.values[:2, 0].tolist() == [1, 2]


def test_an_import_table_from_a_spreadsheet_is_read(folder):
    """Semicolons, UTF-16 with its mark, and empty columns and lines of separators."""
    lines = [*(folder / "table.csv").read_text().replace(",", ";").splitlines(), ";;;;;;"]
    text = "".join(f"{line};;\r\r\n" for line in lines)
    (folder / "table.csv").write_bytes(text.encode("utf-16"))
    assert len(import_table(folder / "table.csv", folder / "out")) == 2


def test_labels_and_groups_are_stored_with_composed_letters(folder):
    text = (folder / "table.csv").read_text().replace("cup", "cafe\u0301")
    (folder / "table.csv").write_text(text, "utf-8")
    made = import_table(folder / "table.csv", folder / "out")
    assert read_recording(made[0]).manifest.labels == {"object": "caf\u00e9"}


@pytest.mark.parametrize("column", ["rate", "rate:100Hz"])
def test_a_rate_in_a_column_of_its_own_is_sent_to_the_column_time(tmp_path, column):
    table = tmp_path / "import.csv"
    table.write_text(f"file,channels,{column}\na.csv,a[V],100\n")
    with pytest.raises(BadTable, match="in the column time, as rate:100Hz"):
        import_table(table, tmp_path / "out")


def test_a_person_who_rates_is_a_group_and_no_rate(tmp_path):
    table = tmp_path / "import.csv"
    table.write_text("file,channels,rater\na.csv,a[V],Ann\n")
    with pytest.raises(BadTable, match="call it label:rater or group:rater"):
        import_table(table, tmp_path / "out")
