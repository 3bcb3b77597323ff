"""Claims about texts on their side: each line is a channel, where the import table says so."""

import numpy as np
import pytest

from taxel.errors import BadTable
from taxel.recordings.imports.importing import ImportOptions, import_table
from taxel.recordings.imports.notes import notes_of
from taxel.recordings.reader import read_recording

VALUES = np.round(np.random.default_rng(0).random((2, 9)), 3)
HEAD = "file,channels,time,axes,label:object\n"


def text_of(rows) -> str:
    """Return rows of cells as a CSV."""
    return "".join(",".join(map(str, row)) + "\n" for row in rows)


def imported(folder, text, channels="*[N]", time="rate:10Hz", axes="channels rows", **options):
    """Import a text; return its recording, and the notes."""
    (folder / "a.csv").write_text(text)
    (folder / "t.csv").write_text(f"{HEAD}a.csv,{channels},{time},{axes},cup\n")
    facts = []
    (path,) = import_table(folder / "t.csv", folder / "out", on_file=facts.append,
                           options=ImportOptions(**options))  # fmt: skip
    return read_recording(path), notes_of(facts)


def refusal(folder, text, **words) -> str:
    """Import a text that must be refused; return the one line."""
    with pytest.raises(BadTable) as caught:
        imported(folder, text, **words)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_lines_become_channels(tmp_path):
    """Numbered from 1; the rest is as of any file, without a note on how it was read."""
    recording, notes = imported(tmp_path, text_of(VALUES))

    np.testing.assert_allclose(recording.samples.values, VALUES.T, rtol=1e-6)
    assert recording.manifest.sensor.channels == ("1", "2")
    assert recording.manifest.sensor.rate_hz == 10
    assert recording.manifest.labels == {"object": "cup"}
    assert notes == []


@pytest.mark.parametrize("top", ["", "# a remark\n", ",0,1,2,3,4,5,6,7,8\n"])
def test_a_word_in_front_of_a_line_names_its_channel(tmp_path, top):
    """Below remarks, or below a line that counts the scans, as pandas writes it."""
    text = top + text_of([["left", *VALUES[0]], ["right", *VALUES[1]]])
    recording, _ = imported(tmp_path, text, channels="right[N] left[V]")

    assert recording.manifest.sensor.channels == ("right", "left")
    assert recording.manifest.sensor.units == ("N", "V")
    np.testing.assert_allclose(recording.samples.values, VALUES[::-1].T, rtol=1e-6)


def test_an_index_of_numbers_below_counted_scans_names_channels(tmp_path):
    """As pandas writes a table without names."""
    text = ",0,1,2,3,4,5,6,7,8\n" + text_of([[0, *VALUES[0]], [1, *VALUES[1]]])
    recording, _ = imported(tmp_path, text)

    assert recording.manifest.sensor.channels == ("0", "1")
    np.testing.assert_allclose(recording.samples.values, VALUES.T, rtol=1e-6)


@pytest.mark.parametrize("first", [0, 1])
def test_a_line_that_counts_stays_where_something_stands_in_front(tmp_path, first):
    """A time in ms, or a counter of samples, looks just like it; the lines keep their numbers."""
    count = np.arange(first, first + 9)
    recording, notes = imported(tmp_path, text_of([count, *VALUES]), time="1[ms]")
    assert recording.manifest.sensor.channels == ("2", "3")
    assert recording.manifest.sensor.rate_hz == 1000
    np.testing.assert_allclose(recording.samples.values, VALUES.T, rtol=1e-6)
    assert notes == []

    recording, notes = imported(tmp_path, text_of([count, *VALUES]), overwrite=True)
    assert recording.samples.values[:, 0].tolist() == count.tolist()
    assert notes == [f"a.csv: line 1 ({first}, {first + 1}, {first + 2} …) was taken as a channel; "
                     "if it only numbers the scans, remove it, or name the others in the column "
                     "'channels'"]  # fmt: skip


def test_a_named_line_that_counts_is_a_channel_with_a_note(tmp_path):
    """Unless it holds the times, or is not taken."""
    text = "name,1,2,3\na,4,6,5\n"
    recording, notes = imported(tmp_path, text)
    assert recording.manifest.sensor.channels == ("name", "a")
    assert notes[0].startswith("a.csv: line 1 (1, 2, 3) was taken as a channel; ")
    assert imported(tmp_path, text, channels="a[N]", overwrite=True)[1] == []
    assert imported(tmp_path, text, time="name[ms]", overwrite=True)[1] == []


@pytest.mark.parametrize("front", [["left", "right"], [0, 1], [3, 17]])
def test_a_line_that_is_passed_over_is_a_note(tmp_path, front):
    """As are those of other texts; its number counts remarks."""
    below = [[front[0], 7, 8, 9], [front[1], 4, 5, 6]]
    recording, notes = imported(tmp_path, "# from a skin\n,0,1,2\n" + text_of(below))
    assert recording.manifest.sensor.channels == tuple(map(str, front))
    assert recording.samples.values.tolist() == [[7, 4], [8, 5], [9, 6]]
    assert notes == ["a.csv: passed over line 2, which counts the scans (0, 1, 2)"]


@pytest.mark.parametrize("front", [["0.5", "1.5"], ["7", "3"], ["", "1"]])
def test_a_counting_line_without_its_first_value_stays_where_values_stand_below(tmp_path, front):
    """Then its first value is missing, as another's may be."""
    text = text_of([["", 1, 2, 3], [front[0], 7, 8, 9], [front[1], 4, 5, 6]])
    assert "got nan in" in refusal(tmp_path, text)
    recording, notes = imported(tmp_path, text, missing="keep", overwrite=True)
    assert recording.samples.values.shape == (4, 3)
    assert notes[0].startswith("a.csv: line 1 (1, 2, 3) was taken as a channel")


def test_first_values_that_count_the_lines_are_a_note(tmp_path):
    """They may be the channels' numbers."""
    text = text_of([[number, *row] for number, row in enumerate([*VALUES, VALUES[0]], start=1)])
    recording, notes = imported(tmp_path, text)
    assert recording.samples.values[0].tolist() == [1, 2, 3]
    assert notes == ["a.csv: the first values of its lines are 1, 2, 3; if these are the channels' "
                     "numbers and no scan, write words in their place, as in c1"]  # fmt: skip


def test_of_each_line_only_numbers_are_kept(tmp_path):
    """A cell takes 16 bytes, not the 60 and more of a text."""
    import tracemalloc

    from taxel.recordings.imports.lying_texts import read_lying
    from taxel.recordings.imports.value_tables.row_times import REFUSED
    from taxel.recordings.imports.value_tables.tables import Column, TimeColumn

    (tmp_path / "a.csv").write_text(("0.25," * 1999 + "0.75\n") * 50)
    tracemalloc.start()
    try:
        table = read_lying(tmp_path / "a.csv", [Column(name="*", unit="N")],
                           TimeColumn(rate_hz=9.0), "refuse", REFUSED)  # fmt: skip
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert table.values.shape == (2000, 50)
    assert peak < 30 * table.values.size


@pytest.mark.parametrize("name", ["t", "1"])
def test_a_line_may_hold_times(tmp_path, name):
    """By its name or number; it is no channel then."""
    rows = [np.arange(9) * 20, *VALUES]
    lines = [["t", *rows[0]], ["a", *rows[1]], ["b", *rows[2]]] if name == "t" else rows
    recording, _ = imported(tmp_path, text_of(lines), time=f"{name}[ms]")

    assert recording.manifest.sensor.channels == (("a", "b") if name == "t" else ("2", "3"))
    assert recording.manifest.sensor.rate_hz == 50


def test_decimal_commas_and_blanks_are_read(tmp_path):
    """As in texts that stand upright."""
    text = "0,5;1,5;2,5\n1;2;3,0\n"
    recording, notes = imported(tmp_path, text)
    assert recording.samples.values.tolist() == [[0.5, 1], [1.5, 2], [2.5, 3]]
    assert notes == ["a.csv: commas were taken as decimal signs: 0,5 is a half"]


@pytest.mark.parametrize(
    ("text", "words", "options"),
    [
        ("a,1,2,3\nb,1,x,3\n", "a number; got 'x' in .*a.csv, line 2, cell 3", {}),
        ("a,1,2,3\nb,1,2\n", "4 cells in each line, as in line 1; got 3 in .*, line 2", {}),
        ("1,2,3\n1,nan,3\n", "finite number .*got nan in .*, line 2, cell 2; .*--missing keep", {}),
        ("a,1,2\n\nb,1,2\n", "a channel in each line; got an empty line 2", {}),
        ("a\nb\n", "scans in each line; got none", {}),
        ("", "rows of numbers; got the empty file", {}),
        ("a,1,2\nb,1,2\n", "one line that begins with 'c' .*got 0 of 2 lines, the first is 'a'",
         {"channels": "c[N]"}),
        ("a,1,2\na,1,2\n", "one line that begins with 'a' .*got 2 of 2 lines",
         {"channels": "a[N]"}),
        ("a,1,2\nt,2,1\n", "times that increase .* 2 s in .*a.csv, line 2, cell 3",
         {"time": "t[s]"}),
        ("t,,1\na,1,2\n", "a time in every row; got none in .*a.csv, line 1, cell 2",
         {"time": "t[s]", "missing": "keep"}),
        ("a,1,2,3,4,5,6\nt,1,2,900,4,5,6\n", "900 s in .*a.csv, line 2, cell 4, between",
         {"time": "t[s]"}),
        ("a,1,2,3\nt,1e12,2e12,3e12\n", "1e.12 s in .*a.csv, line 2, cell 2", {"time": "t[s]"}),
        ("time,1,2\n1,1,2\n", "a word in front of each line.*got 'time' in front of line 1 and "
         "'1' in front of line 2 in .*a.csv", {}),
        ("t,2,1\n", "a channel beside the times", {"time": "t[s]"}),
        ("t,2,1\na,1,2\n", "times as numbers", {"time": "t[iso]"}),
    ],
)  # fmt: skip
def test_what_is_wrong_is_refused_by_line_and_cell(tmp_path, text, words, options):
    """Nothing is guessed."""
    import re

    assert re.search(words, refusal(tmp_path, text, **options))


def test_invalid_cells_are_kept_on_request(tmp_path):
    """Flagged, as those of other files."""
    recording, _ = imported(tmp_path, "a,1,2,3\nb,1,,3\n", missing="keep")
    assert recording.samples.validity.astype(bool).tolist() == [[0, 0], [0, 1], [0, 0]]


@pytest.mark.parametrize("channels", ["a[N] b[N]", "*[N]"])
def test_a_refused_text_that_may_lie_on_its_side_says_how(tmp_path, channels):
    """Its channels' names stand in the first column, which is no number."""
    text = text_of([["a", *VALUES[0]], ["b", *VALUES[1]]])
    line = refusal(tmp_path, text, channels=channels, axes="")
    assert line.endswith("; if each line is a channel, write channels rows in the column 'axes'.")


def test_too_many_columns_are_answered_so_too(tmp_path):
    """A second of sound in each line."""
    line = refusal(tmp_path, ("0," * 17_000 + "0\n") * 2, axes="")
    assert "17,001; name the channels; if each line is a channel" in line


def test_a_text_that_stands_upright_is_not_asked_about(tmp_path):
    """Its own fault is what matters."""
    line = refusal(tmp_path, "a,b\n1,2\n3,x\n4,5\n", axes="")
    assert "each line is a channel" not in line


@pytest.mark.parametrize(("named", "asked"), [(False, True), (True, False)])
def test_an_imported_text_that_may_lie_is_asked_about_unless_names_stand_above(
    tmp_path, named, asked
):
    """Both read as two scans of nine channels."""
    top = ",".join("abcdefghi") + "\n" if named else ""
    recording, notes = imported(tmp_path, top + text_of(VALUES), axes="")

    assert len(recording.samples) == 2
    assert any("write channels rows in the column 'axes'" in note for note in notes) is asked


def test_labels_in_rows_need_scans_in_lines(tmp_path):
    """A label for each row of a text on its side has no column."""
    (tmp_path / "a.csv").write_text(text_of(VALUES))
    (tmp_path / "t.csv").write_text(f"{HEAD}a.csv,*[N],rate:9Hz,channels rows,rows:1\n")
    with pytest.raises(BadTable, match="a text for rows:COLUMN, a scan in each line"):
        import_table(tmp_path / "t.csv", tmp_path / "out")
