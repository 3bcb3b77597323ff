"""Claims about imports: each row becomes a recording, or nothing is written at all."""

import numpy as np
import pytest

from taxel.errors import BadTable
from taxel.recordings.importing import ImportOptions, import_table
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


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ("", "a column 'file'"),
        (HEADER, "a row for each file"),
        ("name\na.csv\n", "'name'"),
        ("file,file\na.csv,b.csv\n", "each column once"),
        (HEADER + "a.csv,cup\n", "line 2"),
        (HEADER + "a.csv,,1,x[V],t[ms],,\n", "'label:object'"),
        (HEADER + "gone.csv,cup,1,x[V],t[ms],,\n", "gone.csv"),
        (HEADER + "a.csv,cup,1,x,t[ms],,\n", "name each unit"),
        (HEADER + "a.csv,cup,1,x[V],t[h],,\n", "rate:100Hz"),
        (HEADER + "a.csv,cup,1,z[V],t[ms],,\n", "'z'"),
        (HEADER + "a.csv,cup,1,x[V],t[ms],,much\n", "full_scale"),
        (HEADER + "a.csv,cup,1,x[V],t[ms],,\na.csv,cup,1,x[V],t[ms],,\n", "names differ"),
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


def test_one_bad_file_among_good_ones_leaves_nothing(folder):
    """The import is complete or not there, and leaves no scratch behind."""
    (folder / "b.csv").write_text("t,x,y\n10,1,2\n20,text,3\n")
    before = sorted(path.name for path in folder.iterdir())
    with pytest.raises(BadTable, match=r"b\.csv, line 3"):
        import_table(folder / "table.csv", folder / "out")
    assert sorted(path.name for path in folder.iterdir()) == before


def test_an_output_folder_with_something_in_it_is_not_replaced_unasked(folder):
    """With overwrite it is replaced as a whole, unless something would be lost with it."""
    again = ImportOptions(overwrite=True)
    import_table(folder / "table.csv", folder / "out")
    with pytest.raises(BadTable, match="--overwrite"):
        import_table(folder / "table.csv", folder / "out")
    (folder / "out" / "old.mcap").write_text("precious")
    with pytest.raises(BadTable, match=r"with old\.mcap;"):
        import_table(folder / "table.csv", folder / "out", options=again)
    with pytest.raises(BadTable, match=r"and [0-9] more"):
        import_table(folder / "table.csv", folder, options=again)
    assert (folder / "out" / "old.mcap").read_text() == "precious"
    (folder / "out" / "old.mcap").unlink()
    import_table(folder / "table.csv", folder / "out", options=again)
    assert [path.name for path in list_recordings(folder / "out")] == ["a.mcap", "b.mcap"]


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


def test_a_file_with_neither_label_nor_interval_is_named(folder):
    (folder / "table.csv").write_text("file,channels,time\na.csv,x[V],t[ms]\nb.csv,x[V],t[ms]\n")
    (folder / "iv.csv").write_text(INTERVALS)
    with pytest.raises(BadTable, match=r"none for .*b\.csv"):
        import_table(folder / "table.csv", folder / "out", intervals=folder / "iv.csv")


def test_an_import_table_from_a_spreadsheet_is_read(folder):
    """Semicolons, UTF-16 with its mark, and empty lines of separators."""
    text = (folder / "table.csv").read_text().replace(",", ";") + ";;;;;;\n"
    (folder / "table.csv").write_bytes(text.encode("utf-16"))
    assert len(import_table(folder / "table.csv", folder / "out")) == 2


def test_labels_and_groups_are_stored_with_composed_letters(folder):
    text = (folder / "table.csv").read_text().replace("cup", "cafe\u0301")
    (folder / "table.csv").write_text(text, "utf-8")
    made = import_table(folder / "table.csv", folder / "out")
    assert read_recording(made[0]).manifest.labels == {"object": "caf\u00e9"}
