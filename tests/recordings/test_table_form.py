"""Claims about how a text of numbers may be written: each reading is the only possible one."""

import gzip
import re

import numpy as np
import pytest

from taxel.errors import BadTable
from taxel.recordings.imports.value_tables.tables import parse_columns, parse_time, read_table

WANTED = [[1.5, -2.0], [2.5, 300.0]]


def read(path, channels="a[V] b[V]", time="t[ms]", missing="refuse"):
    return read_table(path, parse_columns(channels, "here"), parse_time(time, "here"), missing)


@pytest.mark.parametrize("text", [
    "t a b\n10 1.5 -2\n20 2.5 3e2\n",
    "  t   a    b\n 10 1.5   -2\n 20 2.5  3e2 \n",  # aligned
    "# t a b\n10 1.5 -2\n20 2.5 3e2\n",  # numpy.savetxt(…, header="t a b")
    '"t" "a" "b"\n10 1.5 -2\n20 2.5 3e2\n',
    "# t,a,b\n10 1.5 -2\n20 2.5 3e2\n",  # names apart from values
    "# pad 7, 3 N\n#\n# t,a,b\n10,1.5,-2\n20,2.5,3e2\n",
    "# made by hand\nt;a;b\n10;1.5;-2\n20;2.5;3e2\n",
    "t;a;b\n10;1,5;-2\n20;2,5;3e2\n",
    "t\ta\tb\n10\t1,5\t-2,0\n20\t2,5\t3,0e2\n",
    "t a b\n10 1,5 -2,0\n20 2,5 300,0\n",
    "t;a;b\n10,0;1,5;-2,0\n20,0;2,5;300,0\n",
])  # fmt: skip
@pytest.mark.parametrize("ending", ["csv", "txt", "DAT", "tsv.gz"])
def test_a_text_is_read_as_it_is_written(tmp_path, text, ending):
    path = tmp_path / f"a.{ending}"
    path.write_bytes(gzip.compress(text.encode()) if ending.endswith("gz") else text.encode())
    table = read(path)

    np.testing.assert_array_equal(table.values, WANTED)
    np.testing.assert_allclose(table.time_s, [0.01, 0.02])
    assert table.decimal_comma == ("1,5" in text)


@pytest.mark.parametrize("text", [
    "10 1.5 -2\n20 2.5 300\n", "10;1,5;-2,0\n20;2,5;300,0\n",
    "# 10 Hz\n10\t1.5\t-2\n20\t2.5\t300\n", "# 1 2 3\n10 1.5 -2\n20 2.5 300\n",
])  # fmt: skip
def test_columns_without_names_go_by_number(tmp_path, text):
    """A remark of another length, or of numbers, names nothing."""
    (tmp_path / "a.txt").write_text(text)
    table = read(tmp_path / "a.txt", "2[V] 3[V]", "1[ms]")

    np.testing.assert_array_equal(table.values, WANTED)


STAMPS = ("2024-03-01T12:00:00.010", "2024-03-01T12:00:00.020")


@pytest.mark.parametrize(("rows", "channels", "time"), [
    ("{t0},1.5,-2\n{t1},2.5,300\n", "2[V] 3[V]", "1[iso]"),
    ("{t0};1,5;-2\n{t1};2,5;300\n", "2[V] 3[V]", "1[iso]"),
    ("{t0},1.5,-2\n{t1},2.5,300\n", "2[V] 3[V]", "rate:100Hz"),
    ("{t0},1.5,-2\n{t1},2.5,300\n", "*[V]", "1[iso]"),
    ("1.5,{t0},-2,2\n2.5,{t1},300,2\n", "1[V] 3[V]", "2[iso]"),
    ("12:00:00.010 1.5 -2\n12:00:00.020 2.5 300\n", "2[V] 3[V]", "1[iso]"),
    ("10,cup,1.5,-2\n20,cup,2.5,300\n", "3[V] 4[V]", "1[ms]"),
    ("cup,1.5,-2\negg,2.5,300\n", "2[V] 3[V]", "rate:100Hz"),
    ("# from {t0}\ncup;1,5;-2,0\negg;2,5;300,0\n", "2[V] 3[V]", "rate:100Hz"),
])  # fmt: skip
def test_a_first_row_with_words_is_a_scan_and_names_no_column(tmp_path, rows, channels, time):
    """No line of names holds a time stamp, or numbers where channels are asked for by number."""
    path = tmp_path / "a.csv"
    path.write_text(rows.format(t0=STAMPS[0], t1=STAMPS[1]))
    table = read(path, channels, time)

    np.testing.assert_array_equal(table.values, WANTED)
    np.testing.assert_allclose(np.diff(table.time_s), 0.01, rtol=1e-4)


def test_one_row_alone_with_a_time_stamp_is_a_scan(tmp_path):
    (tmp_path / "a.csv").write_text(f"{STAMPS[0]},1.5,-2\n")
    assert read(tmp_path / "a.csv", "2[V] 3[V]", "1[iso]").values.tolist() == [WANTED[0]]


@pytest.mark.parametrize(("text", "channels", "time"), [
    ("t,0.5,1.0\n10,1.5,-2\n20,2.5,300\n", "2[V] 3[V]", "1[ms]"),  # a word above numbers
    ("t,2,3\n10,1.5,-2\n20,2.5,300\n", "2[V] 3[V]", "t[ms]"),
    ("at,12:00,12:05\n10,1.5,-2\n20,2.5,300\n", "2[V] 3[V]", "1[ms]"),
    ("shape,0.5,1.0\ncup,1.5,-2\negg,2.5,300\n", "0.5[V] 1.0[V]", "rate:100Hz"),
    ("shape,2,3\ncup,1.5,-2\negg,2.5,300\n", "2[V] 3[V]", "rate:100Hz"),
    ("clock,a,b\n12:00:00.010,1.5,-2\n12:00:00.020,2.5,300\n", "2[V] 3[V]", "1[iso]"),
])  # fmt: skip
def test_a_line_of_names_may_hold_numbers(tmp_path, text, channels, time):
    (tmp_path / "a.csv").write_text(text)
    np.testing.assert_array_equal(read(tmp_path / "a.csv", channels, time).values, WANTED)


@pytest.mark.parametrize("text", ["0\n1 2.5 3\n4 5\n", "1 2\n3 4 5\n6 7\n"])
def test_lines_of_different_lengths_say_that_a_line_was_read_as_one_cell(tmp_path, text):
    (tmp_path / "a.txt").write_text(text)
    with pytest.raises(BadTable, match=(
        r"got '[0-9. ]+' in \S+, line 2, column '.*', where blanks separate no cells; write as "
        r"many numbers in each line, .*; for other texts, name a function .* in the column 'layout'"
    )):  # fmt: skip
        read(tmp_path / "a.txt", "*[V]", "rate:1Hz")


def test_names_that_count_columns_are_not_taken_for_a_row(tmp_path):
    (tmp_path / "a.csv").write_text("shape,0,1,2\ncup,1.5,-2,3\negg,2.5,300,3\n")
    with pytest.raises(BadTable, match=r"'3'.*if line 1 holds values, put names above"):
        read(tmp_path / "a.csv", "2[V] 3[V]", "rate:100Hz")


def test_a_row_below_a_remark_of_names_is_a_scan_though_it_counts(tmp_path):
    (tmp_path / "a.csv").write_text("#t,a,b\n1,2,3\n2,4,6\n")
    table = read(tmp_path / "a.csv")

    assert (table.values.tolist(), table.number_header) == ([[2, 3], [4, 6]], "")


def test_one_row_alone_may_be_blanks_or_decimal_commas(tmp_path):
    for text in ("10 1.5 -2\n", "10;1,5;-2\n"):
        (tmp_path / "a.txt").write_text(text)
        assert read(tmp_path / "a.txt", "2[V] 3[V]", "1[ms]").values.tolist() == [WANTED[0]]


def test_a_comma_separates_where_nothing_else_does(tmp_path):
    """Also behind blanks, and where a name holds a semicolon or blanks."""
    for text in ("10, 1.5, -2\n20, 2.5, 300\n", "t;s,left pad,b\n10,1.5,-2\n20,2.5,300\n"):
        (tmp_path / "a.csv").write_text(text)
        assert read(tmp_path / "a.csv", "2[V] 3[V]", "1[ms]").values.tolist() == WANTED
    (tmp_path / "a.csv").write_text("left pad\n1.5\n2.5\n")
    assert read(tmp_path / "a.csv", "left pad[V]", "rate:9Hz").values.tolist() == [[1.5], [2.5]]


@pytest.mark.parametrize(("text", "words"), [
    ("t;a;b\n10;1,5;2\n20;1.5;2\n", "one decimal sign.*points and commas"),
    ("t;a;b\n10;1,5;2\n20;1,2,5;2\n", r"'1,2,5' in .*, line 3, column 'a'"),
    ("t,a,b\n10,\"1,5\",2\n", r"'1,5' in .*, line 2, column 'a'.*decimal points"),
    ("# t a b\n# u v w\n10 1.5 -2\n", "column 'a'.*u, v, w"),
    ("# t a b\n", "none below the remarks"),
    ("# t a b\n\n# more\n", "none below the remarks"),
    ("t a b\n10 1.5 -2\n20 2.5\n", "line 3"),
    ("# x\nt a b\n10 1.5 oops\n", "'oops' in .*, line 3, column 'b'"),
    ("t a b\n10 1.5 -2\n# end\n", "line 3"),
])  # fmt: skip
def test_what_has_two_readings_or_none_is_refused_by_its_line(tmp_path, text, words):
    (tmp_path / "a.txt").write_text(text)
    with pytest.raises(BadTable) as caught:
        read(tmp_path / "a.txt")

    assert re.search(words, str(caught.value)), str(caught.value)
    assert "\n" not in str(caught.value)


def test_signs_must_agree_from_block_to_block(tmp_path, monkeypatch):
    """A long file is read in pieces; points a million rows below commas are refused, too."""
    monkeypatch.setattr("taxel.recordings.imports.value_tables.table_columns._BLOCK_CELLS", 6)
    rows = [f"{n};{n},5;1" for n in range(9)]
    (tmp_path / "a.csv").write_text("\n".join(["t;a;b", *rows]) + "\n")
    assert read(tmp_path / "a.csv").values[:, 0].tolist() == [n + 0.5 for n in range(9)]
    (tmp_path / "a.csv").write_text("\n".join(["t;a;b", *rows, "10;2.5;1"]) + "\n")
    with pytest.raises(BadTable, match="one decimal sign"):
        read(tmp_path / "a.csv")


@pytest.mark.parametrize("text", [
    "t,a,b\n10,1.5,-2,\n20,2.5,300,\n", "t;a;b\n10;1,5;-2;\n20;2,5;300; \n",
    "# ROS\nt\ta\tb\n10\t1.5\t-2\t\n20\t2.5\t300\t\n\n",
])  # fmt: skip
@pytest.mark.parametrize("channels", ["a[V] b[V]", "*[V]"])
def test_rows_may_end_in_a_separator_that_the_names_do_not_end_in(tmp_path, text, channels):
    """Nothing stands behind it in any row: every cell still stands below its own name."""
    (tmp_path / "a.csv").write_text(text)
    table = read(tmp_path / "a.csv", channels)

    np.testing.assert_array_equal(table.values, WANTED)
    assert (table.names, table.one_more) == (("a", "b"), True)


@pytest.mark.parametrize("text", [
    "t,a,b,\n10,1.5,-2,\n20,2.5,300,\n", "t;a;b;;\n10;1,5;-2;;\n20;2,5;300;;\n",
    "t,a,b,,\n10,1.5,-2\n20,2.5,300\n", "t,a,b\n10,1.5,-2\n20,2.5,300\n,,\n,,\n\n",
    "t;a;b;\nms;V;V;\n10;1,5;-2;\n20;2,5;300;\n;;;\n",
    "t\ta\tb\n10\t1.5\t-2\n20\t2.5\t300\n\t\t\n ",
    "t,a,b\r\r\n10,1.5,-2\r\r\n20,2.5,300\r\r\n",
])  # fmt: skip
@pytest.mark.parametrize("channels", ["a[V] b[V]", "*[V]"])
def test_what_spreadsheets_leave_empty_beside_and_below_a_table_is_no_part_of_it(
    tmp_path, text, channels
):
    """Cells that were only formatted; and the line ends of Python's csv on Windows."""
    (tmp_path / "a.csv").write_bytes(text.encode())
    table = read(tmp_path / "a.csv", channels)

    np.testing.assert_array_equal(table.values, WANTED)
    assert (table.names, table.one_more) == (("a", "b"), False)


def test_rows_of_empty_cells_above_the_last_one_are_kept_and_counted(tmp_path):
    """Nothing is left out within a trial, and messages name the right line."""
    (tmp_path / "a.csv").write_text("a,b\n1,2\n,\n,\n3,4\n,\n")
    table = read(tmp_path / "a.csv", "*[V]", "rate:9Hz", missing="keep")
    assert table.values[[0, 3]].tolist() == [[1, 2], [3, 4]]
    assert np.isnan(table.values[1:3]).all()
    assert len(table.values) == 4
    with pytest.raises(BadTable, match=r"got nan in .*, line 3"):
        read(tmp_path / "a.csv", "*[V]", "rate:9Hz")


@pytest.mark.parametrize(("text", "words"), [
    ("t,a,b,,\n10,1,2,,\n20,2,3,,4\n", "nothing behind the last.*line 2; got '4' in .*, line 3"),
    ("t,a,b,,\n10,1,2,,\n20,2,3,\n", "3 cells and 2 separators behind .*; got 4 in .*, line 3"),
    ("t,a,b\n10,1,2\n\n20,2,3\n", "3 cells in every line; got 0 in .*, line 3"),
    ("t,a,b\n10,1,2,\n20,2,3,4\n", "nothing behind the last.*line 2; got '4' in .*, line 3; name"),
    ("t,a,b\n10,1,2,\n20,2,3\n", "3 cells and a separator .*line 2; got 3 in .*, line 3; write"),
    ("t,a,b\n10,1,2,,\n", "3 cells in every line; got 5 in .*, line 2, where 3 are named; name "),
    ("t,a,b\n10,1,2\n20,2,3,\n", "3 cells in every line; got 4 in .*, line 3, where 3 are named"),
    ("t,a,b\n0,10,1,2\n1,20,2,3\n", "3 cells in every line; got 4 in .*line 2, where 3 are named"),
    ("10,1,2\n20,2,3,4\n", "3 cells in every line; got 4 in .*, line 2, where line 1 has 3; put"),
])  # fmt: skip
def test_more_cells_than_names_are_no_file_that_was_cut_short(tmp_path, text, words):
    """Which name each cell belongs to is then uncertain, as below names without an index."""
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(BadTable, match=words) as caught:
        read(tmp_path / "a.csv", "2[V] 3[V]", "1[ms]")
    assert "cut short" not in str(caught.value)


def test_fewer_cells_than_names_may_be_a_file_that_was_cut_short(tmp_path):
    (tmp_path / "a.csv").write_text("t,a,b\n10,1,2\n20,2\n")
    with pytest.raises(BadTable, match=r"3 cells in every line; got 2 .*line 3; .*cut short"):
        read(tmp_path / "a.csv")
