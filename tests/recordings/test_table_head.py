"""Claims about files as instruments write them: heads, lines of units and stamps are read."""

import numpy as np
import pytest

from taxel.errors import BadTable
from taxel.recordings.imports.importing import import_table
from taxel.recordings.imports.value_tables.tables import parse_columns, parse_time, read_table
from taxel.recordings.reader import read_recording

WANTED = [[1.5, -2.0], [2.5, 300.0]]
ROWS = "10,1.5,-2\n20,2.5,3e2\n"


def read(path, channels="a[V] b[V]", time="t[ms]"):
    return read_table(path, parse_columns(channels, "here"), parse_time(time, "here"))


@pytest.mark.parametrize(("head", "note"), [
    ("t,a,b\nms,V,V\n", "line 2, which holds units (ms, V, V)"),
    ("t,a,b\n[ms],[V],\n", "line 2, which holds units ([ms], [V], )"),
    ("sep=,\nt,a,b\n", "line 1 above the names"),
    ("Device;X 7\n\nDate,2024-03-01\nt,a,b\n", "lines 1 to 3 above the names"),
    ('He said "x\nt,a,b\nms,V,V\n',
     "line 1 above the names and line 3, which holds units (ms, V, V)"),
])  # fmt: skip
@pytest.mark.parametrize("channels", ["a[V] b[V]", "*[V]"])
def test_lines_around_the_names_are_passed_over_and_said(tmp_path, head, note, channels):
    """A head of an instrument above, units below: the same values as without them."""
    (tmp_path / "a.csv").write_text(head + ROWS)
    table = read(tmp_path / "a.csv", channels)

    np.testing.assert_array_equal(table.values, WANTED)
    np.testing.assert_allclose(table.time_s, [0.01, 0.02])
    assert table.passed_over == note


@pytest.mark.parametrize("text", [
    "t,a,b\nn/a,n/a,n/a\n10,1.5,-2\n",  # a row of missing values is no line of units
    "t,a,b\n10,V,V\n20,1.5,-2\n",  # nor is a line with a number
    "t,a,b\nms,V,V\nms,V,V\n10,1,2\n",  # there is one line of units at most
    "t,a,b\nms,V,V\n",
    "Device\nt,a\n10,1.5\n",  # no line names all columns
])  # fmt: skip
def test_anything_else_that_is_no_number_is_refused(tmp_path, text):
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(BadTable):
        read(tmp_path / "a.csv")


def test_a_message_counts_the_lines_that_were_passed_over(tmp_path):
    (tmp_path / "a.csv").write_text("Device\nx\nt,a,b\nms,V,V\n10,1,2\n20,bad,2\n")
    with pytest.raises(BadTable, match=r"'bad' in .*a\.csv, line 6, column 'a'"):
        read(tmp_path / "a.csv")


@pytest.mark.parametrize(("first", "second"), [
    ("2024-03-01T12:00:00.250", "2024-03-01T12:00:00.260"),
    ("2024-03-01 23:59:59.995", "2024-03-02 00:00:00.005"),
    ("2024-03-01T12:00:00.250Z", "2024-03-01T13:00:00.260+01:00"),
    ("12:00:00.250", "12:00:00.260"),
    ("2024/03/01/12:00:00.250000", "2024/03/01/12:00:00.260000"),
    ("2024/03/01 12:00:00.25", "2024/03/01 12:00:00.26"),
    ("2024-03-01T12:00:00.250000000", "2024-03-01T12:00:00.260000000"),
])  # fmt: skip
def test_time_stamps_are_read_as_they_stand(tmp_path, first, second):
    (tmp_path / "a.csv").write_text(f"t,a,b\n{first},1.5,-2\n{second},2.5,300\n")
    table = read(tmp_path / "a.csv", time="t[iso]")

    np.testing.assert_array_equal(table.values, WANTED)
    assert table.time_s[1] - table.time_s[0] == pytest.approx(0.01, abs=1e-6)


def test_a_stamp_read_as_a_number_is_refused_with_what_to_write(tmp_path):
    (tmp_path / "a.csv").write_text("t,a,b\n2024-03-01T12:00:00,1,2\n")
    with pytest.raises(BadTable, match=r"write NAME\[iso\] in the column 'time'"):
        read(tmp_path / "a.csv")


@pytest.mark.parametrize("cell", [
    "03/04/2024 12:00", "2024/03/01", "24/03/01 12:00:00", "20240301", "", "12:61:00", "17.5",
])  # fmt: skip
def test_a_stamp_that_is_not_certain_is_refused(tmp_path, cell):
    (tmp_path / "a.csv").write_text(f"t,a,b\n{cell},1,2\n")
    with pytest.raises(BadTable, match=r"needed a time stamp such as .* line 2, column 't'"):
        read(tmp_path / "a.csv", time="t[iso]")


@pytest.mark.parametrize("trials", ["trial", "restarts"])
def test_a_long_text_of_an_instrument_is_cut_into_its_trials(tmp_path, trials):
    """Head, units and stamps together, as for a file of one trial."""
    rows = [f"{run},12:00:00.{10 * row:03d},{run + row}\n" for run in (1, 2) for row in range(4)]
    (tmp_path / "long.csv").write_text("Device 7\ntrial,clock,a\n,hh:mm,N\n" + "".join(rows))
    (tmp_path / "table.csv").write_text(
        f"file,trials,group:run,channels,time\nlong.csv,{trials},from:trial,a[N],clock[iso]\n"
    )
    made = import_table(tmp_path / "table.csv", tmp_path / "out")
    read = [read_recording(path) for path in made]

    assert [own.samples.values[:, 0].tolist() for own in read] == [[1, 2, 3, 4], [2, 3, 4, 5]]
    np.testing.assert_allclose(np.diff(read[1].samples.fitted_s), 0.01, atol=1e-6)


@pytest.mark.parametrize("channels", ["1[N]", "*[N]"])
def test_an_array_of_one_axis_is_one_channel(tmp_path, channels):
    np.save(tmp_path / "a.npy", np.arange(5.0))
    table = read(tmp_path / "a.npy", channels, "rate:100Hz")

    assert table.values[:, 0].tolist() == [0, 1, 2, 3, 4]


def test_an_array_has_no_time_stamps(tmp_path):
    np.save(tmp_path / "a.npy", np.ones((5, 3)))
    np.save(tmp_path / "stack.npy", np.ones((4, 5, 3)))
    (tmp_path / "table.csv").write_text("file,channels,time\nstack.npy,*[N],from:t[iso]\n")
    with pytest.raises(BadTable, match="needed times as numbers in an array"):
        read(tmp_path / "a.npy", "1[N]", "3[iso]")
    with pytest.raises(BadTable, match="needed times as numbers in an array"):
        import_table(tmp_path / "table.csv", tmp_path / "out")


def test_a_first_row_of_overloads_is_no_line_of_units(tmp_path):
    (tmp_path / "a.csv").write_text("a,b\nOL,ovld\n1.5,-2\n2.5,3\n")
    columns, time = parse_columns("a[V] b[V]", "here"), parse_time("rate:10Hz", "here")
    assert len(read_table(tmp_path / "a.csv", columns, time, "keep").values) == 3


@pytest.mark.parametrize(("head", "mend"), [
    ("t,a [V],b [V]", "write its number, 2, since its name holds blanks or brackets"),
    ("t,a(V),b(V)", "write its number, 2, since"),
    ("t,a left,a right", "correct it"),
])  # fmt: skip
def test_a_name_with_a_unit_behind_it_is_asked_for_by_its_number(tmp_path, head, mend):
    """As such a name, or only one of several, cannot be written in the column channels."""
    (tmp_path / "a.csv").write_text(f"{head}\n{ROWS}")
    with pytest.raises(BadTable, match="needed the column 'a'") as caught:
        read(tmp_path / "a.csv", "a[V]")
    assert caught.value.mend.startswith(mend)


def test_a_time_whose_name_holds_a_unit_is_asked_for_with_a_unit_of_time():
    with pytest.raises(BadTable, match=r"write its number from 1, as in 2\[ms\]"):
        parse_time("Zeit [ms][ms]", "here")
