"""Claims about reading tables: right values from right files, one plain line for wrong ones."""

import gzip

import numpy as np
import pytest

from taxel.errors import BadTable
from taxel.recordings.imports.value_tables.tables import (
    Column,
    TimeColumn,
    parse_columns,
    parse_time,
    read_table,
)

VOLTS = (Column(name="a", unit="V"), Column(name="b", unit="V"))
MILLISECONDS = TimeColumn(column=Column(name="t", unit="ms"))
GOOD = "t,a,b,spare\n10,1.5,-2,x\n20,2.5,3e2,\n35,3.5,0,y\n"


def refusal(path, **kwargs) -> str:
    """Read a file that must be refused; return the one line."""
    with pytest.raises(BadTable) as caught:
        read_table(path, VOLTS, MILLISECONDS, **kwargs)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize("packed", [False, True])
def test_a_csv_gives_the_wanted_columns(tmp_path, separator, packed):
    """Plain or gzipped, whatever the separator, text in other columns is no matter."""
    path = tmp_path / ("a.csv.gz" if packed else "a.csv")
    content = ("\ufeff" + GOOD.replace(",", separator)).encode()
    path.write_bytes(gzip.compress(content) if packed else content)
    table = read_table(path, VOLTS, MILLISECONDS)
    np.testing.assert_array_equal(table.values, [[1.5, -2], [2.5, 300], [3.5, 0]])
    np.testing.assert_allclose(table.time_s, [0.010, 0.020, 0.035], rtol=1e-12)
    assert (table.names, table.units) == (("a", "b"), ("V", "V"))


def test_columns_go_by_number_where_there_is_no_header(tmp_path):
    """Numbers count from 1; a header's names win over numbers."""
    (tmp_path / "a.csv").write_text("10,1,2\n20,3,4\n")
    columns = parse_columns("3[V] 2[V]", "here")
    table = read_table(tmp_path / "a.csv", columns, parse_time("1[ms]", "here"))
    np.testing.assert_array_equal(table.values, [[2, 1], [4, 3]])


@pytest.mark.parametrize("time", ["t[ms]", "1[ms]"])
def test_a_time_column_is_no_channel_though_the_table_names_it_by_number(tmp_path, time):
    """`*` took it for one: the course of time would give labels away."""
    (tmp_path / "a.csv").write_text("t,a,b\n10,1,2\n20,3,4\n")
    table = read_table(tmp_path / "a.csv", parse_columns("*[V]", "here"), parse_time(time, "here"))
    assert table.names == ("a", "b")
    np.testing.assert_allclose(table.time_s, [0.010, 0.020], rtol=1e-12)


@pytest.mark.parametrize("top", ["0,1,2", "1,2,3", ",0,1,2", '"0","1","2"', " 0 , 1 , 2 "])
def test_a_header_that_counts_the_columns_is_no_scan(tmp_path, top):
    """pandas writes 0,1,2 where columns have no names; its index comes first, without a name."""
    index = "9," if top.startswith(",") else ""
    path = tmp_path / "a.csv"
    path.write_text(f"{top}\n{index}0.5,6,7\n{index}0.7,8,9\n")
    columns = parse_columns("2[N] 1[N]", "here")
    table = read_table(path, columns, TimeColumn(rate_hz=100.0))
    assert table.values.shape == (2, 2)
    assert table.values[0].tolist() == ([6, 0.5] if top == "1,2,3" else [7, 6])
    assert table.number_header == ("1, 2, 3" if top == "1,2,3" else "0, 1, 2")


@pytest.mark.parametrize(
    "text", ["0,1,2\n0,1,2\n5,5,5\n", "0,2,4\n1,3,5\n", "10,1,2\n20,3,4\n", "0.0,1.0\n2,3\n"]
)
def test_a_first_row_of_other_numbers_is_a_scan(tmp_path, text):
    """Also one that counts, where the row below it counts as well: names stand in one line."""
    (tmp_path / "a.csv").write_text(text)
    table = read_table(tmp_path / "a.csv", parse_columns("2[N]", "here"), TimeColumn(rate_hz=1.0))
    assert len(table.values) == text.count("\n")
    assert table.number_header == ""


@pytest.mark.parametrize("top", ["t,0,1,2", "0,1,2,3"])
def test_a_number_in_a_header_is_a_name_and_counts_no_columns(tmp_path, top):
    """Else 3 of t,0,1,2 would be the third column unseen, and 2 the fourth."""
    (tmp_path / "a.csv").write_text(f"{top}\n0.5,6,7,8\n")
    columns = parse_columns("1[N] 4[N]", "here")
    with pytest.raises(BadTable, match=r"column '4'.*header with .*, 1, 2.*as it stands there"):
        read_table(tmp_path / "a.csv", columns, TimeColumn(rate_hz=100.0))


def test_a_rate_stands_in_for_a_time_column(tmp_path):
    """Row n is taken at n divided by the rate."""
    (tmp_path / "a.csv").write_text(GOOD)
    table = read_table(tmp_path / "a.csv", VOLTS, parse_time("rate:100Hz", "here"))
    np.testing.assert_allclose(table.time_s, [0.0, 0.01, 0.02])


def test_a_name_for_a_column_of_npy_is_answered_with_the_numbers_there_are(tmp_path):
    """It has none: the message gives the range and how to write them."""
    np.save(tmp_path / "a.npy", np.array([[1, 2, 3], [4, 5, 6]], np.int16))
    for word in ("left[N]", "0[N]", "4[N]"):
        with pytest.raises(BadTable, match=r"columns by their numbers, 1 to 3: .* 1\[N\] 2\[N\]"):
            read_table(tmp_path / "a.npy", parse_columns(word, "x"), TimeColumn(rate_hz=100.0))


def test_npy_goes_by_number(tmp_path):
    """A 2-D array of any real type is a table without a header."""
    np.save(tmp_path / "a.npy", np.array([[1, 2, 3], [4, 5, 6]], np.int16))
    columns = parse_columns("2[V] 3[V]", "here")
    table = read_table(tmp_path / "a.npy", columns, parse_time("1[s]", "here"))
    np.testing.assert_array_equal(table.values, [[2, 3], [5, 6]])
    np.testing.assert_array_equal(table.time_s, [1, 4])


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("", "empty file"),
        ("t,a,b\n", "rows of numbers"),
        ("t,a,b\n1,2,3\n2,3\n", "line 3"),
        ("t,a,b\n1,2,3\n2,3,4,5\n", "line 3"),
        ("t,a,b\n1,2,3\n2,oops,4\n", "'oops' in .*, line 3, column 'a'"),
        ("t,a,b\n1,2,3\n2,1_000,4\n", "'1_000' in .*, line 3, column 'a'"),
        ("t,a,b\n1,2,3\n2,nan,4\n", "line 3, column 'a'.*--missing keep"),
        ("t,a,b\n1,2,3\n2,4,inf\n", "line 3, column 'b'.*--missing keep"),
        ("t,a,b\n1,2,3\n2,,4\n", "line 3, column 'a'.*--missing keep"),
        ("t,a,b\n1,2,3\n1,3,4\n", "increase.*line 3"),
        ("t,a,b\n2,2,3\n1,3,4\n", "increase.*line 3"),
        ("t,a,b\n1,2,3\n,3,4\n", "a time in every row.*line 3"),
        ("t,a,c\n1,2,3\n", "column 'b'.*t, a, c"),
        ("t,a,b,a\n1,2,3,4\n", "2 columns of that name"),
    ],
)
def test_a_wrong_csv_is_refused_by_file_line_and_column(tmp_path, content, words):
    """The message says where; nothing is guessed."""
    import re

    (tmp_path / "wrong.csv").write_text(content)
    line = refusal(tmp_path / "wrong.csv")
    assert re.search(words, line), line
    assert "wrong.csv" in line


def test_cells_without_a_value_can_be_kept(tmp_path):
    """With missing="keep" they come as NaN, however they are written; other text is refused."""
    words = ["", "nan", "NA", "n/a", "#N/A", "<NA>", "NULL", "None", " ", "OL", "ovld", "Overload"]
    lines = [f"{row},{word},4" for row, word in enumerate(words)]
    (tmp_path / "a.csv").write_text("\n".join(["t,a,b", *lines, ""]))
    table = read_table(tmp_path / "a.csv", VOLTS, MILLISECONDS, "keep")
    assert np.isnan(table.values[:, 0]).all()
    assert (table.values[:, 1] == 4).all()
    (tmp_path / "a.csv").write_text("t,a,b\n1,off,3\n")
    assert "'off'" in refusal(tmp_path / "a.csv", missing="keep")


def test_a_word_for_no_value_is_refused_with_the_option_that_keeps_it(tmp_path):
    (tmp_path / "a.csv").write_text("t,a,b\n1,2,3\n2,NA,4\n")
    line = refusal(tmp_path / "a.csv")
    assert "line 3, column 'a'" in line
    assert "--missing keep" in line


def test_a_gzip_that_was_cut_is_refused(tmp_path):
    """Not a row of a half file is used, wherever the cut is."""
    content = gzip.compress(GOOD.encode())
    for cut in (0, 5, len(content) // 2, len(content) - 3):
        (tmp_path / "a.csv.gz").write_bytes(content[:cut])
        refusal(tmp_path / "a.csv.gz")
    (tmp_path / "a.csv.gz").write_bytes(b"not gzip at all")
    assert "gzip" in refusal(tmp_path / "a.csv.gz")


def test_other_files_are_refused(tmp_path):
    """Unknown endings, missing files, odd encodings and odd arrays."""
    (tmp_path / "a.xls").write_text("")
    assert "save it as one of them, or name a function" in refusal(tmp_path / "a.xls")
    assert "check the path" in refusal(tmp_path / "gone.csv")
    (tmp_path / "a.csv").write_bytes("t,a,b\n1,2,µ\n".encode("latin-1"))
    assert "UTF-8" in refusal(tmp_path / "a.csv")
    for name, array in (
        ("one", np.zeros((2, 2, 2))),
        ("text", np.array([["x"]])),
        ("z", np.array([[1j]])),
    ):
        np.save(tmp_path / f"{name}.npy", array)
        assert "(rows, columns)" in refusal(tmp_path / f"{name}.npy")
    np.save(tmp_path / "object.npy", np.array([[{}]], dtype=object), allow_pickle=True)
    assert "numbers" in refusal(tmp_path / "object.npy")
    (tmp_path / "cut.npy").write_bytes((tmp_path / "one.npy").read_bytes()[:20])
    assert "numbers" in refusal(tmp_path / "cut.npy")


def test_column_texts_allow_spaces_in_names():
    """Names may hold blanks; units stand in brackets."""
    assert parse_columns("Data 0[count] b[deg]", "here") == (
        Column(name="Data 0", unit="count"),
        Column(name="b", unit="deg"),
    )


def test_a_grid_stands_for_its_channels_row_by_row(tmp_path):
    """Each has a name; beside it others may stand."""
    found = parse_columns("thumb:2x3[N] palm[V]", "here")
    names = [f"thumb_r{row}c{column}" for row in (1, 2) for column in (1, 2, 3)]

    assert [(own.name, own.unit) for own in found] == [*((n, "N") for n in names), ("palm", "V")]
    with pytest.raises(BadTable, match="at most 16,384 channels"):
        parse_columns("skin:200x200[N]", "here")
    with pytest.raises(BadTable, match="a grid of at least one row and column"):
        parse_columns("skin:0x5[N] a[N]", "here")


@pytest.mark.parametrize(
    "header", ["t,a,b,c,d,e,f\n", "t,s_r1c1,s_r1c2,s_r1c3,s_r2c1,s_r2c2,s_r2c3\n"]
)
def test_a_grid_names_the_columns_of_a_file_in_order(tmp_path, header):
    """All but that of time, whatever they are called; where they are called so, by name."""
    path, time = tmp_path / "a.csv", parse_time("t[ms]", "here")
    path.write_text(f"{header}10,1,2,3,4,5,6\n20,2,3,4,5,6,7\n")

    table = read_table(path, parse_columns("s:2x3[N]", "here"), time)

    assert table.names == tuple(f"s_r{row}c{column}" for row in (1, 2) for column in (1, 2, 3))
    np.testing.assert_array_equal(table.values[0], range(1, 7))
    with pytest.raises(BadTable, match=r"as q:2x2 have places, 4, .* got 6, .*, beside t;"):
        read_table(path, parse_columns("q:2x2[N]", "here"), time)


def test_a_grid_that_does_not_fit_names_the_columns_that_were_counted(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("t,a,b,c,d,label,x\n10,1,2,3,4,5,6\n20,2,3,4,5,6,7\n")
    grid = parse_columns("s:2x2[N]", "here")

    with pytest.raises(
        BadTable, match=r"got 6, a, b, c, d, label, x, beside t; correct .* remove columns that"
    ):
        read_table(path, grid, parse_time("t[ms]", "here"))
    with pytest.raises(BadTable, match=r"got 6, t, a, b, c, d, x, beside label;"):
        read_table(path, grid, TimeColumn(rate_hz=1.0), but=["label"])
    with pytest.raises(BadTable, match=r"got 7, t, a, b, c, d, label, x; .* no line names them"):
        read_table(path, grid, TimeColumn(rate_hz=1.0))


@pytest.mark.parametrize(
    "header",
    [
        "r1c1,r2c1,r1c2,r2c2", "s_r1c1,a,b,c", "s:2x2,a,b,c", "q_r1c2,q_r1c1,q_r2c1,q_r2c2",
        "r1c1_x,r2c1_x,r1c2_x,r2c2_x", "r1c1_x,r1c1_y,r1c2_x,r1c2_y",
        "skinr1c1,skinr2c1,skinr1c2,skinr2c2",
    ],
)  # fmt: skip
def test_a_grid_refuses_columns_that_lie_otherwise(tmp_path, header):
    """By columns, or named so in part: they would get wrong places without a word."""
    (tmp_path / "a.csv").write_text(f"{header}\n1,2,3,4\n2,3,4,5\n")

    with pytest.raises(BadTable, match=r"row by row|as s:2x2 have places"):
        read_table(tmp_path / "a.csv", parse_columns("s:2x2[N]", "x"), TimeColumn(rate_hz=1.0))


@pytest.mark.parametrize("text", ["", "a", "a[V] a[V]", "a[]", "a[V] b", "[V]"])
def test_wrong_column_texts_are_refused(text):
    """A channel without a unit, or twice, is an error."""
    with pytest.raises(BadTable):
        parse_columns(text, "here")


@pytest.mark.parametrize("text", ["", "t", "t[hours]", "rate:0Hz", "rate:1.2.3Hz", "rate:fastHz"])
def test_wrong_time_texts_are_refused(text):
    """Time needs a known unit or a rate above 0."""
    with pytest.raises(BadTable):
        parse_time(text, "here")


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (GOOD.replace("spare", "caf\u00e9").encode("latin-1"), "Latin-1.*line 1 .byte 0xe9"),
        (GOOD.encode("utf-16-le"), "UTF-16 without its mark"),
        (GOOD.encode("utf-16") + b"\0", "broken UTF-16"),
    ],
)
def test_an_encoding_that_is_not_certain_is_named(tmp_path, content, words):
    (tmp_path / "a.csv").write_bytes(content)
    with pytest.raises(BadTable, match=words):
        read_table(tmp_path / "a.csv", VOLTS, MILLISECONDS)


def test_utf_16_with_its_mark_is_read(tmp_path):
    (tmp_path / "a.csv").write_bytes(GOOD.encode("utf-16"))
    assert len(read_table(tmp_path / "a.csv", VOLTS, MILLISECONDS).values) == 3


def test_a_decimal_comma_is_called_one(tmp_path):
    (tmp_path / "a.csv").write_text('t,a,b\n10,"1,5",2\n')
    assert "decimal points, not commas" in refusal(tmp_path / "a.csv")


@pytest.mark.parametrize(("header", "words"), [
    ("t,a,b,a", "2 columns of that name in {}, columns 2, 4 (a header with t, a, b, a); write the "
                "number of the one that is meant, such as 2, or rename all but one of them in the"),
    ("t,a,3,a", "2 columns of that name in {}, columns 2, 4 (a header with t, a, 3, a); rename "),
    ("t,b" + 8 * ",a", "8 columns of that name in {}, columns 3, 4, 5, 6, 7, 8 … (a header"),
])  # fmt: skip
def test_columns_of_one_name_are_counted_up(tmp_path, header, words):
    """Where a name is a whole number, no column goes by its number."""
    path = tmp_path / "a.csv"
    path.write_text(f"{header}\n{','.join('1' * len(header.split(',')))}\n")
    assert words.format(path) in refusal(path)


def test_one_of_several_columns_of_a_name_is_taken_by_its_number(tmp_path):
    (tmp_path / "a.csv").write_text("t,a,b,a\n1,2,3,4\n")
    table = read_table(tmp_path / "a.csv", parse_columns("4[V] b[V]", "here"), MILLISECONDS)
    assert table.values.tolist() == [[4, 3]]


@pytest.mark.parametrize(("times", "words"), [
    ("0 10 20 0 10 20 1 11", "0 s after 0.02 s in {}, line 5: time goes back 2 times, each time to "
     "about where it began; a restart usually begins a new trial: write restarts in the column"),
    ("5 10 20 1 10", "0.001 s after 0.02 s in {}, line 5: time goes back once, to about where it"),
    ("0 10 8 20 30 0 10", "0 s after 0.03 s in {}, line 7: time goes back 2 times, 1 of them to "),
    ("0 10 20 15 30", "0.015 s after 0.02 s in {}, line 5: time goes back once; sort the rows"),
    ("30 20 10", "0.02 s after 0.03 s in {}, line 3: time goes back 2 times; sort the rows, or gi"),
    ("0 10 10 20 20", "0.01 s after 0.01 s in {}, line 4: 2 of 5 rows have the time of the row "
     "above; give a rate instead of a time column, for the clock is too coarse"),
])  # fmt: skip
def test_times_that_go_back_are_said_with_how_often(tmp_path, times, words):
    """Only rows in a wrong order are mended by sorting: that would mix trials with one another."""
    path = tmp_path / "a.csv"
    path.write_text("t,a,b\n" + "".join(f"{time},1,2\n" for time in times.split()))
    message = refusal(path)
    assert f"times that increase from row to row; got {words.format(path)}" in message
    assert ("sort" in message) == (
        "about where it began" not in message and "row above" not in message
    )


def test_times_of_day_that_pass_midnight_ask_for_dates(tmp_path):
    """Sorting them would put what came after midnight first."""
    path = tmp_path / "a.csv"
    path.write_text("t,a,b\n23:59:59.990,1,2\n00:00:00.000,1,2\n00:00:00.010,1,2\n")
    with pytest.raises(BadTable, match=r"0 s after .*line 3; if .*midnight .*write the dates too"):
        read_table(path, parse_columns("a[V]", "here"), parse_time("t[iso]", "here"))


@pytest.mark.parametrize(("start", "bits", "unit", "period"), [
    (4294967275, 32, "us", "4294.967296"), (65515, 16, "ms", "65.536"),
    (4294967275, 32, "ms", "4294967.296"),
])  # fmt: skip
def test_a_counter_that_overflows_begins_no_new_trial(tmp_path, start, bits, unit, period):
    """As of an Arduino after 71 minutes: cut there, one trial would become two."""
    rows = "".join(f"{(start + 10 * n) % 2**bits},1\n" for n in range(6))
    (tmp_path / "a.csv").write_text(f"t,a\n{rows}")
    with pytest.raises(
        BadTable, match=rf"line 5; if .*counter of {period}.* add {period}"
    ) as error:
        read_table(tmp_path / "a.csv", parse_columns("a[N]", "here"), parse_time(f"t[{unit}]", "-"))
    assert "new trial" not in str(error.value)


def test_a_table_with_a_row_for_each_channel_is_not_thinned_out(tmp_path):
    """To leave out rows of the same time would leave out all channels but the first."""
    (tmp_path / "a.csv").write_text("t,a,b\n0,1,2\n0,2,2\n10,1,2\n10,2,2\n20,1,2\n20,2,2\n")
    message = refusal(tmp_path / "a.csv")
    assert "3 of 6 rows have the time of the row above; give a rate" in message
    assert "if each row holds one channel, write the channels side by side" in message


def test_times_of_an_array_that_begin_anew_are_not_cut_by_the_table(tmp_path):
    np.save(tmp_path / "a.npy", [[0, 1], [9, 1], [0, 1]])
    with pytest.raises(BadTable, match=r"once, to about .*save each trial as an array or file of"):
        read_table(tmp_path / "a.npy", parse_columns("2[V]", "here"), parse_time("1[s]", "here"))


def test_a_row_of_numbers_and_a_label_is_no_header_where_all_columns_are_taken(tmp_path):
    """Only the label is asked for by its number; the first trial was lost to its names."""
    path = tmp_path / "uci.csv"
    path.write_text("0.12,-0.13,0.64,cup\n0.22,0.31,-0.18,mug\n0.05,0.11,0.42,cup\n")

    table = read_table(path, parse_columns("*[N]", "here"), TimeColumn(rate_hz=1.0), but={"4"})

    assert table.names == ("1", "2", "3")
    assert len(table.values) == 3


def test_of_columns_that_share_a_name_none_is_left_out_because_another_is_the_time(tmp_path):
    (tmp_path / "a.csv").write_text("x,x,y\n10,1,2\n20,3,4\n")
    with pytest.raises(BadTable, match="2 columns of that name"):
        read_table(tmp_path / "a.csv", parse_columns("*[V]", "here"), parse_time("1[ms]", "here"))
