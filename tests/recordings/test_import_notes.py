"""What an import says of files in which nothing is wrong: a line a matter, not a line a file."""

import json
from pathlib import Path

import numpy as np
import pytest

from taxel.cli.main import main
from taxel.recordings.imports.notes import FileFacts, coarse_of, gaps_of, lying_of, notes_of

Capture = pytest.CaptureFixture[str]


def write(folder: Path, columns: str, **files: str) -> list[str]:
    """Write files and a table that names them; return the command that imports them."""
    for name, text in files.items():
        (folder / f"{name}.csv").write_text(text)
    rows = "".join(f"{name}.csv,cup,{columns}\n" for name in files)
    (folder / "table.csv").write_text("file,label:object,channels,time\n" + rows)
    return ["import", str(folder / "table.csv"), "--output", str(folder / "out")]


def notes(capsys: Capture, words: list[str]) -> list[str]:
    """Import; return the lines on the error stream, and compare them with those in JSON."""
    main(words)
    lines = capsys.readouterr().err.splitlines()
    main([*words, "--overwrite", "--json"])
    assert [f"note: {note}" for note in json.loads(capsys.readouterr().out)["notes"]] == lines
    return lines


def test_a_header_of_numbers_is_said(tmp_path, capsys):
    """What was taken as names is quoted, because a first scan may look like it."""
    text = "0,1,2\n5,6,7\n6,7,8\n"
    words = write(tmp_path, "0[N] 2[N],rate:100Hz", a=text, b=text)
    assert notes(capsys, words) == [
        "note: a.csv and 1 more: line 1 (0, 1, 2) was taken as the columns' names, not as a scan; "
        "if it is a scan, put a line of names above it"
    ]


def test_decimal_commas_are_said(tmp_path, capsys):
    """A thousands separator would look alike."""
    words = write(tmp_path, "x[N],t[ms]", a="t;x\n0;1,5\n5;2,5\n", b="t;x\n0;1.5\n5;2.5\n")
    assert notes(capsys, words) == [
        "note: a.csv: commas were taken as decimal signs: 0,5 is a half"
    ]


def test_a_separator_at_the_end_of_each_row_is_said_once(tmp_path, capsys):
    text = "t,x\n0,1,\n5,2,\n10,3,\n"
    words = write(tmp_path, "x[N],t[ms]", a=text, b=text, c="t,x\n0,1\n5,2\n")
    assert notes(capsys, words) == [
        "note: a.csv and 1 more: each row ends in a separator, the line of names does not; the "
        "empty cell behind it was left out"
    ]


def test_milliseconds_taken_for_seconds_are_said(tmp_path, capsys):
    """2 s of touch would last 33 minutes; the first file is named, and the rates of all."""
    rows = "".join(f"{10 * i},{i}\n" for i in range(200))
    words = write(tmp_path, "x[N],t[s]", a="t,x\n0,1\n5,2\n10,3\n", b="t,x\n" + rows)
    assert notes(capsys, words) == [
        "note: a.csv and 1 more: 0.1 to 0.2 scans a second by the time column t[s]; if that is too "
        "few, its unit is wrong: s, ms, us or ns"
    ]


def test_seconds_taken_for_milliseconds_are_said(tmp_path, capsys):
    """Two rows 10 ms apart would be 10 µs apart."""
    words = write(tmp_path, "x[N],t[ms]", a="t,x\n0,1\n0.01,2\n0.02,3\n")
    assert notes(capsys, words) == [
        "note: a.csv: 1e+05 scans a second by the time column t[ms]; if that is too many, "
        "its unit is wrong: s, ms, us or ns"
    ]


@pytest.mark.parametrize("columns", ["x[N],t[ms]", "x[N],rate:0.1Hz"])
def test_a_rate_that_is_given_or_usual_is_not_said(tmp_path, capsys, columns):
    """Who writes a rate means it; one scan a second is the least without a word."""
    words = write(tmp_path, columns, a="t,x\n0,1\n1000,2\n2000,3\n")
    assert notes(capsys, words) == []


def test_gaps_are_counted_in_one_line(tmp_path, capsys):
    """How many, in how many files, and where the longest is; the median step is 10 ms."""
    whole = "t,x\n" + "".join(f"{10 * i},1\n" for i in range(50))
    holes = "t,x\n" + "".join(f"{10 * i},1\n" for i in range(500, 550) if not 505 <= i < 509)
    more = "t,x\n" + "".join(f"{10 * i},1\n" for i in range(90) if i not in (5, 6, 20, 21, 40))
    words = write(tmp_path, "x[N],t[ms]", a=whole, b=more, c=holes)
    assert notes(capsys, words) == [
        "note: 3 gaps in 2 of 3 files, a step of more than 2 times the median; the longest lasts "
        "0.05 s (c.csv, 0.040 s after its first scan); scans missing there are not counted as lost"
    ]


@pytest.mark.parametrize(
    ("time_s", "found"),
    [
        ([], (0, 0.0, 0.0)),
        ([0.0, 9.0], (0, 0.0, 0.0)),
        ([0.0, 1.0, 2.0, 4.0], (0, 0.0, 0.0)),
        ([0.0, 0.1, 0.2, 0.30000000000000004, 0.5], (0, 0.0, 0.0)),
        ([5.0, 6.0, 7.0, 9.5, 10.0, 14.0], (2, 4.0, 5.0)),
    ],
)
def test_a_gap_is_more_than_two_median_steps(time_s, found):
    """Two exactly are none, however the times are rounded."""
    assert gaps_of(np.array(time_s)) == found


def test_an_ordinary_import_says_nothing(tmp_path, capsys):
    words = write(tmp_path, "x[N],t[ms]", a="t,x\n10,1\n20,2\n30,3\n")
    assert notes(capsys, words) == []


def test_channels_that_32_bits_wear_away_are_named():
    """A clock, or counts around 2^53, would become steps or a constant; counts of 24 bits not."""
    time_ms = 1709294400000.0 + np.arange(50.0)
    fine = 8_000_000 + np.arange(50.0)
    gone = np.where(np.arange(50) == 3, np.nan, 2.0**53 + 2 * np.arange(50.0))
    values = np.stack([time_ms, fine, gone, np.full(50, 1e9 + 1), np.full(50, np.nan)], 1)

    assert coarse_of(values, ("clock", "adc", "huge", "still", "broken")) == "clock, huge"
    (note,) = notes_of([FileFacts(file="a.csv", coarse="clock")])
    assert note.startswith("a.csv: values are kept in 32 bits")
    assert "lost in channels clock; subtract" in note


def test_an_array_far_wider_than_long_may_lie_on_its_side():
    assert (lying_of(60, 3), lying_of(40, 80)) == ("", "")
    assert lying_of(3, 60) == "3 scans of 60 channels"
    (note,) = notes_of([FileFacts(file="a.npy", lying="3 scans of 60 channels")] * 2)
    assert note.startswith("a.npy and 1 more: read as 3 scans of 60 channels; if its rows are")
