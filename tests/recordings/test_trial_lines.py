"""A text with a trial in each line: one scan, or several side by side."""

import numpy as np
import pytest
from stack_imports import bring as import_row

from taxel.errors import BadTable
from taxel.recordings.imports.importing import import_table
from taxel.recordings.reader import read_recording

HEADER = "file,axes,label:fruit,group:day,channels,time\n"
TEXT = """fruit,day,a1,b1,a2,b2,a3,b3
kiwi,mon,1,2,3,4,5,6
plum,mon,7,8,9,10,11,12
kiwi,tue,0,5,1,6,2,9
"""
ROW = "all.csv,trials rows:3 channels,from:fruit,from:day,*[N],rate:50Hz"


def bring(folder, row=ROW, text=TEXT):
    """Import the text by a row of the table."""
    (folder / "all.csv").write_text(text)
    (folder / "table.csv").write_text(HEADER + row + "\n")
    return import_table(folder / "table.csv", folder / "out")


def test_each_line_becomes_a_recording_of_its_scans(tmp_path) -> None:
    made = bring(tmp_path)

    assert [path.name for path in made] == ["all-1.mcap", "all-2.mcap", "all-3.mcap"]
    second = read_recording(made[1])
    np.testing.assert_array_equal(second.samples.values, [[7, 8], [9, 10], [11, 12]])
    np.testing.assert_allclose(second.samples.fitted_s, [0.0, 0.02, 0.04])
    assert second.manifest.labels == {"fruit": "plum"}
    assert second.manifest.groups["day"] == "mon"


def test_the_scans_of_a_channel_may_stand_side_by_side(tmp_path) -> None:
    made = bring(tmp_path, ROW.replace("rows:3 channels", "channels rows:3"))

    values = read_recording(made[0]).samples.values
    np.testing.assert_array_equal(values, [[1, 4], [2, 5], [3, 6]])


def test_without_a_number_of_rows_a_line_is_one_scan(tmp_path) -> None:
    made = bring(tmp_path, ROW.replace(" rows:3", "").replace("*[N]", "b1[N] a3[N]"))

    np.testing.assert_array_equal(read_recording(made[0]).samples.values, [[2, 5]])
    assert read_recording(made[0]).manifest.sensor.channels == ("b1", "a3")


@pytest.mark.parametrize(
    ("row", "message"),
    [
        (ROW.replace("rows:3", "rows:4"), "columns for 4 scans in each line of .*got 6 columns"),
        (ROW.replace("rows:3", "rows"), "axes of a text: 'trials channels' for one scan"),
        (ROW.replace("rows:3", "rows:0"), "axes of a text: 'trials channels' for one scan"),
        (ROW.replace("rate:50Hz", "a1[ms]"), "a rate, as in rate:100Hz"),
        (ROW.replace("from:fruit", "rows:fruit"), "from:COLUMN for a text with a trial in each"),
        (ROW.replace("from:fruit", "from:colour"), "'colour'"),
        (ROW.replace("*[N]", "a1[N] b1[V] a2[N] b2[V] a3[V] b3[V]"), "the same units in all scans"),
    ],
)
def test_what_is_no_such_text_is_refused_and_nothing_is_written(tmp_path, row, message) -> None:
    with pytest.raises(BadTable, match=message):
        bring(tmp_path, row)
    assert not (tmp_path / "out").exists()


def test_a_line_without_its_label_is_refused_by_its_number(tmp_path) -> None:
    with pytest.raises(BadTable, match=r"a value for each trial; got nothing in .*line 3"):
        bring(tmp_path, text=TEXT.replace("plum", ""))


def test_a_column_that_counts_the_lines_is_doubted(tmp_path) -> None:
    text = "\n".join(f"{n},{line}" for n, line in zip(["id", 1, 2, 3], TEXT.split(), strict=True))
    (tmp_path / "all.csv").write_text(text + "\n")
    notes: list[str] = []
    row = ROW.replace(" rows:3", "")
    import_row(tmp_path, row, header=HEADER, notes=notes)

    assert any(
        "the column id counts the lines, and * made a channel of it" in note for note in notes
    )


def test_a_label_that_is_named_by_its_number_is_no_channel(tmp_path) -> None:
    row = ROW.replace(" rows:3", "").replace("from:fruit", "from:1").replace("from:day", "mon")
    made = bring(tmp_path, row, "depth,a,b\n3,1.5,2\n4,2.5,2\n3,4.5,7\n")

    assert read_recording(made[1]).manifest.sensor.channels == ("a", "b")
    assert read_recording(made[1]).manifest.labels == {"fruit": "4"}


@pytest.mark.parametrize("channels", ["1[N] 2[N] 3[N] 4[N]", "*[N]"])
def test_scans_side_by_side_may_have_the_same_names(tmp_path, channels) -> None:
    row = f"all.csv,trials rows:2 channels,from:fruit,mon,{channels},rate:50Hz"
    made = bring(tmp_path, row, "a,b,a,b,fruit\n1,2,3,4,kiwi\n5,6,7,8,kiwi\n")

    np.testing.assert_array_equal(read_recording(made[1]).samples.values, [[5, 6], [7, 8]])
