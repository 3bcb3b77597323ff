"""Claims about labels that stand in a text's rows: stretches of one label become trials."""

import numpy as np
import pytest

from taxel.errors import BadTable
from taxel.recordings.imports.importing import import_table
from taxel.recordings.reader import read_recording

TEXT = """ms,a,b,state,who
0,1,2,stable,anna
10,3,4,stable,anna
20,5,6,slip,anna
30,7,8,,anna
40,9,10,stable,anna
0,11,12,slip,bo
10,13,14,slip,bo
"""
ONE = "file,label:object,label:state,channels,time\nall.csv,cup,rows:state,{},ms[ms]\n"
MANY = "file,trials,label:state,channels,time\nall.csv,who,rows:state,{},ms[ms]\n"


def bring(folder, table, text, channels="*[N]"):
    """Import a text by a table of one line."""
    (folder / "all.csv").write_text(text)
    (folder / "table.csv").write_text(table.format(channels))
    notes = []
    made = import_table(folder / "table.csv", folder / "out", on_file=notes.append)
    return [read_recording(path) for path in made], notes


@pytest.mark.parametrize("channels", ["*[N]", "a[N] b[N]"])
def test_rows_with_one_label_are_a_trial_and_rows_without_are_none(tmp_path, channels):
    text = "\n".join(line.rsplit(",", 1)[0] for line in TEXT.splitlines()[:6])
    (recording,), (facts,) = bring(tmp_path, ONE, text, channels)
    marks = [(mark.start_s, mark.end_s, dict(mark.labels)) for mark in recording.marks]

    assert marks == [
        (pytest.approx(0.00), pytest.approx(0.01), {"state": "stable"}),
        (pytest.approx(0.02), pytest.approx(0.02), {"state": "slip"}),
        (pytest.approx(0.04), pytest.approx(0.04), {"state": "stable"}),
    ]
    assert recording.manifest.labels == {"object": "cup"}
    assert recording.manifest.sensor.channels == ("a", "b")
    assert any("column state" in remark for remark in facts.of_line)


ROWS = TEXT.partition("\n")[2].replace("0,1,2", "0,1.5,2", 1)


@pytest.mark.parametrize(("text", "channels", "time", "trials"), [
    (ROWS, "2[N] 3[N]", "1[ms]", "5"),
    (ROWS, "*[N]", "1[ms]", "5"),
    (ROWS, "2[N] 3[N]", "1[ms]", "restarts"),
    (ROWS, "2[N] 3[N]", "1[ms]", "5+restarts"),
    (ROWS, "*[N]", "1[ms]", "5+restarts"),
    ("ms,a,b,state,who\n" + ROWS, "2[N] 3[N]", "1[ms]", "5"),
    ("ms,a,b,state,who\n" + ROWS, "2[N] 3[N]", "ms[ms]", "who"),
    ("ms,0.5,1.5,state,who\n" + ROWS, "2[N] 3[N]", "1[ms]", "who+restarts"),
])  # fmt: skip
def test_without_a_line_of_names_each_row_keeps_its_label(tmp_path, text, channels, time, trials):
    """Values, labels and trials are read apart, and all begin with the same line."""
    table = f"file,trials,label:state,channels,time\nall.csv,{trials},rows:4,{{}},{time}\n"
    (anna, bo), _ = bring(tmp_path, table, text, channels)

    assert anna.samples.values.tolist() == [[1.5, 2], [3, 4], [5, 6], [7, 8], [9, 10]]
    assert [mark.labels["state"] for mark in anna.marks] == ["stable", "slip", "stable"]
    assert [(mark.start_s, mark.end_s) for mark in bo.marks] == [(0.0, pytest.approx(0.01))]


def test_a_file_without_names_keeps_its_first_row_and_that_row_s_label(tmp_path):
    table = "file,label:state,channels,time\nall.csv,rows:4,{},1[iso]\n"
    rows = "".join(f"12:00:00.0{n}0,{n},{n},{'ab'[n > 2]}\n" for n in range(6))
    (recording,), _ = bring(tmp_path, table, rows, "2[N] 3[N]")

    assert recording.samples.values[:, 0].tolist() == [0, 1, 2, 3, 4, 5]
    assert [mark.labels["state"] for mark in recording.marks] == ["a", "b"]
    assert recording.marks[0].start_s == recording.samples.fitted_s[0]


def test_in_a_text_of_many_trials_each_has_its_own_stretches(tmp_path):
    (anna, bo), _ = bring(tmp_path, MANY, TEXT)
    assert [mark.labels["state"] for mark in anna.marks] == ["stable", "slip", "stable"]
    assert [(mark.labels["state"], mark.end_s) for mark in bo.marks] == [("slip", 0.01)]
    np.testing.assert_array_equal(bo.samples.values, [[11, 12], [13, 14]])


@pytest.mark.parametrize(
    ("table", "text", "message"),
    [
        (ONE.replace("rows:state", "rows:"), TEXT, "rows:COLUMN"),
        (ONE.replace("label:state", "group:state"), TEXT, "label:NAME"),
        (MANY.replace("rows:state", "rows:grip"), TEXT, "grip"),
        (MANY.replace("rows:state", "from:state"), TEXT, "rows:state"),
    ],
)
def test_a_slip_in_the_table_is_told_in_a_line(tmp_path, table, text, message):
    with pytest.raises(BadTable, match=message):
        bring(tmp_path, table, text, "a[N]")
    assert not (tmp_path / "out").exists()


def test_a_column_without_any_label_is_refused(tmp_path):
    text = "ms,a,state\n0,1,\n10,2,\n"
    with pytest.raises(BadTable, match="a label in some row"):
        bring(tmp_path, ONE.replace("label:object,", "").replace("cup,", ""), text)


def test_arrays_and_intervals_beside_are_refused(tmp_path):
    np.savez(tmp_path / "a.npz", X=np.zeros((2, 5, 2)), y=[0, 1])
    array = "file,axes,label:state,channels,time\na.npz,{},rows:y,*[N],rate:50Hz\n"
    with pytest.raises(BadTable, match="a text for rows:COLUMN"):
        bring(tmp_path, array, TEXT, "trials rows channels")
    (tmp_path / "all.csv").write_text("a,state\n1,x\n2,x\n")
    (tmp_path / "table.csv").write_text(
        "file,label:state,channels,time\nall.csv,rows:state,a[N],rate:50Hz\n"
    )
    (tmp_path / "marks.csv").write_text("start_s,end_s,label:kind\n0,0.02,y\n")
    with pytest.raises(BadTable, match="rows or from intervals"):
        import_table(tmp_path / "table.csv", tmp_path / "out", intervals=tmp_path / "marks.csv")
    assert not (tmp_path / "out").exists()


def test_star_names_columns_that_are_rarely_a_sensors(tmp_path):
    """pandas' index and a label's column: channels, but said."""
    table = "file,label:state,channels,time\nall.csv,x,*[N],rate:100Hz\n"
    _, (facts,) = bring(tmp_path, table, ",a,label\n0,1,0\n1,2,1\n")
    assert len(facts.doubts) == 1
    assert "a column without a name, label" in facts.doubts[0]


def test_a_word_for_an_unknown_label_in_the_rows_is_named(tmp_path):
    """Rows of "nan", as numpy writes them, became a trial of that class without a word."""
    text = "\n".join(TEXT.replace("stable", "nan").splitlines()[:6])
    _, (facts,) = bring(tmp_path, ONE, text, "a[N] b[N]")
    assert "all.csv: label state: 'nan' (2 ×): taken as any other value" in facts.doubts[0]
