"""Texts in which a scan is several lines: a line for each row of a grid."""

import numpy as np
import pytest

from taxel.cli.main import main
from taxel.errors import BadTable
from taxel.recordings.imports.scan_blocks import lines_in_scan, read_blocks
from taxel.recordings.imports.value_tables.tables import (
    TimeColumn,
    parse_columns,
    parse_time,
    read_table,
)
from taxel.recordings.reader import read_recording

RATE = TimeColumn(rate_hz=10.0)


def blocks(scans, rows, columns, between="", separator=" "):
    values = (5 + np.arange(scans * rows * columns)).reshape(scans, rows, columns)
    return between.join(
        "".join(separator.join(map(str, row)) + "\n" for row in scan.tolist()) for scan in values
    )


def read(path, channels, missing="refuse"):
    columns = parse_columns(channels, "here")
    return read_blocks(path, columns, RATE, missing, lines_in_scan(path, columns, RATE))


@pytest.mark.parametrize("between", ["", "\n", "\n\n"])
@pytest.mark.parametrize("separator", [" ", ",", ";", "\t"])
def test_as_many_lines_as_a_grid_has_rows_are_one_scan(tmp_path, between, separator):
    path = tmp_path / "cup.txt"
    path.write_text(blocks(3, 4, 4, between, separator))

    table = read(path, "pad:4x4[count]")

    np.testing.assert_array_equal(table.values, 5 + np.arange(48).reshape(3, 16))
    np.testing.assert_allclose(table.time_s, [0, 0.1, 0.2])
    assert table.names[:5] == ("pad_r1c1", "pad_r1c2", "pad_r1c3", "pad_r1c4", "pad_r2c1")


def test_several_grids_of_one_width_stand_below_one_another(tmp_path):
    path = tmp_path / "cup.txt"
    path.write_text("# made by a logger\n" + blocks(2, 5, 3))

    table = read(path, "a:2x3[N] b:3x3[N]")

    np.testing.assert_array_equal(table.values, 5 + np.arange(30).reshape(2, 15))
    assert table.names[5:7] == ("a_r2c3", "b_r1c1")


@pytest.mark.parametrize(
    ("text", "channels", "time"),
    [
        (blocks(2, 4, 4), "*[N]", "rate:1Hz"),
        (blocks(2, 4, 4), "1[N] 2[N] 3[N] 4[N]", "rate:1Hz"),
        (blocks(2, 4, 4), "pad:1x4[N]", "rate:1Hz"),
        (blocks(2, 4, 4), "pad:4x4[N] more[N]", "rate:1Hz"),
        (blocks(2, 4, 4), "a:2x4[N] b:2x2[N]", "rate:1Hz"),
        (blocks(2, 4, 4), "pad:4x3[N]", "1[ms]"),
        (blocks(2, 4, 16), "pad:4x4[N]", "rate:1Hz"),
        ("a,b,c,d\n" + blocks(2, 4, 4, separator=","), "pad:4x4[N]", "rate:1Hz"),
    ],
)
def test_other_texts_have_a_scan_in_each_line(tmp_path, text, channels, time):
    path = tmp_path / "cup.txt"
    path.write_text(text)
    assert lines_in_scan(path, parse_columns(channels, "x"), parse_time(time, "x")) == 0


def test_a_first_line_that_counts_columns_names_nothing(tmp_path):
    """As pandas writes one above an array."""
    path = tmp_path / "cup.csv"
    path.write_text("0,1\n" + blocks(2, 2, 2, separator=","))
    np.testing.assert_array_equal(read(path, "p:2x2[N]").values, 5 + np.arange(8).reshape(2, 4))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (blocks(2, 4, 4) + "1 2 3 4\n", r"needed 4 lines for each scan of pad:4x4; got the end of "
         r"\S+ after 1 of them; mend the file, or correct rows and columns in 'channels'"),
        ("6 7 8 9\n" * 3 + "\n" + blocks(2, 4, 4), r"got a blank line 4 within \S+ after 3 of"),
        (blocks(1, 4, 4) + "1 2 3\n", r"needed 4 cells in every line, as in line 1; got 3 in \S+, "
         "line 5"),
        (blocks(1, 4, 4) + "\n1 2 x 4\n", r"needed a number; got 'x' in \S+, line 6, cell 3"),
        (blocks(1, 4, 4) + "\n1 2 nan 4\n" + blocks(1, 3, 4), r"got nan in \S+, line 6, cell 3"),
    ],
)  # fmt: skip
def test_what_is_no_whole_scan_is_refused_with_its_line(tmp_path, text, words):
    path = tmp_path / "cup.txt"
    path.write_text(text)
    with pytest.raises(BadTable, match=words):
        read(path, "pad:4x4[N]")


def test_missing_values_may_be_kept(tmp_path):
    path = tmp_path / "cup.txt"
    path.write_text("1 nan\n3 4\n")
    np.testing.assert_array_equal(read(path, "p:2x2[N]", "keep").values, [[1, np.nan, 3, 4]])


def test_such_a_text_of_which_all_columns_are_asked_for_says_how_to_name_its_grid(tmp_path):
    path = tmp_path / "cup.txt"
    path.write_text(blocks(3, 4, 4, "\n"))
    with pytest.raises(BadTable, match=r"scans of several lines, write the grid in 'channels', as"):
        read_table(path, parse_columns("*[N]", "here"), RATE)


def test_import_reads_such_a_text_and_says_so_once(tmp_path, capsys):
    for name in ("cup", "box"):
        (tmp_path / f"{name}.txt").write_text(blocks(5, 4, 4, "\n"))
    (tmp_path / "table.csv").write_text(
        "file,channels,time\n{label:object}.txt,pad:4x4[count],rate:50Hz\n"
    )

    main(["import", str(tmp_path / "table.csv"), "--output", str(tmp_path / "out")])

    note = "note: each 4 lines of 4 numbers were read as one scan of pad:4x4\n"
    assert capsys.readouterr().err.count(note) == 1
    samples = read_recording(tmp_path / "out/cup.mcap").samples
    assert samples.values.shape == (5, 16)
    assert samples.values[1, 0] == 21
